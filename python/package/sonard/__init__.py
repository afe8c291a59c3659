"""Physical model of ultrasonic rangers: predicts the readings of a sonar in a scene, with their propagation paths.

>>> import sonard
>>> scene = sonard.Scene.shipped("simple-room")
>>> model = sonard.Model(scene)
>>> readings = model.predict(scene.poses["fig9"])
>>> print(readings["range_m"][300].round(3))
0.828
>>> str(model.reading(scene.poses["fig9"], 270.0).path)
'south, north, south'

Lengths are in metres, angles in degrees counter-clockwise, times in microseconds, as indicated by the names.
"""

from ._sonard import (
    ARRAY_READING,
    LOGGED,
    READING,
    Air,
    AirError,
    ArrayError,
    ArrayModel,
    Course,
    Locator,
    Log,
    LogError,
    Model,
    OptionError,
    PoseError,
    RangerArray,
    Scan,
    Scene,
    SceneError,
    Sensor,
    SensorError,
    SonardError,
    TooManyPathsError,
    __commit__,
    __version__,
    calibrate,
    compare,
    generate,
    image_sources,
    interpret,
    read_log,
    survey,
)
from ._sonard import map as map
from ._results import (
    AlternativePlan,
    Calibration,
    Estimate,
    FittedNumber,
    ImageSources,
    Map,
    NextView,
    Path,
    Peak,
    Reading,
    ResolvedPart,
    Survey,
    SurveyedPost,
    SurveyedWall,
    Trace,
    UnexplainedArc,
    WallPiece,
)
from ._status import Status

# Without `map`, which would replace the built-in function in a star import.
__all__ = [
    "ARRAY_READING",
    "LOGGED",
    "READING",
    "Air",
    "AirError",
    "AlternativePlan",
    "ArrayError",
    "ArrayModel",
    "Calibration",
    "Course",
    "Estimate",
    "FittedNumber",
    "ImageSources",
    "Locator",
    "Log",
    "LogError",
    "Map",
    "Model",
    "NextView",
    "OptionError",
    "Path",
    "Peak",
    "PoseError",
    "RangerArray",
    "Reading",
    "ResolvedPart",
    "Scan",
    "Scene",
    "SceneError",
    "Sensor",
    "SensorError",
    "SonardError",
    "Status",
    "Survey",
    "SurveyedPost",
    "SurveyedWall",
    "TooManyPathsError",
    "Trace",
    "UnexplainedArc",
    "WallPiece",
    "__commit__",
    "__version__",
    "calibrate",
    "compare",
    "generate",
    "image_sources",
    "interpret",
    "read_log",
    "survey",
]
