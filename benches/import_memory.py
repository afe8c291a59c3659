#!/usr/bin/env python3
"""Prints the peak memory of `sonard import` for files of growing size, one row for each format.

    benches/import_memory.py [PROGRAM] [MB...]     default: target/release/sonard, 1 10 100

Streamed formats need the same memory for any size; documents are limited to 16 MB. The column `ratio` is the memory at the
largest size over that at the smallest. MCAP needs the packages `rosbags` and `numpy` and is left out without them.
"""

import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

RANGES_M = [round(1.5 + math.sin(at / 7) + 0.001 * at, 3) for at in range(72)]


def table():
    yield "scan,azimuth_deg,range_m\n"
    scan = 0
    while True:
        yield "".join(f"{scan},{5 * at},{range_m}\n" for at, range_m in enumerate(RANGES_M))
        scan += 1


def json_lines():
    scan = 0
    while True:
        for at, range_m in enumerate(RANGES_M):
            yield json.dumps({"scan": scan, "azimuth_deg": 5 * at, "range_m": range_m}) + "\n"
        scan += 1


def carmen():
    time_s = 0.0
    while True:
        time_s += 0.1
        yield f"ODOM {time_s:.1f} 0 0 0 0 0 {time_s:.1f} host {time_s:.1f}\n"
        ranges = " ".join(map(str, RANGES_M[:2]))
        yield f"SONAR 0.26 2 {ranges} 0.2 0.0 0.0 0.0 0.1 1.5707963267948966 {time_s:.1f} host {time_s:.1f}\n"


def player():
    yield "## Player version 2.0.0\n"
    yield "0000.000 host 6665 sonar 00 001 002 2 0.2 0.0 0.0 0.0 0.1 1.5707963267948966\n"
    time_s = 0.0
    while True:
        time_s += 0.1
        yield f"{time_s:.3f} host 6665 position2d 00 001 001 {time_s:.1f} 0 0 0 0 0 0\n"
        yield f"{time_s:.3f} host 6665 sonar 00 001 001 2 {RANGES_M[0]} {RANGES_M[1]}\n"


def laser_scan(seconds):
    return {
        "header": {"stamp": {"sec": 1_700_000_000 + seconds, "nanosec": 0}, "frame_id": "sonar"},
        "angle_min": 0.0,
        "angle_max": math.radians(355),
        "angle_increment": math.radians(5),
        "time_increment": 0.0,
        "scan_time": 1.0,
        "range_min": 0.02,
        "range_max": 6.0,
        "ranges": RANGES_M,
        "intensities": [],
    }


def rostopic():
    """YAML as `ros2 topic echo` prints it."""
    seconds = 0
    while True:
        scan = laser_scan(seconds)
        header = scan.pop("header")
        stamp = header["stamp"]
        yield f"header:\n  stamp:\n    sec: {stamp['sec']}\n    nanosec: 0\n  frame_id: sonar\n"
        for key, value in scan.items():
            if isinstance(value, list):
                yield f"{key}:" + (" []\n" if not value else "\n" + "".join(f"- {item}\n" for item in value))
            else:
                yield f"{key}: {value}\n"
        yield "---\n"
        seconds += 1


def messages():
    seconds = 0
    while True:
        yield json.dumps(laser_scan(seconds)) + "\n"
        seconds += 1


def write_text(path, pieces, size):
    written = 0
    with open(path, "w") as file:
        for piece in pieces:
            written += file.write(piece)
            if written >= size:
                return


def write_document(path, size):
    """A JSON list of readings."""
    with open(path, "w") as file:
        written = file.write("[")
        lines = json_lines()
        while written < size - 200:
            written += file.write(next(lines).strip() + ",")
        file.write(next(lines).strip() + "]")


def write_bag(path, size):
    """A rosbag2 folder with one file of MCAP."""
    import numpy
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, kind = get_typestore(Stores.ROS2_JAZZY), "sensor_msgs/msg/LaserScan"
    message = lambda kind, *fields: store.types[kind](*fields)
    *limits, ranges, intensities = [value for key, value in laser_scan(0).items() if key != "header"]
    lists = [numpy.array(values, dtype=numpy.float32) for values in (ranges, intensities)]
    written, seconds = 0, 1_700_000_000
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topic = bag.add_connection("/scan", kind, typestore=store)
        while written < size:
            header = message("std_msgs/msg/Header", message("builtin_interfaces/msg/Time", seconds, 0), "sonar")
            content = store.serialize_cdr(message(kind, header, *limits, *lists), kind)
            bag.write(topic, seconds * 10**9, content)
            written, seconds = written + len(content), seconds + 1


FORMATS = {
    "table": ("csv", lambda path, size: write_text(path, table(), size)),
    "JSON, lines": ("jsonl", lambda path, size: write_text(path, json_lines(), size)),
    "JSON, document": ("json", write_document),
    "CARMEN": ("clf", lambda path, size: write_text(path, carmen(), size)),
    "Player": ("log", lambda path, size: write_text(path, player(), size)),
    "LaserScan, JSON": ("jsonl", lambda path, size: write_text(path, messages(), size)),
    "LaserScan, YAML": ("yaml", lambda path, size: write_text(path, rostopic(), size)),
    "LaserScan, MCAP": ("bag", write_bag),
}


def peak_mb(program, path):
    """Peak memory of an import, in MB, and what it printed last."""
    child = subprocess.Popen(
        [program, "import", path, "-o", os.devnull, "--force"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    printed = child.stderr.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    summary = next((line for line in printed.splitlines() if " readings: " in line or "×" in line), printed[:200])
    return usage.ru_maxrss / 1024, child.returncode, summary.strip()


def main():
    arguments = sys.argv[1:]
    program = arguments.pop(0) if arguments and not arguments[0].isdigit() else "target/release/sonard"
    sizes = [int(size) for size in arguments] or [1, 10, 100]
    print(f"{'format':<18}" + "".join(f"{f'{size} MB':>10}" for size in sizes) + f"{'ratio':>8}")
    with tempfile.TemporaryDirectory() as folder:
        for name, (suffix, write) in FORMATS.items():
            cells, peaks, summary = "", [], ""
            for size in sizes:
                path = Path(folder, f"input.{suffix}")
                try:
                    write(path, size * 1_000_000)
                except ImportError:
                    cells, summary = "", "left out: no rosbags"
                    break
                peak, code, summary = peak_mb(program, path)
                shutil.rmtree(path) if path.is_dir() else path.unlink()
                cells += f"{peak:>10.1f}" if code == 0 else f"{'rejected':>10}"
                peaks += [peak] if code == 0 else []
            ratio = f"{peaks[-1] / peaks[0]:>8.2f}" if len(peaks) > 1 else f"{'':>8}"
            print(f"{name:<18}{cells}{ratio}  {summary}", flush=True)


if __name__ == "__main__":
    main()
