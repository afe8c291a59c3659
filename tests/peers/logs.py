"""Logs as they are read without sonard, and figures compared."""

import json
from datetime import datetime


class Log:
    """Content of a log, parsed without sonard."""

    def __init__(self, path):
        self.session, self.scans = None, []
        for line in open(path, encoding="utf-8"):
            record = json.loads(line)
            if record["type"] == "session":
                self.session = record
            elif record["type"] == "scan_start":
                self.scans.append({"start": record, "pings": [], "end": None})
            elif record["type"] == "ping":
                self.scans[-1]["pings"].append(record)
            elif record["type"] == "scan_end":
                self.scans[-1]["end"] = record
        model = self.session["model"] or {}
        sensor, air = self.session["sensor"], self.session["air"]
        self.max_m = model.get("max_range_m") or sensor["max_range_m"]
        self.min_m = air["sound_speed_m_s"] * sensor["blanking_us"] * 1e-6 / 2


def near(a, b, tolerance=2e-6):
    return a == b or abs(a - b) <= tolerance * max(1, abs(b))


def seconds(stamp):
    return stamp["sec"] + stamp["nanosec"] * 1e-9


def nanoseconds(time):
    """Of a moment as a log has it; Python's own times end at microseconds."""
    whole, _, rest = time.rstrip("Z").partition(".")
    return int(datetime.fromisoformat(whole + "+00:00").timestamp()) * 10**9 + int(rest.ljust(9, "0") or 0)
