#!/usr/bin/env python3
"""Round trips through foreign formats: simulated readings of a known room are written as other programs write them, imported,
held against what was written, and compared with the room.

    tests/peers/imports.py PROGRAM [FORMAT ...]

Prints for each format the readings, those that came in as written (direction, position, range, each with the format's own
precision) and the share that `sonard compare` explains; at least 99 % must agree. Formats that leave a question open must be
rejected with the option that answers it. Bags of ROS need the package rosbags; everything else is standard library.
"""

import dataclasses
import json
import math
import os
import re
import subprocess
import sys
import tempfile

ROOM = {
    "name": "known-room",
    "materials": {"w": {"reflectance": 0.97, "roughness": 0.0}},
    "walls": [
        {"id": "outline", "material": "w", "closed": True,
         "polyline": [[0, 0], [4.2, 0], [4.2, 1.9], [2.7, 1.9], [2.7, 3.1], [0, 3.1]]}
    ],
    "cylinders": [{"id": "post", "material": "w", "center": [3.4, 0.6], "radius_m": 0.06}],
    "poses": {},
}
POSE = (1.3, 0.9, 30.0)
COURSE = [(1.3 + 0.05 * at, 0.9 + 0.03 * at, (30 + 25 * at) % 360 - 180) for at in range(16)]
SOUND_M_S = 343.0
START_S = 1_760_000_000
AGREEMENT = 0.99


@dataclasses.dataclass
class Reading:
    scan: int
    azimuth_deg: float
    range_m: float | None
    pose: tuple
    # Position of the ranger on the robot, and its name; of a turning ranger at the origin.
    mount: tuple = (0.0, 0.0)
    ranger: str | None = None

    @property
    def bearing_deg(self):
        return (self.azimuth_deg + self.pose[2]) % 360

    @property
    def place(self):
        x, y, heading = self.pose
        sin, cos = math.sin(math.radians(heading)), math.cos(math.radians(heading))
        return x + self.mount[0] * cos - self.mount[1] * sin, y + self.mount[0] * sin + self.mount[1] * cos


@dataclasses.dataclass
class Log:
    readings: list
    rangers: list
    sound_m_s: float

    def rounds(self):
        """Readings of each scan."""
        scans = sorted({reading.scan for reading in self.readings})
        return [[one for one in self.readings if one.scan == scan] for scan in scans]


def parse(text):
    session, pose, scan, readings = {}, None, -1, []
    for line in text.splitlines():
        record = json.loads(line)
        if record["type"] == "session":
            session = record
        elif record["type"] == "scan_start":
            scan += 1
            pose = record["pose"]
        elif record["type"] == "ping":
            at = record.get("pose") or pose
            mounted = {one["id"]: one for one in (session.get("array") or {}).get("rangers", [])}
            mount = mounted.get(record.get("ranger"), {"x_m": 0.0, "y_m": 0.0})
            readings.append(Reading(
                scan, record["azimuth_deg"], record.get("range_m"), (at["x_m"], at["y_m"], at["heading_deg"]),
                (mount["x_m"], mount["y_m"]), record.get("ranger")))
    rangers = (session.get("array") or {}).get("rangers", [])
    return Log(readings, rangers, session["air"]["sound_speed_m_s"] if "air" in session else SOUND_M_S)


class Trip:
    """Folder with the simulated logs, and the program."""

    def __init__(self, program, folder):
        self.program, self.folder, self.logs = program, folder, {}
        self.write("room.json", json.dumps(ROOM))
        self.write("course.csv", "x_m,y_m,heading_deg\n" + "".join("%.3f,%.3f,%.3f\n" % pose for pose in COURSE))

    def path(self, name):
        return os.path.join(self.folder, name)

    def write(self, name, content):
        with open(self.path(name), "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
        return name

    def run(self, *words):
        return subprocess.run([self.program, *words], cwd=self.folder, capture_output=True, text=True, timeout=600)

    def log(self, kind):
        """Simulated log: a turning HC-SR04 over a circle or a sector, at one pose or several; an array on a course."""
        if kind not in self.logs:
            turning = ["--sensor", "hc-sr04", "--max-range", "4"]
            pose = ["--pose=%g,%g,%g" % POSE]
            options = {
                "circle": [*turning, *pose, "--step-deg", "3"],
                "sector": [*turning, *pose, "--from-deg", "15", "--to-deg", "166", "--step-deg", "1"],
                "course": [*turning, "--poses", "course.csv", "--step-deg", "6"],
                "array": ["--array", "pioneer-8", "--poses", "course.csv"],
            }[kind]
            made = self.run("simulate", "--scene", "room.json", *options)
            if made.returncode:
                sys.exit(f"simulate: {made.stderr}")
            self.logs[kind] = parse(made.stdout)
        return self.logs[kind]


def agreement(trip, imported):
    """Share of the readings that the room explains."""
    trip.write("imported.jsonl", imported)
    compared = trip.run("compare", "imported.jsonl", "--scene", "room.json", "--json")
    if compared.returncode:
        sys.exit(f"compare: {compared.stderr}")
    found = json.loads(compared.stdout.splitlines()[-1])
    return found["beams"], 1 - found["verdicts"]["unexplained"] / max(1, found["beams"])


def equal(got, known, off_m, off_deg):
    """Number of the written readings that were read, each once."""
    left, count = list(got), 0
    for want in known:
        def fits(have):
            turned = abs((have.bearing_deg - want.bearing_deg + 180) % 360 - 180)
            if turned > off_deg or math.dist(have.place, want.place) > off_m + 1e-6:
                return False
            if want.range_m is None or have.range_m is None:
                return want.range_m is have.range_m is None
            return abs(have.range_m - want.range_m) <= off_m
        found = next((at for at, have in enumerate(left) if fits(have)), None)
        if found is not None:
            left.pop(found)
            count += 1
    return count


FORMATS = {}


def written(name, kind, *options, off_m=1e-3, off_deg=0.06, rejected=None):
    """Registers a writer: of (trip, log) to the name of a file, or to (name, further options)."""
    def register(write):
        FORMATS[name] = (kind, write, options, off_m, off_deg, rejected)
        return write
    return register


# Tables.

UNITS = {"m": (1, 4), "cm": (100, 2), "mm": (1000, 1), "in": (1 / 0.0254, 3), "ft": (1 / 0.3048, 4)}


def cell(number, digits, none=""):
    return none if number is None else f"{number:.{digits}f}"


def rows(log, value, names, separator=",", end="\n"):
    lines = [separator.join(names)] if names else []
    return end.join([*lines, *(separator.join(map(str, value(one))) for one in log.readings)]) + end


def scaled(one, unit):
    factor, digits = UNITS[unit]
    return cell(None if one.range_m is None else one.range_m * factor, digits)


for unit in UNITS:
    @written(f"table in {unit}, degrees", "circle")
    def table(trip, log, unit=unit):
        return trip.write("a.csv", rows(log, lambda one: (f"{one.azimuth_deg:g}", scaled(one, unit)), ("angle_deg", f"range_{unit}")))

    @written(f"table in {unit}, radians", "circle")
    def table_of_radians(trip, log, unit=unit):
        return trip.write("a.csv", rows(log, lambda one: (f"{math.radians(one.azimuth_deg):.5f}", scaled(one, unit)), ("theta_rad", f"distance ({unit})")))


@written("table of times of flight", "circle")
def tof(trip, log):
    def us(one):
        return None if one.range_m is None else 2e6 * one.range_m / log.sound_m_s
    return trip.write("a.csv", rows(log, lambda one: (f"{one.azimuth_deg:g}", cell(us(one), 1)), ("angle_deg", "duration_us")))


@written("table of times, in milliseconds", "circle")
def tof_ms(trip, log):
    def ms(one):
        return None if one.range_m is None else 2e3 * one.range_m / log.sound_m_s
    return trip.write("a.csv", rows(log, lambda one: (f"{one.azimuth_deg:g}", cell(ms(one), 4)), ("angle_deg", "time_of_flight_ms")))


CONVENTIONS = {
    "clockwise by name": ("angle_cw_deg", lambda one: -one.azimuth_deg % 360, ()),
    "clockwise by option": ("angle_deg", lambda one: -one.azimuth_deg % 360, ("--clockwise",)),
    "zero to the left": ("angle_deg", lambda one: (one.azimuth_deg - 90) % 360, ("--zero-deg", "90")),
    "compass, clockwise from the left": ("angle_deg", lambda one: (90 - one.azimuth_deg) % 360, ("--clockwise", "--zero-deg", "90")),
    "-180 to 180": ("angle_deg", lambda one: (one.azimuth_deg + 180) % 360 - 180, ()),
    "bearings in the world": ("bearing_deg", lambda one: one.bearing_deg, ()),
    "gradians": ("angle (gon)", lambda one: one.azimuth_deg / 0.9, ()),
    "servo": ("servo [\u00b0]", lambda one: one.azimuth_deg, ()),
    "pan and tilt": ("tilt_deg,pan_deg", lambda one: f"10,{one.azimuth_deg:g}", ()),
}
for convention, (column, angle, options) in CONVENTIONS.items():
    @written(f"angles: {convention}", "circle", *options)
    def angles(trip, log, column=column, angle=angle):
        def value(one):
            own = angle(one)
            return (own if isinstance(own, str) else f"{own:.4f}", scaled(one, "cm"))
        return trip.write("a.csv", rows(log, value, (column, "distance_cm")))


def degrees_cm(log, separator=",", end="\n", names=("angle_deg", "distance_cm"), comma=False, none=""):
    def value(one):
        range_cm = None if one.range_m is None else 100 * one.range_m
        pair = (f"{one.azimuth_deg:.1f}", cell(range_cm, 2, none))
        return [number.replace(".", ",") for number in pair] if comma else pair
    return rows(log, value, names, separator, end)


BY_NUMBER = ("--columns", "azimuth_deg=1,range_cm=2")
DIALECTS = {
    "tabs": (lambda log: degrees_cm(log, "\t"), ()),
    "bars": (lambda log: degrees_cm(log, "|"), ()),
    "blanks, without names": (lambda log: degrees_cm(log, " ", names=None, none="nan"), BY_NUMBER),
    "semicolons, decimal commas": (lambda log: degrees_cm(log, ";", comma=True), ()),
    "tabs, decimal commas": (lambda log: degrees_cm(log, "\t", comma=True), ()),
    "quotes, decimal commas": (lambda log: re.sub(r"[0-9,]+(?=\t|$)", '"\\g<0>"', degrees_cm(log, "\t", comma=True), flags=re.M).replace("\t", ","), ()),
    "sep=;": (lambda log: "sep=;\r\n" + degrees_cm(log, ";", "\r\n"), ()),
    "carriage returns": (lambda log: degrees_cm(log, end="\r"), ()),
    "UTF-16": (lambda log: degrees_cm(log, "\t").encode("utf-16"), ()),
    "UTF-16 without mark": (lambda log: degrees_cm(log).encode("utf-16-le"), ()),
    "byte order mark": (lambda log: "\ufeff" + degrees_cm(log), ()),
    "Latin-1, German": (lambda log: degrees_cm(log, ";", comma=True, names=("Winkel (\u00b0)", "Abstand [cm]")).encode("latin1"), ()),
    "French": (lambda log: degrees_cm(log, ";", names=("angle (degr\u00e9s)", "distance (cm)")), ()),
    "Russian": (lambda log: degrees_cm(log, names=("\u0443\u0433\u043e\u043b_\u0433\u0440\u0430\u0434", "\u0440\u0430\u0441\u0441\u0442\u043e\u044f\u043d\u0438\u0435_\u0441\u043c")), ()),
    "Japanese": (lambda log: degrees_cm(log, names=("\u89d2\u5ea6(\u5ea6)", "\u8ddd\u96e2(cm)")), ()),
    "names in a comment": (lambda log: "% angle_deg distance_cm\n" + degrees_cm(log, " ", names=None, none="NaN"), ()),
    "row of units": (lambda log: degrees_cm(log, names=("angle", "distance")).replace("\n", "\n[deg],[cm]\n", 1), ()),
    "labels of a plotter": (lambda log: "".join(f"angle_deg:{one.azimuth_deg:g},distance_cm:{scaled(one, 'cm') or 'nan'}\n" for one in log.readings), ()),
    "times of a serial monitor": (lambda log: "".join(f"12:00:{at // 10:02}.{at % 10}00 -> {one.azimuth_deg:g},{scaled(one, 'cm')}\n" for at, one in enumerate(log.readings)),
                                  ("--columns", "time=1,azimuth_deg=2,range_cm=3")),
}
for dialect, (text, options) in DIALECTS.items():
    @written(f"dialect: {dialect}", "circle", *options)
    def in_dialect(trip, log, text=text):
        return trip.write("a.txt", text(log))


NO_ECHO = {"400": ("--no-echo", "400"), "-1": ("--no-echo=-1",), "0": ("--no-echo", "0"), "inf": (), "out of range": (), "765": ("--no-echo-from", "765")}
for word, options in NO_ECHO.items():
    @written(f"no echo: {word}", "circle", *options)
    def without_echo(trip, log, word=word):
        return trip.write("a.csv", degrees_cm(log, none=word))


@written("table of several poses", "course")
def poses(trip, log):
    names = ("x_m", "y_m", "heading_deg", "angle_deg", "range_m")
    return trip.write("a.csv", rows(log, lambda one: (*(f"{number:.4f}" for number in one.pose), f"{one.azimuth_deg:g}", scaled(one, "m")), names))


@written("radar capture, a reading a line", "sector", *BY_NUMBER, "--no-echo", "0", off_m=6e-3)
def radar_lines(trip, log):
    return trip.write("a.txt", "".join(f"{one.azimuth_deg:.0f},{100 * (one.range_m or 0):.0f}.\n" for one in log.readings))


@written("radar capture, without line ends", "sector", *BY_NUMBER, "--no-echo", "0", off_m=6e-3)
def radar(trip, log):
    return trip.write("a.txt", "".join(f"{one.azimuth_deg:.0f},{100 * (one.range_m or 0):.0f}." for one in log.readings))


# Questions that must be put.

@written("radians in a column of degrees", "circle", rejected=r"--columns azimuth_rad=angle_deg")
def doubtful_radians(trip, log):
    return trip.write("a.csv", rows(log, lambda one: (f"{math.radians(one.azimuth_deg):.4f}", scaled(one, "cm")), ("angle_deg", "distance_cm")))


@written("metres in a column of centimetres", "circle", rejected=r"--columns azimuth_deg=angle_deg,range_m=distance_cm")
def doubtful_metres(trip, log):
    return trip.write("a.csv", rows(log, lambda one: (f"{one.azimuth_deg:g}", scaled(one, "m")), ("angle_deg", "distance_cm")))


@written("400 for no echo, without the option", "circle", rejected=r"--no-echo=400")
def doubtful_constant(trip, log):
    return trip.write("a.csv", degrees_cm(log, none="400"))


@written("decimal commas between commas", "circle", rejected=r"decimal commas")
def doubtful_commas(trip, log):
    return trip.write("a.csv", degrees_cm(log, ",", comma=True))


@written("positions of the echoes", "circle", rejected=r"leave them out: --columns azimuth_deg=angle_deg,range_cm=distance_cm")
def doubtful_positions(trip, log):
    def value(one):
        range_m = one.range_m or 0.0
        turned = math.radians(one.azimuth_deg)
        return (f"{one.azimuth_deg:g}", scaled(one, "cm"), f"{100 * range_m * math.cos(turned):.1f}", f"{100 * range_m * math.sin(turned):.1f}")
    return trip.write("a.csv", rows(log, value, ("angle_deg", "distance_cm", "x_cm", "y_cm")))


@written("no unit", "circle", rejected=r"range_cm=distance")
def doubtful_unit(trip, log):
    return trip.write("a.csv", degrees_cm(log, names=("angle_deg", "distance")))


# JSON.

def objects(log):
    return [{"angle_deg": one.azimuth_deg, "distance_cm": None if one.range_m is None else round(100 * one.range_m, 3)} for one in log.readings]


JSONS = {
    "list of objects": (lambda log: json.dumps(objects(log)), ()),
    "lines": (lambda log: "".join(json.dumps(one) + "\n" for one in objects(log)), ()),
    "wrapped list": (lambda log: json.dumps({"meta": {"by": "x"}, "readings": objects(log)}), ()),
    "NaN of Python": (lambda log: json.dumps([{**one, "distance_cm": math.nan if one["distance_cm"] is None else one["distance_cm"]} for one in objects(log)]), ()),
    "lists in an object": (lambda log: json.dumps({"angles_deg": [one.azimuth_deg for one in log.readings], "ranges_m": [one.range_m for one in log.readings]}), ()),
    "list of pairs": (lambda log: json.dumps([[one.azimuth_deg, one.range_m] for one in log.readings]), ("--columns", "azimuth_deg=1,range_m=2")),
    "lines of pairs": (lambda log: "".join(json.dumps([one.azimuth_deg, one.range_m]) + "\n" for one in log.readings), ("--columns", "azimuth_deg=1,range_m=2")),
}
for form, (text, options) in JSONS.items():
    @written(f"JSON: {form}", "circle", *options)
    def as_json(trip, log, text=text):
        return trip.write("a.json", text(log))


# Messages of ROS.

def laser_scan(log, infinity=math.inf):
    ranges = [infinity if one.range_m is None else one.range_m for one in sorted(log.readings, key=lambda one: one.azimuth_deg)]
    step = math.tau / len(ranges)
    return {
        "header": {"stamp": {"sec": START_S, "nanosec": 0}, "frame_id": "laser"},
        "angle_min": 0.0, "angle_max": math.tau - step, "angle_increment": step, "time_increment": 0.0, "scan_time": 0.0,
        "range_min": 0.02, "range_max": 4.0, "ranges": ranges, "intensities": [],
    }


def yaml(message, style, depth=0):
    """As `rostopic echo` (flow lists) and `ros2 topic echo` (block lists) print it."""
    text, indent = "", "  " * depth
    number = lambda value: {math.inf: "inf" if style == 1 else ".inf"}.get(value, repr(value))
    for name, value in message.items():
        if style == 1:
            name = {"sec": "secs", "nanosec": "nsecs"}.get(name, name)
        if isinstance(value, dict):
            text += f"{indent}{name}:\n{yaml(value, style, depth + 1)}"
        elif isinstance(value, list) and style == 1:
            text += f"{indent}{name}: [{', '.join(map(number, value))}]\n"
        elif isinstance(value, list):
            text += f"{indent}{name}:" + (" []\n" if not value else "\n" + "".join(f"{indent}- {number(one)}\n" for one in value))
        else:
            text += f"{indent}{name}: {value if isinstance(value, str) else number(value)}\n"
    return text


ROS_TEXTS = {
    "LaserScan as JSON": lambda log: json.dumps(laser_scan(log)),
    "LaserScan by rosbridge": lambda log: json.dumps({"op": "publish", "topic": "/scan", "msg": laser_scan(log, None)}),
    "LaserScan by rostopic echo": lambda log: yaml(laser_scan(log), 1) + "---\n",
    "LaserScan by ros2 topic echo": lambda log: yaml(laser_scan(log), 2) + "---\n",
}
for form, text in ROS_TEXTS.items():
    @written(form, "circle")
    def as_ros_text(trip, log, text=text):
        return trip.write("a.txt", text(log))


# Logs of robots.

def pose_words(one):
    return one.pose[0], one.pose[1], math.radians(one.pose[2])


def mounts(log):
    return [(one["x_m"], one["y_m"], math.radians(one["bearing_deg"])) for one in log.rangers]


def carmen(log, with_positions, host="robot", none="inf"):
    text = "# CARMEN Logfile\nPARAM robot_length 0.5 nohost 0\n"
    for at, readings in enumerate(log.rounds()):
        x, y, heading = pose_words(readings[0])
        ranges = " ".join(none if one.range_m is None else f"{one.range_m:.4f}" for one in readings)
        places = "".join(" %.4f %.4f %.6f" % mount for mount in mounts(log)) if with_positions else ""
        text += f"ODOM {x:.5f} {y:.5f} {heading:.6f} 0 0 0 {START_S + at}.0 {host} {at}.0\n"
        text += f"SONAR 0.26 {len(readings)} {ranges}{places} {START_S + at}.1 {host} {at}.1\n"
    return text


@written("CARMEN", "array")
def carmen_with_positions(trip, log):
    return trip.write("a.clf", carmen(log, True))


@written("CARMEN without positions", "array", "--array", "pioneer-8", "--no-echo", "8")
def carmen_without_positions(trip, log):
    return trip.write("a.clf", carmen(log, False, none="8.0"))


@written("CARMEN with two robots", "array")
def carmen_two_robots(trip, log):
    mine, other = carmen(log, True).splitlines(), carmen(log, True, "other", "1.0").splitlines()
    both = [line for pair in zip(mine, other) for line in pair]
    return trip.write("a.clf", "\n".join(both) + "\n")


def player(log, version):
    number = lambda value: f"{value:+09.5f}"
    head = lambda time_s, interface, kind: f"{time_s:014.3f} 16777343 6665 {interface} 00 " + (f"{kind} " if kind else f"{time_s:014.3f} ")
    text = "" if version == 1 else f"## Player version {version}.1.0\n## File version 0.3.0\n"
    if version == 2:
        places = " ".join(number(value) for mount in mounts(log) for value in mount)
        text += head(0, "sonar", "004 001") + f"{len(log.rangers):02} {places}\n"
    if version == 3:
        places = " ".join(number(value) for x, y, turn in mounts(log) for value in (x, y, 0, 0, 0, turn))
        sizes = " ".join([number(0.01)] * 3 * len(log.rangers))
        device = " ".join([number(0.0)] * 6 + [number(0.1)] * 3)
        text += head(0, "ranger", "004 001") + f"{device} {len(log.rangers):04} {places} {len(log.rangers):04} {sizes}\n"
    for at, readings in enumerate(log.rounds()):
        pose = " ".join(map(number, pose_words(readings[0])))
        ranges = " ".join(f"{one.range_m or 0:.4f}" for one in readings)
        position = "position" if version == 1 else "position2d"
        kind = "" if version == 1 else "001 001"
        text += head(START_S + at, position, kind) + f"{pose} +00.000 +00.000 +00.000" + (" 0\n" if version > 1 else "\n")
        if version == 1:
            places = " ".join(number(value) for mount in mounts(log) for value in mount)
            text += head(START_S + at + 0.1, "sonar", "") + f"{len(readings)} {places} {len(readings)} {ranges}\n"
        else:
            interface, digits = ("sonar", 2) if version == 2 else ("ranger", 4)
            text += head(START_S + at + 0.1, interface, kind) + f"{len(readings):0{digits}} {ranges}\n"
    return text


for version in (1, 2, 3):
    @written(f"Player {version}", "array")
    def as_player(trip, log, version=version):
        return trip.write("a.log", player(log, version))


def ranger_columns(log, with_names):
    rounds = log.rounds()
    names = [f"sonar{at}_m" for at in range(len(log.rangers))]
    text = ",".join(["x_m", "y_m", "heading_deg", *names]) + "\n" if with_names else ""
    for readings in rounds:
        text += ",".join([*(f"{number:.4f}" for number in readings[0].pose), *(cell(one.range_m, 4) for one in readings)]) + "\n"
    return text


@written("one ranger per column", "array", "--array", "pioneer-8")
def columns_by_name(trip, log):
    return trip.write("a.csv", ranger_columns(log, True))


@written("one ranger per column, without names", "array", "--array", "pioneer-8", "--columns", "x_m=1,y_m=2,heading_deg=3,range_m=4-11")
def columns_by_number(trip, log):
    return trip.write("a.csv", ranger_columns(log, False))


# Recordings, by rosbags.

class Bag:
    """Writer of a bag of ROS 1 or 2 by rosbags."""

    def __init__(self, path, version, storage=None):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        self.version = version
        self.store = get_typestore(Stores.ROS2_JAZZY if version == 2 else Stores.ROS1_NOETIC)
        if "tf2_msgs/msg/TFMessage" not in self.store.types:
            definition = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(definition, "tf2_msgs/msg/TFMessage"))
        if version == 2:
            from rosbags.rosbag2 import StoragePlugin, Writer
            self.writer = Writer(path, version=9, storage_plugin=getattr(StoragePlugin, storage))
        else:
            from rosbags.rosbag1 import Writer
            self.writer = Writer(path)
        self.topics = {}
        self.writer.open()

    def message(self, kind, *fields):
        return self.store.types[kind](*fields)

    def header(self, time_s, frame):
        whole, part = divmod(round(time_s * 1e9), 10**9)
        stamp = self.message("builtin_interfaces/msg/Time", whole, part)
        sequence = [] if self.version == 2 else [0]
        return self.message("std_msgs/msg/Header", *sequence, stamp, frame)

    def add(self, topic, kind, time_s, content):
        if topic not in self.topics:
            self.topics[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialize = self.store.serialize_cdr if self.version == 2 else self.store.serialize_ros1
        self.writer.write(self.topics[topic], round(time_s * 1e9), serialize(content, kind))

    def transform(self, topic, time_s, parent, child, place, turn):
        put = lambda kind, values: self.message(f"geometry_msgs/msg/{kind}", *map(float, values))
        rotation = (turn[0] * math.sin(turn[1] / 2) if turn[0] else 0.0, 0.0, 0.0 if turn[0] else math.sin(turn[1] / 2), math.cos(turn[1] / 2))
        placed = self.message("geometry_msgs/msg/Transform", put("Vector3", place), put("Quaternion", rotation))
        one = self.message("geometry_msgs/msg/TransformStamped", self.header(time_s, parent), child, placed)
        self.add(topic, "tf2_msgs/msg/TFMessage", time_s, self.message("tf2_msgs/msg/TFMessage", [one]))

    def scan(self, time_s, ranges, first_rad, step_rad):
        import numpy
        last_rad = first_rad + step_rad * (len(ranges) - 1)
        values = numpy.array(ranges, dtype=numpy.float32)
        scan = self.message("sensor_msgs/msg/LaserScan", self.header(time_s, "laser"), first_rad, last_rad, step_rad, 0.0, 0.0, 0.02, 4.0,
                            values, numpy.array([], dtype=numpy.float32))
        self.add("/scan", "sensor_msgs/msg/LaserScan", time_s, scan)

    def range(self, topic, time_s, frame, range_m, max_m):
        fields = (0, 0.26, 0.02, max_m, math.inf if range_m is None else range_m)
        variance = [0.0] if self.version == 2 else []
        one = self.message("sensor_msgs/msg/Range", self.header(time_s, frame), *fields, *variance)
        self.add(topic, "sensor_msgs/msg/Range", time_s, one)

    def close(self):
        self.writer.close()


# A rotation about the vertical axis, and one about the axis ahead.
def yaw(angle):
    return (0, angle)


OVER = (1, math.pi)


def scanner(path, log, turned, version=2, storage="MCAP"):
    bag = Bag(path, version, storage)
    bag.transform("/tf_static", START_S, "base_link", "laser", (0, 0, 0.2), OVER if turned else yaw(0.0))
    sense = -1 if turned else 1
    ranges = {sense * one.azimuth_deg % 360: math.inf if one.range_m is None else one.range_m for one in log.readings}
    beams = [ranges[angle] for angle in sorted(ranges)]
    bag.scan(START_S + 1, beams, 0.0, math.tau / len(beams))
    bag.close()


def rangers(path, log, version=2, storage="MCAP"):
    bag = Bag(path, version, storage)
    for one in log.rangers:
        bag.transform("/tf_static", START_S, "base_link", one["id"], (one["x_m"], one["y_m"], 0.2), yaw(math.radians(one["bearing_deg"])))
    for at, readings in enumerate(log.rounds()):
        x, y, heading = pose_words(readings[0])
        for time_s in (START_S + at, START_S + at + 0.5):
            bag.transform("/tf", time_s, "odom", "base_link", (x, y, 0), yaw(heading))
        for number, one in enumerate(readings):
            bag.range(f"/sonar/{one.ranger}/range", START_S + at + 0.01 * (1 + number), one.ranger, one.range_m, 10.0)
    bag.close()


def turning(path, log, version=2, storage="MCAP"):
    """A ranger that is turned by a joint."""
    bag = Bag(path, version, storage)
    bag.transform("/tf_static", START_S, "base_link", "mount", (0, 0, 0.2), yaw(0.0))
    for at, one in enumerate(log.readings):
        time_s = START_S + 0.1 * at
        bag.transform("/tf", time_s, "mount", "sonar", (0, 0, 0), yaw(math.radians(one.azimuth_deg)))
        bag.range("/sonar", time_s, "sonar", one.range_m, 4.0)
    bag.close()


for storage in ("MCAP", "SQLITE3"):
    @written(f"ROS 2, {storage}: scanner", "circle", off_deg=0.01)
    def ros_2_scanner(trip, log, storage=storage):
        scanner(trip.path("bag"), log, False, storage=storage)
        return "bag"

    @written(f"ROS 2, {storage}: array on a course", "array", off_deg=0.01)
    def ros_2_array(trip, log, storage=storage):
        rangers(trip.path("bag"), log, storage=storage)
        return "bag"


@written("ROS 2: scanner upside down", "circle", off_deg=0.01)
def ros_2_upside_down(trip, log):
    scanner(trip.path("bag"), log, True)
    return "bag"


@written("ROS 2: turning ranger", "circle", off_deg=0.01)
def ros_2_turning(trip, log):
    turning(trip.path("bag"), log)
    return "bag"


@written("ROS 1 bag", "array", rejected="rosbags-convert")
def ros_1(trip, log):
    rangers(trip.path("a.bag"), log, version=1)
    return "a.bag"


@written("ROS 1 bag, converted as advised", "array", off_deg=0.01)
def ros_1_converted(trip, log):
    rangers(trip.path("a.bag"), log, version=1)
    convert = os.path.join(os.path.dirname(sys.executable), "rosbags-convert")
    subprocess.run([convert, "--src", trip.path("a.bag"), "--dst", trip.path("new"), "--dst-storage", "mcap"], check=True, capture_output=True)
    return "new"


def check(trip, name):
    """Prints the line of a format; returns why it fails, or nothing."""
    kind, write, options, off_m, off_deg, rejected = FORMATS[name]
    log = trip.log(kind)
    file = write(trip, log)
    pose = ["--sensor", "pioneer"] if kind == "array" else ["--pose=%g,%g,%g" % POSE, "--sensor", "hc-sr04"]
    imported = trip.run("import", file, *options, *pose)
    message = " ".join(imported.stderr.split())
    if rejected is not None:
        print(f"{name:<44} {len(log.readings):>8} {'rejected, with its option' if imported.returncode else 'NOT REJECTED':>30}")
        is_right = imported.returncode == 2 and re.search(rejected, message)
        return None if is_right else f"expected a rejection with {rejected!r}: {message}"
    if imported.returncode:
        return f"rejected: {message}"
    got = parse(imported.stdout)
    same = equal(got.readings, log.readings, off_m, off_deg)
    beams, share = agreement(trip, imported.stdout)
    print(f"{name:<44} {beams:>8} {same:>14} {100 * share:>13.1f} %")
    if (beams, same) != (len(log.readings), len(log.readings)) or share < AGREEMENT:
        return f"{len(log.readings)} were written, {beams} read, {same} of them equal; {100 * share:.1f} % agree: {message}"
    return None


def main():
    program, names = os.path.abspath(sys.argv[1]), sys.argv[2:]
    print(f"{'format':<44} {'readings':>8} {'equal':>14} {'agreement':>15}")
    failures = []
    for name in names or FORMATS:
        with tempfile.TemporaryDirectory() as folder:
            failure = check(Trip(program, folder), name)
        if failure:
            failures.append(f"{name}: {failure}")
    print(f"{len(names or FORMATS) - len(failures)} of {len(names or FORMATS)} formats")
    sys.exit("\n".join(failures) or 0)


if __name__ == "__main__":
    main()
