#!/usr/bin/env python3
"""What docs/reality.md says, measured anew: docs/reality.py SONARD DATA OUT

SONARD is the built binary, DATA the folder with the measurements (docs/reality.md says where they are from), OUT
a folder for logs, calibrations and tables. Needs nothing but Python. 45 sweeps are fitted and located in some minutes.
"""

import collections
import csv
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

FITTED = ("roberto-a", "roberto-b", "roberto-c", "roberto-d")
FIT = "pose,mounting,threshold,rise,beam,skirts"
NEAR_M = 0.03
REACH_M = "2.55"


def main():
    sonard, data, out = sys.argv[1:4]
    os.makedirs(out, exist_ok=True)
    work = Work(sonard, os.path.join(data, "arena.json"), out)
    sweeps = json.load(open(os.path.join(data, "arena-sweeps.json")))
    start = work.path("start.json")
    json.dump(start_sensor(work), open(start, "w"))
    fitted = [sweep for sweep in sweeps if sweep["group"] in FITTED]
    blind = [sweep for sweep in sweeps if sweep["group"] not in FITTED]
    work.imported("fitted", fitted, start)
    work.imported("blind", blind, start)
    work.calibrate("fitted", start)
    sensor = work.path("calibrated", "sensor.json")
    placed = work.located("blind", blind, sensor)
    located_table(blind, placed)
    found = [(sweep, modes[0]) for sweep, modes in zip(blind, placed) if modes]
    score("calibrated, poses by locate", work, found, sensor, ())
    by_range(work, found, sensor)
    score("nearest hit, same poses", work, found, sensor, ("--engine", "cone"))
    by_hand = [by_hand_of(sweep) for sweep in blind]
    score("hc-sr04, poses by hand", work, by_hand, "hc-sr04", ())
    score("nearest hit, poses by hand", work, by_hand, "hc-sr04", ("--engine", "cone"))
    panels(work, data)


class Work:
    """The binary with a scene and a folder."""

    def __init__(self, sonard, scene, out):
        self.sonard, self.scene, self.out = os.path.abspath(sonard), scene, out

    def path(self, *names):
        return os.path.join(self.out, *names)

    def run(self, *args):
        done = subprocess.run([self.sonard, *args], capture_output=True, text=True)
        if done.returncode:
            sys.exit("%s\n%s" % (" ".join(args), done.stderr))
        return done.stdout

    def imported(self, name, sweeps, sensor):
        json.dump(sweeps, open(self.path(name + ".json"), "w"))
        columns = "scan=id,bearing_deg=bearing_deg,range_m=range_m,x_m=fit_m.0,y_m=fit_m.1"
        self.run("import", self.path(name + ".json"), "--columns", columns, "--scene", self.scene,
                 "--sensor", sensor, "--force", "-o", self.path(name + ".jsonl"))

    def calibrate(self, name, sensor):
        priors = [arg for prior in ("x_m=0.03", "y_m=0.03", "heading_deg=4") for arg in ("--prior", prior)]
        said = self.run("calibrate", self.path(name + ".jsonl"), "--sensor", sensor, "--fit", FIT, *priors,
                        "--out", self.path("calibrated"), "--force")
        print("\n".join(line for line in said.splitlines() if "_m of" not in line and "_deg of" not in line))

    def located(self, name, sweeps, sensor):
        """The modes of each sweep, most probable first."""
        said = self.run("locate", self.path(name + ".jsonl"), "--sensor", sensor, "--json")
        modes = collections.OrderedDict()
        for line in map(json.loads, said.splitlines()):
            if "x_m" in line:
                modes.setdefault(line["scan"], []).append(line)
        scans = []
        for line in map(json.loads, open(self.path(name + ".jsonl"))):
            if line.get("scan") and line["scan"] not in scans:
                scans.append(line["scan"])
        assert len(scans) == len(sweeps)
        return [modes.get(scan, []) for scan in scans]

    def predicted(self, pose, sensor, options):
        said = self.run("simulate", "--scene", self.scene, "--pose=%f,%f,%f" % pose, "--sensor", sensor,
                        "--step-deg", "1", "--max-range", REACH_M, *options)
        pings = (line for line in map(json.loads, said.splitlines()) if line["type"] == "ping")
        return {round(ping["azimuth_deg"]) % 360: ping.get("range_m") for ping in pings}


def by_hand_of(sweep):
    """A sweep with ranges from the axis, and the pose that was found by hand."""
    ranges = [range_m and range_m + sweep["radial_offset_m"] for range_m in sweep["range_m"]]
    x_m, y_m = sweep["fit_m"]
    return dict(sweep, range_m=ranges), {"x_m": x_m, "y_m": y_m, "heading_deg": 0.0}


def start_sensor(work):
    """hc-sr04 with a plain amplifier, two cans 3 cm apart, and skirts."""
    sensor = json.loads(work.run("sensor", "show", "hc-sr04"))
    sensor.update(
        name="nxt", aperture={"shape": "piston", "radius_m": 0.0055, "skirts_db": -10.0}, threshold=0.15,
        threshold_rise_db_per_m=1.0, gain={"kind": "steps", "steps": [{"until_us": None, "gain_db": 0.0}]},
        mounting={"separation_m": 0.03, "ahead_m": 0.03}, max_range_m=2.55)
    sensor["sources"] = {key: "where the fit begins" for key in sensor if key not in ("name", "description", "sources")}
    return sensor


def apart_deg(one, other):
    return abs((one - other + 180) % 360 - 180)


def located_table(sweeps, placed):
    """How many were found, by run; bearings in the file are already in the world, so the heading is near 0."""
    near, second, of = collections.Counter(), collections.Counter(), collections.Counter()
    for sweep, modes in zip(sweeps, placed):
        x_m, y_m = sweep["fit_m"]
        is_right = [((mode["x_m"] - x_m) ** 2 + (mode["y_m"] - y_m) ** 2) ** 0.5 < 0.1
                    and apart_deg(mode["heading_deg"], 0) < 10 for mode in modes]
        of[sweep["group"]] += 1
        near[sweep["group"]] += bool(is_right) and is_right[0]
        second[sweep["group"]] += any(is_right[1:])
    for run in of:
        print("%-12s %d of %d located, %d more by a later mode" % (run, near[run], of[run], second[run]))
    print("%-12s %d of %d" % ("all", sum(near.values()), sum(of.values())))


def readings(work, found, sensor, options=()):
    """Measured and predicted ranges of all readings, by run."""
    def one(pair):
        sweep, mode = pair
        predicted = work.predicted((mode["x_m"], mode["y_m"], 0.0), sensor, options)
        turn_deg = mode["heading_deg"]
        return [(sweep["group"], measured, predicted[round(bearing + turn_deg) % 360])
                for bearing, measured in zip(sweep["bearing_deg"], sweep["range_m"])]
    with ThreadPoolExecutor(2) as pool:
        return [reading for sweep in pool.map(one, found) for reading in sweep]


def score(title, work, found, sensor, options):
    counts = collections.defaultdict(collections.Counter)
    for group, measured, model in readings(work, found, sensor, options):
        for count in (counts[group], counts["all"]):
            if measured is None:
                count["silent"] += 1
                count["agreed"] += model is None
            elif measured < 0.27 and group.startswith("roberto") and (model is None or abs(model - measured) > NEAR_M):
                count["body"] += 1
            else:
                count["echo"] += 1
                count["near"] += model is not None and abs(model - measured) < NEAR_M
                count["unheard"] += model is None
    print(title)
    for run, count in counts.items():
        print("  %-12s %.1f %% of %d echoes within 3 cm, %.1f %% not heard; %.0f %% of %d silences; %d of the body" % (
            run, 100 * count["near"] / count["echo"], count["echo"], 100 * count["unheard"] / count["echo"],
            100 * count["agreed"] / max(1, count["silent"]), count["silent"], count["body"]))


def by_range(work, found, sensor):
    """Which ranges the model gets right."""
    edges = (0, 0.4, 0.6, 0.9, 1.3, 1.7, 2.1, 2.6)
    counts = collections.Counter()
    for _, measured, model in readings(work, found, sensor):
        if measured is not None:
            bin_m = max(edge for edge in edges if edge <= measured)
            counts[bin_m, "echo"] += 1
            counts[bin_m, "near"] += model is not None and abs(model - measured) < NEAR_M
    for edge in edges[:-1]:
        print("  from %.1f m: %d of %d" % (edge, counts[edge, "near"], counts[edge, "echo"]))


def panels(work, data):
    """Half the arc over which a panel answers, and how much later its ends are than its middle, by distance."""
    series = collections.OrderedDict()
    with open(os.path.join(data, "hcsr04-panel-sweeps.csv")) as file:
        for row in csv.DictReader(file):
            # Ranges were computed with 340.2 m/s, and sound went 1.25 % faster.
            reading = (float(row["sensor_angle_deg"]), 0.010125 * float(row["reported_range_cm"]))
            series.setdefault(float(row["series_mean_distance_cm"]), []).append(reading)
    for threshold in (0.094, 0.13, 0.17):
        squares, misses, late_mm = 0.0, 0.0, 0.0
        print("panel, hc-sr04 with a threshold of %.3f" % threshold)
        for distance_cm, measured in series.items():
            half_deg, ends_m = arc(measured)
            model_deg, model_m = arc(panel(work, 0.01 * distance_cm, threshold))
            squares += (model_deg - half_deg) ** 2
            misses += model_deg - half_deg
            late_mm += 1e3 * (model_m - ends_m)
            print("  %5.1f cm: +-%.1f degrees, model %.1f; ends %.0f mm late, model %.0f" % (
                distance_cm, half_deg, model_deg, 1e3 * ends_m, 1e3 * model_m))
        count = len(series)
        print("  rms %.1f degrees, mean %.1f; ends %.0f mm later than measured" % (
            (squares / count) ** 0.5, misses / count, late_mm / count))


def arc(readings):
    """Half the width of an arc, degrees, and how much later its two ends are than its middle, metres."""
    readings = sorted(readings)
    middle_m = min(readings, key=lambda reading: abs(reading[0]))[1]
    ends_m = 0.5 * (readings[0][1] + readings[-1][1])
    return 0.5 * (readings[-1][0] - readings[0][0]), ends_m - middle_m


def panel(work, distance_m, threshold):
    wall = {"id": "panel", "from": [distance_m, -0.1335], "to": [distance_m, 0.1335], "material": "board"}
    scene = {"name": "panel", "materials": {"board": {"reflectance": 0.97}}, "walls": [wall]}
    json.dump(scene, open(work.path("panel.json"), "w"))
    said = work.run("simulate", "--scene", work.path("panel.json"), "--pose=0,0,0", "--sensor", "hc-sr04",
                    "--threshold", str(threshold), "--step-deg", "1", "--temperature-c", "16.5",
                    "--humidity-percent", "32")
    pings = (line for line in map(json.loads, said.splitlines()) if line["type"] == "ping")
    return [((ping["azimuth_deg"] + 180) % 360 - 180, ping["range_m"]) for ping in pings if ping["status"] == "echo"]


if __name__ == "__main__":
    main()
