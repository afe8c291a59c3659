#!/usr/bin/env python3
"""Holds exports against the logs that they were made of, as other programs read them.

    tests/peers/exports.sh [PROGRAM]        makes logs and exports, and calls this

A recording is read by mcap with mcap-ros2-support and by rosbags: both have to read every message alike,
field by field, and their values must equal those of the log. A table is read by duckdb and by pyarrow: as text, and
typed (Parquet), where both have to read every cell alike and as the log has it.
"""

import json
import math
import pathlib
import sys

import pyogrio
import shapely

import bag
from logs import Log, near, nanoseconds
from recordings import check_recording, only_message
from tables import check_table, check_typed_table


def check_map(folder):
    """The grid of a recording against the image that map_server reads."""
    topics = only_message(folder / "map.mcap")
    assert list(topics) == ["/map"]
    grid, info = topics["/map"], topics["/map"]["info"]
    header, _, pixels = (folder / "map.pgm").read_bytes().partition(b"255\n")
    width, height = map(int, header.split()[1:3])
    assert (info["width"], info["height"]) == (width, height) and grid["header"]["frame_id"] == "map"
    assert len(grid["data"]) == len(pixels) == width * height
    yaml = dict(line.split(": ", 1) for line in (folder / "map.yaml").read_text().splitlines())
    assert near(info["resolution"], float(yaml["resolution"]))
    at = info["origin"]["position"]
    assert [at["x"], at["y"]] == json.loads(yaml["origin"])[:2] and info["origin"]["orientation"]["w"] == 1
    for place, cell in enumerate(grid["data"]):
        row, column = divmod(place, width)
        pixel = pixels[(height - 1 - row) * width + column]
        # The image has steps of 1 in 255, the grid of 1 in 100.
        assert abs((50 if cell == -1 else cell) - 100 * (1 - pixel / 255)) <= 0.75, (place, cell, pixel)
    print(f"{folder}: {width} x {height} cells, read alike by both")


def flat(record):
    """Members of members, and the two of a pair, by names of their own."""
    fields = {}
    for name, value in record.items():
        if isinstance(value, list):
            value = dict(zip(("first", "last"), value))
        if isinstance(value, dict):
            fields |= {f"{name}_{part}": one for part, one in flat(value).items()}
        else:
            fields[name] = value
    return fields


def check_found(folder, name, marker_type):
    """Lines or features as markers and as GeoJSON, against the output of the command."""
    records = [json.loads(line) for line in open(folder / f"{name}.jsonl", encoding="utf-8")]
    path = folder / f"{name}.geojson"
    text = json.loads(path.read_text(encoding="utf-8"))
    assert text["sonard"]["units"] == "metres"
    # What has no place has no geometry (RFC 7946, 3.2); in a collection GEOS, alone of all, stumbles over that.
    by_shapely = [
        shapely.from_geojson(json.dumps(one["geometry"])) if one["geometry"] else shapely.Point()
        for one in text["features"]
    ]
    _, _, by_gdal, _ = pyogrio.raw.read(path)
    drawn = {}
    for record, read, one, other in zip(records, text["features"], by_shapely, by_gdal, strict=True):
        if name == "lines":
            expected = [record["from_m"], record["to_m"]]
        else:
            expected = [] if record["x_m"] is None else [[record["x_m"], record["y_m"]]]
        for geometry in [one, shapely.from_wkb(other) if other else shapely.Point()]:
            found = shapely.get_coordinates(geometry).tolist()
            assert found == expected, (found, expected)
        properties = {k: v for k, v in read["properties"].items() if k != "what" and not k.startswith("seen_from")}
        assert properties == flat({k: v for k, v in record.items() if k not in ("from_m", "to_m")})
        drawn.setdefault(record["kind"], []).extend(expected)
    markers = only_message(folder / f"{name}.mcap")[f"/sonar/{name}"]["markers"]
    for marker in markers:
        points = [[point["x"], point["y"]] for point in marker["points"]]
        assert points == drawn.pop(marker["ns"], []) and marker["type"] == marker_type
    assert not any(drawn.values()), drawn
    print(f"{path}: {len(records)} {name}, read alike by both")


def check_imported(path):
    """The log that was made of a bag of rosbags (bag.py): each reading, when and where."""
    log = Log(path)
    [front, left] = log.session["array"]["rangers"]
    for ranger, (x, y, bearing) in zip([front, left], bag.RANGERS.values()):
        assert near(ranger["x_m"], x) and near(ranger["y_m"], y) and near(ranger["bearing_deg"], bearing)
    pings = [(ping, scan) for scan in log.scans for ping in scan["pings"]]
    assert len(pings) == 80
    for place, (ping, scan) in enumerate(pings):
        number, name = place // 2, ping["ranger"]
        assert name == list(bag.RANGERS)[place % 2]
        range_m = bag.range_at(name, number)
        status = {math.inf: "no_echo", -math.inf: "min_range"}.get(range_m, "echo")
        assert ping["status"] == status, ping
        assert ping["range_m"] == (None if math.isinf(range_m) else round(range_m, 6)), ping
        time_s = 0.1 * number + (0.03 if name == "left" else 0)
        assert abs(nanoseconds(ping["time"]) - round((bag.START_S + time_s) * 1e9)) < 1000, ping
        pose = ping.get("pose") or scan["start"]["pose"]
        expected = bag.pose_at(time_s)
        for key, value in zip(("x_m", "y_m", "heading_deg"), expected):
            assert abs(math.remainder(pose[key] - value, 360)) < 1e-6, (key, pose, expected)
    print(f"{path}: {len(pings)} readings of another program's bag")


if __name__ == "__main__":
    folder = pathlib.Path(sys.argv[1])
    for recording in sorted(folder.glob("*.mcap")):
        name, profile = recording.stem.rsplit("-", 1)
        check_recording(recording, folder / f"{name}.jsonl", profile)
    for table in sorted(folder.glob("*.csv")):
        check_table(table, folder / f"{table.stem}.jsonl")
    for table in sorted(folder.glob("*.parquet")):
        check_typed_table(table, folder / f"{table.stem}.jsonl")
    check_map(folder / "places" / "map")
    check_found(folder / "places", "lines", 5)
    check_found(folder / "places", "features", 7)
    for name in ("bag", "bag-zstd", "bag-sqlite", "bag-converted"):
        check_imported(folder / "places" / f"{name}.jsonl")
