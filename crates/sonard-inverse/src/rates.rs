//! What could have been reported of each firing, and how that moves with the parameters.

use std::{
    cell::LazyCell,
    collections::{HashMap, hash_map::Entry},
};

use smallvec::SmallVec;
use sonard_model::{
    acoustics::{BeamPattern, Receiver},
    geometry::{DVec2, Pose, wrap_360, wrap_pi},
    model::{Arrival, Mechanism, ObservationPoint, Reflector, Simulator, TooCostly, receiver},
    scene::Scene,
};

use crate::{
    bearing::Bearing,
    candidates::{Candidate, Candidates, Listener, Phases, SPAN_DB},
    judged::{Judged, Possible, Rates},
    motion::{Motion, length_rate},
    parameter::Parameter,
    sweep::{Beam, Sweep},
    world::World,
};

/// Step of the directions that turned sweeps share, degrees.
const GRID_DEG: f64 = 0.5;
/// Natural logarithm of how much wider and narrower a band is tried, for the difference: so much that the steps of a pulse's table
/// do not show.
const BY_BAND: f64 = 0.02;

/// Predicts sweeps in a world, with what they gain for each unit of the parameters.
pub(crate) struct RateFinder<'a> {
    world: &'a World,
    parameters: &'a [&'a Parameter],
    /// By parameter, what moves whichever way the transducer looks.
    steady: Vec<Option<Motion>>,
    /// By parameter, the beam pattern slightly changed by it, if it is about the beam, and by how much.
    changed_beams: Vec<Option<(BeamPattern, f64)>>,
    /// Receivers with a slightly narrower and a slightly wider band, if that is a parameter.
    other_bands: Option<[Receiver; 2]>,
    reference_m_s: f64,
    phases: Phases,
    /// Thresholds that are looked at, decibels to both sides of the nominal one.
    span_db: f64,
}

/// A firing.
struct Firing<'a> {
    simulator: &'a Simulator,
    /// Where the stepper says it points, degrees.
    azimuth_deg: f64,
    /// Where the stepper's axis is.
    axis: DVec2,
    direction_rad: f64,
    /// Transmitter and receiver.
    ends: [DVec2; 2],
}

impl<'a> RateFinder<'a> {
    /// Ranges are in metres at `reference_m_s`.
    pub(crate) fn new(
        world: &'a World,
        parameters: &'a [&'a Parameter],
        reference_m_s: f64,
        phases: Phases,
    ) -> Self {
        let steady = parameters.iter().map(|parameter| world.steady_motion(parameter)).collect();
        let changed = |parameter: &&Parameter| changed_beam(world, parameter);
        let changed_beams = parameters.iter().map(changed).collect();
        Self {
            world,
            parameters,
            steady,
            changed_beams,
            other_bands: other_bands(world, parameters),
            reference_m_s,
            phases,
            span_db: SPAN_DB,
        }
    }

    /// The same for thresholds that vary by a standard deviation in decibels and are not changed: what only others
    /// would report is left out.
    pub(crate) fn with_threshold_spread(self, sigma_db: f64) -> Self {
        /// Beyond so many standard deviations there is less than 1e-23.
        const SIGMAS: f64 = 10.0;
        Self { span_db: SPAN_DB.min(SIGMAS * sigma_db), ..self }
    }

    /// How many parameters there are.
    pub(crate) const fn parameters(&self) -> usize {
        self.parameters.len()
    }

    /// The firings of the sweep with this number.
    pub(crate) fn sweep(
        &self,
        simulator: &Simulator,
        point: &ObservationPoint,
        number: usize,
        sweep: &Sweep,
        pose: &Pose,
    ) -> Result<Vec<Judged>, TooCostly> {
        let listener = Listener::new(simulator.receiver(), self.phases, self.span_db);
        let concerns = |parameter: &Parameter| parameter.sweep().is_none_or(|of| of == number);
        let all = self.parameters.iter().zip(0u32..);
        let concerning: Vec<u32> =
            all.filter(|(parameter, _)| concerns(parameter)).map(|(_, at)| at).collect();
        let mut judged = Vec::with_capacity(sweep.beams.len());
        for beam in &sweep.beams {
            let direction_rad = self.world.direction_rad(pose, beam.azimuth_deg);
            let firing = Firing::new(simulator, pose, direction_rad, beam);
            let possible = self.all_possible(&listener, point, &firing, &concerning)?;
            judged.push(Judged { heard_m: beam.heard.range_m(self.reference_m_s), possible });
        }
        Ok(judged)
    }

    /// What each beam of a sweep could have been after turns by so many degrees, up to half a step of [`GRID_DEG`]:
    /// directions are predicted once for all beams that come to look there. A robot's body stays as it stands.
    pub(crate) fn turned(
        &self,
        simulator: &Simulator,
        point: &ObservationPoint,
        sweep: &Sweep,
        pose: &Pose,
        turns_deg: &[f64],
    ) -> Result<Vec<Vec<Judged>>, TooCostly> {
        let listener = Listener::new(simulator.receiver(), self.phases, self.span_db);
        let all: Vec<u32> = (0..self.parameters.len() as u32).collect();
        let mut known: HashMap<i64, SmallVec<[Possible; 2]>> = HashMap::new();
        let mut judged = |beam: &Beam, by_deg: f64| {
            let direction_rad = self.world.direction_rad(pose, beam.azimuth_deg);
            let place = (wrap_360(direction_rad.to_degrees() + by_deg) / GRID_DEG).round() as i64;
            let possible = match known.entry(place) {
                Entry::Occupied(known) => known.get().clone(),
                Entry::Vacant(unknown) => {
                    let direction_rad = (place as f64 * GRID_DEG).to_radians();
                    let firing = Firing::new(simulator, pose, direction_rad, beam);
                    let possible = self.all_possible(&listener, point, &firing, &all)?;
                    unknown.insert(possible).clone()
                }
            };
            Ok(Judged { heard_m: beam.heard.range_m(self.reference_m_s), possible })
        };
        let mut turned =
            |by_deg: &f64| sweep.beams.iter().map(|beam| judged(beam, *by_deg)).collect();
        turns_deg.iter().map(&mut turned).collect()
    }

    fn all_possible(
        &self,
        listener: &Listener,
        point: &ObservationPoint,
        firing: &Firing,
        concerning: &[u32],
    ) -> Result<SmallVec<[Possible; 2]>, TooCostly> {
        let mut found = Candidates::new();
        listener.candidates(point, firing.direction_rad, &mut found)?;
        Ok(found.iter().map(|candidate| self.possible(candidate, firing, concerning)).collect())
    }

    fn possible(&self, candidate: &Candidate, firing: &Firing, concerning: &[u32]) -> Possible {
        let stretch = self.stretch(firing);
        let beside =
            candidate.arrival.as_ref().and_then(|arrival| self.beside_axis(arrival, firing));
        let (longer_m, louder_db) = beside.unwrap_or_default();
        let range_m = candidate
            .range_m
            .map(|range_m| stretch * (range_m + 0.5 * longer_m) + self.world.delay_m);
        let (mut range_rates, mut until_rates) = (Rates::new(), Rates::new());
        if let (Some(arrival), Some(predicted_m)) = (&candidate.arrival, candidate.range_m) {
            // A threshold alone, as turned sweeps are asked about, needs none.
            let flanks = LazyCell::new(|| Flanks::of(arrival, firing));
            for &at in concerning {
                let told = (predicted_m, candidate.margin_db);
                let (by_range, by_db) = self.rates(at, arrival, told, firing, &flanks);
                range_rates.extend((by_range != 0.0).then_some((at, by_range)));
                until_rates.extend((by_db != 0.0).then_some((at, by_db)));
            }
        }
        Possible {
            range_m,
            range_rates,
            until_db: candidate.until_db + louder_db,
            until_rates,
            spread_db: candidate.spread_db,
            further_reflections: candidate.arrival.as_ref().map_or(0.0, further_reflections),
            walk_m_per_db: stretch * candidate.walk_m_per_db,
        }
    }

    /// What an arrival's range and its margin above the threshold, which are told as they are, gain with a parameter, metres and
    /// decibels for each unit.
    fn rates(
        &self,
        at: u32,
        arrival: &Arrival,
        (predicted_m, margin_db): (f64, f64),
        firing: &Firing,
        flanks: &LazyCell<Flanks, impl FnOnce() -> Flanks>,
    ) -> (f64, f64) {
        let parameter = self.parameters[at as usize];
        let turning = match &self.steady[at as usize] {
            Some(_) => None,
            None => self.world.turning_motion(parameter, firing.direction_rad, firing.azimuth_deg),
        };
        let motion = self.steady[at as usize].as_ref().or(turning.as_ref());
        let longer_m =
            motion.map_or(0.0, |motion| firing.length_rate(arrival, firing.ends, motion));
        let louder_db = motion.map_or(0.0, |motion| flanks.rate_db(firing, motion));
        match parameter {
            Parameter::SoundSpeed => (-self.stretch(firing) * predicted_m, 0.0),
            Parameter::Delay => (1.0, 0.0),
            Parameter::Bandwidth => (self.stretch(firing) * self.earlier_m(margin_db), 0.0),
            Parameter::ThresholdRise => (0.0, -predicted_m),
            _ => (
                0.5 * self.stretch(firing) * longer_m,
                louder_db + self.margin_rate(at, arrival, firing, flanks),
            ),
        }
    }

    /// What the range of a lone echo gains with the width of the band: its pulse rises faster, so that it is less late. How far it
    /// reaches above the threshold is by its peak, which stays.
    fn earlier_m(&self, margin_db: f64) -> f64 {
        self.other_bands.as_ref().map_or(0.0, |bands| {
            let [narrower_m, wider_m] = bands.each_ref().map(|of| of.time_walk_m(margin_db));
            (wider_m - narrower_m) / (2.0 * BY_BAND)
        })
    }

    /// What a predicted range is longer at the speed of sound that ranges are told at.
    fn stretch(&self, firing: &Firing) -> f64 {
        self.reference_m_s / firing.simulator.sound_speed_m_s()
    }

    /// What a path from the axis gains where the face is beside it: in length, to first order, and by the beam pattern in
    /// the directions in which it leaves and comes then, decibels. `None` where it was found from the face.
    fn beside_axis(&self, arrival: &Arrival, firing: &Firing) -> Option<(f64, f64)> {
        let mounting = &self.world.sensor.mounting;
        if mounting.is_on_axis() || !firing.simulator.sensor().mounting.is_on_axis() {
            return None;
        }
        let places = mounting.places(DVec2::ZERO, firing.direction_rad);
        let motion = Motion { transducer: places, ..Motion::default() };
        let ends = [firing.axis; 2];
        let scene = firing.simulator.scene();
        let louder_db = |(weights, off_rad): ([f64; 2], f64)| {
            let turn_rad = Bearing::new(arrival, ends, scene, weights)?.rate(scene, &motion);
            Some(level_db(firing.simulator.beam(), off_rad, off_rad + turn_rad))
        };
        let both = [[1.0, 0.0], [0.0, 1.0]].into_iter().zip(firing.off_rad(arrival));
        let louder_db: Option<f64> = both.map(louder_db).sum();
        Some((firing.length_rate(arrival, ends, &motion), louder_db.unwrap_or(0.0)))
    }

    /// What an arrival's margin above the threshold gains, decibels for each unit. That a stronger echo is also a little
    /// earlier (time walk) is in the predictions and not in the rates: where several arrivals overlap they are not
    /// known so well that tenths of a millimetre could be believed. See [`Curve::walk`](crate::linear::Curve).
    fn margin_rate(
        &self,
        at: u32,
        arrival: &Arrival,
        firing: &Firing,
        flanks: &LazyCell<Flanks, impl FnOnce() -> Flanks>,
    ) -> f64 {
        match self.parameters[at as usize] {
            Parameter::Heading(_) | Parameter::HeadingZero => flanks.turned_db(1f64.to_radians()),
            Parameter::Gear => flanks.turned_db(firing.azimuth_deg.to_radians()),
            Parameter::Threshold => -1.0,
            Parameter::Aperture | Parameter::Skirts => {
                self.changed_beams[at as usize].as_ref().map_or(0.0, |(pattern, by)| {
                    let gain = |off_rad| {
                        amplitude(pattern, off_rad) / amplitude(firing.simulator.beam(), off_rad)
                    };
                    20.0 * firing.off_rad(arrival).map(gain).iter().product::<f64>().log10() / by
                })
            }
            parameter => material_rate_db(parameter, firing.simulator.scene(), arrival),
        }
    }
}

impl<'a> Firing<'a> {
    fn new(simulator: &'a Simulator, pose: &Pose, direction_rad: f64, beam: &Beam) -> Self {
        let axis = pose.position();
        let ends = simulator.sensor().mounting.places(axis, direction_rad);
        Self { simulator, azimuth_deg: beam.azimuth_deg, axis, direction_rad, ends }
    }

    /// Beside its axis, the directions in which an arrival leaves and comes, radians.
    fn off_rad(&self, arrival: &Arrival) -> [f64; 2] {
        [arrival.departure_rad, arrival.arrival_rad].map(|end| wrap_pi(end - self.direction_rad))
    }

    fn length_rate(&self, arrival: &Arrival, ends: [DVec2; 2], motion: &Motion) -> f64 {
        let z_m = self.simulator.sensor_z_m().unwrap_or(0.0);
        length_rate(arrival, ends, z_m, self.simulator.scene(), motion)
    }
}

/// What an arrival's level gains with the directions in which it leaves and comes.
struct Flanks {
    /// Of the beam pattern, decibels a radian, at departure and arrival.
    db_per_rad: [f64; 2],
    bearing: Option<Bearing>,
}

impl Flanks {
    fn of(arrival: &Arrival, firing: &Firing) -> Self {
        // Over half a degree to both sides, and no steeper than a main lobe's flank: a null is steeper, but what is
        // heard there is the sum of several arrivals.
        const BY_RAD: f64 = 0.01;
        const STEEPEST_DB_PER_RAD: f64 = 125.0;
        let pattern = firing.simulator.beam();
        let [leaves_rad, comes_rad] = firing.off_rad(arrival);
        let flank = |off_rad: f64| {
            let by_db = level_db(pattern, off_rad - BY_RAD, off_rad + BY_RAD);
            (by_db / (2.0 * BY_RAD)).clamp(-STEEPEST_DB_PER_RAD, STEEPEST_DB_PER_RAD)
        };
        let leaves = flank(leaves_rad);
        let comes = if comes_rad == leaves_rad { leaves } else { flank(comes_rad) };
        let db_per_rad = [leaves, comes];
        let scene = firing.simulator.scene();
        let bearing = Bearing::new(arrival, firing.ends, scene, db_per_rad);
        Self { db_per_rad, bearing }
    }

    /// What the level gains where the transducer turns by so much, decibels.
    fn turned_db(&self, turn_rad: f64) -> f64 {
        -turn_rad * self.db_per_rad.iter().sum::<f64>()
    }

    /// What it gains where transducer and scene move, decibels.
    fn rate_db(&self, firing: &Firing, motion: &Motion) -> f64 {
        let bearing = self.bearing.as_ref();
        bearing.map_or(0.0, |bearing| bearing.rate(firing.simulator.scene(), motion))
    }
}

/// Mirror reflections of an arrival after its first.
fn further_reflections(arrival: &Arrival) -> f64 {
    arrival.path.order().saturating_sub(1) as f64
}

/// The beam pattern slightly changed by a parameter, if it is about the beam, and by how much.
fn changed_beam(world: &World, parameter: &Parameter) -> Option<(BeamPattern, f64)> {
    let by = match parameter {
        Parameter::Aperture => 0.01,
        // Downwards, where there is always room.
        Parameter::Skirts => -0.1,
        _ => return None,
    };
    let changed = world.changed(&[(parameter, by)]).ok()?;
    Some((BeamPattern::new(&changed.sensor, changed.air.sound_speed_m_s()), by))
}

/// Receivers with a slightly narrower and a slightly wider band, if that is a parameter.
fn other_bands(world: &World, parameters: &[&Parameter]) -> Option<[Receiver; 2]> {
    let parameter = parameters.iter().find(|of| ***of == Parameter::Bandwidth)?;
    let with_band = |by: f64| {
        let changed = world.changed(&[(*parameter, by)]).ok()?;
        Some(receiver(&changed.sensor, &changed.air, &changed.options))
    };
    Some([with_band(-BY_BAND)?, with_band(BY_BAND)?])
}

/// What a beam pattern's level gains from one direction beside its axis to another, decibels.
fn level_db(pattern: &BeamPattern, from_rad: f64, to_rad: f64) -> f64 {
    let [from, to] = [from_rad, to_rad].map(|off_rad| amplitude(pattern, wrap_pi(off_rad)));
    20.0 * (to / from).log10()
}

/// Of a beam pattern, beside its axis; so much that it has a level.
fn amplitude(pattern: &BeamPattern, off_rad: f64) -> f64 {
    pattern.one_way(off_rad).max(1e-6)
}

/// What the strength of an arrival gains with a parameter of a material, decibels for each unit; 0 for others.
pub(crate) fn material_rate_db(parameter: &Parameter, scene: &Scene, arrival: &Arrival) -> f64 {
    /// Where a material hardly mirrors or scatters, a little more is many decibels, which no step would hold.
    const LEAST_SHARE: f64 = 0.02;
    let (Parameter::Reflectance(name) | Parameter::Roughness(name)) = parameter else { return 0.0 };
    let Some(material) = scene.materials.get(name) else { return 0.0 };
    let [by_mirror, by_scattering] = match parameter {
        // Both have shares of the same energy, which are roots in the amplitude.
        Parameter::Roughness(_) => {
            let scattered = material.roughness;
            [-0.5 / (1.0 - scattered).max(LEAST_SHARE), 0.5 / scattered.max(LEAST_SHARE)]
        }
        _ => [1.0, 1.0],
    };
    let of_wall = |wall: u32| scene.walls.get(wall as usize).map(|wall| wall.material);
    let rate = |mechanism: Mechanism| {
        let (of, rate) = match mechanism {
            Mechanism::Reflection(Reflector::Wall(wall)) => (of_wall(wall), by_mirror),
            Mechanism::Reflection(Reflector::Cylinder(cylinder)) => {
                (scene.cylinders.get(cylinder as usize).map(|of| of.material), by_mirror)
            }
            Mechanism::Reflection(Reflector::Floor) => (Some(scene.floor_material), by_mirror),
            Mechanism::Reflection(Reflector::Ceiling) => (Some(scene.ceiling_material), by_mirror),
            Mechanism::Scattering { wall } => (of_wall(wall), by_scattering),
            Mechanism::Diffraction(_) | Mechanism::Transducer => (None, 0.0),
        };
        if of == Some(*material) { rate } else { 0.0 }
    };
    20.0 * std::f64::consts::LOG10_E * arrival.path.mechanisms().map(rate).sum::<f64>()
}
