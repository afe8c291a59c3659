"""Recordings (MCAP) as two programs read them, held against the logs that they were made of."""

import json
import math
import pathlib
import struct
from datetime import datetime

import shapely
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from logs import Log, near, seconds
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


def quaternion_yaw(q):
    return 2 * math.atan2(q["z"], q["w"])


def expected_range(reading, log, profile):
    silent, close = (math.inf, -math.inf) if profile == "rep117" else (log.max_m, log.min_m)
    return {"echo": reading["range_m"], "no_echo": silent, "min_range": close}.get(reading["status"])


def check_ranges(topics, log, profile):
    ranges = 0
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
                ranges += 1
    return ranges


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
            echoes = {p["index"]: p for p in scan["pings"] if (reading_of(p) or {}).get("status") == "echo"}
            assert points.keys() == echoes.keys(), topic
            for index, ping in echoes.items():
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
            known = moving.setdefault(t["child_frame_id"], {}).setdefault(tuple(t["header"]["stamp"].values()), t)
            assert known == t, "two places at one time"
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
            # The log rounds points to a micrometre.
            assert abs(drawn - lengths.get(marker["ns"], 0)) < 1e-5 * max(1, len(points)), marker["ns"]


def check_residuals(topics, log):
    expected = {}
    for ping in (ping for scan in log.scans for ping in scan["pings"] if ping.get("residual_m") is not None):
        topic = f"/sonar/{ping['ranger']}/residual" if ping.get("ranger") else "/sonar/residual"
        expected.setdefault(topic, []).append({"data": ping["residual_m"]})
    residuals = {topic: [m for _, m in of] for topic, of in topics.items() if topic.endswith("/residual")}
    assert residuals == expected


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
