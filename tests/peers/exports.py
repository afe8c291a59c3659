#!/usr/bin/env python3
"""Holds exports against the logs that they were made of, as other programs read them.

    tests/peers/exports.sh [PROGRAM]        makes logs and exports, and calls this

A recording is read by mcap with mcap-ros2-support and by rosbags: both have to read every message alike,
field by field, and what they read has to be what the log says. A table is read by duckdb and by pyarrow: as text, and
typed (Parquet), where both have to read every cell alike and as the log has it.
"""

import csv
import json
import math
import pathlib
import struct
import sys
from datetime import datetime

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pyogrio
import shapely
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import bag
from plain import plain


def by_mcap(path):
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        messages = [
            (channel.topic, message.log_time, plain(decoded))
            for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False)
        ]
        attachments = {one.name: one.data for one in reader.iter_attachments()}
        metadata = {one.name: one.metadata for one in reader.iter_metadata()}
        assert reader.get_header().profile == "ros2"
        return messages, attachments, metadata, reader.get_summary()


def by_rosbags(path):
    with AnyReader([pathlib.Path(path)]) as reader:
        offered = {one.topic: one.ext.offered_qos_profiles for one in reader.connections}
        messages = [
            (connection.topic, at, plain(reader.deserialize(raw, connection.msgtype)))
            for connection, at, raw in reader.messages()
        ]
        return messages, offered


def check_types(summary):
    """Names, definitions and hashes are those that rosbags has of ROS 2."""
    store = get_typestore(Stores.ROS2_JAZZY)
    seen = set()
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        declared = get_types_from_msg(schema.data.decode(), schema.name)
        for name, definition in declared.items():
            assert definition == store.fielddefs[name], name
        assert channel.metadata["topic_type_hash"] == store.hash_rihs01(schema.name), schema.name
        seen.add(schema.name)
    return seen


def check_qos(offered):
    for topic, [profile] in offered.items():
        kept = topic in ("/tf_static", "/map", "/sonar/scene", "/sonar/lines", "/sonar/features")
        durable = "TRANSIENT_LOCAL" if kept else "VOLATILE"
        assert (profile.durability.name, profile.reliability.name) == (durable, "RELIABLE"), topic
        assert profile.depth == (1 if kept else 10), topic


class Log:
    """What a log says, read without sonard."""

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


def quaternion_yaw(q):
    return 2 * math.atan2(q["z"], q["w"])


def expected_range(reading, log, profile):
    silent, close = (math.inf, -math.inf) if profile == "rep117" else (log.max_m, log.min_m)
    return {"echo": reading["range_m"], "no_echo": silent, "min_range": close}.get(reading["status"])


def check_ranges(topics, log, profile):
    told = 0
    for above, reading_of in [("/sonar", lambda p: p), ("/sonar/predicted", lambda p: p.get("sim"))]:
        expected = {}
        for scan in log.scans:
            for ping in scan["pings"]:
                reading = reading_of(ping)
                value = expected_range(reading, log, profile) if reading else None
                if value is not None:
                    topic = f"{above}/{ping['ranger']}/range" if ping.get("ranger") else f"{above}/range"
                    frame = f"sonar_{ping['ranger']}" if ping.get("ranger") else "sonar"
                    expected.setdefault(topic, []).append((value, frame))
        for topic, values in expected.items():
            messages = topics[topic]
            assert len(messages) == len(values), (topic, len(messages), len(values))
            for (_, message), (value, frame) in zip(messages, values):
                assert near(message["range"], value), (topic, message, value)
                assert message["header"]["frame_id"] == frame
                assert near(message["min_range"], log.min_m) and near(message["max_range"], log.max_m)
                assert (message["radiation_type"], message["variance"]) == (0, 0)
                assert 0 < message["field_of_view"] < math.pi
                told += 1
    return told


def check_scans(topics, log):
    if log.session.get("array"):
        assert "/sonar/scan" not in topics
        return
    assert len(topics["/sonar/scan"]) == len(log.scans)
    for (_, message), scan in zip(topics["/sonar/scan"], log.scans):
        plan, by_index = scan["start"]["plan"], {ping["index"]: ping for ping in scan["pings"]}
        step = math.radians(plan["step_deg"])
        assert near(message["angle_increment"], step) and near(message["angle_min"], math.radians(plan["from_deg"]))
        assert near(message["angle_max"], message["angle_min"] + step * (len(message["ranges"]) - 1), 1e-5)
        assert near(message["range_min"], log.min_m) and near(message["range_max"], log.max_m)
        assert message["header"]["frame_id"] == "sonar_mount"
        assert 0 < message["time_increment"] < message["scan_time"]
        for place, value in enumerate(message["ranges"]):
            expected = expected_range(by_index[place], log, "rep117") if place in by_index else None
            assert value == "nan" if expected is None else near(value, expected), (place, value, expected)
        margins = [by_index[place].get("margin_db") or 0 for place in range(len(message["ranges"]))]
        if any("margin_db" in ping for ping in scan["pings"]):
            assert all(near(a, b) for a, b in zip(message["intensities"], margins))
        else:
            assert message["intensities"] == []


def points_of(message):
    names = [field["name"] for field in message["fields"]]
    formats = {5: "i", 6: "I", 7: "f"}
    form = "<" + "".join(formats[field["datatype"]] for field in message["fields"])
    assert struct.calcsize(form) == message["point_step"] and not message["is_bigendian"]
    assert [field["offset"] for field in message["fields"]] == [4 * place for place in range(len(names))]
    data = bytes(message["data"])
    assert len(data) == message["width"] * message["point_step"] == message["row_step"]
    return [dict(zip(names, values)) for values in struct.iter_unpack(form, data)]


def place_of(ping, scan, log):
    """Where a transducer on its axis was and looked: x, y, direction."""
    pose = ping.get("pose") or scan["start"]["pose"]
    heading = math.radians(pose["heading_deg"])
    x, y, direction = pose["x_m"], pose["y_m"], heading + math.radians(ping["azimuth_deg"])
    if ping.get("ranger"):
        [ranger] = [one for one in log.session["array"]["rangers"] if one["id"] == ping["ranger"]]
        x += ranger["x_m"] * math.cos(heading) - ranger["y_m"] * math.sin(heading)
        y += ranger["x_m"] * math.sin(heading) + ranger["y_m"] * math.cos(heading)
        direction = heading + math.radians(ranger["bearing_deg"])
    return x, y, direction


def check_points(topics, log):
    for topic, reading_of in [("/sonar/points", lambda p: p), ("/sonar/predicted/points", lambda p: p.get("sim"))]:
        scans = [s for s in log.scans if topic == "/sonar/points" or any(p.get("sim") for p in s["pings"])]
        assert len(topics.get(topic, [])) == len(scans), topic
        for (_, message), scan in zip(topics.get(topic, []), scans):
            assert message["header"]["frame_id"] == "map" and message["is_dense"]
            points = {point["index"]: point for point in points_of(message)}
            heard = {p["index"]: p for p in scan["pings"] if (reading_of(p) or {}).get("status") == "echo"}
            assert points.keys() == heard.keys(), topic
            for index, ping in heard.items():
                point, reading = points[index], reading_of(ping)
                x, y, direction = place_of(ping, scan, log)
                assert near(point["range"], reading["range_m"])
                assert near(point["x"], x + reading["range_m"] * math.cos(direction), 1e-5)
                assert near(point["y"], y + reading["range_m"] * math.sin(direction), 1e-5)
                assert point["time"] >= 0
                for name, value in [("intensity", reading.get("margin_db")), ("residual", ping["residual_m"]),
                                    ("confidence", ping.get("confidence"))]:
                    assert math.isnan(point[name]) if value is None else near(point[name], value), name
                path = reading.get("path") or (ping.get("sim") or {}).get("path")
                assert point["order"] == (path["order"] if path else -1)


def check_transforms(topics, log):
    """From map to the face of each ranger at the stamp of each of its readings."""
    fixed = {t["child_frame_id"]: t for _, m in topics["/tf_static"] for t in m["transforms"]}
    moving = {}
    for _, message in topics["/tf"]:
        for t in message["transforms"]:
            told = moving.setdefault(t["child_frame_id"], {}).setdefault(tuple(t["header"]["stamp"].values()), t)
            assert told == t, "two places at one time"
    sent = {}
    for topic, messages in topics.items():
        if topic.endswith("/range") and "predicted" not in topic:
            for _, message in messages:
                sent[tuple(message["header"]["stamp"].values())] = message["header"]["frame_id"]
    pings = [(p, s) for s in log.scans for p in s["pings"] if expected_range(p, log, "rep117") is not None]
    assert len(sent) == len(pings), (len(sent), len(pings))
    for (stamp, frame), (ping, scan) in zip(sorted(sent.items()), pings):
        base, turn = moving["base_link"][stamp], fixed.get(frame) or moving["sonar"][stamp]
        assert base["header"]["frame_id"] == "map"
        at, yaw = base["transform"]["translation"], quaternion_yaw(base["transform"]["rotation"])
        on = turn["transform"]["translation"]
        x = at["x"] + on["x"] * math.cos(yaw) - on["y"] * math.sin(yaw)
        y = at["y"] + on["x"] * math.sin(yaw) + on["y"] * math.cos(yaw)
        direction = yaw + quaternion_yaw(turn["transform"]["rotation"])
        expected = place_of(ping, scan, log)
        assert near(x, expected[0], 1e-9) and near(y, expected[1], 1e-9)
        assert abs(math.remainder(direction - expected[2], math.tau)) < 1e-9


def check_paths(topics, log):
    assert len(topics["/sonar/paths"]) == len(log.scans)
    for (_, message), scan in zip(topics["/sonar/paths"], log.scans):
        lengths = {}
        for ping in scan["pings"]:
            for one in [ping, ping.get("sim") or {}]:
                if one.get("path") and one["status"] in ("echo", "min_range"):
                    kind = one["path"]["kind"]
                    lengths[kind] = lengths.get(kind, 0) + one["path"]["length_m"]
                    break
        for marker in message["markers"]:
            assert (marker["type"], marker["header"]["frame_id"]) == (5, "map")
            points = [tuple(p.values()) for p in marker["points"]]
            drawn = sum(math.dist(a, b) for a, b in zip(points[::2], points[1::2]))
            assert marker["action"] == (0 if points else 2)
            # Points stand in the log to a micrometre.
            assert abs(drawn - lengths.get(marker["ns"], 0)) < 1e-5 * max(1, len(points)), marker["ns"]


def check_residuals(topics, log):
    expected = {}
    for ping in (ping for scan in log.scans for ping in scan["pings"] if ping.get("residual_m") is not None):
        topic = f"/sonar/{ping['ranger']}/residual" if ping.get("ranger") else "/sonar/residual"
        expected.setdefault(topic, []).append({"data": ping["residual_m"]})
    told = {topic: [m for _, m in of] for topic, of in topics.items() if topic.endswith("/residual")}
    assert told == expected


def check_scene(topics, log):
    text = log.session.get("scene_text")
    assert ("/sonar/scene" in topics) == bool(text)
    if not text:
        return
    walls, cylinders = topics["/sonar/scene"][0][1]["markers"]
    assert (walls["ns"], walls["type"], walls["header"]["frame_id"]) == ("walls", 5, "map")
    scene = json.loads(text)
    drawn = shapely.MultiPoint([(p["x"], p["y"]) for p in walls["points"]])
    corners = [at for wall in scene["walls"] for at in wall.get("polyline") or (wall["from"], wall["to"])]
    assert all(drawn.distance(shapely.Point(corner)) < 1e-9 for corner in corners)
    for circle in scene.get("cylinders", []):
        centre = circle["center"]
        assert any(near(math.dist(centre, (p["x"], p["y"])), circle["radius_m"], 1e-9) for p in cylinders["points"])


def check_times(messages, log):
    """Where the log has times, they are the stamps; in any case time goes on."""
    stamps = sorted(
        {seconds(m["header"]["stamp"]) for topic, _, m in messages if topic.endswith("/range")}
    )
    times = [p["time"] for s in log.scans for p in s["pings"] if p["time"] and p["time_sigma_us"]]
    if times:
        of_log = [datetime.fromisoformat(time[:26].rstrip("Z") + "+00:00").timestamp() for time in times]
        assert all(min(abs(stamp - other) for other in of_log) < 2e-6 for stamp in stamps)
    assert all(a < b for a, b in zip(stamps, stamps[1:]))


def check_recording(path, log_path, profile):
    log = Log(log_path)
    messages, attachments, metadata, summary = by_mcap(path)
    others, offered = by_rosbags(path)
    key = lambda one: (one[1], one[0], json.dumps(one[2]))
    assert len(messages) == len(others) == summary.statistics.message_count
    for one, other in zip(sorted(messages, key=key), sorted(others, key=key)):
        assert one == other, (one, other)
    types = check_types(summary)
    check_qos(offered)
    topics = {}
    for topic, at, message in messages:
        topics.setdefault(topic, []).append((at, message))
    ranges = check_ranges(topics, log, profile)
    check_scans(topics, log)
    check_points(topics, log)
    check_transforms(topics, log)
    check_paths(topics, log)
    check_residuals(topics, log)
    check_scene(topics, log)
    check_times(messages, log)
    assert attachments == {pathlib.Path(log_path).name: pathlib.Path(log_path).read_bytes()}
    assert metadata["sonard"]["profile"] == profile and metadata["sonard"]["time_base"]
    print(f"{path}: {len(messages)} messages of {len(types)} types, {ranges} ranges, read alike by both")


def check_table(path, log_path):
    """Every cell of a table by duckdb, pyarrow and Python's csv, against the log."""
    log = Log(log_path)
    pings = [ping for scan in log.scans for ping in scan["pings"]]
    rows = list(csv.DictReader(open(path, encoding="utf-8", newline="")))
    arrow = pyarrow.csv.read_csv(path)
    duck = duckdb.sql(f"SELECT count(*), sum(range_m), count(range_m), sum(sim_range_m::DOUBLE) FROM read_csv('{path}', sample_size=-1)")
    ranges = [ping["range_m"] for ping in pings if ping["range_m"] is not None]
    predicted = [ping["sim"]["range_m"] for ping in pings if ping.get("sim") and ping["sim"]["range_m"] is not None]
    count, total, heard, of_sim = duck.fetchall()[0]
    assert (count, heard) == (len(pings), len(ranges)) and near(float(total), sum(ranges))
    assert near(float(of_sim or 0), sum(predicted))
    assert arrow.num_rows == len(rows) == len(pings)
    assert near(sum(x for x in arrow["range_m"].to_pylist() if x is not None), sum(ranges))
    for row, ping in zip(rows, pings):
        for name, value in ping.items():
            if name in row and name != "path":
                told = " ".join(map(str, value)) if isinstance(value, list) else "" if value is None else value
                cell = row[name]
                assert (float(cell) == told if isinstance(told, float) else cell == str(told)), (name, cell, told)
        for name, value in (ping.get("sim") or {}).items():
            if f"sim_{name}" in row and name != "path":
                cell = row[f"sim_{name}"]
                assert (cell == "" if value is None else cell == value or float(cell) == value), (name, cell)
    print(f"{path}: {len(rows)} rows, read alike by three")


SINGLE = {"range_m", "tof_us", "amplitude", "margin_db", "path_length_m"}
SINGLE |= {f"sim_{name}" for name in SINGLE - {"tof_us"}} | {"residual_m", "confidence"}
TEXT = {"log", "provenance", "scene", "sensor", "array", "scan", "ranger", "status", "path_kind", "path",
        "crosstalk_ranger", "sim_status", "sim_path_kind", "sim_path", "sim_crosstalk_ranger"}
TIME = {"session_started", "scan_started", "time"}
WHOLE = {"session", "collection_pose", "collection_repeat", "index", "step", "fired_ticks", "path_order", "sim_path_order"}


def type_of(name):
    if name in SINGLE:
        return pa.float32()
    if name in TEXT:
        return pa.string()
    if name in TIME:
        return pa.timestamp("ns", tz="UTC")
    if name in WHOLE:
        return pa.int64()
    counts = pa.list_(pa.field("element", pa.uint32(), nullable=False))
    return {"echo_ticks": counts, "repaired": pa.bool_()}.get(name, pa.float64())


def nanoseconds(time):
    """Of a moment as a log has it; Python's own times end at microseconds."""
    whole, _, rest = time.rstrip("Z").partition(".")
    return int(datetime.fromisoformat(whole + "+00:00").timestamp()) * 10**9 + int(rest.ljust(9, "0") or 0)


def cells_of_log(log, scan, ping):
    """What a row has to say, by the names of the columns: all that is not of geometry."""
    session, start, sim = log.session, scan["start"], ping.get("sim") or {}
    pose = ping.get("pose") or start["pose"]
    air = start.get("air") or session["air"]
    cells = {name: None for name in TEXT | SINGLE | TIME | WHOLE}
    nested = ("type", "sim", "path", "pose", "crosstalk")
    cells |= {name: ping.get(name) for name in ping if name not in nested}
    cells |= {f"sim_{name}": value for name, value in sim.items() if name not in nested}
    for prefix, of in [("", ping), ("sim_", sim)]:
        for name in ("ranger", "before_us"):
            cells[f"{prefix}crosstalk_{name}"] = (of.get("crosstalk") or {}).get(name)
    for prefix, path in [("", ping.get("path")), ("sim_", sim.get("path"))]:
        if path:
            cells |= {f"{prefix}path_{name}": path[name] for name in ("kind", "order")}
            cells[f"{prefix}path_length_m"] = path["length_m"]
    cells |= {name: pose[name] for name in ("x_m", "y_m", "heading_deg")}
    cells |= {"session": 1, "session_started": session["started"], "scan": start["scan"], "scan_started": start["time"]}
    cells |= {name: (session.get(name) or {}).get("name") for name in ("scene", "sensor", "array")}
    cells |= {name: air[name] for name in ("temperature_c", "sound_speed_m_s")}
    cells["provenance"] = ping.get("provenance") or session["provenance"]
    cells.setdefault("repaired", False)
    for name in TIME:
        cells[name] = cells[name] and nanoseconds(cells[name])
    for name in SINGLE:
        cells[name] = None if cells[name] is None else float(np.float32(cells[name]))
    return cells


# What the log has in other words or not in one field: held against the table as text.
DERIVED = {"log", "path", "sim_path", "transducer_x_m", "transducer_y_m", "transducer_z_m", "direction_deg", "tilt_deg"}


def check_typed_table(path, log_path):
    """Every cell of a table in Parquet by pyarrow and by duckdb, against the log and against the same table as text."""
    log = Log(log_path)
    file = pyarrow.parquet.ParquetFile(path)
    table = file.read()
    for field in table.schema:
        assert field.type == type_of(field.name), field
    moments = [name for name in table.column_names if name in TIME]
    for name in moments:
        table = table.set_column(table.column_names.index(name), name, table[name].cast(pa.int64()))
    rows = table.to_pylist()
    db = duckdb.connect()
    quoted = [f'"{name}"' for name in table.column_names]
    columns = ", ".join(
        f"epoch_ns({quoted}::TIMESTAMP_NS) AS {quoted}" if name in TIME else quoted
        for name, quoted in zip(table.column_names, quoted)
    )
    found = db.sql(f"SELECT {columns} FROM read_parquet('{path}')")
    by_duckdb = [dict(zip(found.columns, row)) for row in found.fetchall()]
    text = list(csv.DictReader(open(path.with_suffix(".csv"), encoding="utf-8", newline="")))
    pings = [(scan, ping) for scan in log.scans for ping in scan["pings"]]
    assert len(rows) == len(by_duckdb) == len(text) == len(pings)
    assert list(text[0]) == table.column_names == file.schema_arrow.names
    for row, other, line, (scan, ping) in zip(rows, by_duckdb, text, pings):
        expected = cells_of_log(log, scan, ping)
        for name, cell in row.items():
            # duckdb has times with a zone to the microsecond.
            agree = cell // 1000 == other[name] // 1000 if name in TIME and cell is not None else cell == other[name]
            assert agree, (name, cell, other[name])
            if name in DERIVED:
                told = line[name]
                assert (cell or "") == told if name in TEXT else cell == (float(told) if told else None), (name, cell, told)
            else:
                assert cell == expected.get(name), (name, cell, expected.get(name))
    told = {key.decode(): value.decode() for key, value in file.metadata.metadata.items()}
    by_duckdb = db.sql(f"SELECT key, value FROM parquet_kv_metadata('{path}')").fetchall()
    assert {bytes(key).decode(): bytes(value).decode() for key, value in by_duckdb} == told
    session = json.loads(told["sonard.session.1"])
    scene = log.session.get("scene_text")
    assert session == {key: value for key, value in log.session.items() if key not in ("type", "scene_text")}
    assert scene is None or told[f"sonard.scene.{session['scene']['sha256']}"] == scene
    size = path.stat().st_size / len(rows)
    print(f"{path}: {len(rows)} rows, {size:.0f} bytes each, read alike by both")


def only_message(path):
    """The messages of a recording by topic, read alike by both, one each."""
    messages, _, metadata, summary = by_mcap(path)
    others, offered = by_rosbags(path)
    assert sorted(map(str, messages)) == sorted(map(str, others))
    check_types(summary)
    check_qos(offered)
    assert metadata["sonard"]["provenance"] == "simulated"
    topics = {topic: message for topic, _, message in messages}
    assert len(topics) == len(messages)
    return topics


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
    told = {}
    for name, value in record.items():
        if isinstance(value, list):
            value = dict(zip(("first", "last"), value))
        if isinstance(value, dict):
            told |= {f"{name}_{part}": one for part, one in flat(value).items()}
        else:
            told[name] = value
    return told


def check_found(folder, name, marker_type):
    """Lines or features as markers and as GeoJSON, against what the command said."""
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
        said = bag.range_at(name, number)
        status = {math.inf: "no_echo", -math.inf: "min_range"}.get(said, "echo")
        assert ping["status"] == status, ping
        assert ping["range_m"] == (None if math.isinf(said) else round(said, 6)), ping
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
