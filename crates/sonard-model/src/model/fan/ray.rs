//! A single ray of the fan and its arrivals at the receiver.

use smallvec::SmallVec;

use super::Fan;
use crate::{
    acoustics::BeamPattern,
    geometry::{DVec2, wrap_pi},
    model::{
        Arrival, Diffractor, Edge, Interaction, Mechanism, Path, Reflector,
        raycast::{Hit, Reflectors},
    },
};

/// Distance from a wall's end, metres, within which a ray is dropped after the end has diffracted
/// it. The wall that it hits there is a matter of rounding, and its neighbours cover the
/// reflection.
const END_MARGIN_M: f64 = 1e-7;

/// Accuracy of the ray to the receiver's centre (or to an edge), metres, and the maximum number of
/// Newton steps: one without curved surfaces, three with them are usual.
const EXACT_M: f64 = 1e-12;
const MAX_STEPS: usize = 30;

/// A ray, at the last surface that it hit.
#[derive(Debug)]
pub(super) struct FanRay {
    origin: DVec2,
    direction: DVec2,
    departure_rad: f64,
    /// Length of the path so far, metres.
    travelled_m: f64,
    /// Product of the reflectances so far.
    gain: f64,
    /// Distance to the neighbouring ray per angle between them at departure, metres, and its growth
    /// per metre. Without curved surfaces the values are `travelled_m` and 1.
    width_m: f64,
    growth: f64,
    /// 1 as long as the neighbour to the left at departure is to the left, otherwise -1.
    handedness: f64,
    walls: SmallVec<[Reflector; 4]>,
}

/// A path to the receiver, before the beam pattern.
#[derive(Debug, Clone)]
pub(super) struct FanCandidate {
    pub(super) length_m: f64,
    /// Amplitude without the beam pattern.
    pub(super) gain: f64,
    pub(super) departure_rad: f64,
    pub(super) arrival_rad: f64,
    /// Distance at which the ray passed its target: the receiver's centre, or the edge.
    pub(super) miss_m: f64,
    /// Share of its half-length that the receiver segment must present to the ray for an arrival.
    pub(super) share: f64,
    /// Direction in which the ray itself leaves, radians.
    ray_departure_rad: f64,
    pub(super) key: PathKey,
}

/// Interactions of a path: reflectors, in order, and an optional edge.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct PathKey {
    reflectors: SmallVec<[Reflector; 4]>,
    edge: Option<Edge>,
}

impl FanRay {
    pub(super) fn new(origin: DVec2, departure_rad: f64) -> Self {
        Self {
            origin,
            direction: DVec2::from_angle(departure_rad),
            departure_rad,
            travelled_m: 0.0,
            gain: 1.0,
            width_m: 0.0,
            growth: 1.0,
            handedness: 1.0,
            walls: SmallVec::new(),
        }
    }

    pub(super) const fn travelled_m(&self) -> f64 {
        self.travelled_m
    }

    /// Traces the next leg: returns the arrival at a receiver at `position`, if the ray passes
    /// there, and the hit at the end of the leg, if any.
    pub(super) fn advance(
        &self,
        fan: &Fan,
        position: DVec2,
    ) -> (Option<FanCandidate>, Option<Hit>) {
        let leaving = self.walls.last().copied();
        let hit = fan.reflectors.nearest(self.origin, self.direction, leaving);
        let end_m = hit.map_or(f64::INFINITY, |hit| hit.distance_m);
        (self.receive(fan, position, end_m), hit)
    }

    /// Returns the arrival at the receiver, if the ray passes it on a leg that ends after `end_m`.
    ///
    /// The receiver is a segment across the azimuth as long as the face is wide plus the local
    /// spacing of the rays; `share` later decides whether the ray hits it at a given azimuth.
    fn receive(&self, fan: &Fan, position: DVec2, end_m: f64) -> Option<FanCandidate> {
        let to_center = position - self.origin;
        let foot_m = to_center.dot(self.direction);
        let target = self.aim(to_center);
        let (_, spacing_rad) = fan.settings.rays();
        let half_m = fan.settings.half_face_m + 0.5 * spacing_rad * target.width_m.abs();
        let outgoing = self.walls.is_empty();
        if outgoing || foot_m <= 0.0 || foot_m >= end_m || target.offset_m.abs() > half_m {
            return None;
        }
        let gain = self.gain * target.tube_gain() * fan.settings.through_air(target.length_m);
        if target.length_m > fan.settings.max_path_m || gain < fan.settings.min_amplitude {
            return None;
        }
        Some(FanCandidate {
            length_m: target.length_m,
            gain,
            departure_rad: self.departure_rad + self.handedness * target.departure_turn_rad(),
            arrival_rad: (-self.direction).to_angle() + target.arrival_turn_rad(),
            miss_m: target.offset_m.abs(),
            share: target.offset_m.abs() / half_m,
            ray_departure_rad: self.departure_rad,
            key: PathKey { reflectors: self.walls.clone(), edge: None },
        })
    }

    /// Diffracted rays from the ends of the wall that are within one ray spacing of the hit, each
    /// straight to the receiver if that is visible from there.
    pub(super) fn diffract(
        &self,
        hit: &Hit,
        fan: &Fan,
        position: DVec2,
    ) -> SmallVec<[FanCandidate; 2]> {
        let Reflector::Wall(wall) = hit.reflector else { return SmallVec::new() };
        fan.wall_ends.known[wall as usize]
            .iter()
            .filter_map(|&edge| self.diffract_at(edge, fan, position))
            .collect()
    }

    fn diffract_at(&self, edge: Edge, fan: &Fan, position: DVec2) -> Option<FanCandidate> {
        let settings = &fan.settings;
        let point = fan.reflectors.edge_point(edge);
        let target = self.aim(point - self.origin);
        let (_, spacing_rad) = settings.rays();
        if target.offset_m.abs() > spacing_rad * target.width_m.abs() {
            return None;
        }
        let back_m = position.distance(point);
        let length_m = target.length_m + back_m;
        let gain = self.gain
            * target.tube_gain()
            * fan.wall_ends.mirror[&edge]
            * settings.edge_ratio(target.length_m, back_m)
            * settings.through_air(length_m);
        let matters = length_m <= settings.max_path_m && gain >= settings.min_amplitude;
        if !matters || !fan.reflectors.sees(position, point) {
            return None;
        }
        Some(FanCandidate {
            length_m,
            gain,
            departure_rad: self.departure_rad + self.handedness * target.departure_turn_rad(),
            arrival_rad: (point - position).to_angle(),
            miss_m: target.offset_m.abs(),
            share: 0.0,
            ray_departure_rad: self.departure_rad,
            key: PathKey { reflectors: self.walls.clone(), edge: Some(edge) },
        })
    }

    /// Reflects the ray at a hit; returns `false` if the ray ends there.
    pub(super) fn reflect(&mut self, hit: &Hit, fan: &Fan) -> bool {
        let settings = &fan.settings;
        self.turn(hit, &fan.reflectors);
        let left = self.gain * settings.through_air(self.travelled_m);
        hit.from_end_m > END_MARGIN_M
            && self.walls.len() <= settings.max_order as usize
            && self.travelled_m <= settings.max_path_m
            && left >= settings.min_amplitude
    }

    fn turn(&mut self, hit: &Hit, reflectors: &Reflectors) {
        self.origin += hit.distance_m * self.direction;
        self.travelled_m += hit.distance_m;
        self.width_m += hit.distance_m * self.growth;
        self.gain *= reflectors.mirror(hit.reflector);
        if let Some(radius_m) = reflectors.radius_m(hit.reflector) {
            // Mirror equation for an oblique ray in the plane of incidence: the wave front's
            // curvature grows by 2 / (r cos i), and less from inside the cylinder.
            let toward = -self.direction.dot(hit.normal);
            self.growth += 2.0 * self.width_m / (radius_m * toward);
        }
        self.direction -= 2.0 * self.direction.dot(hit.normal) * hit.normal;
        self.handedness = -self.handedness;
        self.walls.push(hit.reflector);
    }

    /// Traces the ray that leaves `origin` in a direction over these reflectors, with walls as
    /// infinite lines. Returns it at the last of them, with the points of reflection; `None` if it
    /// misses a cylinder.
    fn over(
        origin: DVec2,
        departure_rad: f64,
        surfaces: &[Reflector],
        reflectors: &Reflectors,
    ) -> Option<(Self, Vec<DVec2>)> {
        let mut ray = Self::new(origin, departure_rad);
        let mut points = Vec::with_capacity(surfaces.len() + 1);
        for &reflector in surfaces {
            ray.turn(&reflectors.intersect(ray.origin, ray.direction, reflector)?, reflectors);
            points.push(ray.origin);
        }
        Some((ray, points))
    }

    /// Returns the neighbouring ray that passes exactly through a point at `run` from the origin.
    fn aim(&self, run: DVec2) -> Aim {
        let foot_m = run.dot(self.direction);
        let offset_m = self.direction.perp_dot(run);
        let width_m = self.width_m + self.growth * foot_m;
        // Radius of curvature of the wave front; its centre is the image of the source.
        let radius_m = width_m / self.growth;
        let slack_m = radius_m.signum() * radius_m.hypot(offset_m) - radius_m;
        let ray_m = self.travelled_m + foot_m;
        Aim { length_m: ray_m + slack_m, ray_m, offset_m, width_m, radius_m }
    }
}

struct Aim {
    /// Length from the source to the point, metres.
    length_m: f64,
    /// Length from the source along the ray itself to the foot of the perpendicular from the point,
    /// metres.
    ray_m: f64,
    /// Distance of the point from the ray, positive to the left, metres.
    offset_m: f64,
    width_m: f64,
    radius_m: f64,
}

impl Aim {
    /// Amplitude relative to a wave over flat walls only, which spreads over `ray_m` in the plane
    /// instead of `width_m`.
    fn tube_gain(&self) -> f64 {
        (self.ray_m / self.width_m.abs().max(1e-3)).sqrt()
    }

    fn departure_turn_rad(&self) -> f64 {
        (self.offset_m / self.width_m).atan()
    }

    fn arrival_turn_rad(&self) -> f64 {
        (self.offset_m / self.radius_m).atan()
    }
}

impl FanCandidate {
    /// Returns the arrival at a ranger at `position`, with its amplitude at some azimuth.
    pub(super) fn arrival(&self, fan: &Fan, position: DVec2, amplitude: f64) -> Arrival {
        Arrival {
            length_m: self.length_m,
            amplitude,
            path_amplitude: self.gain,
            phase_rad: 0.0,
            departure_rad: wrap_pi(self.departure_rad),
            arrival_rad: wrap_pi(self.arrival_rad),
            path: self.path(&fan.reflectors, position),
        }
    }

    /// Path of the neighbouring ray that this candidate represents. By way of cylinders, where the
    /// length comes from the curvature of the front, the points are more exact than the length.
    /// Where the neighbour passes a corner on its other side, a point lies slightly beyond the end
    /// of its wall. Where the neighbour that would return misses the cylinder (13 of a thousand in
    /// the shipped scenes), the last ray that hit it is used, and the last leg does not obey the
    /// law of reflection.
    fn path(&self, reflectors: &Reflectors, position: DVec2) -> Path {
        let diffractor = self.key.edge.map(|edge| (edge, reflectors.edge_point(edge)));
        let end = diffractor.map_or(position, |(_, point)| point);
        let over =
            |leaves_rad| FanRay::over(position, leaves_rad, &self.key.reflectors, reflectors);
        let mut leaves_rad = self.ray_departure_rad;
        let mut points = Vec::new();
        let mut turn_rad = 0.0;
        for _ in 0..MAX_STEPS {
            let Some((ray, reflected)) = over(leaves_rad + turn_rad) else {
                turn_rad *= 0.5;
                continue;
            };
            points = reflected;
            leaves_rad += turn_rad;
            let aim = ray.aim(end - ray.origin);
            if aim.offset_m.abs() < EXACT_M {
                break;
            }
            turn_rad = ray.handedness * aim.departure_turn_rad();
        }
        let reflections =
            self.key.reflectors.iter().copied().map(Mechanism::Reflection).zip(points);
        let diffractor = diffractor
            .map(|(edge, point)| (Mechanism::Diffraction(Diffractor::Upright(edge)), point));
        let interaction = |(mechanism, point)| Interaction { mechanism, point, z_m: None };
        Path { interactions: reflections.chain(diffractor).map(interaction).collect() }
    }

    pub(super) fn weighing(&self) -> Weighing {
        Weighing {
            length_m: self.length_m,
            gain: self.gain,
            share: self.share,
            departure: DVec2::from_angle(self.departure_rad),
            arrival: DVec2::from_angle(self.arrival_rad),
        }
    }
}

/// Data of a candidate that are needed to weight it with the beam pattern.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weighing {
    pub(super) length_m: f64,
    gain: f64,
    share: f64,
    departure: DVec2,
    arrival: DVec2,
}

impl Weighing {
    /// Amplitude at a transducer that points in this direction; 0 if the ray does not hit its face.
    pub(super) fn amplitude(&self, beam: &BeamPattern, facing: DVec2) -> f64 {
        let arriving = facing.dot(self.arrival);
        // The segment turns with the transducer: seen at an angle it is shorter. Nothing leaves or
        // arrives behind it.
        if arriving <= self.share || facing.dot(self.departure) <= 0.0 {
            return 0.0;
        }
        let one_way = |end: DVec2| beam.one_way(facing.perp_dot(end).atan2(facing.dot(end)));
        self.gain * one_way(self.departure) * one_way(self.arrival)
    }
}
