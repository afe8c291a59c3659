"""Occupancy maps from sweeps: a benchmark for machine learning, with two baselines.

The data are fixed (learn_occupancy.toml, generated here; another file may be given): 24 furnished rooms with ten sweeps
each, of 400 readings. The task is to predict the probability that a cell of a room is occupied, from the sweeps of that room
alone. The metric is the average precision of occupied cells among the known cells of each room, averaged over the rooms of
the last shard, which must not be used for training. Cells that are unreachable from the poses of the sweeps do not count.

Baselines: the map of `sonard map`, and a small gradient boosting on features of the sweeps at a cell.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.compute
import pyarrow.parquet
import sklearn.ensemble
import sklearn.metrics
from numpy.typing import NDArray

import sonard

SHARDS, TEST = 4, 4
STEP_DEG, REACH_M = 0.9, 4.0
NEAR_BEAMS = 8
FREE, OCCUPIED = 0, 1
PROGRAM = os.environ.get("SONARD", "sonard")

Array = NDArray[np.float64]
Table = dict[str, list[float]]


class Room:
    """Sweeps of a room, and its true map."""

    def __init__(self, readings: Table, truth: Table) -> None:
        column = {name: np.array(values, dtype=float) for name, values in readings.items() if name != "status"}
        self.table = column
        self.places = np.column_stack([column[name].reshape(-1, 400)[:, 0] for name in ("x_m", "y_m", "heading_deg")])
        ranges_m = column["range_m"].reshape(-1, 400)
        self.ranges_m = np.where(np.isnan(ranges_m), np.inf, ranges_m)
        self.shape = int(truth["height"][0]), int(truth["width"][0])
        self.origin_m = truth["origin_x_m"][0], truth["origin_y_m"][0]
        self.cell_m = truth["resolution_m"][0]
        self.truth = np.array(truth["cells"][0])

    def centres(self) -> Array:
        rows, columns = np.mgrid[: self.shape[0], : self.shape[1]]
        return np.column_stack([columns.ravel() + 0.5, rows.ravel() + 0.5]) * self.cell_m + self.origin_m


def rooms(folder: Path, shard: int) -> list[Room]:
    def of_scene(name: str) -> dict[int, Table]:
        table = pyarrow.parquet.read_table(folder / f"shard-{shard:05}" / f"{name}.parquet")
        scenes = sorted(set(table["scene"].to_pylist()))
        return {scene: table.filter(pyarrow.compute.equal(table["scene"], scene)).to_pydict() for scene in scenes}

    readings, truth = of_scene("readings"), of_scene("occupancy")
    return [Room(readings[scene], truth[scene]) for scene in readings]


def score(room: Room, occupancy: Array) -> float:
    known = room.truth <= OCCUPIED
    return float(sklearn.metrics.average_precision_score(room.truth[known] == OCCUPIED, occupancy.ravel()[known]))


def mapped(room: Room, folder: Path) -> Array:
    """Returns the map of `sonard map` for the sweeps."""
    table, log = folder / "room.csv", folder / "room.jsonl"
    columns = ["x_m", "y_m", "heading_deg", "azimuth_deg", "range_m"]
    rows = np.column_stack([room.table[name] for name in columns])
    text = "\n".join(",".join("" if np.isnan(cell) else repr(float(cell)) for cell in row) for row in rows)
    table.write_text(",".join(columns) + "\n" + text + "\n")
    log.unlink(missing_ok=True)
    subprocess.run([PROGRAM, "import", table, "-o", log], check=True, capture_output=True)
    (x, y), (height, width) = room.origin_m, room.shape
    region = (x, y, x + width * room.cell_m, y + height * room.cell_m)
    return sonard.map(sonard.read_log(log), resolution_m=room.cell_m, region=region).occupancy


def features(room: Room) -> Array:
    """Features of each cell, over all sweeps: shape (cells, features)."""
    centres = room.centres()
    off_m = centres[:, None, :] - room.places[None, :, :2]
    distance_m = np.hypot(off_m[..., 0], off_m[..., 1])
    azimuth_deg = np.degrees(np.arctan2(off_m[..., 1], off_m[..., 0])) - room.places[None, :, 2]
    beam = np.round(azimuth_deg / STEP_DEG).astype(int) % 400
    sweep = np.arange(len(room.places))[None, :]
    # Range of the beam and of its neighbours minus the distance of the cell.
    neighbours = np.stack([room.ranges_m[sweep, (beam + turn) % 400] for turn in range(-NEAR_BEAMS, NEAR_BEAMS + 1)])
    beyond_m = np.clip(neighbours - distance_m, -REACH_M, REACH_M)
    straight_m, nearest_m = beyond_m[NEAR_BEAMS], np.abs(beyond_m).min(axis=0)
    passed, hit = (beyond_m.min(axis=0) > 0.15), (np.abs(straight_m) < 0.1)
    by_distance = np.argsort(distance_m, axis=1)[:, :3]
    near = [np.take_along_axis(values, by_distance, axis=1) for values in (distance_m, straight_m, nearest_m)]
    return np.column_stack(
        [
            nearest_m.min(axis=1),
            np.abs(straight_m).min(axis=1),
            straight_m.max(axis=1),
            np.median(straight_m, axis=1),
            passed.sum(axis=1),
            hit.sum(axis=1),
            (straight_m < -0.15).sum(axis=1),
            (nearest_m < 0.05).sum(axis=1),
            *near,
        ]
    )


def learned(train: list[Room]) -> sklearn.ensemble.HistGradientBoostingClassifier:
    known = [room.truth <= OCCUPIED for room in train]
    inputs = np.concatenate([features(room)[of] for room, of in zip(train, known)])
    truth = np.concatenate([room.truth[of] == OCCUPIED for room, of in zip(train, known)])
    return sklearn.ensemble.HistGradientBoostingClassifier(random_state=0).fit(inputs, truth)


folder = Path("learn-occupancy")
spec = sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix(".toml")
print(sonard.generate(spec, folder))
train = [room for shard in range(1, SHARDS + 1) if shard != TEST for room in rooms(folder, shard)]
test = rooms(folder, TEST)
model = learned(train)
scores = {
    "chance": [score(room, np.zeros(room.truth.size)) for room in test],
    "sonard map": [score(room, mapped(room, Path("."))) for room in test],
    "gradient boosting": [score(room, model.predict_proba(features(room))[:, 1]) for room in test],
}
for name, of_rooms in scores.items():
    print(f"{name:18} average precision {np.mean(of_rooms):.3f}  ({', '.join(f'{value:.2f}' for value in of_rooms)})")
means = {name: np.mean(of_rooms) for name, of_rooms in scores.items()}
assert means["chance"] < 0.6 * means["sonard map"], "the map must be better than chance"
assert means["sonard map"] < means["gradient boosting"], "learning must be better than the map"
