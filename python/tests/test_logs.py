"""Logs, and results computed from scans."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import sonard

from .conftest import Command


@pytest.fixture(scope="module")
def course(command: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of two scans."""
    folder = tmp_path_factory.mktemp("logs")
    poses = folder / "poses.csv"
    poses.write_text("x_m,y_m,heading_deg\n2,1.5,0\n2.6,1.5,30\n")
    log = folder / "course.jsonl"
    command("simulate", "--scene", "mcgill-lab", "--poses", poses, "--max-range", 5, "--temperature-c", 15, "-o", log)
    return log


@pytest.fixture(scope="module")
def compared(command: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of noisy readings with predictions."""
    folder = tmp_path_factory.mktemp("compared")
    plain, both = folder / "plain.jsonl", folder / "both.jsonl"
    command("simulate", "--scene", "simple-room", "--pose", "fig7", "--jitter-us", 5, "-o", plain)
    command("predict", plain, "-o", both)
    return both


def test_records(course: Path) -> None:
    log = sonard.read_log(course)
    records = [json.loads(line) for line in course.read_text().splitlines()]
    pings = [record for record in records if record["type"] == "ping"]
    assert len(log) == 2 and log.damaged == [] and log.path == course
    assert repr(log) == f"<Log '{course}': 2 scans, {len(pings)} readings>"
    readings = log.readings
    assert readings.dtype == sonard.LOGGED and readings.shape == (len(pings),) and readings.flags.aligned
    assert [scan.pose for scan in log] == [(2, 1.5, 0), (2.6, 1.5, 30)]
    np.testing.assert_array_equal(np.concatenate([scan.readings for scan in log])["range_m"], readings["range_m"])
    for row, ping in zip(readings, pings, strict=True):
        assert log[int(row["scan"])].id == ping["scan"]
        assert (row["index"], row["azimuth_deg"]) == (ping["index"], ping["azimuth_deg"])
        assert sonard.Status(row["status"]).name.lower() == ping["status"]
        for field in ["range_m", "tof_us", "amplitude", "margin_db"]:
            value = ping.get(field)
            assert row[field] == value if value is not None else not np.isfinite(row[field])
        assert row["sim_status"] == 255 and np.isnan(row["sim_range_m"]) and np.isnat(row["time"])


def test_logged_model(course: Path) -> None:
    for scan in sonard.read_log(course):
        assert scan.provenance == "simulated" and scan.session is not None and scan.start is not None
        assert scan.session["sensor"]["name"] == scan.sensor.name == "senscomp-6500"
        assert scan.air == sonard.Air(15.0)
        assert scan.scene is not None and scan.scene.name == "mcgill-lab" and scan.pose is not None
        model = scan.model()
        assert model.options == {"max_range_m": 5.0}
        again = model.predict(scan.pose, scan.readings["azimuth_deg"])
        for field in ["status", "range_m", "tof_us", "amplitude", "margin_db"]:
            np.testing.assert_array_equal(again[field], scan.readings[field])
        assert scan.model("mcgill-lab").scene.name == "mcgill-lab"
        assert scan.end is not None and scan.events == []


def test_pickling(course: Path) -> None:
    log = sonard.read_log(course)
    assert repr(pickle.loads(pickle.dumps(log))) == repr(log)
    assert repr(pickle.loads(pickle.dumps(log[-1]))) == repr(log[1]) != repr(log[0])
    with pytest.raises(IndexError, match="the log has 2"):
        log[2]
    with pytest.raises(IndexError):
        log[-3]


def test_damaged_lines(course: Path, tmp_path: Path) -> None:
    lines = course.read_text().splitlines(keepends=True)
    damaged = tmp_path / "damaged.jsonl"
    damaged.write_text("".join([*lines[:5], '{"type": "ping", "scan": 3}\n', *lines[5:9], lines[9][:20]]))
    log = sonard.read_log(damaged)
    assert [number for number, _ in log.damaged] == [6, 11] and "2 damaged lines" in repr(log)
    assert log.readings.size == 7
    for name, text, words in [
        ("scene.json", sonard.Scene.shipped("corridor").to_json(), "use --scene for it"),
        ("text.txt", "nonsense\n", ""),
    ]:
        (tmp_path / name).write_text(text)
        with pytest.raises(sonard.LogError) as caught:
            sonard.read_log(tmp_path / name)
        assert name in str(caught.value) and words in caught.value.help
    with pytest.raises(FileNotFoundError):
        sonard.read_log(tmp_path / "nothing.jsonl")
    with pytest.raises(IsADirectoryError):
        sonard.read_log(tmp_path)


def test_compare_matches_command(compared: Path, command: Command) -> None:
    (expected,) = command("compare", compared, "--json")
    log = sonard.read_log(compared)
    found = sonard.compare(log)
    assert {name: value for name, value in expected.items() if name in found} == found
    assert found["both_echo"] > 300 and sonard.compare(log[0]) == sonard.compare([log]) == found
    readings = log.readings
    assert (readings["sim_status"] < 255).all()
    both = (readings["status"] == sonard.Status.ECHO) & (readings["sim_status"] == sonard.Status.ECHO)
    residuals_m = readings["range_m"][both] - readings["sim_range_m"][both]
    assert abs(np.median(np.abs(residuals_m)) - found["median_abs_residual_m"]) < 1e-12


def test_interpret_matches_command(command: Command, tmp_path: Path) -> None:
    log = tmp_path / "one.jsonl"
    command("simulate", "--scene", "plane-corner-edge", "--pose", "fig13", "--sensor", "bozma-kuc-60khz", "-o", log)
    expected = command("interpret", log, "--json")
    found = sonard.interpret(sonard.read_log(log))
    assert found == expected and {feature["kind"] for feature in found} >= {"edge", "unresolved"}
    with pytest.raises(ValueError, match="min_confidence is 2"):
        sonard.interpret(sonard.read_log(log), min_confidence=2)
    with pytest.raises(TypeError, match="must be a Log"):
        sonard.interpret(3)  # type: ignore[arg-type]
    with pytest.raises(sonard.LogError, match="no scan"):
        sonard.interpret([])


def test_interpret_rejects_arrays(command: Command, tmp_path: Path) -> None:
    log = tmp_path / "array.jsonl"
    command("simulate", "--array", "pioneer-8", "--scene", "mcgill-lab", "--pose", "fig4", "-o", log)
    scan = sonard.read_log(log)[0]
    assert scan.readings.size == 8 and scan.session is not None and scan.session["array"]["name"] == "pioneer-8"
    with pytest.raises(sonard.LogError, match="arcs require a single rotating ranger"):
        sonard.interpret(scan)


def test_locate(command: Command, tmp_path: Path) -> None:
    log = tmp_path / "room.jsonl"
    command("simulate", "--scene", "two-surface-room", "--pose", "1.2,1,30", "--max-range", 3, "-o", log)
    expected = command("locate", log, "--json")
    scan = sonard.read_log(log)[0]
    locator = sonard.Locator(scan.model())
    found = locator.locate(scan)
    assert found == [{name: mode[name] for name in found[0]} for mode in expected]
    best = found[0]
    assert np.hypot(best["x_m"] - 1.2, best["y_m"] - 1.0) < 0.01 and abs(best["heading_deg"] - 30) < 1
    # The same readings as arrays, with and without status.
    readings = scan.readings
    for given in [readings, np.where(readings["status"] == sonard.Status.MIN_RANGE, np.nan, readings["range_m"])]:
        again = locator.locate(given, readings["azimuth_deg"])[0]
        assert abs(again["x_m"] - best["x_m"]) < 1e-6
    with pytest.raises(ValueError, match="lengths must be equal"):
        locator.locate(readings, [0.0])
    with pytest.raises(ValueError, match="at least 8"):
        locator.locate(np.full(400, np.nan))
    assert repr(pickle.loads(pickle.dumps(locator))) == repr(locator)


def test_locate_fits_threshold() -> None:
    usual = sonard.Sensor.preset("senscomp-6500")
    # Half the sensitivity of the prior: 6 dB.
    insensitive = usual.replace(threshold=2 * usual.threshold)
    scan = sonard.Model("simple-room", insensitive, max_range_m=3).predict([0.3, 0.3, 20.0])
    model = sonard.Model("simple-room", usual, max_range_m=3)
    locator = sonard.Locator(model, fit=["threshold"], priors={"threshold_db": 4.0})
    (threshold,) = locator.locate(scan)[0]["nuisance"]
    usual_db = 20 * np.log10(usual.threshold)
    assert threshold["name"] == "threshold_db" and abs(threshold["value"] - usual_db - 6.02) < 1
    again = pickle.loads(pickle.dumps(locator)).locate(scan)[0]["nuisance"]
    assert again == [threshold]
    assert "nuisance" not in sonard.Locator(model).locate(scan)[0]
    with pytest.raises(sonard.OptionError, match="`gear` is not fitted"):
        sonard.Locator(model, fit=["threshold"], priors={"gear": 1.0})


@pytest.mark.parametrize("feature_prediction", [True, False])
def test_map_matches_command(
    course: Path, feature_prediction: bool, command: Command, tmp_path: Path
) -> None:
    switch = "on" if feature_prediction else "off"
    (summary,) = command("map", course, "--out", tmp_path / "map", "--feature-prediction", switch, "--json")
    made = sonard.map(sonard.read_log(course), feature_prediction=feature_prediction)
    rows, columns = made.occupancy.shape
    assert (columns, rows) == (summary["width"], summary["height"]) and made.resolution_m == summary["resolution_m"]
    assert list(made.origin_m) == summary["origin_m"] and made.extent[0] == made.origin_m[0]
    assert (made.occupancy > 0.65).sum() == summary["occupied_cells"] > 100
    assert (made.occupancy < 0.196).sum() == summary["free_cells"] > 100
    header, _, pixels = (tmp_path / "map/map.pgm").read_bytes().partition(b"255\n")
    image = np.frombuffer(pixels, np.uint8).reshape(rows, columns)[::-1].astype(float)
    # Bright is free, and the first row of the image is the top one.
    assert np.abs((255 - image) / 255 - made.occupancy).max() < 0.01
    small = sonard.map(sonard.read_log(course), region=(0.0, 0.0, 1.0, 2.0), resolution_m=0.1)
    assert small.occupancy.shape == (20, 10)
    with pytest.raises(ValueError, match="resolution_m is 0"):
        sonard.map(sonard.read_log(course), resolution_m=0)
    with pytest.raises(sonard.LogError, match="no scan"):
        sonard.map([])
