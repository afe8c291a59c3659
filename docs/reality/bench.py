"""An HC-SR04 on a bench, turned before a panel and before three other targets."""

import collections
import csv
import json
import math

from work import table

# What the ranges were computed with, 340.2 m/s, times what sound went faster at 16.5 degrees.
RIGHT_SPEED = 1.0125
AIR = ("--temperature-c", "16.5", "--humidity-percent", "32")
THRESHOLDS = (0.094, 0.13, 0.17)
# Width and height of the targets, metres. The height of the ranger before them is not known: their middle is assumed.
TARGETS = {
    "underlayment_26.7x122cm": (0.267, 1.22),
    "aluminium_38.5x58.4cm": (0.385, 0.584),
    "steel_yardstick_2.54cm_wide_86cm": (0.0254, 0.86),
    "aluminium_flashing_3.3x3.8cm": (0.033, 0.038),
}


def main(work):
    panels(work)
    aimed(work)


def rows_of(work, name):
    with open(work.given(name)) as file:
        return list(csv.DictReader(file))


def panels(work):
    """Half the arc over which a panel answers, and how much later its ends are than its middle, by distance."""
    series = collections.OrderedDict()
    for row in rows_of(work, "hcsr04-panel-sweeps.csv"):
        reading = float(row["sensor_angle_deg"]), 0.01 * RIGHT_SPEED * float(row["reported_range_cm"])
        series.setdefault(float(row["series_mean_distance_cm"]), []).append(reading)
    size_m = 0.267, 1.22
    lines, off = [], {threshold: [] for threshold in THRESHOLDS}
    for distance_cm, measured in series.items():
        half_deg, late_m = arc(measured)
        line = ["%.1f cm" % distance_cm, "%.1f°, %.0f mm" % (half_deg, 1e3 * late_m)]
        for threshold in THRESHOLDS:
            model_deg, model_m = arc(before(work, 0.01 * distance_cm, size_m, threshold))
            off[threshold].append((model_deg - half_deg, 1e3 * (model_m - late_m)))
            line.append("%.0f°, %.0f mm" % (model_deg, 1e3 * model_m))
        lines.append(line)
    lines.append(["rms error of half the arc", ""] + [
        "%.1f° (mean %+.1f)" % (rms(turn for turn, _ in off[key]), mean(turn for turn, _ in off[key])) for key in THRESHOLDS])
    lines.append(["ends later than measured, mean", ""] + [
        "%.0f mm" % mean(late for _, late in off[key]) for key in THRESHOLDS])
    table(["distance", "measured"] + ["threshold %s" % key for key in THRESHOLDS], lines)


def aimed(work):
    """By target: the largest bearing of its middle at which it still answers."""
    series = collections.OrderedDict()
    for row in rows_of(work, "hcsr04-envelope-aimed.csv"):
        series.setdefault(row["target"], []).append(
            (0.01 * float(row["distance_cm"]), float(row["max_half_angle_deg_target_width_removed"])))
    lines = []
    for target, points in series.items():
        off = {threshold: [] for threshold in THRESHOLDS}
        unheard = dict.fromkeys(THRESHOLDS, 0)
        told = []
        for distance_m, beyond_deg in points:
            width_m, _ = TARGETS[target]
            half_deg = beyond_deg + math.degrees(math.atan(0.5 * width_m / distance_m))
            told.append(half_deg)
            for threshold in THRESHOLDS:
                readings = before(work, distance_m, TARGETS[target], threshold)
                unheard[threshold] += not readings
                off[threshold].append((arc(readings)[0] if readings else 0.0) - half_deg)
        lines.append([target.replace("_", " "), len(points), "%.0f to %.0f°" % (min(told), max(told))] + [
            "%.1f° (mean %+.1f)%s" % (rms(off[key]), mean(off[key]), ", %d not heard" % unheard[key] if unheard[key] else "")
            for key in THRESHOLDS])
    table(["target", "distances", "measured"] + ["rms error, threshold %s" % key for key in THRESHOLDS], lines)


def before(work, distance_m, size_m, threshold):
    """Bearings and ranges of a ranger that turns before the middle of a target."""
    width_m, height_m = size_m
    wall = {"id": "target", "from": [distance_m, -0.5 * width_m], "to": [distance_m, 0.5 * width_m], "material": "board",
            "z_m": [2.0 - 0.5 * height_m, 2.0 + 0.5 * height_m]}
    # The floor is far enough below not to be heard.
    scene = work.keep("target.json", {
        "name": "target", "materials": {"board": {"reflectance": 0.97}}, "walls": [wall], "floor_z_m": -8.0})
    sensor = json.loads(work.run("sensor", "show", "hc-sr04"))
    sensor.update(name="on-a-bench", threshold=threshold, mounting=dict(sensor["mounting"], z_m=2.0))
    pings = work.pings(scene, (0, 0, 0), work.keep("on-a-bench.json", sensor), "--step-deg", "1", *AIR)
    return [(turned(ping["azimuth_deg"]), ping["range_m"]) for ping in pings if ping["status"] == "echo"]


def turned(azimuth_deg):
    return (azimuth_deg + 180) % 360 - 180


def arc(readings):
    """Half the width of an arc, degrees, and how much later its two ends are than its middle, metres."""
    readings = sorted(readings)
    middle_m = min(readings, key=lambda reading: abs(reading[0]))[1]
    ends_m = 0.5 * (readings[0][1] + readings[-1][1])
    return 0.5 * (readings[-1][0] - readings[0][0]), ends_m - middle_m


def mean(values):
    values = list(values)
    return sum(values) / len(values)


def rms(values):
    return mean(value * value for value in values) ** 0.5
