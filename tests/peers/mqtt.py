"""Holds what mosquitto's subscriber got of a daemon against that daemon's log.

    tests/peers/mqtt.sh [PROGRAM]        finds the tools, and calls this

Broker, subscriber and daemon are processes; the log is read without sonard. Figures are printed.
"""

import atexit
import contextlib
import http.client
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

PROGRAM = sys.argv[1]
READINGS = 10_000
ROBOT = "kiwi"
COMMON = ["--mock", "--scene", "simple-room", "--pose", "fig9", "--virtual-time"]
SMALL = ["model.max_range_m=3", f"fleet.robot={ROBOT}"]
SCANS = READINGS // 400 + 1


def spawn(command, **pipes):
    """A process that ends with this one, however that ends."""
    process = subprocess.Popen(command, **pipes)
    atexit.register(process.kill)
    return process


def until(what, condition, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"waited in vain for {what}"
        time.sleep(0.05)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Broker:
    """mosquitto, with what it knows kept on the disk."""

    def __init__(self, folder, *settings):
        self.folder, self.port = folder, free_port()
        folder.mkdir()
        self.file = folder / "mosquitto.conf"
        lines = [
            f"listener {self.port} 127.0.0.1",
            "persistence true",
            f"persistence_location {folder}/",
            "max_inflight_messages 0",
            "max_queued_messages 0",
            *(settings or ["allow_anonymous true"]),
        ]
        if os.getuid() == 0:
            lines.append("user root")
        self.file.write_text("\n".join(lines) + "\n")
        self.start()

    def start(self):
        file = open(self.folder / "output", "ab")
        self.process = spawn(["mosquitto", "-c", self.file], stdout=file, stderr=file)
        until("the broker", self.listens)

    def listens(self):
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def kill(self):
        self.process.kill()
        self.process.wait()

    def kill_once_read(self):
        """Kills it in the middle of what it is sent, with all read of what it gave out itself.

        A client that notices that the broker is gone throws away what it has not read yet. The broker informed the
        daemon that it has those messages, and forgets them with its memory: no later sending can bring them back.
        """
        self.process.send_signal(signal.SIGSTOP)
        until("the readers of the broker", lambda: not self.unread_bytes())
        self.kill()

    def unread_bytes(self):
        """What its clients have not read yet of what it gave out (columns of the kernel's table: proc_net_tcp)."""
        connections = (line.split() for line in pathlib.Path("/proc/net/tcp").read_text().splitlines()[1:])
        from_broker = (fields[4] for fields in connections if fields[2].endswith(f":{self.port:04X}"))
        return sum(int(queues.split(":")[1], 16) for queues in from_broker)

    def remember(self):
        """Has it write its sessions to the disk, as a restart does."""
        file = self.folder / "mosquitto.db"
        file.unlink(missing_ok=True)
        self.process.send_signal(signal.SIGUSR1)
        until("the broker's sessions", file.exists)
        time.sleep(0.3)


class Subscriber:
    """mosquitto_sub, which comes back by itself, and whose messages wait for it meanwhile."""

    def __init__(self, folder, broker, *options):
        self.file = folder / f"got-{broker.port}"
        command = ["mosquitto_sub", "-h", "localhost", "-p", str(broker.port), "-i", "listener", "-c", "-q", "1"]
        command += ["-t", f"sonard/{ROBOT}/#", "-F", "%t %r %p", "-k", "5", *options]
        self.process = spawn(command, stdout=open(self.file, "wb"))
        ready = lambda: b"listener" in (broker.folder / "output").read_bytes()
        until("the subscriber", ready)
        time.sleep(0.5)

    def messages(self):
        """Topic below the robot's, and text, in the order they came in."""
        lines = self.file.read_bytes().split(b"\n")[:-1]
        fields = (line.decode().split(" ", 2) for line in lines)
        return [(topic.removeprefix(f"sonard/{ROBOT}/"), text) for topic, _retained, text in fields]

    def pings(self):
        """Readings that came, each counted once."""
        lines = self.file.read_bytes().split(b"\n")[:-1]
        return len({line for line in lines if line.startswith(f"sonard/{ROBOT}/ping ".encode())})

    @contextlib.contextmanager
    def stopped(self):
        self.process.send_signal(signal.SIGSTOP)
        yield
        self.process.send_signal(signal.SIGCONT)

    def stop(self):
        self.process.terminate()
        self.process.wait()


class Daemon:
    def __init__(self, folder, settings):
        self.folder, self.socket = folder, folder / "socket"
        self.socket.unlink(missing_ok=True)
        command = [PROGRAM, "run", *COMMON, "--log", folder / "log", "--socket", self.socket]
        for setting in SMALL + settings:
            command += ["--set", setting]
        self.output = open(folder / "output", "ab")
        self.process = spawn(command, stderr=self.output)
        until("the daemon", self.socket.exists)

    def request(self, method, route, body=None):
        connection = http.client.HTTPConnection("localhost")
        connection.sock = socket.socket(socket.AF_UNIX)
        connection.sock.connect(str(self.socket))
        headers = {"Content-Type": "application/json"}
        connection.request(method, route, None if body is None else json.dumps(body), headers)
        answer = connection.getresponse()
        assert answer.status < 300, (route, answer.status, answer.read())
        return json.loads(answer.read())

    def mqtt(self):
        return self.request("GET", "/v1/status")["mqtt"]

    def cpu_s(self):
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")")[-1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def resident_mb(self):
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1000

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self):
        self.process.terminate()
        assert self.process.wait(30) == 0


def log(folder):
    files = sorted((folder / "log").glob("sonard-*.jsonl"))
    return [json.loads(line) for file in files for line in file.read_text().splitlines()]


def name(record):
    """Identity of a record."""
    match record["type"]:
        case "ping":
            return record["scan"], record["index"]
        case "scan_start" | "scan_end":
            return record["scan"], record["type"]
        case _:
            return json.dumps(record, sort_keys=True)


def compare(messages, logged):
    """Checks that exactly the records of the log arrived, with every field; returns the number of repeated ones."""
    came, twice = {}, 0
    for topic, text in messages:
        if topic in ("online", "status", "answer"):
            continue
        record = json.loads(text)
        assert record["type"] == topic, (topic, record)
        before = came.setdefault(name(record), record)
        assert before == record, f"the same twice, and not alike: {before} {record}"
        twice += before is not record
    wanted = {name(record): record for record in logged}
    # Each log repeats the session in force.
    others = [record for record in logged if record["type"] != "session"]
    sessions = sum(record["type"] == "session" for record in wanted.values())
    assert len(wanted) == len(others) + sessions, "the log has a record twice"
    lost = wanted.keys() - came.keys()
    assert not lost, f"{len(lost)} lost, of {len(wanted)}: {list(lost)[:3]}"
    strange = came.keys() - wanted.keys()
    assert not strange, f"{len(strange)} that are not in the log: {list(strange)[:3]}"
    for key, record in wanted.items():
        assert came[key] == record, f"{record}\nwas sent as\n{came[key]}"
    return twice


def online(messages):
    return [text for topic, text in messages if topic == "online"]


def pings(folder):
    return sum(file.read_bytes().count(b'{"type":"ping",') for file in (folder / "log").glob("sonard-*.jsonl"))


def is_ready(daemon):
    return daemon.request("GET", "/v1/status")["link"]["state"] in ("ready", "scanning")


def is_idle(daemon):
    status = daemon.request("GET", "/v1/status")
    return status["scan"] is None and status["scanning"]["requested"] == 0


def take_scans(daemon, scans):
    until("the ranger", lambda: is_ready(daemon))
    daemon.request("POST", "/v1/start", {"scans": scans})


def wait_for_rest(daemon):
    """Until no scan is taken any more, and the broker has all."""
    until("the scans", lambda: is_idle(daemon))
    # Longer than the interval in which the broker's delay is published.
    time.sleep(2.5)
    until("all of it", lambda: daemon.mqtt()["connected"] and daemon.mqtt()["lag_bytes"] == 0)


def kills(work):
    """Broker and daemon are killed in mid-stream."""
    folder = work / "kills"
    folder.mkdir()
    broker = Broker(work / "kills-broker")
    subscriber = Subscriber(folder, broker)
    broker.remember()
    settings = [f"mqtt.broker=mqtt://127.0.0.1:{broker.port}", "log.rotate_mb=1"]
    daemon = Daemon(folder, settings)
    kills = 0
    while pings(folder) < READINGS:
        # What a broker has for a subscriber that is not back yet goes with the broker, and is no daemon's loss.
        until("the subscriber", lambda: subscriber.pings() == pings(folder))
        # What dies without one is given no last will.
        until("a connection", lambda: daemon.mqtt()["connected"])
        before = pings(folder)
        take_scans(daemon, 5)
        # In the middle of the scans, and of what is under way.
        until("readings", lambda: pings(folder) > before + 200)
        kills += 1
        if kills % 2:
            # Behind, as on a computer with much else to do.
            with subscriber.stopped():
                until("unread messages", broker.unread_bytes)
            broker.kill_once_read()
            broker.start()
            until("the scans", lambda: is_idle(daemon))
        else:
            daemon.kill()
            daemon = Daemon(folder, settings)
    assert kills >= 4
    take_scans(daemon, 1)
    wait_for_rest(daemon)
    daemon.stop()
    logged = log(folder)
    until("the last one", lambda: subscriber.messages() and online(subscriber.messages())[-1] == "false")
    time.sleep(1)
    subscriber.stop()
    messages = subscriber.messages()
    twice = compare(messages, logged)
    assert "false" in online(messages)[:-1], "no last will was received"
    broker.kill()
    count = sum(record["type"] == "ping" for record in logged)
    print(f"{count} readings, {len(logged)} records, {kills} kills: none lost, {twice} came twice")


def catch_up(work):
    """All that was measured while no broker was there; then live, with what it costs."""
    folder = work / "catch-up"
    folder.mkdir()
    port = free_port()
    daemon = Daemon(folder, [f"mqtt.broker=mqtt://127.0.0.1:{port}"])
    take_scans(daemon, SCANS)
    until("readings", lambda: daemon.request("GET", "/v1/health")["scans"]["completed"] == SCANS)
    daemon.stop()
    assert "connection refused" in (folder / "output").read_text()
    broker = Broker(work / "catch-up-broker")
    subscriber = Subscriber(folder, broker)
    settings = [f"mqtt.broker=mqtt://127.0.0.1:{broker.port}"]
    daemon = Daemon(folder, settings)
    until("a connection", lambda: daemon.mqtt()["connected"])
    before, cpu_s = time.monotonic(), daemon.cpu_s()
    first = daemon.mqtt()["acknowledged"]
    until("all of it", lambda: daemon.mqtt()["lag_bytes"] == 0 and daemon.mqtt()["waiting"] == 0)
    took, used = time.monotonic() - before, daemon.cpu_s() - cpu_s
    sent = daemon.mqtt()["acknowledged"] - first
    print(f"catching up: at least {sent / took:.0f} records/s ({sent} in {took:.2f} s, {used:.2f} s of processor time)")
    print(f"resident with a broker: {daemon.resident_mb():.1f} MB")
    daemon.stop()
    until("the last one", lambda: online(subscriber.messages())[-1:] == ["false"])
    subscriber.stop()
    assert compare(subscriber.messages(), log(folder)) == 0
    broker.kill()


def secrets(work):
    """User and password, and TLS by an authority of our own."""
    folder = work / "secrets"
    folder.mkdir()

    def openssl(*arguments):
        subprocess.run(["openssl", *arguments], check=True, capture_output=True, cwd=folder)

    for who in ("ca", "other"):
        openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
                "-subj", f"/CN={who}", "-keyout", f"{who}.key", "-out", f"{who}.pem")
    (folder / "names").write_text("subjectAltName=DNS:localhost,IP:127.0.0.1\n")
    for who in ("broker", "robot"):
        openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-subj", f"/CN={who}",
                "-keyout", f"{who}.key", "-out", f"{who}.csr")
        openssl("x509", "-req", "-in", f"{who}.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
                "-days", "2", "-extfile", "names", "-out", f"{who}.pem")
    subprocess.run(["mosquitto_passwd", "-b", "-c", folder / "passwords", "robot", "right"], check=True)
    for word in ("right", "wrong"):
        (folder / word).write_text(word + "\n")
        (folder / word).chmod(0o600)
    (folder / "robot.key").chmod(0o600)
    broker = Broker(work / "secrets-broker", "allow_anonymous false", f"password_file {folder}/passwords",
                    f"cafile {folder}/ca.pem", f"certfile {folder}/broker.pem", f"keyfile {folder}/broker.key",
                    "require_certificate true")
    own = ["--cert", folder / "robot.pem", "--key", folder / "robot.key"]
    subscriber = Subscriber(folder, broker, "--cafile", folder / "ca.pem", "-u", "robot", "-P", "right", *own)

    def settings(password, authority, host="localhost"):
        return [f"mqtt.broker=mqtts://{host}:{broker.port}", "mqtt.user=robot",
                f"mqtt.password_file={folder}/{password}", f"mqtt.ca_file={folder}/{authority}.pem",
                f"mqtt.certificate_file={folder}/robot.pem", f"mqtt.key_file={folder}/robot.key",
                "plan.to_deg=36"]

    for wrong, reason in [(("wrong", "ca"), "password"), (("right", "other"), "TLS")]:
        daemon = Daemon(folder, settings(*wrong))
        until(reason, lambda: reason in (daemon.mqtt()["error"] or ""))
        print(f"rejected: {daemon.mqtt()['error']}")
        assert not daemon.mqtt()["connected"]
        daemon.stop()
    for host in ("localhost", "127.0.0.1"):
        daemon = Daemon(folder, settings("right", "ca", host))
        until("a connection", lambda: daemon.mqtt()["connected"])
        take_scans(daemon, 2)
        until("scans", lambda: daemon.request("GET", "/v1/health")["scans"]["completed"] == 2)
        daemon.stop()
    until("the last one", lambda: online(subscriber.messages())[-2:] == ["true", "false"])
    subscriber.stop()
    assert compare(subscriber.messages(), log(folder)) == 0
    broker.kill()
    print("TLS, user and password: right ones are accepted, wrong ones reported")


def commands(work):
    """mosquitto_pub starts a scan, and the answer comes to who listens."""
    folder = work / "commands"
    folder.mkdir()
    broker = Broker(work / "commands-broker")
    subscriber = Subscriber(folder, broker)

    def publish(command, body, *options):
        subprocess.run(["mosquitto_pub", "-h", "localhost", "-p", str(broker.port), "-q", "1", *options,
                        "-t", f"sonard/{ROBOT}/command/{command}", "-m", body], check=True)

    # One that waited is not carried out.
    publish("start", "{}", "-r")
    daemon = Daemon(folder, [f"mqtt.broker=mqtt://127.0.0.1:{broker.port}", "mqtt.commands=true", "plan.to_deg=36"])
    until("the ranger", lambda: is_ready(daemon))
    answers = lambda: [json.loads(text) for topic, text in subscriber.messages() if topic == "answer"]
    until("a refusal", lambda: len(answers()) == 1)
    assert "retained" in answers()[0]["error"], answers()
    publish("start", '{"scans": 1}')
    until("an answer", lambda: len(answers()) == 2)
    assert answers()[1]["accepted"], answers()
    until("the scan", lambda: daemon.request("GET", "/v1/health")["scans"]["completed"] == 1)
    daemon.kill()
    until("the last will", lambda: online(subscriber.messages())[-2:] == ["true", "false"])
    starts = [record for record in log(folder) if record["type"] == "scan_start"]
    assert [start["request"] for start in starts] == [answers()[1]["request"]]
    subscriber.stop()
    broker.kill()
    print("a command is answered and carried out, a retained one is rejected; the last will is received")


with tempfile.TemporaryDirectory() as folder:
    for part in (kills, catch_up, secrets, commands):
        part(pathlib.Path(folder))
