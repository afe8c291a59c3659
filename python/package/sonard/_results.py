"""Results of the model other than arrays: plain, immutable, picklable classes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._sonard import Air, Model, Scene, Sensor
from ._status import Status


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Path:
    """Propagation path from the transmitter to the receiver; ``str(path)`` lists its interactions."""

    kind: Literal["specular", "diffracted", "scattered"]
    """Mirror reflections only, diffraction at an edge (once or twice), or scattering by a rough wall."""
    order: int
    """Number of mirror reflections."""
    length_m: float
    """Total length of the path, metres."""
    amplitude: float
    """Amplitude before the beam pattern; a head-on, perfectly reflecting wall gives 1."""
    phase_deg: float
    """Phase in addition to that of the length, degrees: the contribution of edges."""
    departure_deg: float
    """Direction of departure, degrees in the world, counter-clockwise from +x, 0 to 360."""
    arrival_deg: float
    """Direction of arrival, from the ranger towards the incoming sound, degrees as for ``departure_deg``."""
    interactions: tuple[tuple[Literal["reflection", "diffraction", "scattering", "transducer"], str], ...]
    """Interactions in order: kind, and name of the wall, cylinder or edge."""
    points: NDArray[np.float64]
    """Points of the interactions, metres: shape (interactions, 2), or (interactions, 3) in a scene with heights."""

    @property
    def range_m(self) -> float:
        """Half the length, metres: the measured range of a strong echo on this path."""
        return self.length_m / 2

    def __str__(self) -> str:
        return ", ".join(f"edge {name}" if kind == "diffraction" else name for kind, name in self.interactions)

    def __repr__(self) -> str:
        return f"<Path {self.kind}, {self.length_m:.4f} m, amplitude {self.amplitude:.4f}: {self}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Reading:
    """Single predicted reading with its path."""

    status: Status
    """Outcome of the firing."""
    range_m: float | None
    """Range, metres; ``None`` without an echo."""
    amplitude: float | None
    """Peak of the envelope at the echo, relative to a head-on, perfectly reflecting wall."""
    margin_db: float | None
    """Peak level above the threshold, decibels; negative without an echo, for the strongest candidate."""
    tof_us: float | None
    """Time at which ECHO rises, microseconds after firing; ``None`` without an echo."""
    path: Path | None
    """Path of the echo; without an echo that of the strongest candidate, if there is one."""
    crosstalk: str | None = None
    """Ranger of an array that transmitted the detected sound, if not the ranger itself; the path begins there."""

    def __repr__(self) -> str:
        at = "" if self.range_m is None else f" at {self.range_m:.4f} m"
        margin = "" if self.margin_db is None else f", margin {self.margin_db:.1f} dB"
        by = "" if self.path is None else f", by {self.path}"
        of = "" if self.crosstalk is None else f", sound of {self.crosstalk}"
        return f"<Reading {self.status.name}{at}{margin}{by}{of}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Peak:
    """Envelope of a single arrival in a trace."""

    tof_us: float
    """Time of arrival by the path length, microseconds after firing."""
    peak_us: float
    """Time of the envelope's peak, microseconds after firing."""
    peak: float
    """Peak of the envelope, relative to a head-on, perfectly reflecting wall."""
    path: Path
    """Propagation path of the arrival."""

    def __repr__(self) -> str:
        return f"<Peak {self.peak:.4f}, arrives at {self.tof_us:.1f} us: {self.path}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trace:
    """Signal of a firing against time, as on an oscilloscope."""

    t_us: NDArray[np.float64]
    """Times of the samples after firing, microseconds: shape (samples,)."""
    envelope: NDArray[np.float64]
    """Envelope of all arrivals together after gain compensation: shape (samples,)."""
    threshold: NDArray[np.float64]
    """Detection threshold at each sample: shape (samples,)."""
    gain_db: NDArray[np.float64]
    """Gain, decibels relative to the gain that compensates the spreading from a wall at 1 m: shape (samples,)."""
    echoes_us: NDArray[np.float64]
    """Times at which ECHO rises if it is re-armed after each echo, microseconds after firing: shape (0 to 8,)."""
    peaks: tuple[Peak, ...]
    """Envelopes of the individual arrivals, shortest path first."""

    def __repr__(self) -> str:
        until_us = self.t_us[-1] if self.t_us.size else 0.0
        return f"<Trace of {until_us:.0f} us: {len(self.peaks)} arrivals, ECHO rises {self.echoes_us.size} times>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Map:
    """Occupancy grid of a region."""

    occupancy: NDArray[np.float64]
    """Probability that a cell is occupied, 0.5 for unknown cells: shape (rows, columns), from the lower left."""
    origin_m: tuple[float, float]
    """Lower left corner of the first cell, x and y in metres."""
    resolution_m: float
    """Side of a cell, metres."""

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top, metres, as for ``matplotlib``'s ``imshow(..., origin="lower")``."""
        (x, y), (rows, columns) = self.origin_m, self.occupancy.shape
        return x, x + columns * self.resolution_m, y, y + rows * self.resolution_m

    def __repr__(self) -> str:
        rows, columns = self.occupancy.shape
        return f"<Map of {columns} x {rows} cells of {self.resolution_m} m at {self.origin_m}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ImageSources:
    """Image sources that receivers see: one entry for each image and receiver, by receiver and then by delay."""

    receivers: NDArray[np.uint32]
    """Index of the receiver among all given ones, in row-major order: shape (images,)."""
    positions_m: NDArray[np.float64]
    """Positions of the images, metres; z is 0 in a planar room: shape (images, 3)."""
    delays_s: NDArray[np.float64]
    """Times of flight, seconds: shape (images,)."""
    amplitudes: NDArray[np.float64]
    """Reflectances over ``4 pi`` times the length of the path, per metre: shape (images,)."""
    reflectances: NDArray[np.float64]
    """Product of the reflectances along the path: shape (images,)."""
    orders: NDArray[np.uint16]
    """Numbers of reflections: shape (images,)."""
    walls: NDArray[np.int32]
    """Reflecting surfaces in order from the source, filled up with -1: shape (images, largest order). Surfaces are
    numbered as the walls of the scene (of a box: at y = 0, largest x, largest y, x = 0), then floor and ceiling."""

    def __len__(self) -> int:
        return self.orders.size

    def __repr__(self) -> str:
        receivers = np.unique(self.receivers).size
        return f"<ImageSources: {len(self)} images up to order {self.orders.max(initial=0)} at {receivers} receivers>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Estimate:
    """Fitted parameter with its uncertainty."""

    name: str
    """Name of the parameter: ``"x_m"``, ``"sound_speed"``, ``"reflectance brick"``, ``"wall north"``, ..."""
    scan: str | None
    """Scan that the parameter belongs to; ``None`` for a parameter shared by all scans."""
    value: float
    """Estimate, in the unit given by the name. The unit of ``"sound_speed"`` is metres per second, that of a wall metres
    along its normal, that of ``"aperture"`` metres, that of a reflectance the ratio of amplitudes."""
    change: float
    """Estimate minus prior value."""
    sigma: float
    """Standard deviation of the estimate."""
    low: float
    """Lower limit of the 95 percent interval."""
    high: float
    """Upper limit of the 95 percent interval."""
    prior: float
    """Prior value of the parameter."""
    prior_sigma: float
    """Standard deviation of the prior."""
    identified: bool
    """``True`` if the readings determine the parameter better than the prior."""
    at_limit: bool
    """``True`` if the estimate is at the minimum or maximum of the parameter."""

    def __repr__(self) -> str:
        of = "" if self.scan is None else f" of {self.scan[:8]}"
        left = ", at its limit" if self.at_limit else "" if self.identified else ", left at its prior"
        return f"<Estimate {self.name}{of}: {self.value:.5g} \u00b1 {self.sigma:.2g}{left}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Calibration:
    """Result of ``calibrate``."""

    estimates: tuple[Estimate, ...]
    """Fitted parameters."""
    covariance: NDArray[np.float64]
    """Covariance of the estimates, to first order, in the products of their units: shape (estimates, estimates)."""
    model: Model
    """Model with the fitted scene, sensor, air and options; without delay and stepper, which are separate fields."""
    poses: NDArray[np.float64]
    """Fitted poses of the scans, x and y in metres, heading in degrees: shape (scans, 3)."""
    scans: tuple[str, ...]
    """Identifiers of the scans used."""
    delay_m: float
    """Offset added to every range, metres."""
    heading_zero_deg: float
    """Offset added to every azimuth, degrees."""
    gear: float
    """Factor applied to every azimuth before the offset."""
    readings: int
    """Number of readings used."""
    explained: float
    """Fraction of the readings that are explained."""
    sigma_m: float
    """Standard deviation of the ranges about the model's, metres."""
    sigma_db: float
    """Standard deviation of the levels about the model's, decibels."""
    log_likelihood: float
    """Natural logarithm of the likelihood of all readings."""
    log_posterior: float
    """Natural logarithm of the posterior density, up to a constant."""

    @property
    def scene(self) -> Scene:
        """Fitted scene."""
        return self.model.scene

    @property
    def sensor(self) -> Sensor:
        """Fitted sensor, named ``NAME-calibrated`` if it differs from the prior one."""
        return self.model.sensor

    @property
    def air(self) -> Air:
        """Fitted state of the air."""
        return self.model.air

    def __getitem__(self, name: str) -> Estimate:
        """Returns the estimate of the given name; the first one if there is one for each scan."""
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise KeyError(f"{name!r} was not fitted; fitted: {', '.join(sorted({item.name for item in self.estimates}))}")

    def __repr__(self) -> str:
        return (
            f"<Calibration of {len(self.estimates)} figures by {self.readings} readings, "
            f"{self.explained:.0%} explained, within {1e3 * self.sigma_m:.1f} mm>"
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WallPiece:
    """Stretch of a surveyed wall with one status."""

    ends: NDArray[np.float64]
    """Both ends, x and y in metres: shape (2, 2)."""
    status: Literal["observed", "implied", "conjectured"]
    """``"observed"`` by echoes of two sweeps or more, ``"implied"`` by the score, which is over 3 nats less without the
    stretch, or ``"conjectured"``: the readings hardly depend on it."""

    @property
    def length_m(self) -> float:
        """Length, metres."""
        return float(np.hypot(*(self.ends[1] - self.ends[0])))

    def __repr__(self) -> str:
        return f"<WallPiece {self.status}, {self.length_m:.3f} m>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SurveyedWall:
    """Wall of a surveyed room with its uncertainty."""

    id: str
    """Name of the wall in the scene."""
    ends: NDArray[np.float64]
    """Both ends, x and y in metres: shape (2, 2)."""
    covariances_m2: NDArray[np.float64]
    """Covariances of both ends, metres squared; ``nan`` for an end that is no corner: shape (2, 2, 2)."""
    sigma_across_m: float
    """Standard deviation of the position across the wall, at its middle, metres; ``nan`` if unknown."""
    sigma_direction_deg: float
    """Standard deviation of the direction, degrees; ``nan`` if unknown."""
    evidence_nats: float
    """Loss of score without the wall, nats."""
    pieces: tuple[WallPiece, ...]
    """Stretches by status, from the first end to the second."""

    def length_m(self, status: Literal["observed", "implied", "conjectured"] | None = None) -> float:
        """Length of all stretches of a status, by default of the wall, metres."""
        return sum((piece.length_m for piece in self.pieces if status in (None, piece.status)), 0.0)

    def __repr__(self) -> str:
        return f"<SurveyedWall '{self.id}': {self.length_m():.3f} m, {self.length_m('observed'):.3f} m observed>"


@dataclass(frozen=True, slots=True, repr=False)
class SurveyedPost:
    """Upright cylinder of a surveyed room, such as a table leg, with its uncertainty."""

    id: str
    """Name of the post in the scene."""
    center: tuple[float, float]
    """Axis, x and y in metres."""
    radius_m: float
    """Radius, metres."""
    sigma_m: tuple[float, float]
    """Standard deviations of x and y of the axis, metres; ``nan`` if unknown."""
    sigma_radius_m: float
    """Standard deviation of the radius, metres; ``nan`` if unknown."""
    evidence_nats: float
    """Loss of score without the post, nats."""
    sweeps: int
    """Number of sweeps with a direct echo of the post."""
    status: Literal["observed", "conjectured"]
    """``"observed"`` if direct echoes of two sweeps or more determine it to 1 cm and the score is over 10 nats less without it,
    otherwise ``"conjectured"``: not in the scene unless ``closed``."""

    def __repr__(self) -> str:
        x, y = self.center
        return f"<SurveyedPost '{self.id}': ({x:.3f}, {y:.3f}) m, radius {self.radius_m:.3f} m, {self.status}>"


@dataclass(frozen=True, slots=True, repr=False)
class FittedNumber:
    """Number of sensor or air, fitted together with a surveyed plan."""

    name: str
    """Name, as of the estimates of ``calibrate``."""
    value: float
    """Estimate, in the unit of the name."""
    sigma: float
    """Standard deviation."""
    interval: tuple[float, float]
    """Ends of the 95 % interval."""
    assumed: float
    """Assumed value, the mean of the prior."""
    assumed_sigma: float
    """Standard deviation of the prior."""
    is_determined: bool
    """The readings determine the number to less than half the standard deviation of its prior."""
    coupled_with: tuple[str, ...]
    """Names of other numbers that can hardly be separated from it (correlation above 0.95)."""

    def __repr__(self) -> str:
        remark = "" if self.is_determined else ", not determined"
        return f"<FittedNumber '{self.name}': {self.value:.4g} ± {self.sigma:.2g}{remark}>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AlternativePlan:
    """Floor plan that explains the readings nearly as well as the best one."""

    walls: NDArray[np.float64]
    """Both ends of each wall, x and y in metres: shape (walls, 2, 2)."""
    score_difference: float
    """Score relative to that of the best plan, nats."""
    probability: float
    """Probability among the best plan and all alternatives, 0 to 1."""

    def __repr__(self) -> str:
        return f"<AlternativePlan: {len(self.walls)} walls, probability {self.probability:.3f}>"


@dataclass(frozen=True, slots=True)
class UnexplainedArc:
    """Neighbouring echoes of equal range that the plan does not explain."""

    sweep: int
    """Index of the sweep."""
    azimuth_deg: float
    """Azimuth of the middle, degrees from the heading."""
    range_m: float
    """Range, metres."""
    beams: int
    """Number of beams."""


@dataclass(frozen=True, slots=True, eq=False)
class ResolvedPart:
    """Possible difference from the best plan that a view resolves."""

    kind: Literal["wall", "gap", "post", "alternative", "unexplained_arcs"]
    """A stretch of wall or a post that may be absent, walls at free ends that may be present, another plan, or one that was not
    found: arcs that none explains."""
    name: str | None
    """Name of the wall or post."""
    ends: NDArray[np.float64]
    """Both ends of the stretch or of each wall that may be present, x and y in metres: shape (walls, 2, 2)."""
    alternative: int | None
    """Index among the alternatives."""
    probability: float
    """Probability of the plan with that difference, 0 to 1."""
    share: float
    """Share of the gain of the view, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class NextView:
    """Pose of a full turn, or of a round of an array, that resolves most of what is open."""

    pose: NDArray[np.float64]
    """Place, x and y in metres, and heading in degrees, which is irrelevant for a full turn."""
    gain_nats: float
    """Expected decrease of ``open_nats`` by the readings there, nats; 0 for a view chosen because of unexplained arcs."""
    resolves: tuple[ResolvedPart, ...]
    """Open parts that they resolve, the largest share first."""

    def __repr__(self) -> str:
        x, y, _ = self.pose
        return f"<NextView: ({x:.3f}, {y:.3f}) m, {self.gain_nats:.3f} nats>"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Survey:
    """Result of ``survey``."""

    scene: Scene
    """Floor plan with the poses ``stop-1``, ``stop-2``, ..., without conjectured stretches unless ``closed``."""
    poses: NDArray[np.float64]
    """Poses of the sweeps in the frame of the first one's odometry, x and y in metres, heading in degrees: shape
    (sweeps, 3)."""
    sigmas: NDArray[np.float64]
    """Standard deviations of the poses, 0 for the first, ``nan`` if unknown: shape (sweeps, 3)."""
    equivalent: tuple[NDArray[np.float64], ...]
    """Other poses of each sweep, from which the room looks alike: shapes (poses, 3)."""
    scans: tuple[str, ...]
    """Identifiers of the scans."""
    walls: tuple[SurveyedWall, ...]
    """Walls with their uncertainty and status."""
    posts: tuple[SurveyedPost, ...]
    """Posts with their uncertainty and status."""
    alternatives: tuple[AlternativePlan, ...]
    """Other plans within 10 nats, most probable first."""
    probability: float
    """Probability of the plan among the alternatives and itself, 0 to 1."""
    open_nats: float
    """Entropy of what the readings leave open, nats: of the plan, its alternatives, and the plan with a stretch, a post
    or a gap changed."""
    next_view: NextView | None
    """Pose of a further sweep that resolves most of it, ``None`` if nothing is open or no reachable place resolves anything."""
    score: float
    """Logarithm of the likelihood of the readings, less the price of walls and posts, nats."""
    end: Literal["complete", "unexplained_arcs", "budget", "cancelled"]
    """Reason why the search ended: all arcs are explained, or some remain although no change gains; the budget of
    ``max_scenes`` is spent, or the search was cancelled."""
    arcs: int
    """Number of arcs in all sweeps."""
    unexplained: tuple[UnexplainedArc, ...]
    """Arcs that the plan does not explain."""
    causes: tuple[tuple[Literal["first", "multiple", "edge", "no_range", "unexplained"], ...], ...]
    """Cause of each reading in order of azimuth, by sweep: one reflection, several, an edge, a predicted missing echo
    or minimum range, or none."""
    scored_scenes: int
    """Number of floor plans whose readings were predicted."""
    reflectance: float
    """Amplitude reflection coefficient of all walls, assumed or fitted."""
    fitted: tuple[FittedNumber, ...]
    """Numbers of sensor and air that were fitted."""
    sensor: Sensor | None
    """Sensor with the fitted numbers; ``None`` without a fit."""

    @classmethod
    def _from_dict(cls, found: dict[str, Any], scene: Scene, sensor: Sensor | None) -> Survey:
        poses = found["poses"]
        nothing = [None, None]
        sigmas = [[*(pose["sigma_m"] or nothing), pose["sigma_heading_deg"]] for pose in poses]
        return cls(
            scene=scene,
            poses=_pose_rows([pose["pose"] for pose in poses]),
            sigmas=np.array(sigmas, dtype=float),
            equivalent=tuple(_pose_rows(pose["equivalent"]) for pose in poses),
            scans=tuple(pose["scan"] for pose in poses),
            walls=tuple(_surveyed_wall(wall) for wall in found["walls"]),
            posts=tuple(_surveyed_post(post) for post in found["posts"]),
            alternatives=tuple(
                AlternativePlan(np.array(plan["walls"], dtype=float), plan["score_difference"], plan["probability"])
                for plan in found["alternatives"]
            ),
            probability=found["probability"],
            open_nats=found["open_nats"],
            next_view=None if found["next_view"] is None else _next_view(found["next_view"]),
            score=found["score"],
            end=found["end"],
            arcs=found["arcs"],
            unexplained=tuple(UnexplainedArc(arc["sweep"], arc["azimuth_deg"], arc["range_m"], arc["beams"]) for arc in found["unexplained"]),
            causes=tuple(tuple(causes) for causes in found["causes"]),
            scored_scenes=found["scored_scenes"],
            reflectance=found["reflectance"],
            fitted=tuple(_fitted_number(of) for of in (found["fitted"] or {"numbers": ()})["numbers"]),
            sensor=sensor,
        )

    def __repr__(self) -> str:
        explained = self.arcs - len(self.unexplained)
        return (
            f"<Survey of {len(self.poses)} sweeps: {len(self.walls)} walls, {explained} of {self.arcs} arcs explained, "
            f"{self.end.replace('_', ' ')}>"
        )


def _pose_rows(poses: list[dict[str, float]]) -> NDArray[np.float64]:
    rows = [[pose["x_m"], pose["y_m"], pose["heading_deg"]] for pose in poses]
    return np.array(rows, dtype=float).reshape(-1, 3)


def _fitted_number(of: dict[str, Any]) -> FittedNumber:
    low, high = of["interval"]
    return FittedNumber(**(of | {"interval": (low, high), "coupled_with": tuple(of["coupled_with"])}))


def _next_view(view: dict[str, Any]) -> NextView:
    return NextView(_pose_rows([view["pose"]])[0], view["gain_nats"], tuple(_resolved_part(part) for part in view["resolves"]))


def _resolved_part(part: dict[str, Any]) -> ResolvedPart:
    walls = [[part["from_m"], part["to_m"]]] if part["kind"] == "wall" else part.get("walls", [])
    return ResolvedPart(
        kind=part["kind"],
        name=part.get("wall", part.get("post")),
        ends=np.array(walls, dtype=float).reshape(-1, 2, 2),
        alternative=part["number"] - 1 if part["kind"] == "alternative" else None,
        probability=part["probability"],
        share=part["share"],
    )


def _surveyed_post(post: dict[str, Any]) -> SurveyedPost:
    x_m, y_m = post["center_m"]
    sigma_x_m, sigma_y_m = post["sigma_m"] or [np.nan] * 2
    sigma_radius_m = np.nan if post["sigma_radius_m"] is None else post["sigma_radius_m"]
    return SurveyedPost(
        id=post["id"],
        center=(x_m, y_m),
        radius_m=post["radius_m"],
        sigma_m=(sigma_x_m, sigma_y_m),
        sigma_radius_m=sigma_radius_m,
        evidence_nats=post["evidence_nats"],
        sweeps=post["sweeps"],
        status=post["status"],
    )


def _surveyed_wall(wall: dict[str, Any]) -> SurveyedWall:
    ends = [wall["from"], wall["to"]]
    covariances = [end["covariance_m2"] or [np.nan] * 3 for end in ends]
    return SurveyedWall(
        id=wall["id"],
        ends=np.array([end["at_m"] for end in ends]),
        covariances_m2=np.array([[[xx, xy], [xy, yy]] for xx, xy, yy in covariances]),
        sigma_across_m=np.nan if wall["sigma_across_m"] is None else wall["sigma_across_m"],
        sigma_direction_deg=np.nan if wall["sigma_direction_deg"] is None else wall["sigma_direction_deg"],
        evidence_nats=wall["evidence_nats"],
        pieces=tuple(WallPiece(np.array([piece["from_m"], piece["to_m"]]), piece["status"]) for piece in wall["pieces"]),
    )
