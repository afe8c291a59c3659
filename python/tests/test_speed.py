"""Readings cost in Python what they cost in Rust."""

import time

import sonard
from sonard._sonard import _seconds_of_predict_many

from .conftest import places_in

# Of Rust's speed.
LEAST = 0.8
ROUNDS = 9


def test_400_scans_of_400_beams_are_nearly_as_fast_as_predict_many(room: sonard.Scene) -> None:
    model = sonard.Model(room)
    poses = places_in(room, 400)
    python_s = rust_s = float("inf")
    # Of each the best of some counts, taken in turn, because other programs run on a computer, too.
    for _ in range(ROUNDS):
        began = time.perf_counter()
        assert model.predict(poses).shape == (400, 400)
        python_s = min(python_s, time.perf_counter() - began)
        rust_s = min(rust_s, _seconds_of_predict_many(model, poses))
        if rust_s / python_s >= LEAST:
            break
    else:
        raise AssertionError(f"{rust_s / python_s:.2f} of what Rust has")
    print(f"{160_000 / python_s:,.0f} readings a second, {rust_s / python_s:.2f} of what Rust has")
