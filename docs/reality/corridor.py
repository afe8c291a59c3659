"""Eight sonars of a robot that drives along a corridor."""

import collections
import json

from work import share, table

NEAR_M = 0.1
REACH_M = "5.11"
REFLECTANCE = 0.97
# What is tried: title, sensor, roughness of the walls, engine.
TRIED = (
    ("nearest hit", "hc-sr04", 0.0, "cone"),
    ("smooth walls, `hc-sr04`", "hc-sr04", 0.0, "paths"),
    ("smooth walls, `senscomp-6500`", "senscomp-6500", 0.0, "paths"),
    ("rough walls (0.6), `senscomp-6500`", "senscomp-6500", 0.6, "paths"),
)


def main(work):
    """By bearing: which share of the readings is within 0.1 m of the prediction, an echo or a silence."""
    with open(work.given("eight-sonar-corridor", "corridor.json")) as file:
        corridor = json.load(file)
    bearings = corridor["bearings_deg"]
    lines = []
    for title, sensor, roughness, engine in TRIED:
        right, of = collections.Counter(), collections.Counter()
        for pose, model in zip(corridor["poses"], predicted(work, corridor, sensor, roughness, engine)):
            for bearing, measured, expected in zip(bearings, pose["range_m"], model):
                of[bearing] += 1
                right[bearing] += agree(measured, expected)
        lines.append([title, *(share(right[bearing], of[bearing]) for bearing in bearings),
                      share(sum(right.values()), sum(of.values()))])
    table(["", *("%g°" % bearing for bearing in bearings), "all"], lines)


def agree(measured, expected):
    if measured is None or expected is None:
        return measured is expected
    return abs(measured - expected) < NEAR_M


def predicted(work, corridor, sensor, roughness, engine):
    """The ranges that the eight sonars read at each pose."""
    bearings = corridor["bearings_deg"]
    walls = [{key: wall[key] for key in ("id", "from", "to")} | {"material": "board"} for wall in corridor["walls"]]
    materials = {"board": {"reflectance": REFLECTANCE, "roughness": roughness}}
    scene = work.keep("corridor.json", {"name": "corridor", "materials": materials, "walls": walls})
    # So far apart that none detects another's sound.
    rangers = [{"id": "s%d" % i, "x_m": 0.0, "y_m": 0.0, "bearing_deg": turn} for i, turn in enumerate(bearings)]
    array = work.keep("eight.json", {"name": "eight", "description": "A corridor's eight sonars", "sensor": sensor, "interval_ms": 1000.0, "rangers": rangers})
    poses = work.path("corridor-poses.jsonl")
    with open(poses, "w") as file:
        for pose in corridor["poses"]:
            file.write(json.dumps({key: pose[key] for key in ("x_m", "y_m", "heading_deg")}) + "\n")
    records = work.lines("simulate", "--scene", scene, "--poses", poses, "--array", array, "--max-range", REACH_M,
                      "--engine", engine)
    ranges = [ping.get("range_m") for ping in records if ping["type"] == "ping"]
    count = len(bearings)
    return [ranges[at:at + count] for at in range(0, len(ranges), count)]
