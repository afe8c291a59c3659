"""Fixtures shared by the tests."""

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from numpy.typing import NDArray

import sonard

# Uses the same random cases in every run; HYPOTHESIS_PROFILE=default draws new ones.
settings.register_profile("same", derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))

REPOSITORY = Path(__file__).resolve().parents[2]

PROGRAM = os.environ.get("SONARD", str(Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target")) / "debug/sonard"))

Command = Callable[..., list[dict[str, Any]]]


@pytest.fixture(scope="session")
def command() -> Command:
    """Runs the command `sonard` and returns its output as a list of JSON lines."""

    def run(*arguments: object) -> list[dict[str, Any]]:
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return [json.loads(line) for line in done.stdout.splitlines()]

    return run


@pytest.fixture
def room() -> sonard.Scene:
    return sonard.Scene.shipped("simple-room")


def places_in(scene: sonard.Scene, count: int, seed: int = 1) -> NDArray[np.float64]:
    """Random poses at which a ranger can be placed, shape (count, 3)."""
    rng = np.random.default_rng(seed)
    ends = scene.walls.reshape(-1, 2)
    places = np.empty((0, 2))
    while len(places) < count:
        drawn = rng.uniform(ends.min(axis=0), ends.max(axis=0), (4 * count, 2))
        places = np.concatenate([places, drawn[scene.are_accessible(drawn)]])
    return np.column_stack([places[:count], rng.uniform(-180, 180, count)])
