"""Readings compared bit by bit with those of the command `sonard simulate`."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import sonard

from .conftest import Command, places_in

STATUSES = {status.name.lower(): status.value for status in sonard.Status}


def logged(records: list[dict[str, Any]], beams: int) -> np.ndarray[Any, Any]:
    """Returns the readings of a log as an array of the model."""
    pings = [record for record in records if record["type"] == "ping"]
    array = np.empty(len(pings), sonard.READING)
    for row, ping in zip(array, pings, strict=True):
        none = np.inf if ping["status"] == "no_echo" else np.nan
        row["status"] = STATUSES[ping["status"]]
        for field, otherwise in [("range_m", none), ("tof_us", none), ("amplitude", np.nan), ("margin_db", np.nan)]:
            value = ping.get(field)
            row[field] = otherwise if value is None else value
    return array.reshape(-1, beams)


def assert_same(found: np.ndarray[Any, Any], expected: np.ndarray[Any, Any]) -> None:
    assert found.shape == expected.shape
    for field in sonard.READING.names or ():
        np.testing.assert_array_equal(found[field], expected[field], field)


@pytest.mark.parametrize("name", sonard.Scene.shipped_names())
def test_shipped_poses_match_command(name: str, command: Command) -> None:
    scene = sonard.Scene.shipped(name)
    model = sonard.Model(scene, max_range_m=5.0)
    azimuths_deg = np.round(np.arange(100) * 3.6, 9)
    assert scene.poses
    for pose_name, pose in scene.poses.items():
        records = command(
            "simulate", "--scene", name, "--pose", pose_name, "--step-deg", 3.6, "--max-range", 5
        )
        assert_same(model.predict([pose], azimuths_deg), logged(records, 100))


def test_default_is_full_turn(command: Command, room: sonard.Scene) -> None:
    records = command("simulate", "--scene", "simple-room", "--pose", "fig9")
    assert_same(sonard.Model(room).predict([room.poses["fig9"]]), logged(records, 400))


ENGINES = st.one_of(
    st.fixed_dictionaries(
        {"engine": st.just("paths")},
        optional={
            "response": st.sampled_from(["stationary", "full"]),
            "ideal_receiver": st.just(True),
            "lossless": st.just(True),
            "max_order": st.integers(0, 4),
            "edge_law": st.sampled_from(["utd", "kuc-siegel", "bozma-kuc"]),
        },
    ),
    st.fixed_dictionaries(
        {"engine": st.just("fan"), "ray_spacing_deg": st.floats(0.2, 2)},
        optional={"lossless": st.just(True), "max_order": st.integers(0, 4)},
    ),
    st.fixed_dictionaries({"engine": st.just("cone")}, optional={"aperture_deg": st.floats(0, 60)}),
)

COMMON = st.fixed_dictionaries(
    {"max_range_m": st.floats(0.5, 6)}, optional={"threshold": st.floats(0.001, 0.5)}
)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    scene=st.sampled_from(sonard.Scene.shipped_names()),
    sensor=st.sampled_from(sonard.Sensor.preset_names()),
    engine=ENGINES,
    common=COMMON,
    temperature_c=st.floats(-20, 50),
    seed=st.integers(0, 2**32),
)
def test_any_model_matches_command(
    scene: str,
    sensor: str,
    engine: dict[str, Any],
    common: dict[str, Any],
    temperature_c: float,
    seed: int,
    command: Command,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    options = {**engine, **common}
    poses = [tuple(pose) for pose in places_in(sonard.Scene.shipped(scene), 3, seed)]
    course = tmp_path_factory.mktemp("course") / "course.jsonl"
    course.write_text(
        "".join(json.dumps({"x_m": x, "y_m": y, "heading_deg": heading}) + "\n" for x, y, heading in poses)
    )
    try:
        model = sonard.Model(scene, sensor, sonard.Air(temperature_c), **options)
        found = model.predict(poses, np.round(np.arange(40) * 9.0, 9))
    except sonard.PoseError:
        assert "robot" in scene  # The body requires more room than a ranger.
        return
    arguments: list[object] = ["simulate", "--scene", scene, "--poses", course, "--sensor", sensor]
    arguments += [f"--temperature-c={temperature_c}", "--step-deg", 9]
    for name, value in options.items():
        arguments.append("--" + name.removesuffix("_m" if name == "max_range_m" else " ").replace("_", "-"))
        if value is not True:
            arguments.append(value)
    assert_same(found, logged(command(*arguments), 40))


@settings(max_examples=50, deadline=None)
@given(shape=st.lists(st.integers(0, 3), max_size=3), beams=st.integers(0, 5), threads=st.integers(1, 3))
def test_shapes_and_threads(shape: list[int], beams: int, threads: int) -> None:
    scene = sonard.Scene.shipped("simple-room")
    model = sonard.Model(scene, max_range_m=2.0)
    poses = places_in(scene, int(np.prod(shape, dtype=int))).reshape(*shape, 3) if 0 not in shape else np.empty((*shape, 3))
    azimuths_deg = np.linspace(-400, 400, beams)
    found = model.predict(poses, azimuths_deg, threads)
    assert found.shape == (*shape, beams) and found.dtype == sonard.READING and found.flags.aligned
    for index in np.ndindex(*shape):
        assert_same(found[index][None], model.predict(poses[index][None], azimuths_deg))
        for beam, azimuth_deg in enumerate(azimuths_deg):
            alone = model.reading(poses[index], azimuth_deg)
            assert alone.status == found[index][beam]["status"]
            if alone.range_m is not None:
                assert alone.range_m == found[index][beam]["range_m"]


def test_no_echo_fields(room: sonard.Scene) -> None:
    readings = sonard.Model(room, threshold=1.0).predict(room.poses["fig7"])
    no_echo = readings["status"] == sonard.Status.NO_ECHO
    assert no_echo.any()
    assert np.isposinf(readings["range_m"][no_echo]).all() and np.isposinf(readings["tof_us"][no_echo]).all()
    assert np.nanmax(readings["margin_db"][no_echo]) < 0
    assert np.isfinite(readings["range_m"][~no_echo]).all()
