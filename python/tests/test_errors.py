"""Exceptions have the messages of the library."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonard

MODEL = sonard.Model("simple-room")

REFUSED: list[tuple[Callable[[], Any], type[Exception], str]] = [
    (lambda: MODEL.predict([[0.4, 0.3, 0.0], [9.0, 9.0, 0.0]]), sonard.PoseError, "poses[1]: the pose (9, 9) m is outside the room"),
    (lambda: MODEL.predict([np.nan, 0, 0]), sonard.PoseError, "is not a number"),
    (lambda: MODEL.reading([0, 0, 0]), sonard.PoseError, "keep at least 1 mm"),
    (lambda: MODEL.predict([[0.4, 0.3]]), ValueError, "x_m, y_m, heading_deg"),
    (lambda: MODEL.paths([[0.4, 0.3, 0]]), ValueError, "it must be (3,)"),
    (lambda: MODEL.predict([0.4, 0.3, 0], [np.inf]), ValueError, "azimuths_deg[0] is inf"),
    (lambda: MODEL.predict([0.4, 0.3, 0], [[0.0]]), ValueError, "it must be (n,)"),
    (lambda: MODEL.predict([0.4, 0.3, 0], threads=0), ValueError, "threads is 0: it must be 1 to 1024"),
    (lambda: MODEL.predict([0.4, 0.3, 0], threads=10**6), ValueError, "threads"),
    (lambda: MODEL.paths([0.4, 0.3, 0], min_amplitude=0), ValueError, "min_amplitude is 0"),
    (lambda: MODEL.trace([0.4, 0.3, 0], step_us=0), ValueError, "step_us is 0"),
    (lambda: MODEL.trace([0.4, 0.3, 0], max_range_m=np.nan), ValueError, "max_range_m is NaN"),
    (lambda: MODEL.trace([0.4, 0.3, 0], np.nan), ValueError, "azimuth_deg is NaN"),
    (lambda: sonard.Scene.shipped("simple-rom"), sonard.SceneError, "did you mean `simple-room`"),
    (lambda: sonard.Scene.from_json("{"), sonard.SceneError, "1:"),
    (lambda: sonard.Scene.from_points([[0, 0], [1, 0]]), sonard.SceneError, "walls[0].polyline"),
    (lambda: sonard.Scene.from_points([[0, 0], [1, 0], [1, 1]], reflectance=2), sonard.SceneError, "reflectance"),
    (lambda: sonard.Scene.from_points([[0, 0], [1, 0], [1, 1]], floor_z_m=0), ValueError, "ceiling_z_m"),
    (lambda: sonard.Scene.shipped("corridor").pose("x"), sonard.PoseError, "has no pose `x`"),
    (lambda: sonard.Sensor.preset("x"), sonard.SensorError, "known presets: senscomp-6500"),
    (lambda: MODEL.sensor.replace(treshold=1), TypeError, "did you mean `threshold`"),
    (lambda: MODEL.sensor.replace(threshold=-1), sonard.SensorError, "threshold is -1: it must be"),
    (lambda: sonard.Air(99), sonard.AirError, "temperature_c is 99: it must be from -20 to 50"),
    (lambda: sonard.Model("simple-room", engine="fan", edge_law="utd"), sonard.OptionError, "choose the engine paths"),
    (lambda: sonard.Model("simple-room", engine="ray"), sonard.OptionError, "expected one of `paths`"),  # type: ignore[arg-type]
    (lambda: sonard.Model("simple-room", max_range_m=0), sonard.OptionError, "max_range_m is 0"),
    (lambda: sonard.Model("simple-room", max_rang_m=1), TypeError, "max_rang_m"),  # type: ignore[call-arg]
    (lambda: sonard.Model(3), TypeError, "must be a Scene or the name of a shipped one"),  # type: ignore[arg-type]
    (
        lambda: sonard.Model("mcgill-lab", max_range_m=100, lossless=True, threshold=1e-6).predict([2, 1.5, 0]),
        sonard.TooManyPathsError,
        "too many echo paths",
    ),
]


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_error_messages(number: int) -> None:
    call, kind, words = REFUSED[number]
    with pytest.raises(kind) as caught:
        call()
    assert type(caught.value) is kind and words in str(caught.value)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value) and vars(again) == vars(caught.value)


def test_error_location() -> None:
    with pytest.raises(sonard.PoseError) as pose:
        MODEL.predict(np.array([[[0.4, 0.3, 0], [0.4, 0.3, 0]], [[0.4, 0.3, 0], [9, 9, 0]]]))
    assert pose.value.index == (1, 1) and "spans x 0 to 0.928 m" in pose.value.help
    text = sonard.Scene.shipped("corridor").to_json()
    with pytest.raises(sonard.SceneError) as scene:
        sonard.Scene.from_json(text.replace('"walls"', '"wals"'))
    assert scene.value.line and scene.value.line > 1 and scene.value.column and "walls" in scene.value.help
    assert isinstance(scene.value, sonard.SonardError) and isinstance(scene.value, ValueError)


def test_missing_file(tmp_path: Path) -> None:
    for load in [sonard.Scene.load, sonard.Sensor.load]:
        with pytest.raises(FileNotFoundError) as caught:
            load(tmp_path / "nothing.json")
        assert caught.value.filename == str(tmp_path / "nothing.json")
        assert caught.value.strerror == "No such file or directory"
        with pytest.raises(IsADirectoryError):
            load(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    with pytest.raises(OSError, match="UTF-8"):
        sonard.Scene.load(tmp_path / "binary")
