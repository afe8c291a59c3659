"""An HC-SR04 on a bench, turned before a panel and before three other targets."""

import collections
import csv
import json
import math

from work import DATA_SHEET, table

# Ranges were computed with 340.2 m/s; at 16.5 degrees sound went faster.
RIGHT_SPEED = 1.0125
AIR = ("--temperature-c", "16.5", "--humidity-percent", "32")
# What the panel's board gives back is not known; metal gives back nearly all.
REFLECTANCE = {"board": 0.97, "metal": 0.99}
# Beyond the stated bearings there was no echo, as far as the ranger was turned.
SILENT_TO_DEG = 60
PRIORS = ("x_m=0.005", "y_m=0.01", "heading_deg=4")
MATERIALS = ("reflectance board=0.5", "reflectance metal=0.005")
# Positions of the targets in the scene to which sweeps are fitted, metres.
TARGET_X_M = 5.0
PANEL = "underlayment_26.7x122cm"
# Width and height of the targets, metres. The height of the ranger is not stated; the middle is assumed.
TARGETS = {
    PANEL: (0.267, 1.22),
    "aluminium_38.5x58.4cm": (0.385, 0.584),
    "steel_yardstick_2.54cm_wide_86cm": (0.0254, 0.86),
    "aluminium_flashing_3.3x3.8cm": (0.033, 0.038),
}
# Those of metal that are fitted with the panel, and their y in the scene, metres.
OF_METAL = {"aluminium_38.5x58.4cm": 20.0, "steel_yardstick_2.54cm_wide_86cm": 40.0}
# How much later than head-on the ends of a metal target's arc are taken to be read, as the panel's are, metres; and
# how many readings at each end are.
ENDS_LATE_M = 0.034
ENDS = 3


def main(work):
    sweeps = panel_sweeps(work)
    envelopes = aimed_envelopes(work)
    skirted = dict(DATA_SHEET, threshold=0.2, aperture={"shape": "piston", "radius_m": 0.0059, "skirts_db": -10.0})
    panel_log = imported(work, "panels", panel_readings(sweeps))
    readings = panel_readings(sweeps) + metal_readings(envelopes)
    log = imported(work, "targets", readings)
    sensors = {
        "data sheet": (DATA_SHEET, REFLECTANCE),
        "fitted to the panel": fitted(work, panel_log, "piston", DATA_SHEET, "pose,threshold,beam,pulse"),
        "with skirts": fitted(work, panel_log, "skirts", skirted, "pose,threshold,beam,skirts,pulse"),
        "fitted to panel, sheet and ruler": fitted(
            work, log, "joint", skirted, "pose,threshold,beam,skirts,pulse,materials", MATERIALS),
    }
    panels(work, sweeps, sensors)
    aimed(work, envelopes, sensors)


def rows_of(work, name):
    with open(work.given(name)) as file:
        return list(csv.DictReader(file))


def panel_sweeps(work):
    """Bearings and ranges by distance, centimetres."""
    sweeps = collections.OrderedDict()
    for row in rows_of(work, "hcsr04-panel-sweeps.csv"):
        reading = float(row["sensor_angle_deg"]), 0.01 * RIGHT_SPEED * float(row["reported_range_cm"])
        sweeps.setdefault(float(row["series_mean_distance_cm"]), []).append(reading)
    return sweeps


def aimed_envelopes(work):
    """By target: distances, metres, and the largest bearing at which its middle still answers, degrees."""
    series = collections.OrderedDict()
    for row in rows_of(work, "hcsr04-envelope-aimed.csv"):
        distance_m, target = 0.01 * float(row["distance_cm"]), row["target"]
        # In the file half the target's width is taken off.
        beyond_deg = math.degrees(math.atan(0.5 * TARGETS[target][0] / distance_m))
        half_deg = float(row["max_half_angle_deg_target_width_removed"]) + beyond_deg
        series.setdefault(target, []).append((distance_m, half_deg))
    return series


def panel_readings(sweeps):
    """All distances as scans, each before the same panel; silent beyond the ends of its arc."""
    rows = []
    for distance_cm, readings in sweeps.items():
        ranges = dict(readings)
        for bearing in range(-SILENT_TO_DEG, SILENT_TO_DEG + 1):
            if bearing in ranges or not min(ranges) <= bearing <= max(ranges):
                place = "%g" % distance_cm, TARGET_X_M - 0.01 * distance_cm, 0.0
                rows.append((*place, bearing, ranges.get(bearing)))
    return rows


def metal_readings(envelopes):
    """Distances of metal targets as scans: the ends of their arcs are given, with no echo beyond."""
    rows = []
    for target, y_m in OF_METAL.items():
        for distance_m, half_deg in envelopes[target]:
            place = "%s %g" % (target, distance_m), TARGET_X_M - distance_m, y_m
            for bearing in range(-SILENT_TO_DEG, SILENT_TO_DEG + 1):
                inside_deg = half_deg - abs(bearing)
                if inside_deg < 0:
                    rows.append((*place, bearing, None))
                elif inside_deg < ENDS:
                    rows.append((*place, bearing, distance_m + ENDS_LATE_M))
    return rows


def imported(work, name, rows):
    with open(work.path(name + ".csv"), "w") as file:
        file.write("scan,x_m,y_m,bearing_deg,range_m\n")
        for scan, x_m, y_m, bearing, range_m in rows:
            file.write("%s,%.4f,%.4f,%g,%s\n" % (scan, x_m, y_m, bearing, "" if range_m is None else "%.4f" % range_m))
    places = {PANEL: 0.0, **OF_METAL}
    scene = work.keep("targets.json", scene_of([(target, TARGET_X_M, y_m) for target, y_m in places.items()], REFLECTANCE))
    columns = ",".join("%s=%s" % (column, column) for column in ("scan", "x_m", "y_m", "bearing_deg", "range_m"))
    work.run("import", work.path(name + ".csv"), "--columns", columns, "--scene", scene, "--sensor", "hc-sr04", *AIR,
             "--force", "-o", work.path(name + ".jsonl"))
    return work.path(name + ".jsonl")


def fitted(work, log, name, start, fit, more_priors=()):
    """The sensor that explains all distances best and what the materials reflect, with a table of what was fitted."""
    start = work.keep("%s-start.json" % name, dict(start, name=name))
    priors = [arg for prior in (*PRIORS, *more_priors) for arg in ("--prior", prior)]
    lines = work.lines("calibrate", log, "--sensor", start, "--fit", fit, *priors, "--out", work.path(name), "--force",
                       "--json")
    lines = [line for line in lines if "scan" not in line]
    table([name, "was", "is", "standard deviation"], [
        [line["name"], "%.4g" % line["prior"], "%.4g" % line["value"], "%.2g" % line["sigma"]] for line in lines])
    with open(work.path(name, "report.md")) as file:
        print("\n".join(line for line in file.read().splitlines() if "explained," in line or "apart" in line) + "\n")
    found = {line["name"].removeprefix("reflectance "): line["value"] for line in lines}
    with open(work.path(name, "sensor.json")) as file:
        return json.load(file), {material: found.get(material, known) for material, known in REFLECTANCE.items()}


def panels(work, sweeps, sensors):
    """Half the arc over which a panel answers, and how much later its ends are than its middle, by distance."""
    lines, off = [], {title: [] for title in sensors}
    for distance_cm, measured in sweeps.items():
        half_deg, late_m = arc(measured)
        line = ["%.1f cm" % distance_cm, "%.1f°, %.0f mm" % (half_deg, 1e3 * late_m)]
        for title, sensor in sensors.items():
            model_deg, model_m = arc(before(work, 0.01 * distance_cm, PANEL, sensor))
            off[title].append((model_deg - half_deg, 1e3 * (model_m - late_m)))
            line.append("%.0f°, %.0f mm" % (model_deg, 1e3 * model_m))
        lines.append(line)
    lines.append(["rms error of half the arc", ""] + [
        "%.1f° (mean %+.1f)" % (rms(turn for turn, _ in of), mean(turn for turn, _ in of)) for of in off.values()])
    lines.append(["ends later than measured, mean", ""] + [
        "%.0f mm" % mean(late for _, late in of) for of in off.values()])
    table(["distance", "measured", *sensors], lines)


def aimed(work, envelopes, sensors):
    """By target: the largest bearing of its middle at which it still answers."""
    table(["target", "distances", "measured", *sensors],
          [aimed_at(work, target, points, sensors) for target, points in envelopes.items()])


def aimed_at(work, target, points, sensors):
    half_deg = dict(points)
    cells = []
    for sensor in sensors.values():
        detected = {distance_m: before(work, distance_m, target, sensor) for distance_m in half_deg}
        off = [arc(readings)[0] - half_deg[distance_m] for distance_m, readings in detected.items() if readings]
        silent = len(half_deg) - len(off)
        cells.append("%.1f° (mean %+.1f)%s" % (rms(off), mean(off), ", no echo at %d" % silent if silent else ""))
    stated = "%.0f to %.0f°" % (min(half_deg.values()), max(half_deg.values()))
    return [target.replace("_", " "), len(points), stated, *cells]


def scene_of(targets, reflectance):
    """Targets by name with the places of their middles, facing -x."""
    materials = {name: {"reflectance": share} for name, share in reflectance.items()}
    def wall(target, x_m, y_m):
        half_m = 0.5 * TARGETS[target][0]
        return {"id": target, "from": [x_m, y_m - half_m], "to": [x_m, y_m + half_m],
                "material": "board" if target == PANEL else "metal"}
    return {"name": "targets", "materials": materials, "walls": [wall(*target) for target in targets]}


def before(work, distance_m, target, found):
    """Bearings and ranges of a ranger that turns before the middle of a target."""
    sensor, reflectance = found
    middle_m = 2.0
    scene = scene_of([(target, distance_m, 0.0)], reflectance)
    half_m = 0.5 * TARGETS[target][1]
    scene["walls"][0]["z_m"] = [middle_m - half_m, middle_m + half_m]
    # Too far below to be detected.
    scene["floor_z_m"] = -8.0
    sensor = dict(sensor, mounting=dict(sensor["mounting"], z_m=middle_m))
    pings = work.pings(work.keep("target.json", scene), (0, 0, 0), work.keep("on-a-bench.json", sensor),
                       "--step-deg", "1", *AIR)
    return [((ping["azimuth_deg"] + 180) % 360 - 180, ping["range_m"]) for ping in pings if ping["status"] == "echo"]


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
