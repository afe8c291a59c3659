"""Calibration compared with the command and with the true values of a log."""

import json
import pickle
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import sonard

from .conftest import Command

TRUE_POSE = (0.80, 0.05, 92.0)
BELIEVED = (0.774, 0.085, 90.0)


def simulate(command: Command, path: Path, step_deg: float) -> Path:
    pose = ",".join(map(str, TRUE_POSE))
    air = ("--temperature-c", 15, "--max-range", 3)
    command("simulate", "--scene", "simple-room", "--pose", pose, *air, "--step-deg", step_deg, "-o", path)
    return path


@pytest.fixture(scope="module")
def log(command: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of a sweep in colder air and at another pose than the prior."""
    return simulate(command, tmp_path_factory.mktemp("calibrate") / "room.jsonl", 0.9)


@pytest.fixture(scope="module")
def sparse_log(command: Command, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with a quarter of the beams, for comparisons of several fits with the command."""
    return simulate(command, tmp_path_factory.mktemp("calibrate") / "sparse.jsonl", 3.6)


@pytest.fixture(scope="module")
def found(log: Path) -> sonard.Calibration:
    scans = sonard.read_log(log)
    return sonard.calibrate(scans, scans[0].model(), poses=[BELIEVED])


def as_line(estimate: sonard.Estimate) -> dict[str, Any]:
    fields = [name for name in estimate.__dataclass_fields__ if getattr(estimate, name) is not None]
    return {name: getattr(estimate, name) for name in fields}


def test_matches_command(
    log: Path, found: sonard.Calibration, command: Command, tmp_path: Path
) -> None:
    out = tmp_path / "fitted"
    lines = command("calibrate", log, "--pose", ",".join(map(str, BELIEVED)), "--json", "--out", out)
    assert [as_line(estimate) for estimate in found.estimates] == lines
    assert found.sensor == sonard.Sensor.load(out / "sensor.json") and found.sensor.name == "senscomp-6500-calibrated"
    assert found.scene == sonard.Scene.load(out / "scene.json")
    air = json.loads((out / "air.json").read_text())
    assert found.air.sound_speed_m_s == air["sound_speed_m_s"]
    (pose,) = [json.loads(line) for line in (out / "poses.jsonl").read_text().splitlines()]
    assert found.scans == (pose["scan"],)
    assert found.poses.tolist() == [[pose["x_m"], pose["y_m"], pose["heading_deg"]]]


def test_recovers_true_values(log: Path, found: sonard.Calibration) -> None:
    truth = dict(zip(["x_m", "y_m", "heading_deg"], TRUE_POSE, strict=True))
    for name, value in truth.items():
        estimate = found[name]
        assert estimate.identified and abs(estimate.value - value) < max(0.003, 3 * estimate.sigma), estimate
        assert estimate.low < estimate.value < estimate.high
    assert found.explained > 0.9 and found.sigma_m < 0.005 and found.readings > 300
    assert (found.delay_m, found.heading_zero_deg, found.gear) == (0.0, 0.0, 1.0)
    assert found.log_posterior <= found.log_likelihood
    # The fitted model reproduces the log better than the prior one.
    scan = sonard.read_log(log)[0]

    def off_m(model: sonard.Model, pose: Any) -> float:
        readings = model.predict(pose, scan.readings["azimuth_deg"])
        off = np.abs(readings["range_m"] - scan.readings["range_m"])
        return float(np.median(off[np.isfinite(off)]))

    assert off_m(found.model, found.poses[0]) < 0.1 * off_m(scan.model(), BELIEVED)


def test_covariance(found: sonard.Calibration) -> None:
    sigmas = np.array([estimate.sigma for estimate in found.estimates])
    assert found.covariance.shape == (5, 5)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), sigmas, rtol=1e-12)
    np.testing.assert_allclose(found.covariance, found.covariance.T, rtol=1e-9, atol=1e-18)
    assert (np.linalg.eigvalsh(found.covariance / np.outer(sigmas, sigmas)) > 0).all()


def test_pickling(found: sonard.Calibration) -> None:
    again = pickle.loads(pickle.dumps(found))
    assert repr(again) == repr(found) and again.sensor == found.sensor and again.scene == found.scene
    np.testing.assert_array_equal(again.covariance, found.covariance)
    match = re.fullmatch(rf"<Estimate x_m of {found.scans[0][:8]}: (\S+) ± (\S+)>", repr(found["x_m"]))
    assert match and abs(float(match[1]) - 0.8) < 6 * float(match[2]) < 0.01
    with pytest.raises(KeyError, match="was not fitted; fitted: heading_deg, sound_speed"):
        found["gear"]


def test_priors(sparse_log: Path, command: Command) -> None:
    scans = sonard.read_log(sparse_log)
    lines = command("calibrate", sparse_log, "--fit", "pose,materials,gear", "--prior", "gear=0.000001", "--prior", "x_m=0.03", "--json")
    found = sonard.calibrate(scans, fit=["pose", "materials", "gear"], priors={"gear": 1e-6, "x_m": 0.03})
    assert [as_line(estimate) for estimate in found.estimates] == lines
    assert not found["gear"].identified and abs(found.gear - 1) < 1e-5
    assert found["x_m"].prior_sigma == pytest.approx(0.03)


@pytest.mark.parametrize("search", ["thorough", "furnished"])
def test_searches_match_command(
    sparse_log: Path, command: Command, search: Literal["thorough", "furnished"]
) -> None:
    scans = sonard.read_log(sparse_log)
    options = ("--fit", "pose", "--pose", ",".join(map(str, BELIEVED)), "--search", search, "--json")
    lines = command("calibrate", sparse_log, *options)
    found = sonard.calibrate(scans, fit=["pose"], poses=[BELIEVED], search=search)
    assert [as_line(estimate) for estimate in found.estimates] == lines


def test_error_messages(log: Path, command: Command, tmp_path: Path) -> None:
    scans = sonard.read_log(log)
    for kind, words, options in [
        (sonard.OptionError, "`y` is not fitted", {"priors": {"y": 0.1}}),
        (sonard.OptionError, "the prior of x_m is -1", {"priors": {"x_m": -1.0}}),
        (sonard.OptionError, "the prior of x_m is NaN", {"priors": {"x_m": np.nan}}),
        (sonard.OptionError, "neither floor nor ceiling", {"fit": ["height"]}),
        (sonard.OptionError, "expected one of `pose`", {"fit": ["everything"]}),
        (sonard.OptionError, "expected one of `quick`", {"search": "everywhere"}),
        (sonard.SonardError, "no parameter to fit", {"fit": []}),
        (TypeError, "str", {"fit": "pose"}),
        (ValueError, "max_initial_error_m is 0", {"max_initial_error_m": 0.0}),
        (ValueError, r"poses has the shape (2, 3): it must be (1, 3)", {"poses": [BELIEVED] * 2}),
        (ValueError, "poses[0]: values must be finite", {"poses": [(0.8, np.inf, 0.0)]}),
    ]:
        with pytest.raises(kind) as caught:
            sonard.calibrate(scans, **options)  # type: ignore[arg-type]
        assert words in str(caught.value)
    with pytest.warns(UserWarning, match="are not explained"):
        sonard.calibrate(scans, poses=[(9.0, 9.0, 0.0)])
    with pytest.raises(sonard.LogError, match="no sweep"):
        sonard.calibrate([])
    other = tmp_path / "other.jsonl"
    command("simulate", "--scene", "two-surface-room", "--pose", "middle", "--max-range", 3, "-o", other)
    with pytest.raises(sonard.LogError, match="different sensors or scenes"):
        sonard.calibrate([scans, sonard.read_log(other)])
    ring = tmp_path / "ring.jsonl"
    command("simulate", "--scene", "two-surface-room", "--pose", "middle", "--array", "pioneer-8", "-o", ring)
    with pytest.warns(UserWarning, match="of an array.*skipped"), pytest.raises(sonard.LogError, match="no sweep"):
        sonard.calibrate(sonard.read_log(ring))
