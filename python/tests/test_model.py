"""Scenes, sensors, air and single firings."""

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sonard

from .conftest import Command

MODEL = sonard.Model("simple-room")
FIG9 = (0.774, 0.085, 0.0)


def test_paths_match_command(command: Command) -> None:
    for name, pose in [("simple-room", "fig9"), ("mcgill-lab", "fig4"), ("echo-traces", "d")]:
        scene = sonard.Scene.shipped(name)
        model = sonard.Model(scene, max_range_m=3.0)
        lines = command("paths", "--scene", name, "--pose", pose, "--max-range", 3, "--json")
        paths = model.paths(scene.poses[pose])
        assert len(paths) == len(lines) > 3
        for path, line in zip(paths, lines, strict=True):
            for field in ["kind", "order", "length_m", "amplitude", "phase_deg", "departure_deg", "arrival_deg"]:
                assert getattr(path, field) == line[field]
            assert path.range_m == line["length_m"] / 2
            assert list(path.interactions) == [(item["kind"], item["id"]) for item in line["interactions"]]
            np.testing.assert_allclose(path.points, [item["point"] for item in line["interactions"]], atol=1e-6)


def test_trace_matches_command(command: Command) -> None:
    (line,) = command(
        "trace", "--scene", "echo-traces", "--pose", "d", "--until", 3, "--step-us", 20, "--json"
    )
    scene = sonard.Scene.shipped("echo-traces")
    trace = sonard.Model(scene).trace(scene.poses["d"], max_range_m=3.0, step_us=20.0)
    for field in ["t_us", "envelope", "threshold", "gain_db"]:
        np.testing.assert_array_equal(getattr(trace, field), line[field])
    np.testing.assert_array_equal(trace.echoes_us, line["detection"]["tof_us"])
    for peak, expected in zip(trace.peaks, line["peaks"], strict=True):
        assert (peak.tof_us, peak.peak_us, peak.peak) == (expected["tof_us"], expected["peak_us"], expected["peak"])
        assert peak.path.length_m == expected["path"]["length_m"]


def test_reading_has_path() -> None:
    reading = MODEL.reading(FIG9, 270.0)
    assert repr(reading) == "<Reading ECHO at 0.8282 m, margin 29.3 dB, by south, north, south>"
    assert reading.path is not None and reading.path.order == 3
    assert reading.status is sonard.Status.ECHO
    no_echo = sonard.Model("simple-room", threshold=1.0, max_range_m=0.5).reading((0.4, 0.3, 20.0))
    assert no_echo.range_m is None and no_echo.tof_us is None
    assert no_echo.status is sonard.Status.NO_ECHO


def test_room_by_hand() -> None:
    corners = np.array([[0, 0], [4, 0], [4, 3], [0, 3]])
    scene = sonard.Scene.from_points(corners, name="hall", cylinders=[[3.0, 2.5, 0.1]])
    assert scene == sonard.Scene.from_points([*corners, corners[0]], name="hall", cylinders=[[3.0, 2.5, 0.1]])
    np.testing.assert_array_equal(scene.walls[:, 0], corners)
    np.testing.assert_array_equal(scene.walls[:, 1], np.roll(corners, -1, axis=0))
    assert repr(scene) == "<Scene 'hall': 4 walls, 1 cylinders>" and len(scene.wall_ids) == 4
    readings = sonard.Model(scene).predict([1.0, 1.0, 0.0], [0.0, 90.0])
    # A weak echo crosses the threshold slightly later (time walk).
    assert 3.0 <= readings["range_m"][0] < 3.005 and 2.0 <= readings["range_m"][1] < 2.005
    np.testing.assert_array_equal(scene.are_accessible([[1.0, 1.0], [5.0, 1.0], [3.0, 2.5]]), [True, False, False])
    np.testing.assert_allclose(scene.clearance_m([[[1.0, 1.0], [3.0, 2.5]]]), np.array([[1.0, -0.1]]))
    line = sonard.Scene.from_points(corners[:2], closed=False)
    assert line.walls.tolist() == [[[0, 0], [4, 0]]]
    tall = sonard.Scene.from_points(corners, floor_z_m=0, ceiling_z_m=2.5)
    assert (tall.floor_z_m, tall.ceiling_z_m) == (0, 2.5)
    assert sonard.Model(tall).paths([1, 1, 0])[0].points.shape[1] == 3


def test_scene_file(tmp_path: Path) -> None:
    scene = sonard.Scene.shipped("corridor")
    file = tmp_path / "corridor.json"
    file.write_text(scene.to_json())
    for again in [sonard.Scene.load(file), sonard.Scene.load(str(file)), sonard.Scene.from_json(scene.to_json())]:
        assert again == scene and hash(again) == hash(scene) and again.sha256 == scene.sha256
    assert scene != sonard.Scene.shipped("simple-room") and scene != 1
    assert scene.pose("1,0.5,90") == (1, 0.5, 90)


def test_sensor_replace(tmp_path: Path) -> None:
    sensor = MODEL.sensor
    assert sensor.name == "senscomp-6500" and sensor == sonard.Sensor.preset("senscomp-6500")
    other = sensor.replace(threshold=0.5, mounting={"z_m": 1.0}, edge_law="kuc-siegel")
    assert (other.threshold, other.mounting["z_m"], other.edge_law) == (0.5, 1.0, "kuc-siegel")
    assert other.aperture == sensor.aperture and other != sensor and other.replace() == other
    assert other.replace(mounting={"left_m": 0.1}).mounting["z_m"] == 1.0
    # Values that the preset's file omits are accepted, too.
    stepped = sensor.replace(range_step_m=0.01, integration_us=50.0)
    assert stepped.integration_us == 50.0 and json.loads(stepped.to_json())["range_step_m"] == 0.01
    file = tmp_path / "sensor.json"
    file.write_text(other.to_json())
    assert sonard.Sensor.load(file) == other
    assert sonard.Model("simple-room", other).sensor.threshold == 0.5


def test_air() -> None:
    assert abs(sonard.Air().sound_speed_m_s - 343.99) < 0.005  # Cramer's table.
    assert abs(sonard.Air().absorption_db_per_m(50e3) - 1.661) < 5e-4  # ISO 9613-1.
    assert sonard.Air(sound_speed_m_s=340.0).sound_speed_m_s == 340.0
    assert sonard.Model("simple-room", air=sonard.Air(0.0)).sound_speed_m_s < 332


@pytest.mark.parametrize(
    "value",
    [
        sonard.Air(5.0, sound_speed_m_s=340.0),
        sonard.Air(-0.0),
        sonard.Sensor.preset("hc-sr04"),
        sonard.Scene.shipped("mcgill-lab"),
    ],
)
def test_pickling_values(value: Any) -> None:
    for again in [pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value)]:
        assert again == value and hash(again) == hash(value) and repr(again) == repr(value)


@pytest.mark.parametrize(
    "model",
    [
        MODEL,
        sonard.Model("simple-room", "pioneer", sonard.Air(3.0), "fan", ray_spacing_deg=0.5, max_range_m=2.0),
        sonard.Model("two-surface-room", engine="cone", aperture_deg=12.5),
        sonard.Model("simple-room", response="full", edge_law="bozma-kuc", max_order=3, lossless=True),
    ],
)
def test_pickling_model(model: sonard.Model) -> None:
    for again in [pickle.loads(pickle.dumps(model)), copy.deepcopy(model)]:
        assert (again.scene, again.sensor, again.air) == (model.scene, model.sensor, model.air)
        assert (again.engine, again.options, repr(again)) == (model.engine, model.options, repr(model))
        pose = next(iter(model.scene.poses.values()))
        assert model.predict(pose).tobytes() == again.predict(pose).tobytes()


def test_pickling_results() -> None:
    path = MODEL.paths(FIG9)[5]
    reading, trace = MODEL.reading(FIG9), MODEL.trace(FIG9, max_range_m=1.0)
    for value in [path, reading, trace, trace.peaks[0]]:
        again = pickle.loads(pickle.dumps(value))
        assert repr(again) == repr(value) and type(again) is type(value)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(path)).points, path.points)
    with pytest.raises(AttributeError):
        path.kind = "specular"  # type: ignore[misc]


NONSENSE = st.one_of(
    st.none(),
    st.text(max_size=3),
    st.lists(st.floats(), max_size=4),
    st.lists(st.lists(st.floats(), min_size=3, max_size=3), max_size=3),
    st.binary(max_size=3),
    st.complex_numbers(),
)


@settings(max_examples=200, deadline=None)
@given(poses=NONSENSE, azimuths_deg=NONSENSE, threads=st.one_of(st.none(), st.integers(-2, 2)))
def test_arbitrary_arguments(poses: Any, azimuths_deg: Any, threads: Any) -> None:
    try:
        readings = MODEL.predict(poses, azimuths_deg, threads)
    except (TypeError, ValueError, OverflowError):
        return
    assert readings.dtype == sonard.READING


@settings(max_examples=100, deadline=None)
@given(points=NONSENSE, closed=st.booleans(), cylinders=NONSENSE, reflectance=st.floats())
def test_arbitrary_scenes(points: Any, closed: bool, cylinders: Any, reflectance: float) -> None:
    try:
        scene = sonard.Scene.from_points(points, closed=closed, cylinders=cylinders, reflectance=reflectance)
    except (TypeError, ValueError):
        return
    assert sonard.Scene.from_json(scene.to_json()) == scene


@settings(max_examples=100, deadline=None)
@given(text=st.text(max_size=30))
def test_arbitrary_texts(text: str) -> None:
    for read in [sonard.Scene.from_json, sonard.Sensor.from_json]:
        with pytest.raises(sonard.SonardError):
            read(text)
