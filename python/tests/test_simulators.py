"""Runs examples for simulators that are not installed, with substitutes for their modules."""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import sonard

from .conftest import REPOSITORY

SIMULATORS = REPOSITORY / "examples/simulators"
# Near the wall, in the middle, and outside.
PLACES = [(0.774, 0.085), (0.3, 0.4), (9.0, 9.0)]


def module(monkeypatch: pytest.MonkeyPatch, name: str, **what: Any) -> ModuleType:
    """Installs a module with the given name and members."""
    made = ModuleType(name)
    made.__dict__.update(what)
    monkeypatch.setitem(sys.modules, name, made)
    return made


@pytest.fixture
def scene_file(tmp_path: Path, room: sonard.Scene) -> Path:
    path = tmp_path / "scene.json"
    path.write_text(room.to_json())
    return path


def test_webots_controller(
    monkeypatch: pytest.MonkeyPatch, scene_file: Path, capsys: pytest.CaptureFixture[str], room: sonard.Scene
) -> None:
    places = iter(PLACES)

    class Robot:
        place = (0.0, 0.0)

        def getBasicTimeStep(self) -> float:
            return 32.0

        def getTime(self) -> float:
            return 1.0

        def getDevice(self, name: str) -> Any:
            assert name in ("gps", "imu")
            return SimpleNamespace(
                enable=lambda step_ms: None,
                getValues=lambda: [*self.place, 0.0],
                getRollPitchYaw=lambda: [0.0, 0.0, 0.0],
            )

        def step(self, step_ms: int) -> int:
            self.place = next(places, (0.0, 0.0))
            return -1 if self.place == (0.0, 0.0) else 0

    module(monkeypatch, "controller", Robot=Robot)
    monkeypatch.setattr(sys, "argv", ["webots_sonar.py", str(scene_file)])
    runpy.run_path(str(SIMULATORS / "webots_sonar.py"), run_name="__main__")
    output = capsys.readouterr().out.splitlines()
    model = sonard.Model(room)
    assert output[:2] == [f"1.00 s: {model.reading((*place, 0.0))}" for place in PLACES[:2]]
    assert len(output) == 3
    assert output[2].startswith("no reading: ")


def test_gazebo_system(monkeypatch: pytest.MonkeyPatch, scene_file: Path, room: sonard.Scene) -> None:
    places = iter(PLACES)
    published: list[Any] = []

    class Link:
        def __init__(self, entity: object) -> None: ...

        def enable_velocity_checks(self, ecm: object, on: bool) -> None: ...

        def world_pose(self, ecm: object) -> Any:
            x, y = next(places)
            return SimpleNamespace(
                pos=lambda: SimpleNamespace(x=lambda: x, y=lambda: y),
                rot=lambda: SimpleNamespace(yaw=lambda: 0.0),
            )

    class Node:
        def advertise(self, topic: str, kind: object) -> Any:
            assert topic == "/sonar/range"
            return SimpleNamespace(publish=published.append)

    def message(**fields: Any) -> Any:
        return SimpleNamespace(ranges=[], **fields)

    model_of = SimpleNamespace(link_by_name=lambda ecm, name: name)
    sim = module(monkeypatch, "gz.sim", Model=lambda entity: model_of, Link=Link)
    transport = module(monkeypatch, "gz.transport", Node=Node)
    module(monkeypatch, "gz", sim=sim, transport=transport)
    module(monkeypatch, "gz.msgs")
    module(monkeypatch, "gz.msgs.laserscan_pb2", LaserScan=message)
    sdf = {"scene": str(scene_file)}
    system = runpy.run_path(str(SIMULATORS / "gazebo_sonar.py"))["get_system"]()
    element = SimpleNamespace(get_string=lambda name, default: (sdf.get(name, default), name in sdf))
    system.configure(1, element, None, None)
    for time_s in [0.0, 0.01, 0.1, 0.2]:
        info = SimpleNamespace(paused=False, sim_time=SimpleNamespace(total_seconds=lambda: time_s))
        system.post_update(info, None)
    ranges = sonard.Model(room).predict([(*place, 0.0) for place in PLACES[:2]], [0.0])["range_m"]
    # Between two periods, and at poses where no ranger can be placed, nothing is published.
    assert [list(message.ranges) for message in published] == [[float(one)] for one in ranges[:, 0]]


def test_examples_are_documented() -> None:
    text = (SIMULATORS / "README.md").read_text()
    assert all(f"`{path.name}`" in text for path in SIMULATORS.glob("*.py"))
