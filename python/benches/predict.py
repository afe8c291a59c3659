"""Speed of predictions compared with Rust: `python python/benches/predict.py`, with the package installed.

Prints readings per second for 400 scans of 400 beams in `simple-room`, and the ratio to `Simulator::predict_many`
in the same process, run alternately. The best of seven runs counts, because other programs use the computer, too.
"""

import time

import numpy as np

import sonard
from sonard._sonard import _time_predict_many


def main() -> None:
    scene = sonard.Scene.shipped("simple-room")
    model = sonard.Model(scene)
    rng = np.random.default_rng(1)
    ends = scene.walls.reshape(-1, 2)
    drawn = rng.uniform(ends.min(axis=0), ends.max(axis=0), (4000, 2))
    places = drawn[scene.are_accessible(drawn)][:400]
    poses = np.column_stack([places, rng.uniform(-180, 180, len(places))])

    def here() -> float:
        began = time.perf_counter()
        model.predict(poses)
        return time.perf_counter() - began

    rounds = [(here(), _time_predict_many(model, poses)) for _ in range(7)]
    python_s, rust_s = (min(times) for times in zip(*rounds, strict=True))
    print(f"{len(poses)} scans: {len(poses) * 400 / python_s:,.0f} readings per second, {rust_s / python_s:.2f} of the speed of Rust")


if __name__ == "__main__":
    main()
