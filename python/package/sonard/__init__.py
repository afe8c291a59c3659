"""Physical model of ultrasonic rangers: what a sonar reads in a scene, and by which path.

>>> import sonard
>>> scene = sonard.Scene.shipped("simple-room")
>>> model = sonard.Model(scene)
>>> readings = model.predict(scene.poses["fig9"])
>>> print(readings["range_m"][300].round(3))
0.828
>>> str(model.reading(scene.poses["fig9"], 270.0).path)
'south, north, south'

All lengths are metres, angles degrees counter-clockwise, times microseconds, as the names say.
"""

from ._sonard import (
    READING,
    Air,
    AirError,
    Model,
    OptionError,
    PoseError,
    Scene,
    SceneError,
    Sensor,
    SensorError,
    SonardError,
    TooManyPathsError,
    __version__,
)
from ._results import Path, Peak, Reading, Trace
from ._status import Status

__all__ = [
    "READING",
    "Air",
    "AirError",
    "Model",
    "OptionError",
    "Path",
    "Peak",
    "PoseError",
    "Reading",
    "Scene",
    "SceneError",
    "Sensor",
    "SensorError",
    "SonardError",
    "Status",
    "TooManyPathsError",
    "Trace",
    "__version__",
]
