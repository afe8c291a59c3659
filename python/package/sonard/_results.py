"""What the model answers beside arrays: plain, immutable, picklable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ._sonard import Air, Model, Scene, Sensor
from ._status import Status


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Path:
    """The way that sound took from the transmitter to the receiver; ``str(path)`` says what it met."""

    kind: Literal["specular", "diffracted", "scattered"]
    """Mirror reflections only, diffraction at an edge (once or twice), or scattering by a rough wall."""
    order: int
    """Number of mirror reflections."""
    length_m: float
    """Length there and back, metres."""
    amplitude: float
    """Amplitude before the beam pattern; a head-on, perfectly reflecting wall gives 1."""
    phase_deg: float
    """Phase beside that of the length, degrees: what edges add."""
    departure_deg: float
    """Direction in which the sound leaves, degrees in the world, counter-clockwise from +x, 0 to 360."""
    arrival_deg: float
    """Direction from the ranger towards where the sound comes from, likewise."""
    interactions: tuple[tuple[Literal["reflection", "diffraction", "scattering", "transducer"], str], ...]
    """What the sound meets, in order: the kind, and the name of the wall, cylinder or edge."""
    points: NDArray[np.float64]
    """Where it meets them, metres: shape (interactions, 2), or (interactions, 3) in a scene with heights."""

    @property
    def range_m(self) -> float:
        """Half the length, metres: the range at which a strong echo of it is read."""
        return self.length_m / 2

    def __str__(self) -> str:
        return ", ".join(f"edge {name}" if kind == "diffraction" else name for kind, name in self.interactions)

    def __repr__(self) -> str:
        return f"<Path {self.kind}, {self.length_m:.4f} m, amplitude {self.amplitude:.4f}: {self}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Reading:
    """A single predicted reading with its path."""

    status: Status
    """What became of the firing."""
    range_m: float | None
    """Range, metres; ``None`` of a silence."""
    amplitude: float | None
    """The most that the envelope reached with the echo; a head-on, perfectly reflecting wall gives 1."""
    margin_db: float | None
    """The same above the threshold in force, decibels; negative of a silence: what it lacked."""
    tof_us: float | None
    """When ECHO rises, microseconds after firing; ``None`` of a silence."""
    path: Path | None
    """The path of the echo; of a silence that of the candidate that came closest, if there was any."""
    crosstalk: str | None = None
    """The ranger of an array whose sound it was, if not its own; the path begins at that one."""

    def __repr__(self) -> str:
        at = "" if self.range_m is None else f" at {self.range_m:.4f} m"
        margin = "" if self.margin_db is None else f", margin {self.margin_db:.1f} dB"
        by = "" if self.path is None else f", by {self.path}"
        of = "" if self.crosstalk is None else f", sound of {self.crosstalk}"
        return f"<Reading {self.status.name}{at}{margin}{by}{of}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Peak:
    """The envelope of one arrival in a trace."""

    tof_us: float
    """When it arrives by the length of its path, microseconds after firing."""
    peak_us: float
    """When its envelope is largest, microseconds after firing."""
    peak: float
    """The most of its envelope; a head-on, perfectly reflecting wall gives 1."""
    path: Path
    """Its path."""

    def __repr__(self) -> str:
        return f"<Peak {self.peak:.4f}, arrives at {self.tof_us:.1f} us: {self.path}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trace:
    """What an oscilloscope would show of one firing."""

    t_us: NDArray[np.float64]
    """Times of the samples after firing, microseconds: shape (samples,)."""
    envelope: NDArray[np.float64]
    """Envelope of all arrivals together after gain compensation: shape (samples,)."""
    threshold: NDArray[np.float64]
    """Least envelope that the detector notices then: shape (samples,)."""
    gain_db: NDArray[np.float64]
    """Gain, decibels above what makes up for the spreading from a wall at 1 m: shape (samples,)."""
    echoes_us: NDArray[np.float64]
    """Moments at which ECHO rises where it is made ready again, microseconds after firing: shape (0 to 8,)."""
    peaks: tuple[Peak, ...]
    """The envelope of each arrival, shortest path first."""

    def __repr__(self) -> str:
        until_us = self.t_us[-1] if self.t_us.size else 0.0
        return f"<Trace of {until_us:.0f} us: {len(self.peaks)} arrivals, ECHO rises {self.echoes_us.size} times>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Map:
    """An occupancy grid."""

    occupancy: NDArray[np.float64]
    """Probability that a cell is occupied, 0.5 where nothing is known: shape (rows, columns), from the lower left."""
    origin_m: tuple[float, float]
    """Lower left corner of the first cell, x and y in metres."""
    resolution_m: float
    """Side of a cell, metres."""

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top, metres: what ``matplotlib``'s ``imshow(..., origin="lower")`` takes."""
        (x, y), (rows, columns) = self.origin_m, self.occupancy.shape
        return x, x + columns * self.resolution_m, y, y + rows * self.resolution_m

    def __repr__(self) -> str:
        rows, columns = self.occupancy.shape
        return f"<Map of {columns} x {rows} cells of {self.resolution_m} m at {self.origin_m}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Estimate:
    """A figure that was fitted."""

    name: str
    """What it is: ``"x_m"``, ``"sound_speed"``, ``"reflectance brick"``, ``"wall north"``, ..."""
    scan: str | None
    """The scan that it is of alone, if it is of one."""
    value: float
    """The value found, in the unit that the name says; of ``"sound_speed"`` metres a second, of a wall metres along its
    normal, of ``"aperture"`` metres, of a reflectance the share of the amplitude."""
    change: float
    """Less what it was."""
    sigma: float
    """Standard deviation."""
    low: float
    """95 percent lie from here ..."""
    high: float
    """... to here."""
    prior: float
    """What it was."""
    prior_sigma: float
    """Standard deviation of what was believed."""
    identified: bool
    """Whether the readings say more about it than was believed."""
    at_limit: bool
    """Whether it would go on if it could: the value is the least or the largest there is."""

    def __repr__(self) -> str:
        of = "" if self.scan is None else f" of {self.scan[:8]}"
        left = ", at its limit" if self.at_limit else "" if self.identified else ", left at its prior"
        return f"<Estimate {self.name}{of}: {self.value:.5g} \u00b1 {self.sigma:.2g}{left}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibration:
    """What ``calibrate`` found."""

    estimates: tuple[Estimate, ...]
    """Each figure that was fitted."""
    covariance: NDArray[np.float64]
    """Covariance of their values, to first order, in the products of their units: shape (estimates, estimates)."""
    model: Model
    """Scene, sensor, air and options as they were found; delay and stepper, which a model does not know, are below."""
    poses: NDArray[np.float64]
    """Where the scans were taken, x and y in metres, heading in degrees: shape (scans, 3)."""
    scans: tuple[str, ...]
    """The scans that were used."""
    delay_m: float
    """What is added to every range, metres."""
    heading_zero_deg: float
    """What is added to every azimuth, degrees."""
    gear: float
    """What every azimuth is multiplied with before."""
    readings: int
    """How many readings were used."""
    explained: float
    """The share of them that is explained."""
    sigma_m: float
    """Standard deviation of the ranges about the model's, metres."""
    sigma_db: float
    """Standard deviation of the strengths, decibels."""
    log_likelihood: float
    """Natural logarithm of the likelihood of all readings."""
    log_posterior: float
    """The same with the priors."""

    @property
    def scene(self) -> Scene:
        """The scene as it was found."""
        return self.model.scene

    @property
    def sensor(self) -> Sensor:
        """The sensor as it was found, ``NAME-calibrated`` where it differs."""
        return self.model.sensor

    @property
    def air(self) -> Air:
        """The air as it was found."""
        return self.model.air

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of that name; of several, one for each scan, the first."""
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise KeyError(f"{name!r} was not fitted: there are {', '.join(sorted({one.name for one in self.estimates}))}")

    def __repr__(self) -> str:
        return (
            f"<Calibration of {len(self.estimates)} figures by {self.readings} readings, "
            f"{self.explained:.0%} explained, within {1e3 * self.sigma_m:.1f} mm>"
        )
