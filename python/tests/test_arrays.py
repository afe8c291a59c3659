"""Arrays of rangers at rest and in motion, compared bit by bit with `sonard simulate --array`."""

import copy
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import sonard

from .conftest import Command, places_in
from .test_processes import in_a_fork_of
from .test_readings import assert_same, logged

LAB = sonard.Scene.shipped("mcgill-lab")
# Two rangers that fire simultaneously and receive each other, and a third.
PAIR = json.dumps(
    {
        "name": "pair",
        "description": "Two rangers side by side, fired at once, and one astern.",
        "sensor": "senscomp-6500",
        "interval_ms": 30,
        "rangers": [
            {"id": "left", "x_m": 0.0, "y_m": 0.1, "bearing_deg": 10},
            {"id": "right", "x_m": 0.0, "y_m": -0.1, "bearing_deg": -10},
            {"id": "astern", "x_m": -0.1, "y_m": 0.0, "bearing_deg": 180},
        ],
        "firing_order": [["left", "right"], "astern"],
        "sources": {},
    }
)


def logged_firings(records: list[dict[str, Any]], array: sonard.RangerArray, beams: int) -> NDArray[np.void]:
    """Returns the readings of a log as an array of the model, with their source rangers."""
    plain = logged(records, beams)
    whole = np.empty(plain.shape, sonard.ARRAY_READING)
    for field in sonard.READING.names or ():
        whole[field] = plain[field]
    pings = [record for record in records if record["type"] == "ping"]
    others = [ping["crosstalk"]["ranger"] if ping.get("crosstalk") else None for ping in pings]
    indices = [-1 if other is None else array.ids.index(other) for other in others]
    whole["crosstalk"] = np.reshape(indices, plain.shape)
    return whole


def assert_equal(found: NDArray[np.void], expected: NDArray[np.void]) -> None:
    assert_same(found, expected)
    np.testing.assert_array_equal(found["crosstalk"], expected["crosstalk"])


def random_poses(scene: sonard.Scene, array: sonard.RangerArray, count: int, seed: int) -> NDArray[np.float64]:
    """Random poses at which a robot with that array can be placed at any heading."""
    model = sonard.ArrayModel(scene, array, max_range_m=0.3, without_crosstalk=True)
    found = np.empty((0, 3))
    for pose in places_in(scene, 400, seed):
        try:
            model.predict(pose, rounds=3)
        except sonard.PoseError:
            continue
        found = np.vstack([found, pose])
        if len(found) == count:
            break
    return found


def as_course(poses: NDArray[np.float64], folder: Path) -> Path:
    path = folder / "poses.jsonl"
    path.write_text("".join(json.dumps({"x_m": x, "y_m": y, "heading_deg": turn}) + "\n" for x, y, turn in poses.tolist()))
    return path


@pytest.mark.parametrize("name", sonard.RangerArray.preset_names())
@pytest.mark.parametrize("rounds", [1, 2])
def test_presets_match_command(name: str, rounds: int, command: Command, tmp_path: Path) -> None:
    array = sonard.RangerArray.preset(name)
    poses = random_poses(LAB, array, 2, seed=7)
    assert len(poses) == 2
    course = as_course(poses, tmp_path)
    records = command("simulate", "--scene", "mcgill-lab", "--array", name, "--poses", course, "--rounds", rounds)
    model = sonard.ArrayModel(LAB, name)
    found = model.predict(poses, rounds)
    beams = rounds * len(array.round)
    assert found.shape == (2, beams) and found.dtype == sonard.ARRAY_READING and found.flags.aligned
    assert_equal(found, logged_firings(records, array, beams))
    # Each firing from the pose of the robot at that time, as for a moving robot.
    pings = [record for record in records if record["type"] == "ping"]
    starts = {record["scan"]: record["pose"] for record in records if record["type"] == "scan_start"}
    taken_at = [ping.get("pose") or starts[ping["scan"]] for ping in pings]
    each = np.array([[pose["x_m"], pose["y_m"], pose["heading_deg"]] for pose in taken_at]).reshape(2, beams, 3)
    assert_equal(model.fire(each), found)
    assert [ping["ranger"] for ping in pings[:beams]] == array.round * rounds


@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    interval_ms=st.sampled_from([8.0, 15.0, 40.0]),
    rounds=st.integers(1, 2),
    options=st.fixed_dictionaries(
        {"max_range_m": st.floats(1, 3)},
        optional={"threshold": st.floats(0.01, 0.2), "max_order": st.integers(0, 4), "without_crosstalk": st.just(True)},
    ),
    seed=st.integers(0, 1000),
)
def test_crosstalk_matches_command(
    interval_ms: float,
    rounds: int,
    options: dict[str, Any],
    seed: int,
    command: Command,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    folder = tmp_path_factory.mktemp("array")
    text = PAIR.replace('"interval_ms": 30', f'"interval_ms": {interval_ms}')
    (folder / "pair.json").write_text(text)
    array = sonard.RangerArray.load(folder / "pair.json")
    scene = sonard.Scene.shipped("two-surface-room")
    poses = random_poses(scene, array, 2, seed)
    arguments: list[object] = ["simulate", "--scene", "two-surface-room", "--array", folder / "pair.json"]
    arguments += ["--poses", as_course(poses, folder), "--rounds", rounds]
    for name, value in options.items():
        arguments += ["--" + name.removesuffix("_m").replace("_", "-")] + ([] if value is True else [value])
    found = sonard.ArrayModel(scene, array, **options).predict(poses, rounds, threads=2)
    assert_equal(found, logged_firings(command(*arguments), array, 3 * rounds))
    if options.get("without_crosstalk"):
        assert (found["crosstalk"] == -1).all()


def test_crosstalk_source() -> None:
    scene = sonard.Scene.shipped("two-surface-room")
    array = sonard.RangerArray.from_json(PAIR)
    model = sonard.ArrayModel(scene, array, threshold=0.005)
    poses = random_poses(scene, array, 40, seed=3)
    found = model.predict(poses)
    received = np.argwhere(found["crosstalk"] >= 0)
    assert len(received) > 0
    at, firing = received[0]
    reading = model.reading(poses[at], int(firing))
    assert reading.crosstalk == array.ids[found["crosstalk"][at, firing]]
    assert reading.range_m == found["range_m"][at, firing] and f"sound of {reading.crosstalk}" in repr(reading)
    alone = sonard.ArrayModel(scene, array, threshold=0.005, without_crosstalk=True)
    assert (alone.predict(poses)["crosstalk"] == -1).all()
    assert alone.reading(poses[at]).crosstalk is None


def test_fire_matches_predict(room: sonard.Scene) -> None:
    model = sonard.Model(room, max_range_m=3.0)
    poses = places_in(room, 12).reshape(3, 4, 3)
    azimuths_deg = np.array([0.0, 33.3, 180.0, 270.9])
    found = model.fire(poses, azimuths_deg)
    assert found.shape == (3, 4) and found.dtype == sonard.READING
    for index in np.ndindex(3, 4):
        assert_same(found[index][None], model.predict(poses[index], [azimuths_deg[index[1]]]))
    assert_same(model.fire(poses, 33.3, threads=1)[:, 1], found[:, 1])
    assert model.fire(poses[0, 0], 5.0).shape == () and model.fire(np.empty((0, 3)), 0.0).shape == (0,)
    with pytest.raises(ValueError, match="broadcast|shape"):
        model.fire(poses, [0.0, 1.0, 2.0])
    with pytest.raises(sonard.PoseError, match=r"poses\[1, 0\]") as caught:
        model.fire(np.array([[[0.4, 0.3, 0.0]], [[9.0, 9.0, 0.0]]]), 0.0)
    assert caught.value.index == (1, 0)


def test_course_matches_command(command: Command) -> None:
    course = sonard.Course([[2.0, 1.5, 0.0], [2.6, 1.5, 350.0]], speed_m_s=0.5)
    assert course.duration_s == pytest.approx(1.2) and len(course) == 2 and repr(course) == "<Course of 2 poses in 1.2 s>"
    np.testing.assert_allclose(course.poses_at([-1, 0.6, 9]), [[2, 1.5, 0], [2.3, 1.5, 355], [2.6, 1.5, 350]])
    model = sonard.ArrayModel(LAB, "pioneer-8")
    times_s = model.array.firing_times_s(2)
    assert times_s.shape == (16,) and abs(times_s[9] - 9e-3 * model.array.interval_ms) < 1e-12
    poses = course.poses_at(times_s)
    found = model.fire(poses)
    assert found.shape == (16,)
    for number in (0, 5, 13):
        assert_equal(found[number : number + 1], model.predict(poses[number])[number % 8 : number % 8 + 1])
        pose = ",".join(map(str, poses[number].tolist()))
        records = command("simulate", "--scene", "mcgill-lab", "--array", "pioneer-8", f"--pose={pose}")
        assert_equal(found[number : number + 1], logged_firings(records, model.array, 8)[0, number % 8 : number % 8 + 1])


@settings(max_examples=50, deadline=None)
@given(
    poses=st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-360, 360)), min_size=1, max_size=6),
    waits_s=st.lists(st.floats(0.01, 100), min_size=6, max_size=6),
)
def test_course_interpolation(poses: list[tuple[float, float, float]], waits_s: list[float]) -> None:
    course = sonard.Course(poses, np.cumsum(waits_s)[: len(poses)])
    assert course.times_s[0] == 0 and (np.diff(course.times_s) > 0).all()
    np.testing.assert_allclose(course.poses_at(course.times_s)[..., :2], course.poses[..., :2], atol=1e-9)
    between = course.poses_at(np.linspace(0, course.duration_s, 50))
    assert (between[:, :2] >= course.poses[:, :2].min(axis=0) - 1e-9).all()
    assert (between[:, :2] <= course.poses[:, :2].max(axis=0) + 1e-9).all()
    assert pickle.loads(pickle.dumps(course)) == course


def test_course_file(tmp_path: Path) -> None:
    path = as_course(np.array([[2.0, 1.5, 0.0], [2.6, 1.5, 30.0]]), tmp_path)
    assert sonard.Course.load(path, 0.5) == sonard.Course([[2, 1.5, 0], [2.6, 1.5, 30]], speed_m_s=0.5)
    path.write_text('{"x_m": 1}\n')
    with pytest.raises(sonard.ArrayError, match=r"poses.jsonl:1: .*y_m"):
        sonard.Course.load(path)
    with pytest.raises(FileNotFoundError):
        sonard.Course.load(tmp_path / "none")


def test_array_properties(tmp_path: Path) -> None:
    array = sonard.RangerArray.preset("ring-12")
    assert array.name == "ring-12" and len(array.ids) == 12 and array.round == [id for turn in array.slots for id in turn]
    assert repr(array).startswith("<RangerArray 'ring-12': 12 rangers '") and array.description
    assert array.mounts.shape == (12, 3) and array.mounts[1, 2] == 30.0
    assert sonard.RangerArray.preset("pioneer-8").mounts[0, 2] == 90.0
    assert isinstance(array.sources, dict) and array.sensor in sonard.Sensor.preset_names()
    on = array.ranger_poses([[1.0, 2.0, 90.0]])
    assert on.shape == (1, 12, 3)
    # The first ranger is in front of a robot with heading +y.
    np.testing.assert_allclose(on[0, 0], [1.0, 2.0 + array.mounts[0, 0], 90.0], atol=1e-12)
    for again in [pickle.loads(pickle.dumps(array)), copy.deepcopy(array), sonard.RangerArray.from_json(array.to_json())]:
        assert again == array and hash(again) == hash(array)
    (tmp_path / "ring.json").write_text(array.to_json())
    assert sonard.RangerArray.load(tmp_path / "ring.json") == array != sonard.RangerArray.preset("pioneer-8")
    pair = sonard.RangerArray.from_json(PAIR)
    assert pair.slots == [["left", "right"], ["astern"]] and pair.round == ["left", "right", "astern"]
    np.testing.assert_allclose(pair.firing_times_s(2), [0, 0, 0.03, 0.06, 0.06, 0.09])


def test_pickling() -> None:
    model = sonard.ArrayModel(LAB, "pioneer-8", "pioneer", sonard.Air(5.0), max_range_m=2.0, without_crosstalk=True)
    assert repr(model) == (
        "<ArrayModel of 'pioneer-8' in 'mcgill-lab', engine 'paths', max_range_m=2.0, without_crosstalk=True>"
    )
    pose = LAB.poses["fig4"]
    for again in [pickle.loads(pickle.dumps(model)), copy.deepcopy(model)]:
        assert repr(again) == repr(model) and again.array == model.array and again.air == model.air
        assert again.predict(pose).tobytes() == model.predict(pose).tobytes()
    assert model.max_range_m == 2.0 and model.sensor.name == "pioneer" and model.options["without_crosstalk"] is True
    assert in_a_fork_of(lambda: model.predict(pose).tobytes()) == model.predict(pose).tobytes()


def test_logged_array(command: Command, tmp_path: Path) -> None:
    log = tmp_path / "ring.jsonl"
    command(
        *["simulate", "--scene", "mcgill-lab", "--array", "ring-12", "--pose", "fig4", "--rounds", 2, "-o", log],
        *["--temperature-c", 12, "--without-crosstalk"],
    )
    scan = sonard.read_log(log)[0]
    assert scan.array == sonard.RangerArray.preset("ring-12") and scan.pose is not None
    model = scan.array_model()
    readings = scan.readings
    poses = np.column_stack([readings[name] for name in ("x_m", "y_m", "heading_deg")])
    for found in [model.predict(scan.pose, 2), model.fire(poses)]:
        for field in ["status", "range_m", "tof_us", "amplitude", "margin_db"]:
            np.testing.assert_array_equal(found[field], readings[field], field)
    # A single ranger of the array, on a stepper.
    assert set(pickle.loads(pickle.dumps(scan.model())).options) == {"max_range_m"}
    command("simulate", "--scene", "mcgill-lab", "--pose", "fig4", "--step-deg", 9, "-o", tmp_path / "one.jsonl")
    alone = sonard.read_log(tmp_path / "one.jsonl")[0]
    assert alone.array is None
    with pytest.raises(sonard.LogError, match="not from an array"):
        alone.array_model()


def test_error_messages() -> None:
    model = sonard.ArrayModel("simple-room", "pioneer-8")
    with pytest.raises(sonard.PoseError, match=r"poses\[1\]: ranger \w+ of the array") as pose:
        model.predict([[0.4, 0.37, 0], [0.8, 0.37, 0]])
    assert pose.value.index == (1,) and "move or turn the robot" in pose.value.help
    with pytest.raises(sonard.PoseError):
        model.predict([0.4, 0.37, np.nan])
    nonsense: Any = 3
    refused: list[tuple[Callable[[], Any], type[Exception], str]] = [
        (lambda: model.predict([0.4, 0.37, 0], rounds=0), ValueError, "rounds is 0"),
        (lambda: model.predict([0.4, 0.37, 0], rounds=201), ValueError, "1 to 200"),
        (lambda: model.array.firing_times_s(0), ValueError, "rounds is 0"),
        (lambda: model.reading([0.4, 0.37, 0], 8), ValueError, "firing is 8: it must be 0 to 7"),
        (lambda: sonard.RangerArray.preset("pioneer-9"), sonard.ArrayError, "did you mean `pioneer-"),
        (lambda: sonard.RangerArray.from_json("{"), sonard.ArrayError, "line 1"),
        (lambda: sonard.RangerArray.from_json(PAIR.replace("30", "0")), sonard.ArrayError, "interval_ms is 0"),
        (lambda: sonard.ArrayModel("simple-room", nonsense), TypeError, "must be a RangerArray"),
        (lambda: sonard.ArrayModel("simple-room", "ring-12", engine=nonsense), TypeError, "str"),
        (lambda: sonard.Course([]), sonard.ArrayError, "no pose"),
        (lambda: sonard.Course([[0, 0, 0], [1, 0, 0]], [1, 1]), sonard.ArrayError, r"poses[1]: time_s 1 is not after the previous one, 1"),
        (lambda: sonard.Course([[0, 0, np.nan]]), sonard.ArrayError, "finite"),
        (lambda: sonard.Course([0, 0, 0]), ValueError, "(n, 3)"),
        (lambda: sonard.Course([[0, 0, 0]], speed_m_s=0), ValueError, "speed_m_s is 0"),
        (lambda: sonard.Course([[0, 0, 0]]).poses_at(np.nan), ValueError, "nan"),
    ]
    for call, kind, words in refused:
        with pytest.raises(kind) as caught:
            call()
        assert words in str(caught.value)
