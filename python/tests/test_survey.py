"""Surveys compared with the command and with the true room."""

import json
import pickle
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import sonard

from .conftest import Command

ROOM = sonard.Scene.from_points([[0.0, 0.0], [2.8, 0.0], [2.8, 2.3], [0.0, 2.3]], name="room")
STOPS = np.array([[0.7, 0.6, 20.0], [1.2, 0.9, 65.0], [1.9, 1.3, 100.0]])
ODOMETRY = STOPS + np.outer(np.arange(3), [0.012, -0.009, 1.1])
PATIENCE_S = 60


@pytest.fixture(scope="module")
def sweeps() -> NDArray[np.void]:
    return sonard.Model(ROOM, max_range_m=4.0).predict(STOPS)


@pytest.fixture(scope="module")
def found(sweeps: NDArray[np.void]) -> sonard.Survey:
    return sonard.survey(sweeps, ODOMETRY, max_range_m=4.0)


def test_reconstructs_room(found: sonard.Survey) -> None:
    assert found.end == "complete" and not found.unexplained and found.arcs > 30
    lengths_m = sorted(wall.length_m() for wall in found.walls)
    np.testing.assert_allclose(lengths_m, [2.3, 2.3, 2.8, 2.8], atol=1e-3)
    # The frame is the first pose, which has no error.
    np.testing.assert_allclose(found.poses[:, :2], STOPS[:, :2], atol=1e-3)
    np.testing.assert_allclose(found.poses[:, 2], STOPS[:, 2], atol=0.1)
    assert found.poses.shape == found.sigmas.shape == (3, 3) and (found.sigmas[0] == 0).all()
    assert (found.sigmas[1:] > 0).all() and (found.sigmas[1:] < 0.5).all()
    assert sorted(found.scene.poses) == ["stop-1", "stop-2", "stop-3"]
    for wall in found.walls:
        assert wall.length_m("observed") > 0 and 0 < wall.sigma_across_m < 0.01 and wall.evidence_nats > 0
        assert wall.ends.shape == (2, 2) and (np.linalg.eigvalsh(wall.covariances_m2) >= 0).all()
    assert [len(causes) for causes in found.causes] == [400] * 3
    assert found.probability + sum(plan.probability for plan in found.alternatives) == pytest.approx(1)
    # The scene predicts a sweep at a place that was not visited.
    place = [1.6, 0.7, 0.0]
    [true, again] = [sonard.Model(scene, max_range_m=4.0).predict(place)["range_m"] for scene in (ROOM, found.scene)]
    both = np.isfinite(true) & np.isfinite(again)
    assert both.sum() > 200 and (np.abs(true[both] - again[both]) < 0.005).mean() > 0.95


def test_finds_a_post() -> None:
    corners = [[0.0, 0.0], [2.8, 0.0], [2.8, 2.3], [0.0, 2.3]]
    room = sonard.Scene.from_points(corners, cylinders=[[2.1, 0.6, 0.06]])
    stops = np.vstack([STOPS, [1.4, 1.6, 190.0]])
    found = sonard.survey(sonard.Model(room, max_range_m=4.0).predict(stops), stops, max_range_m=4.0)
    (post,) = found.posts
    assert post.status == "observed" and post.sweeps >= 2 and post.evidence_nats > 10
    np.testing.assert_allclose([*post.center, post.radius_m], [2.1, 0.6, 0.06], atol=0.005)
    assert all(0 < sigma < 0.01 for sigma in (*post.sigma_m, post.sigma_radius_m))
    np.testing.assert_allclose(found.scene.cylinders, [[*post.center, post.radius_m]], atol=1e-5)


def test_next_view() -> None:
    corners = np.array([[0.0, 0.0], [3.4, 0.0], [3.4, 1.5], [1.6, 1.5], [1.6, 2.9], [0.0, 2.9]])
    room = sonard.Scene.from_points(corners)
    stops = np.array([[2.6, 0.4, 20.0], [3.0, 0.8, 20.0]])
    found = sonard.survey(sonard.Model(room, max_range_m=4.0).predict(stops), stops, max_range_m=4.0)
    view = found.next_view
    assert view is not None and 0.1 < view.gain_nats <= found.open_nats
    assert view.pose.shape == (3,) and np.hypot(*(view.pose[:2] - stops[:, :2]).T).min() <= 1.5
    assert room.clearance_m(view.pose[:2]) > 0.2
    shares = [part.share for part in view.resolves]
    assert shares == sorted(shares, reverse=True) and 0 < sum(shares) <= 1 + 1e-9
    for part in view.resolves:
        assert part.ends.shape[1:] == (2, 2) and 0 < part.probability < 1
        assert (part.kind in ("wall", "post")) == (part.name is not None)
    # Places are limited to the reach.
    near = sonard.survey(sonard.Model(room, max_range_m=4.0).predict(stops), stops, max_range_m=4.0, view_reach_m=0.0)
    assert near.next_view is None and near.open_nats == found.open_nats


def test_matches_command(command: Command, tmp_path: Path) -> None:
    room = tmp_path / "truth.json"
    room.write_text(ROOM.to_json())
    logs = [tmp_path / f"{at}.jsonl" for at in range(3)]
    for log, pose in zip(logs, STOPS, strict=True):
        command("simulate", "--scene", room, "--pose", ",".join(map(str, pose)), "--max-range", 4, "-o", log)
    (listed,) = command("survey", *logs, "--max-range", 4, "--json", "--out", tmp_path / "out")
    found = sonard.survey([sonard.read_log(log) for log in logs], max_range_m=4.0)
    assert found.scans == tuple(pose["scan"] for pose in listed["poses"])
    assert (found.score, found.probability, found.scored_scenes) == (
        listed["score"],
        listed["probability"],
        listed["scored_scenes"],
    )
    assert [wall.ends.tolist() for wall in found.walls] == [
        [wall["from"]["at_m"], wall["to"]["at_m"]] for wall in listed["walls"]
    ]
    assert [list(causes) for causes in found.causes] == listed["causes"]
    assert (found.open_nats, found.next_view) == (listed["open_nats"], listed["next_view"])
    assert found.scene == sonard.Scene.load(tmp_path / "out/scene.json")


def test_array_on_a_moving_robot(command: Command, tmp_path: Path) -> None:
    along = np.column_stack([np.linspace(0.6, 1.8, 7), np.full(7, 0.7), np.zeros(7)])
    up = np.column_stack([np.full(6, 1.9), 0.7 + 0.15 * np.arange(6), np.full(6, 90.0)])
    poses = np.vstack([along, up])
    odometry = poses + np.outer(np.arange(13), [0.004, -0.003, 0.3])
    model = sonard.ArrayModel(ROOM, "ring-12", max_range_m=4.0)
    rounds = model.predict(poses)
    found = sonard.survey(rounds, odometry, array="ring-12", max_range_m=4.0)
    np.testing.assert_allclose(sorted(wall.length_m() for wall in found.walls), [2.3, 2.3, 2.8, 2.8], atol=0.01)
    np.testing.assert_allclose(found.poses, poses, atol=0.6)
    np.testing.assert_allclose(found.poses[:, :2], poses[:, :2], atol=0.01)
    assert [len(causes) for causes in found.causes] == [12] * 13
    # Bare ranges in the order of the firings, as measured by a robot.
    ranges = np.where(rounds["status"] == sonard.Status.ECHO, rounds["range_m"], np.inf)
    again = sonard.survey(ranges, odometry, array=model.array, sensor=model.sensor, max_range_m=4.0)
    assert again.end == found.end and len(again.walls) == 4

    # Scans of a log give what the command gives.
    scene, course, log = (tmp_path / name for name in ("room.json", "course.csv", "ring.jsonl"))
    scene.write_text(ROOM.to_json())
    np.savetxt(course, poses, delimiter=",", header="x_m,y_m,heading_deg", comments="")
    command("simulate", "--array", "ring-12", "--scene", scene, "--poses", course, "--max-range", 4, "-o", log)
    (listed,) = command("survey", log, "--max-range", 4, "--round-spacing", 0.3, "--json", "--out", tmp_path / "out")
    logged = sonard.survey(sonard.read_log(log), max_range_m=4.0, round_spacing_m=0.3)
    assert len(logged.poses) == len(listed["poses"]) == 7 and logged.score == listed["score"]

    with pytest.raises(ValueError, match="poses must be omitted for scans of an array"):
        sonard.survey(sonard.read_log(log), np.zeros((len(sonard.read_log(log)), 3)))
    wrong: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = [
        ("array must be omitted for scans", (sonard.read_log(log),), {"array": "ring-12"}),
        ("azimuths_deg must be omitted with an array", (rounds, odometry), {"array": "ring-12", "azimuths_deg": [0.0]}),
        ("sweeps[0]: 11 readings, but a round of the array has 12 firings", (rounds[:, :11], odometry), {"array": "ring-12"}),
        ("round_spacing_m is 9: it must be from 0 to 5", (rounds, odometry), {"array": "ring-12", "round_spacing_m": 9.0}),
    ]
    for words, arguments, options in wrong:
        with pytest.raises(ValueError) as caught:
            sonard.survey(*arguments, **options)
        assert words in str(caught.value)
    with pytest.raises(sonard.SonardError, match="201 rounds of the array: a survey takes 200 at most"):
        sonard.survey(np.ones((201, 12)), np.zeros((201, 3)), array="ring-12")


def test_ranges_and_progress(sweeps: NDArray[np.void], found: sonard.Survey) -> None:
    steps: list[dict[str, Any]] = []
    again = sonard.survey(sweeps["range_m"], ODOMETRY, max_range_m=4.0, progress=steps.append)
    # Bare ranges lack the targets below the minimum range only, and there are none.
    assert (again.score, again.scored_scenes) == (found.score, found.scored_scenes)
    assert [step["stage"] for step in steps][:2] == ["course", "walls"] and steps[-1]["stage"] == "alternatives"
    assert steps[1]["round"] == 1 and steps[-1]["walls"] == 4
    counts = [step["scored_scenes"] for step in steps]
    assert counts == sorted(counts) and counts[-1] <= found.scored_scenes


def test_budget(sweeps: NDArray[np.void], found: sonard.Survey) -> None:
    early = sonard.survey(sweeps, ODOMETRY, max_range_m=4.0, max_scenes=100)
    assert early.end == "budget" and early.scored_scenes < found.scored_scenes


def test_pickling(found: sonard.Survey) -> None:
    again = pickle.loads(pickle.dumps(found))
    assert repr(again) == repr(found) and again.scene == found.scene
    assert json.dumps(again.causes) == json.dumps(found.causes)


def test_callback_ends_search(sweeps: NDArray[np.void]) -> None:
    def stop(step: dict[str, Any]) -> None:
        raise LookupError(step["stage"])

    with pytest.raises(LookupError, match="course"):
        sonard.survey(sweeps, ODOMETRY, max_range_m=4.0, progress=stop)


def test_other_threads_run(sweeps: NDArray[np.void]) -> None:
    ticks: list[str] = []
    reached = threading.Event()

    def tick() -> None:
        # Runs only if the survey releases the lock, between its first and its last report.
        assert reached.wait(PATIENCE_S)
        ticks.append("tick")

    thread = threading.Thread(target=tick)
    thread.start()

    def report(step: dict[str, Any]) -> None:
        ticks.append(step["stage"])
        reached.set()

    sonard.survey(sweeps, ODOMETRY, max_range_m=4.0, progress=report)
    thread.join()
    assert ticks.index("tick") < ticks.index("alternatives")


INTERRUPTED = """
import numpy as np, os, signal, sonard
# Shells start background jobs with the signal ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
room = sonard.Scene.from_points([[0, 0], [2.8, 0], [2.8, 2.3], [0, 2.3]])
stops = np.array([[0.7, 0.6, 20.0], [1.2, 0.9, 65.0], [1.9, 1.3, 100.0]])
sweeps = sonard.Model(room, max_range_m=4.0).predict(stops)
done = []
def report(step):
    done.append(step["stage"])
    if len(done) == 2:
        os.kill(os.getpid(), signal.SIGINT)
try:
    sonard.survey(sweeps, stops, max_range_m=4.0, progress=report)
except KeyboardInterrupt:
    print("interrupted after", done)
"""


def test_interrupt() -> None:
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert (done.stdout, done.stderr) == ("interrupted after ['course', 'walls']\n", "")
    assert done.returncode == 0


def test_error_messages(sweeps: NDArray[np.void]) -> None:
    nan = ODOMETRY.copy()
    nan[1, 2] = np.nan
    silent = sweeps["range_m"].copy()
    silent[2] = np.inf
    cases: list[tuple[type[Exception], str, tuple[Any, ...], dict[str, Any]]] = [
        (sonard.SonardError, "too few sweeps (1): a survey needs at least 2", (sweeps[:1], ODOMETRY[:1]), {}),
        (sonard.LogError, "no sweep to survey: pass scans of a ranger on a stepper, or of an array", ([],), {}),
        (sonard.SonardError, "sweeps[2] has no arc of equal ranges", (silent, ODOMETRY), {}),
        (sonard.SonardError, "leave this sweep out, or raise max_range_m", (sweeps, ODOMETRY), {"max_range_m": 0.3}),
        (ValueError, "poses[1]: values must be finite", (sweeps, nan), {}),
        (ValueError, "poses has the shape (2, 3): it must be (3, 3), a pose for each sweep", (sweeps, ODOMETRY[:2]), {}),
        (ValueError, "its last axis must be x_m, y_m, heading_deg", (sweeps, ODOMETRY[:, :2]), {}),
        (ValueError, "poses is missing: pass the pose of each sweep by odometry, or odometry=None", (sweeps,), {}),
        (ValueError, "sweeps[0]: 3 readings, but 400 azimuths_deg", (np.ones((2, 3)), ODOMETRY[:2]), {}),
        (ValueError, "sweeps[0]: readings has the shape ()", (np.ones(3), ODOMETRY), {}),
        (ValueError, "it must be scans or an array of shape (sweeps, beams)", (3, ODOMETRY), {}),
        (ValueError, "max_range_m is 30: it must be from 0.3 to 20", (sweeps, ODOMETRY), {"max_range_m": 30}),
        (ValueError, "max_range_m is NaN", (sweeps, ODOMETRY), {"max_range_m": np.nan}),
        (ValueError, "max_scenes is -1: it must be at least 1", (sweeps, ODOMETRY), {"max_scenes": -1}),
        (ValueError, "odometry[0] is 0: it must be positive and finite", (sweeps, ODOMETRY), {"odometry": (0.0, 5.0)}),
        (ValueError, "view_reach_m is 30: it must be from 0 to 20", (sweeps, ODOMETRY), {"view_reach_m": 30}),
        (ValueError, "reflectance is 1.5: it must be above 0, up to 1", (sweeps, ODOMETRY), {"reflectance": 1.5}),
    ]
    for kind, words, arguments, options in cases:
        with pytest.raises(kind) as caught:
            sonard.survey(*arguments, **options)
        assert words in str(caught.value)
