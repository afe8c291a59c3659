#!/usr/bin/env python3
"""Writes a bag of a robot that drives and turns past a wall, two rangers on it, by rosbags; exports.py holds what
`sonard import` makes of it.

    tests/peers/bag.py FOLDER
"""

import math
import pathlib
import sys

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
START_S = 1_700_000_000
# Where the rangers are on the robot: ahead, to the left, and where they look, degrees.
RANGERS = {"front": (0.2, 0.0, 0.0), "left": (0.1, 0.15, 90.0)}


def pose_at(time_s):
    """Known twice a second; between those times on a straight line, the turn evenly."""
    return 0.4 * time_s, 0.1 * time_s, 20.0 * time_s


def range_at(name, number):
    """An echo, silence, too near, in turn."""
    return {0: 1.0 + 0.01 * number, 1: math.inf, 2: -math.inf}[(number + len(name)) % 3]


def message(kind, *fields):
    return STORE.types[kind](*fields)


def header(time_s, frame):
    whole, part = divmod(round(time_s * 1e9), 10**9)
    stamp = message("builtin_interfaces/msg/Time", START_S + whole, part)
    return message("std_msgs/msg/Header", stamp, frame)


def transform(time_s, parent, child, x, y, yaw_deg):
    half = math.radians(yaw_deg) / 2
    place = message("geometry_msgs/msg/Vector3", x, y, 0.0)
    turn = message("geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(half), math.cos(half))
    placed = message("geometry_msgs/msg/Transform", place, turn)
    return message("geometry_msgs/msg/TransformStamped", header(time_s, parent), child, placed)


def write(folder, storage, packed=False):
    bag = Writer(folder, version=9, storage_plugin=storage)
    if packed:
        bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with bag:
        topics = {
            topic: bag.add_connection(topic, kind, typestore=STORE)
            for topic, kind in [("/tf_static", "tf2_msgs/msg/TFMessage"), ("/tf", "tf2_msgs/msg/TFMessage"),
                                *((f"/{name}/range", "sensor_msgs/msg/Range") for name in RANGERS)]
        }

        def put(topic, time_s, content):
            connection = topics[topic]
            bag.write(connection, round((START_S + time_s) * 1e9), STORE.serialize_cdr(content, connection.msgtype))

        mounted = [transform(0, "base_link", name, *place) for name, place in RANGERS.items()]
        put("/tf_static", 0, message("tf2_msgs/msg/TFMessage", mounted))
        for half in range(9):
            moved = transform(half / 2, "odom", "base_link", *pose_at(half / 2))
            put("/tf", half / 2, message("tf2_msgs/msg/TFMessage", [moved]))
        for number in range(40):
            for name in RANGERS:
                time_s = 0.1 * number + (0.03 if name == "left" else 0)
                reading_message = message("sensor_msgs/msg/Range", header(time_s, name), 0, 0.5, 0.2, 4.0, range_at(name, number), 0.0)
                put(f"/{name}/range", time_s, reading_message)


if __name__ == "__main__":
    folder = pathlib.Path(sys.argv[1])
    write(folder, StoragePlugin.MCAP)
    write(folder.with_name(folder.name + "-zstd"), StoragePlugin.MCAP, packed=True)
    write(folder.with_name(folder.name + "-sqlite"), StoragePlugin.SQLITE3)
