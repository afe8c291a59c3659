"""The program with folders for data and results, and what its answers are read into."""

import json
import os
import subprocess
import sys


# An HC-SR04 by its manual and by data sheets of 16 mm open transducers, from which the fits begin.
DATA_SHEET = {
    "name": "data-sheet",
    "description": "HC-SR04 by its manual and its transducers' data sheets",
    "frequency_hz": 40000.0,
    "aperture": {"shape": "piston", "radius_m": 0.0065},
    "mounting": {"separation_m": 0.026},
    "pulse": {"shape": "burst", "cycles": 8.0, "bandwidth_hz": 1000.0},
    "blanking_us": 117.0,
    "max_range_m": 4.0,
    "threshold": 0.094,
    "sources": {},
}


class Work:
    """Runs the built program; `data` has the measurements, `out` takes what is made."""

    def __init__(self, sonard, data, out):
        self.sonard, self.data, self.out = os.path.abspath(sonard), data, out
        os.makedirs(out, exist_ok=True)

    def given(self, *names):
        return os.path.join(self.data, *names)

    def path(self, *names):
        return os.path.join(self.out, *names)

    def keep(self, name, value):
        """Writes a JSON file into `out` and returns its path."""
        with open(self.path(name), "w") as file:
            json.dump(value, file)
        return self.path(name)

    def run(self, *args):
        done = subprocess.run([self.sonard, *args], capture_output=True, text=True)
        if done.returncode:
            sys.exit("%s\n%s" % (" ".join(args), done.stderr))
        return done.stdout

    def lines(self, *args):
        """The JSON lines that a command prints."""
        return [json.loads(line) for line in self.run(*args).splitlines()]

    def pings(self, scene, pose, sensor, *options):
        """The readings that the model predicts from a pose (x, y, heading)."""
        records = self.lines("simulate", "--scene", scene, "--pose=%f,%f,%f" % pose, "--sensor", sensor, *options)
        return [line for line in records if line["type"] == "ping"]


def table(head, rows):
    """Prints a table in Markdown."""
    for row in (head, ["---"] * len(head), *rows):
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print()


def share(part, whole):
    return "%.1f %%" % (100 * part / whole) if whole else "none"
