"""LEGO NXT rangers that turn in an arena: fitted to the runs of one robot, predicted for all others."""

import collections
import json
from concurrent.futures import ThreadPoolExecutor
from statistics import median

from work import DATA_SHEET, share, table

FITTED = ("roberto-a", "roberto-b", "roberto-c", "roberto-d")
FIT = "pose,mounting,threshold,rise,beam,skirts,pulse"
PRIORS = ("x_m=0.03", "y_m=0.03", "heading_deg=4")
# Each sweep states as well how sensitive its ranger was and how far ahead of the axis its face sat; how far aside is
# believed within 5 mm, because a heading does nearly the same.
OF_ITS_OWN = ("--fit", "threshold,mounting", "--prior", "threshold_db=6", "--prior", "left_m=0.005")
NEAR_M = 0.03
# 255 means no echo.
REACH_M = "2.55"
# The first robot sees itself from here on.
BODY_M = 0.27
# The sweep that is drawn.
DRAWN = "roberto-e-1"
RANGES_M = (0, 0.4, 0.6, 0.9, 1.3, 1.7, 2.1, 2.6)


def main(work):
    with open(work.given("arena-sweeps.json")) as file:
        sweeps = json.load(file)
    start = work.keep("start.json", start_sensor())
    groups = {
        "fitted": [sweep for sweep in sweeps if sweep["group"] in FITTED],
        "blind": [sweep for sweep in sweeps if sweep["group"] not in FITTED],
    }
    for name, of in groups.items():
        imported(work, name, of, start)
    calibrate(work, start)
    sensor = work.path("calibrated", "sensor.json")
    own, as_fitted = "own threshold and mounting", "the sensor as fitted"
    ways = {own: OF_ITS_OWN, as_fitted: ()}
    placed = {(name, way): located(work, name, sensor, *options) for name in groups for way, options in ways.items()}
    courses = {(name, way): along_course(work, of, sensor, options)
               for name, of in groups.items() for way, options in ways.items()}
    table(["sweeps", "with", "located first", "right pose only in a later answer", "located along the course"],
          [[name, way, *how_many(groups[name], placed[name, way], courses[name, way])] for name, way in placed])
    blind = groups["blind"]
    by_run(work, blind, placed["blind", own], courses["blind", own], sensor)
    found = located_by(blind, placed["blind", own])
    by_model(work, blind, found, located_by(blind, courses["blind", own]),
             located_by(blind, placed["blind", as_fitted]), sensor)
    by_range(work, found, sensor)
    picture(work, *next(pair for pair in found if pair[0]["id"] == DRAWN), sensor)


def start_sensor():
    """An HC-SR04 by data sheets, its pulse too, with a plain amplifier, two cans 3 cm apart, and skirts."""
    return dict(
        DATA_SHEET, name="nxt", aperture={"shape": "piston", "radius_m": 0.0055, "skirts_db": -10.0}, threshold=0.15,
        threshold_rise_db_per_m=1.0, gain={"kind": "steps", "steps": [{"until_us": None, "gain_db": 0.0}]},
        mounting={"separation_m": 0.03, "ahead_m": 0.03}, max_range_m=float(REACH_M))


def imported(work, name, sweeps, sensor, place="fit_m"):
    columns = "scan=id,bearing_deg=bearing_deg,range_m=range_m,x_m=%s.0,y_m=%s.1" % (place, place)
    work.run("import", work.keep(name + ".json", sweeps), "--columns", columns, "--scene", work.given("arena.json"),
             "--sensor", sensor, "--force", "-o", work.path(name + ".jsonl"))


def calibrate(work, sensor):
    priors = [arg for prior in PRIORS for arg in ("--prior", prior)]
    lines = work.lines("calibrate", work.path("fitted.jsonl"), "--sensor", sensor, "--fit", FIT, *priors,
                       "--out", work.path("calibrated"), "--force", "--json")
    rows = [[line["name"], "%.5g" % line["prior"], "%.5g" % line["value"], "%.2g" % line["sigma"]]
            for line in lines if "scan" not in line]
    table(["", "initial", "estimate", "standard deviation"], rows)
    with open(work.path("calibrated", "report.md")) as file:
        print("\n".join(line for line in file.read().splitlines() if "explained" in line or "told apart" in line) + "\n")


def located(work, name, sensor, *options):
    """The modes of each sweep, most probable first; scans are in the order of the sweeps."""
    modes = collections.defaultdict(list)
    for line in work.lines("locate", work.path(name + ".jsonl"), "--sensor", sensor, "--json", *options):
        if "x_m" in line:
            modes[line["scan"]].append(line)
    with open(work.path(name + ".jsonl")) as file:
        scans = [line["scan"] for line in map(json.loads, file) if line["type"] == "scan_start"]
    return [modes[scan] for scan in scans]


def along_course(work, sweeps, sensor, own):
    """The modes of each sweep with those before it in its run. Odometry are the waypoints that the robots were sent to;
    headings, which are of the fits by hand, are not used."""
    placed = []
    for run in dict.fromkeys(sweep["group"] for sweep in sweeps):
        imported(work, run, [sweep for sweep in sweeps if sweep["group"] == run], sensor, "waypoint_m")
        placed += located(work, run, sensor, "--course", "--drift-deg-per-m", "180", *own)
    return placed


def located_by(sweeps, placed):
    """Each sweep with the first pose that was found; bearings in the file are the world's, so headings are near 0."""
    return [(sweep, modes[0]) for sweep, modes in zip(sweeps, placed) if modes]


def by_others(found):
    """The same poses, each with what was found besides in the other sweeps of its run: the median."""
    def own(sweep, mode):
        others = [of["nuisance"] for other, of in found if other["group"] == sweep["group"] and other is not sweep]
        besides = [dict(one, value=median(of[at]["value"] for of in others)) for at, one in enumerate(mode["nuisance"])]
        return sweep, dict(mode, nuisance=besides)
    return [own(*pair) for pair in found]


def by_hand_of(sweep):
    """A sweep with ranges from the axis, and the pose that was found by hand."""
    ranges = [range_m and range_m + sweep["radial_offset_m"] for range_m in sweep["range_m"]]
    x_m, y_m = sweep["fit_m"]
    return dict(sweep, range_m=ranges), {"x_m": x_m, "y_m": y_m, "heading_deg": 0.0}


def located_rightly(sweeps, placed):
    """How many sweeps were found within 10 cm and 10 degrees, by the first answer or a later one."""
    count = collections.Counter()
    for sweep, modes in zip(sweeps, placed):
        is_right = [is_near(mode, sweep["fit_m"]) for mode in modes]
        count["first"] += is_right[:1] == [True]
        count["later"] += any(is_right[1:]) and not is_right[0]
    return count


def how_many(sweeps, placed, courses):
    """How many are located first, only later, and along the course."""
    alone, along = (located_rightly(sweeps, of) for of in (placed, courses))
    return "%d of %d" % (alone["first"], len(sweeps)), alone["later"], "%d of %d" % (along["first"], len(sweeps))


def is_near(mode, place):
    off_m = ((mode["x_m"] - place[0]) ** 2 + (mode["y_m"] - place[1]) ** 2) ** 0.5
    return off_m < 0.1 and abs((mode["heading_deg"] + 180) % 360 - 180) < 10


def by_run(work, sweeps, placed, courses, sensor):
    counts = scores(work, located_by(sweeps, placed), sensor)
    rows = []
    for run, count in counts.items():
        of = [at for at, sweep in enumerate(sweeps) if run in ("all", sweep["group"])]
        counted = how_many(*([all[at] for at in of] for all in (sweeps, placed, courses)))
        own = [median(value["value"] for at in of for value in placed[at][0]["nuisance"] if value["name"] == name)
               for name in ("threshold_db", "ahead_m")]
        rows.append([run, "%.1f dB, %.0f mm" % (own[0], 1e3 * own[1]), *counted,
                     "%s of %d" % (share(count["near"], count["echo"]), count["echo"]),
                     share(count["unheard"], count["echo"]),
                     "%s of %d" % (share(count["agreed"], count["silent"]), count["silent"]), count["body"]])
    table(["run", "threshold and offset ahead, medians", "located within 10 cm and 10 degrees",
           "right pose only in a later answer", "located along the course",
           "echoes within 3 cm", "missed echoes", "missing echoes predicted", "of the body"], rows)


def by_model(work, sweeps, found, along, as_fitted, sensor):
    by_hand = [by_hand_of(sweep) for sweep in sweeps]
    nearest = ("--engine", "cone")
    rows = []
    for title, poses, of, options in (
        ("fitted sensor, poses, thresholds and mountings by `locate`", found, sensor, ()),
        ("the same poses, thresholds and mountings of the run's other sweeps", by_others(found), sensor, ()),
        ("nearest hit, the same poses", found, sensor, nearest),
        ("fitted sensor, poses, thresholds and mountings along the courses", along, sensor, ()),
        ("fitted sensor as it is, poses by `locate`", as_fitted, sensor, ()),
        ("`lego-nxt`, poses and offsets by hand", by_hand, "lego-nxt", ()),
        ("`hc-sr04` as shipped, poses and offsets by hand", by_hand, "hc-sr04", ()),
        ("nearest hit, poses and offsets by hand", by_hand, "hc-sr04", nearest),
    ):
        count = scores(work, poses, of, options)["all"]
        rows.append([title, share(count["near"], count["echo"]), share(count["agreed"], count["silent"])])
    table(["", "echoes within 3 cm", "missing echoes predicted"], rows)


def by_range(work, found, sensor):
    counts = collections.Counter()
    for _, measured, model in readings(work, found, sensor):
        if measured is not None:
            least_m = max(edge for edge in RANGES_M if edge <= measured)
            counts[least_m, "echo"] += 1
            counts[least_m, "near"] += is_echo_of(model, measured)
    table(["from", "echoes within 3 cm"], [
        ["%.1f m" % edge, "%d of %d" % (counts[edge, "near"], counts[edge, "echo"])] for edge in RANGES_M[:-1]])


def picture(work, sweep, mode, sensor):
    """One blind sweep on the floor plan, beside what the fitted sensor reads at the pose that was located."""
    imported(work, "drawn", [sweep], sensor)
    pose = "--pose=%f,%f,%f" % (mode["x_m"], mode["y_m"], mode["heading_deg"])
    own = of_its_own(work, sensor, sweep, mode)
    work.run("predict", work.path("drawn.jsonl"), pose, "--sensor", own, "--force", "-o", work.path("predicted.jsonl"))
    work.run("plot", work.path("predicted.jsonl"), "--force", "-o", work.path("reality-arena.png"), "--width", "1200")


def scores(work, found, sensor, options=()):
    """Counts of what agrees, by run and in all."""
    counts = collections.defaultdict(collections.Counter)
    for run, measured, model in readings(work, found, sensor, options):
        for count in (counts[run], counts["all"]):
            if measured is None:
                count["silent"] += 1
                count["agreed"] += model is None
            elif measured < BODY_M and run.startswith("roberto") and not is_echo_of(model, measured):
                count["body"] += 1
            else:
                count["echo"] += 1
                count["near"] += is_echo_of(model, measured)
                count["unheard"] += model is None
    counts["all"] = counts.pop("all")
    return counts


def is_echo_of(model, measured):
    return model is not None and abs(model - measured) < NEAR_M


def of_its_own(work, sensor, sweep, mode):
    """The sensor with what was found with a pose."""
    found = {of["name"]: of["value"] for of in mode.get("nuisance", ())}
    if not found:
        return sensor
    with open(sensor) as file:
        own = json.load(file)
    own["threshold"] = 10 ** (found["threshold_db"] / 20)
    own["mounting"].update(ahead_m=found["ahead_m"], left_m=found["left_m"])
    return work.keep("of-its-own-%s.json" % sweep["id"], own)


def readings(work, found, sensor, options=()):
    """Run, measured and predicted range of each reading."""
    def one(pair):
        sweep, mode = pair
        pings = work.pings(work.given("arena.json"), (mode["x_m"], mode["y_m"], 0.0), 
                           of_its_own(work, sensor, sweep, mode), "--step-deg", "1", "--max-range", REACH_M, *options)
        predicted = {round(ping["azimuth_deg"]) % 360: ping.get("range_m") for ping in pings}
        return [(sweep["group"], measured, predicted[round(bearing + mode["heading_deg"]) % 360])
                for bearing, measured in zip(sweep["bearing_deg"], sweep["range_m"])]
    with ThreadPoolExecutor(2) as pool:
        return [reading for sweep in pool.map(one, found) for reading in sweep]
