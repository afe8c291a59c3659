#!/usr/bin/env python3
"""Compares a daemon's messages to ROS 2, as Cyclone DDS receives them, with its log and with a recording of it.

    tests/peers/ros.sh [PROGRAM]        opens a network of its own without a way out, and calls this
    ros.py PROGRAM FOLDER subscribe     subscribes to everything, until it is ended

Each message has to be what `sonard export` makes of the same log, field by field, as mcap-ros2-support reads that, and
readings must equal those of the log.
"""

import atexit
import collections
import datetime
import json
import math
import os
import pathlib
import signal
import struct
import subprocess
import sys
import time

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import ros_types as ros
from plain import plain

PROGRAM, WORK = sys.argv[1], pathlib.Path(sys.argv[2])
# Where there are echoes, silence, and walls that are too near.
ROOM = ["--mock", "--scene", "simple-room", "--pose", "fig7", "--set", "plan.step_deg=3.6", "--set", "model.max_range_m=1"]
ARRAY = ["--simulate", "--array", "pioneer-8", "--scene", "mcgill-lab", "--pose", "fig4",
         "--set", "scanning.mode=on-request", "--set", "model.max_range_m=2"]
OF_SCANS = {"/sonar/scan": ros.LaserScan, "/sonar/points": ros.PointCloud2, "/sonar/paths": ros.MarkerArray,
            "/sonar/predicted/points": ros.PointCloud2, "/tf": ros.TFMessage, "/tf_static": ros.TFMessage,
            "/sonar/scene": ros.MarkerArray}
STILL = ("/tf_static", "/sonar/scene", "/map")
# Its map has more bytes than a packet of UDP.
HALL = {"name": "hall", "materials": {"plaster": {"reflectance": 0.9}},
        "walls": [{"id": "around", "polyline": [[0, 0], [30, 0], [30, 12], [0, 12]], "closed": True,
                   "material": "plaster"}]}


class Daemon:
    """A daemon on a mock, or that plays an array."""

    def __init__(self, name, options, ros_keys):
        self.log, self.socket = WORK / name, WORK / f"{name}.sock"
        keys = [option for key, value in ros_keys.items() for option in ("--set", f"ros.{key}={value}")]
        command = [PROGRAM, "run", *options, *keys, "--log", self.log, "--socket", self.socket]
        self.output = WORK / f"{name}.output"
        with open(self.output, "wb") as file:
            self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=file)
        # It ends with this program, however that ends.
        atexit.register(self.process.kill)
        until(lambda: self.socket.exists() and self.status()["link"]["state"] in ("ready", "scanning"), "a daemon")

    def request(self, method, path, body=None):
        command = ["curl", "-sS", "--unix-socket", self.socket, "-X", method, f"http://localhost{path}"]
        if body is not None:
            command += ["-H", "Content-Type: application/json", "-d", json.dumps(body)]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    def status(self):
        try:
            return json.loads(self.request("GET", "/v1/status"))
        except subprocess.CalledProcessError:
            return {"link": {"state": "absent"}}

    def scan(self, scans):
        """Takes so many scans more."""
        done = lambda: json.loads(self.request("GET", "/v1/health"))["scans"]["completed"]
        wanted = done() + scans
        self.request("POST", "/v1/start", {"scans": scans})
        until(lambda: done() >= wanted, "scans", 60)

    def memory_kb(self):
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1])

    def ports(self):
        """The local ports of its sockets of UDP."""
        inodes = {os.readlink(f).removeprefix("socket:[").removesuffix("]")
                  for f in pathlib.Path(f"/proc/{self.process.pid}/fd").iterdir() if f.is_symlink()}
        lines = pathlib.Path("/proc/net/udp").read_text().splitlines()[1:]
        return [line.split()[1] for line in lines if line.split()[9] in inodes]

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(20) == 0, self.output.read_text()
        text = self.output.read_text()
        assert "ERROR" not in text and "panicked" not in text, text


def until(holds, what, limit_s=20):
    end = time.monotonic() + limit_s
    while not holds():
        assert time.monotonic() < end, f"{what}: waited {limit_s} s"
        time.sleep(0.05)


def policies(still):
    kept = Policy.Durability.TransientLocal if still else Policy.Durability.Volatile
    return Qos(Policy.Reliability.Reliable(duration(seconds=1)), kept, Policy.History.KeepAll)


class Subscriber:
    """Who subscribes to topics as a node of ROS 2 does."""

    def __init__(self, types, namespace=""):
        self.participant = DomainParticipant(0)
        self.namespace = namespace
        self.readers = {topic: self.reader(topic, kind) for topic, kind in types.items()}
        self.messages = collections.defaultdict(list)

    def reader(self, topic, kind):
        named = Topic(self.participant, f"rt{self.namespace}{topic}", kind)
        return DataReader(self.participant, named, qos=policies(topic in STILL))

    def take(self):
        for topic, reader in self.readers.items():
            self.messages[topic] += reader.take(N=1000)
        return self.messages

    def wait_for(self, numbers):
        """Until there are so many messages of each topic, and no more of any."""
        end = time.monotonic() + 20
        have = lambda: {topic: len(messages) for topic, messages in self.take().items() if messages}
        while have() != numbers:
            assert time.monotonic() < end, f"{ {k: (have().get(k), v) for k, v in numbers.items() if have().get(k) != v} }"
            time.sleep(0.1)
        time.sleep(0.3)
        assert have() == numbers, have()


def recorded(log, *options):
    """The messages by topic that a recording of the log holds."""
    path = WORK / "recorded.mcap"
    path.unlink(missing_ok=True)
    subprocess.run([PROGRAM, "export", log, "-o", path, *options], check=True, capture_output=True)
    return messages_of(path)


def maps(log):
    """The maps that `sonard map` makes of the log up to the end of each of its scans."""
    lines = [line for file in sorted(log.glob("*.jsonl")) for line in file.read_text().splitlines(keepends=True)]
    ends = [place for place, line in enumerate(lines, 1) if json.loads(line)["type"] == "scan_end"]
    part, folder = WORK / "part.jsonl", WORK / "map"
    made = []
    for end in ends:
        part.write_text("".join(lines[:end]))
        subprocess.run([PROGRAM, "map", part, "--out", folder], check=True, capture_output=True)
        made += messages_of(folder / "map.mcap")["/map"]
    return made


def messages_of(path):
    messages = collections.defaultdict(list)
    with open(path, "rb") as file:
        for _, channel, _, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            messages[channel.topic].append(plain(message))
    return messages


def pings(log):
    for file in sorted(log.glob("*.jsonl")):
        for line in file.read_text().splitlines():
            record = json.loads(line)
            if record["type"] == "ping":
                yield record


def single(value):
    """As it is in 32 bits."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def nanoseconds(text):
    whole, _, part = text.removesuffix("Z").partition(".")
    seconds = datetime.datetime.fromisoformat(whole + "+00:00").timestamp()
    return int(seconds) * 10**9 + int(part.ljust(9, "0") or 0)


def hold_against_log(ranges, readings, profile, is_humble):
    """Compares readings with the log by the profile's rules. Returns the statuses of those without an echo."""
    silent = collections.Counter()
    stated = [ping for ping in readings if ping["status"] in ("echo", "no_echo", "min_range")]
    assert len(ranges) == len(stated) > 0, (len(ranges), len(stated))
    for message, ping in zip(ranges, stated):
        limits = {"rep117": (math.inf, -math.inf), "nav2": (message.max_range, message.min_range)}[profile]
        expected = {"echo": lambda: single(ping["range_m"]), "no_echo": lambda: limits[0], "min_range": lambda: limits[1]}
        assert message.range == expected[ping["status"]](), (message, ping)
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == nanoseconds(ping["time"])
        assert message.radiation_type == 0 and (is_humble or message.variance == 0)
        if ping["status"] != "echo":
            silent[ping["status"]] += 1
    return silent


def compare(name, options, rangers=(), namespace="", **keys):
    """Messages of scans, compared with recording and log, and messages to late subscribers."""
    profile, is_humble = keys.get("profile", "rep117"), keys.get("distribution") == "humble"
    range_type = ros.RangeOfHumble if is_humble else ros.Range
    types = dict(OF_SCANS)
    if keys.get("map"):
        types["/map"] = ros.OccupancyGrid
    for ranger in rangers or ("",):
        of = f"/{ranger}" if ranger else ""
        types |= {f"/sonar{of}/range": range_type, f"/sonar/predicted{of}/range": range_type,
                  f"/sonar{of}/residual": ros.Float64}
    daemon = Daemon(name, options, {"enabled": "true", "namespace": namespace, **keys})
    until(lambda: daemon.status()["ros"]["up"], "a node")
    subscriber = Subscriber(types, namespace)
    # Topics are there before the first scan: nothing of it is missed.
    offered = daemon.status()["ros"]["topics"]
    until(lambda: daemon.status()["ros"]["subscriptions"] == offered, "subscriptions")
    daemon.scan(2)
    expected = recorded(daemon.log, "--profile", profile)
    if keys.get("map"):
        expected["/map"] = maps(daemon.log)
        assert len(expected["/map"]) == 2 and expected["/map"][0] != expected["/map"][1]
    subscriber.wait_for({topic: len(messages) for topic, messages in expected.items()})
    compared = 0
    for topic, messages in subscriber.messages.items():
        for place, (mine, other) in enumerate(zip([plain(one) for one in messages], expected.get(topic, []))):
            if is_humble and topic.endswith("/range"):
                assert other.pop("variance") == 0
            assert mine == other, f"{name}: {topic} {place}:\n{mine}\n{other}"
            compared += 1
    readings, silent = list(pings(daemon.log)), collections.Counter()
    for ranger in rangers or (None,):
        topic = f"/sonar/{ranger}/range" if ranger else "/sonar/range"
        of_ranger = [ping for ping in readings if ping.get("ranger") == ranger]
        silent += hold_against_log(subscriber.messages[topic], of_ranger, profile, is_humble)
    assert silent["no_echo"] > 0 and (rangers or silent["min_range"] > 0), silent
    late(daemon, subscriber, types, namespace, expected)
    known_as(subscriber, namespace, is_humble, offered)
    status = daemon.status()["ros"]
    assert status["dropped"] == 0 and status["messages"] >= compared, status
    figures = daemon.request("GET", "/metrics")
    assert "sonard_ros_up 1" in figures and "sonard_ros_dropped_messages_total 0" in figures, figures
    daemon.stop()
    print(f"ros: {name}: {compared} messages of {len(expected)} topics are those of the recording, "
          f"{len(readings)} readings those of the log ({dict(silent)})")


def newest(subscriber, topic):
    """The last message. The library lets go of one that another took the place of within some seconds: who comes before gets
    both, in their order."""
    messages = subscriber.take()[topic]
    return plain(messages[-1]) if messages else None


def late(daemon, subscriber, types, namespace, expected):
    """Late subscribers receive static messages, and all others from then on."""
    comer = Subscriber(types, namespace)
    until(lambda: newest(comer, "/map") == expected.get("/map", [None])[-1], "the last map")
    comer.messages["/map"] = comer.messages["/map"][-1:]
    comer.wait_for({topic: 1 for topic in STILL if topic in expected})
    for topic in STILL:
        for mine, other in zip(comer.messages[topic], subscriber.messages[topic][-1:]):
            assert plain(mine) == plain(other)
    # Matched by now, because static messages have arrived.
    until(lambda: daemon.status()["ros"]["subscriptions"] == 2 * daemon.status()["ros"]["topics"], "both")
    daemon.scan(1)
    until(lambda: len(comer.take()["/sonar/points"]) == 1, "points of a scan")
    before = len(subscriber.messages["/sonar/points"])
    until(lambda: len(subscriber.take()["/sonar/points"]) == before + 1, "points of that scan")
    assert plain(comer.messages["/sonar/points"]) == plain(subscriber.messages["/sonar/points"][before:])


def known_as(subscriber, namespace, is_humble, topics):
    """What `ros2 node list` and `ros2 node info` go by."""
    kind = ros.ParticipantOfHumble if is_humble else ros.ParticipantEntitiesInfo
    named = Topic(subscriber.participant, "ros_discovery_info", kind)
    reader = DataReader(subscriber.participant, named, qos=policies(True))
    found = []
    until(lambda: found.extend(reader.take(N=10)) or found, "a node")
    [node] = found[-1].node_entities_info_seq
    assert (node.node_namespace, node.node_name) == (namespace or "/", "sonard"), node
    # All topics, but no service.
    assert len(node.writer_gid_seq) == topics and not node.reader_gid_seq, node
    participant = found[-1].gid.data[:12]
    assert all(gid.data[:12] == participant for gid in node.writer_gid_seq), "they are of this participant"


def call(participant, namespace, service, number):
    """Calls a service as rmw_cyclonedds does; the reply that bears the request's number."""
    named = lambda kind, name: Topic(participant, f"{kind}{namespace}/sonar/{service}{name}", TYPES[name])
    requests = DataWriter(participant, named("rq", "Request"), qos=policies(False))
    replies = DataReader(participant, named("rr", "Reply"), qos=policies(False))
    until(lambda: requests.get_matched_subscriptions() and replies.get_matched_publications(), "a service")
    time.sleep(0.5)
    requests.write(ros.TriggerRequest(guid=0x1122334455667788, number=number, structure_needs_at_least_one_member=0))
    got = []
    until(lambda: got.extend(replies.take(N=10)) or got, "a reply")
    assert len(got) == 1 and (got[0].guid, got[0].number) == (0x1122334455667788, number), got
    return got[0]


TYPES = {"Request": ros.TriggerRequest, "Reply": ros.TriggerResponse}


def large_map():
    """A map of many packets comes whole, also to who comes late."""
    scene = WORK / "hall.json"
    scene.write_text(json.dumps(HALL))
    options = ["--mock", "--scene", scene, "--pose", "2,2,0", "--set", "plan.step_deg=7.2", "--set", "model.max_range_m=3"]
    daemon = Daemon("hall", options, {"enabled": "true", "map": "true"})
    until(lambda: daemon.status()["ros"]["up"], "a node")
    subscriber = Subscriber({"/map": ros.OccupancyGrid})
    until(lambda: daemon.status()["ros"]["subscriptions"] == 1, "a subscription")
    daemon.scan(1)
    daemon.request("PUT", "/v1/pose", {"x_m": 28, "y_m": 10, "heading_deg": 45})
    daemon.scan(1)
    expected = maps(daemon.log)
    comer = Subscriber({"/map": ros.OccupancyGrid})
    until(lambda: newest(comer, "/map") == expected[-1], "the last map", 30)
    subscriber.wait_for({"/map": 2})
    assert [plain(message) for message in subscriber.messages["/map"]] == expected
    cells = len(expected[-1]["data"])
    assert cells > 100_000, cells
    daemon.stop()
    print(f"ros: a map of {cells} cells is that of the log, also for who comes late")


def initial_pose(daemon, me, namespace):
    """A pose in the map is followed by the next scan; others are rejected with a reason."""
    named = Topic(me, f"rt{namespace}/initialpose", ros.PoseWithCovarianceStamped)
    poses = DataWriter(me, named, qos=policies(False))
    until(poses.get_matched_subscriptions, "a node that listens")
    time.sleep(0.5)

    def publish(frame, position, orientation):
        pose = ros.Pose(position=ros.Point(*position), orientation=ros.Quaternion(*orientation))
        header = ros.Header(stamp=ros.Time(sec=0, nanosec=0), frame_id=frame)
        whole = ros.PoseWithCovariance(pose=pose, covariance=[0.25] * 36)
        poses.write(ros.PoseWithCovarianceStamped(header=header, pose=whole))

    wanted = lambda: json.loads(daemon.request("GET", "/v1/pose"))
    before, status = wanted(), lambda: daemon.status()["ros"]
    refused = status()["rejected"]
    here, half = (0.5, 0.3, 0.0), math.sqrt(0.5)
    for wrong, why in (
        (("odom", here, (0, 0, 0, 1)), 'its frame is "odom"'),
        (("map", here, (half, 0, 0, half)), "it is inclined by 90 degrees"),
        (("map", (math.nan, 0, 0), (0, 0, 0, 1)), "not finite"),
        (("map", here, (0, 0, 0, 0)), "length 0"),
        (("map", (-7, 0, 0), (0, 0, 0, 1)), "outside the room"),
    ):
        publish(*wrong)
        refused += 1
        until(lambda: status()["rejected"] == refused, f"a refusal: {why}")
        assert "/initialpose is rejected" in status()["refusal"] and why in status()["refusal"], status()
    assert wanted() == before, wanted()
    publish("map", here, (0, 0, half, half))
    until(lambda: wanted() != before, "a pose that is followed")
    daemon.scan(1)
    starts = [json.loads(line) for file in daemon.log.glob("*.jsonl") for line in file.read_text().splitlines()
              if '"scan_start"' in line]
    pose = max(starts, key=lambda start: start["time"])["pose"]
    assert (pose["x_m"], pose["y_m"]) == here[:2] and abs(pose["heading_deg"] - 90) < 1e-9, pose
    assert "is rejected" in daemon.output.read_text()
    return refused


def commands():
    """Services start and stop scans where that is configured, by the API's rules, and are not there else."""
    daemon = Daemon("commands", ROOM, {"enabled": "true", "commands": "true", "namespace": "/kiwi"})
    until(lambda: daemon.status()["ros"]["up"], "a node")
    me = DomainParticipant(0)
    reply = call(me, "/kiwi", "start", 7)
    assert reply.success and reply.message.startswith("request "), reply
    scans = lambda: json.loads(daemon.request("GET", "/v1/health"))["scans"]
    until(lambda: daemon.status()["scan"], "a scan")
    reply = call(me, "/kiwi", "stop", 8)
    assert reply.success and reply.message == "stopped", reply
    until(lambda: scans()["stopped"] == 1 and scans()["completed"] == 0, f"a scan that was stopped")
    status = daemon.status()["ros"]
    assert (status["commands"], status["rejected"]) == (2, 0), status
    refused = initial_pose(daemon, me, "/kiwi")
    status = daemon.status()["ros"]
    assert (status["commands"], status["rejected"]) == (3, refused), status
    daemon.stop()
    daemon = Daemon("no-commands", ROOM, {"enabled": "true"})
    until(lambda: daemon.status()["ros"]["up"], "a node")
    named = Topic(me, "rq/sonar/startRequest", ros.TriggerRequest)
    requests = DataWriter(me, named, qos=policies(False))
    named = Topic(me, "rt/initialpose", ros.PoseWithCovarianceStamped)
    poses = DataWriter(me, named, qos=policies(False))
    subscriber = Subscriber({"/sonar/range": ros.Range})
    until(lambda: subscriber.readers["/sonar/range"].get_matched_publications(), "a topic")
    time.sleep(1)
    assert not requests.get_matched_subscriptions(), "there is no service"
    assert not poses.get_matched_subscriptions(), "no subscription to poses"
    daemon.stop()
    print("ros: services start and stop scans and poses are followed where that is configured, and only there")


def stuck():
    """A subscriber that stops to read costs a bounded amount of memory, and the daemon goes on."""
    keys = {"enabled": "true", "queue_kb": 16}
    daemon = Daemon("stuck", [*ROOM, "--set", "scanning.mode=continuous", "--set", "plan.to_deg=360"], keys)
    me = Subscriber({"/sonar/range": ros.Range})
    other = os.fork()
    if other == 0:
        # Cyclone's threads do not go along with a fork: another program.
        os.execv(sys.executable, [sys.executable, __file__, PROGRAM, str(WORK), "subscribe"])
    until(lambda: daemon.status()["ros"]["subscriptions"] >= 9, "the other's subscriptions", 30)
    time.sleep(3)
    before_kb, before = daemon.memory_kb(), daemon.status()
    os.kill(other, signal.SIGSTOP)
    until(lambda: daemon.status()["ros"]["dropped"] > before["ros"]["dropped"] + 50, "messages left out", 60)
    after_kb, after = daemon.memory_kb(), daemon.status()
    until(lambda: daemon.status()["last_reading_age_s"] < 5, "readings go on", 30)
    gaps = [line for file in daemon.log.glob("*.jsonl") for line in file.read_text().splitlines()
            if '"gap"' in line and "ros: " in line]
    assert 1 <= len(gaps) <= 3, gaps
    # It is given up as gone, and then everybody else gets everything again.
    have = lambda: len(me.take()["/sonar/range"])
    subscriptions = lambda: daemon.status()["ros"]["subscriptions"]
    until(lambda: subscriptions() <= 1, "it is given up", 60)
    first = have()
    until(lambda: have() > first + 20, "readings for the others", 30)
    os.kill(other, signal.SIGKILL)
    os.waitpid(other, 0)
    daemon.stop()
    print(f"ros: a subscriber that stopped reading: {after['ros']['dropped']} messages left out, "
          f"memory {before_kb} -> {after_kb} kB, reported {len(gaps)} times, others go on")


def subscribe():
    """Subscribes to everything and reads it until it is ended."""
    subscriber = Subscriber(OF_SCANS | {"/sonar/range": ros.Range, "/sonar/predicted/range": ros.Range,
                                        "/sonar/residual": ros.Float64, "/map": ros.OccupancyGrid})
    while True:
        subscriber.take()
        time.sleep(0.05)


def sent_outside():
    """Packets that went out by the interface which is not loopback."""
    lines = pathlib.Path("/proc/net/dev").read_text().splitlines()
    return int(next(line for line in lines if line.strip().startswith("outside:")).split()[10])


def off():
    """Without the section no port is open and nothing is sent."""
    daemon = Daemon("off", ROOM, {})
    daemon.scan(1)
    assert daemon.status()["ros"] is None and daemon.ports() == [], daemon.ports()
    assert "sonard_ros" not in daemon.request("GET", "/metrics")
    daemon.stop()
    print("ros: off: no port of UDP")


def confined():
    """By default messages stay on loopback; with an address of another network they are sent there."""
    before = sent_outside()
    daemon = Daemon("confined", ROOM, {"enabled": "true"})
    until(lambda: daemon.status()["ros"]["up"], "a node")
    assert daemon.status()["ros"]["networks"] == ["127.0.0.1"] and daemon.ports()
    daemon.scan(1)
    time.sleep(2)
    daemon.stop()
    assert sent_outside() == before, "something went out"
    daemon = Daemon("outside", ROOM, {"enabled": "true", "networks": "outside"})
    until(lambda: daemon.status()["ros"]["up"], "a node")
    assert daemon.status()["ros"]["networks"] == ["10.77.0.1"], daemon.status()["ros"]
    until(lambda: sent_outside() > before, "multicast on that network")
    daemon.stop()
    print("ros: on loopback nothing goes out; on a named network it does")


def main():
    if sys.argv[3:] == ["subscribe"]:
        subscribe()
    off()
    confined()
    compare("stepper", ROOM, map="true")
    compare("stepper-nav2", ROOM, profile="nav2", namespace="/kiwi")
    compare("stepper-humble", ROOM, distribution="humble")
    rangers = [f"s{number}" for number in range(8)]
    compare("array", ARRAY, rangers=rangers, map="true")
    compare("array-nav2", ARRAY, rangers=rangers, profile="nav2", distribution="humble")
    large_map()
    commands()
    stuck()


if __name__ == "__main__":
    main()
