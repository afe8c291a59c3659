"""An HC-SR04 on a bench, turned before a panel and before three other targets."""

import collections
import csv
import json
import math

from work import table

# Ranges were computed with 340.2 m/s; at 16.5 degrees sound went faster.
RIGHT_SPEED = 1.0125
AIR = ("--temperature-c", "16.5", "--humidity-percent", "32")
REFLECTANCE = 0.97
# Beyond the bearings that are told nothing was heard, as far as the ranger was turned.
SILENT_TO_DEG = 60
PRIORS = ("x_m=0.005", "y_m=0.01", "heading_deg=4")
# Where the panel stands in the scene that its sweeps are fitted in, metres.
PANEL_X_M = 5.0
PANEL = "underlayment_26.7x122cm"
# Width and height of the targets, metres. At what height the ranger was is not told; the middle is assumed.
TARGETS = {
    PANEL: (0.267, 1.22),
    "aluminium_38.5x58.4cm": (0.385, 0.584),
    "steel_yardstick_2.54cm_wide_86cm": (0.0254, 0.86),
    "aluminium_flashing_3.3x3.8cm": (0.033, 0.038),
}


def main(work):
    sweeps = panel_sweeps(work)
    shipped = json.loads(work.run("sensor", "show", "hc-sr04"))
    log = imported(work, sweeps)
    piston = fitted(work, log, "piston", shipped, "pose,threshold,beam")
    skirted = dict(shipped, threshold=0.2, aperture=dict(shipped["aperture"], radius_m=0.0059, skirts_db=-10.0))
    skirts = fitted(work, log, "skirts", skirted, "pose,threshold,beam,skirts")
    sensors = {"as shipped": shipped, "fitted": piston, "fitted with skirts": skirts}
    panels(work, sweeps, sensors)
    aimed(work, sensors)


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


def imported(work, sweeps):
    """All distances as scans of one log, each before the same panel; silent beyond the ends of its arc."""
    with open(work.path("panels.csv"), "w") as file:
        file.write("scan,x_m,y_m,bearing_deg,range_m\n")
        for distance_cm, readings in sweeps.items():
            ranges = dict(readings)
            for bearing in range(-SILENT_TO_DEG, SILENT_TO_DEG + 1):
                if bearing in ranges or not min(ranges) <= bearing <= max(ranges):
                    range_m = "%.4f" % ranges[bearing] if bearing in ranges else ""
                    x_m = PANEL_X_M - 0.01 * distance_cm
                    file.write("%g,%.4f,0,%g,%s\n" % (distance_cm, x_m, bearing, range_m))
    scene = work.keep("panel.json", scene_of(PANEL_X_M, TARGETS[PANEL][0]))
    columns = ",".join("%s=%s" % (name, name) for name in ("scan", "x_m", "y_m", "bearing_deg", "range_m"))
    work.run("import", work.path("panels.csv"), "--columns", columns, "--scene", scene, "--sensor", "hc-sr04", *AIR,
             "--force", "-o", work.path("panels.jsonl"))
    return work.path("panels.jsonl")


def fitted(work, log, name, start, fit):
    """The sensor that explains all distances best, with a table of what was fitted."""
    start = work.keep("%s-start.json" % name, dict(start, name=name, sources={}))
    priors = [arg for prior in PRIORS for arg in ("--prior", prior)]
    lines = work.lines("calibrate", log, "--sensor", start, "--fit", fit, *priors, "--out", work.path(name), "--force",
                       "--json")
    table([name, "was", "is", "standard deviation"], [
        [line["name"], "%.4g" % line["prior"], "%.4g" % line["value"], "%.2g" % line["sigma"]]
        for line in lines if "scan" not in line])
    with open(work.path(name, "report.md")) as file:
        print("\n".join(line for line in file.read().splitlines() if "explained," in line) + "\n")
    with open(work.path(name, "sensor.json")) as file:
        return json.load(file)


def panels(work, sweeps, sensors):
    """Half the arc over which a panel answers, and how much later its ends are than its middle, by distance."""
    lines, off = [], {title: [] for title in sensors}
    for distance_cm, measured in sweeps.items():
        half_deg, late_m = arc(measured)
        line = ["%.1f cm" % distance_cm, "%.1f°, %.0f mm" % (half_deg, 1e3 * late_m)]
        for title, sensor in sensors.items():
            model_deg, model_m = arc(before(work, 0.01 * distance_cm, TARGETS[PANEL], sensor))
            off[title].append((model_deg - half_deg, 1e3 * (model_m - late_m)))
            line.append("%.0f°, %.0f mm" % (model_deg, 1e3 * model_m))
        lines.append(line)
    lines.append(["rms error of half the arc", ""] + [
        "%.1f° (mean %+.1f)" % (rms(turn for turn, _ in of), mean(turn for turn, _ in of)) for of in off.values()])
    lines.append(["ends later than measured, mean", ""] + [
        "%.0f mm" % mean(late for _, late in of) for of in off.values()])
    table(["distance", "measured", *sensors], lines)


def aimed(work, sensors):
    """By target: the largest bearing of its middle at which it still answers."""
    series = collections.OrderedDict()
    for row in rows_of(work, "hcsr04-envelope-aimed.csv"):
        series.setdefault(row["target"], []).append(
            (0.01 * float(row["distance_cm"]), float(row["max_half_angle_deg_target_width_removed"])))
    table(["target", "distances", "measured", *sensors],
          [aimed_at(work, target, points, sensors) for target, points in series.items()])


def aimed_at(work, target, points, sensors):
    width_m, _ = TARGETS[target]
    # In the file half the target's width is taken off.
    half_deg = {distance_m: beyond + math.degrees(math.atan(0.5 * width_m / distance_m)) for distance_m, beyond in points}
    cells = []
    for sensor in sensors.values():
        heard = {distance_m: before(work, distance_m, TARGETS[target], sensor) for distance_m in half_deg}
        off = [arc(readings)[0] - half_deg[distance_m] for distance_m, readings in heard.items() if readings]
        silent = len(half_deg) - len(off)
        cells.append("%.1f° (mean %+.1f)%s" % (rms(off), mean(off), ", not heard at %d" % silent if silent else ""))
    told = "%.0f to %.0f°" % (min(half_deg.values()), max(half_deg.values()))
    return [target.replace("_", " "), len(points), told, *cells]


def scene_of(distance_m, width_m, z_m=None):
    wall = {"id": "target", "from": [distance_m, -0.5 * width_m], "to": [distance_m, 0.5 * width_m], "material": "board"}
    scene = {"name": "target", "materials": {"board": {"reflectance": REFLECTANCE}}, "walls": [wall]}
    if z_m is not None:
        wall["z_m"] = z_m
        # Too far below to be heard.
        scene["floor_z_m"] = -8.0
    return scene


def before(work, distance_m, size_m, sensor):
    """Bearings and ranges of a ranger that turns before the middle of a target."""
    width_m, height_m = size_m
    middle_m = 2.0
    scene = scene_of(distance_m, width_m, [middle_m - 0.5 * height_m, middle_m + 0.5 * height_m])
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
