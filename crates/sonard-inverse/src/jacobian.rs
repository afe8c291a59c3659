//! Candidate readings of each firing, with their Jacobian.

mod firing;
mod path_jacobian;

use std::{
    cell::LazyCell,
    collections::{HashMap, hash_map::Entry},
};

use smallvec::SmallVec;
use sonard_model::{
    acoustics::{BeamPattern, Receiver},
    geometry::{DVec2, Pose, wrap_360},
    model::{
        Arrival, Mechanism, ObservationPoint, Path, Reflector, Simulator, TooCostly, receiver,
    },
    scene::{MaterialProperty, Scene},
};

use self::{
    firing::{FiringGeometry, PatternSlopes, amplitude, level_db},
    path_jacobian::{PathCache, PathDerivative, PathJacobian},
};
use crate::{
    candidates::{CandidateList, Phases, SPAN_DB, ThresholdCandidate, ThresholdScan},
    likelihood_terms::{CandidateReading, ReadingModel, SparseRow},
    motion::SceneMotion,
    parameter::Parameter,
    sweep::{FitSweep, RangeOutcome, SweepFiring},
    time_walk::TimeWalk,
    world::World,
};

/// Angular grid shared by rotated sweeps, degrees.
const GRID_DEG: f64 = 0.5;
/// Bandwidth change of the central difference, natural logarithm: large enough to hide the steps of
/// the pulse table.
const BY_BAND: f64 = 0.02;

/// Predicts sweeps in a world with their derivatives by the parameters.
pub(crate) struct JacobianBuilder<'a> {
    world: &'a World,
    parameters: &'a [&'a Parameter],
    /// Motion that is independent of the beam direction, by parameter.
    steady: Vec<Option<SceneMotion>>,
    /// Beam pattern after a small change, and the change, by parameter of the beam.
    changed_beams: Vec<Option<(BeamPattern, f64)>>,
    /// Time walk with a slightly narrower and a slightly wider band, if that is a parameter.
    other_bands: Option<[TimeWalk; 2]>,
    reference_m_s: f64,
    phases: Phases,
    /// Range of thresholds scanned, decibels on either side of the nominal one.
    span_db: f64,
}

impl<'a> JacobianBuilder<'a> {
    /// Predictor for the world; ranges are in metres at `reference_m_s`.
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

    /// Limits the scan to thresholds within the given standard deviation in decibels, for
    /// evaluation without a change of the threshold.
    pub(crate) fn with_threshold_spread(self, sigma_db: f64) -> Self {
        /// The probability beyond so many standard deviations is below 2e-12.
        const SIGMAS: f64 = 7.0;
        Self { span_db: SPAN_DB.min(SIGMAS * sigma_db), ..self }
    }

    /// Number of parameters.
    pub(crate) const fn parameters(&self) -> usize {
        self.parameters.len()
    }

    /// Readings of a sweep with their candidates; `number` is its index.
    pub(crate) fn sweep(
        &self,
        simulator: &Simulator,
        point: &ObservationPoint,
        number: usize,
        sweep: &FitSweep,
        pose: &Pose,
    ) -> Result<Vec<ReadingModel>, TooCostly> {
        let listener = ThresholdScan::new(simulator.receiver(), self.phases, self.span_db);
        let concerns = |parameter: &Parameter| parameter.sweep().is_none_or(|of| of == number);
        let all = self.parameters.iter().zip(0u32..);
        let concerning: Vec<u32> =
            all.filter(|(parameter, _)| concerns(parameter)).map(|(_, at)| at).collect();
        let mut known = PathCache::new(self, concerning);
        let mut readings = Vec::with_capacity(sweep.beams.len());
        for beam in &sweep.beams {
            let direction_rad = self.world.direction_rad(pose, beam.azimuth_deg);
            let firing = FiringGeometry::new(simulator, pose, direction_rad, beam);
            let possible = self.all_possible(&listener, point, &firing, &mut known)?;
            readings.push(ReadingModel {
                measured: beam.outcome.outcome(self.reference_m_s),
                possible,
            });
        }
        Ok(readings)
    }

    /// Readings of a sweep after each of some rotations, rounded to [`GRID_DEG`]: each direction is
    /// predicted once for all beams. The robot's body is not rotated.
    pub(crate) fn turned(
        &self,
        simulator: &Simulator,
        point: &ObservationPoint,
        sweep: &FitSweep,
        pose: &Pose,
        turns_deg: &[f64],
    ) -> Result<Vec<Vec<ReadingModel>>, TooCostly> {
        let listener = ThresholdScan::new(simulator.receiver(), self.phases, self.span_db);
        let all: Vec<u32> = (0..self.parameters.len() as u32).collect();
        let mut paths = PathCache::new(self, all);
        let mut known: HashMap<i64, SmallVec<[CandidateReading; 2]>> = HashMap::new();
        let mut readings = |beam: &SweepFiring, by_deg: f64| {
            let direction_rad = self.world.direction_rad(pose, beam.azimuth_deg);
            let place = (wrap_360(direction_rad.to_degrees() + by_deg) / GRID_DEG).round() as i64;
            let possible = match known.entry(place) {
                Entry::Occupied(known) => known.get().clone(),
                Entry::Vacant(unknown) => {
                    let direction_rad = (place as f64 * GRID_DEG).to_radians();
                    let firing = FiringGeometry::new(simulator, pose, direction_rad, beam);
                    let possible = self.all_possible(&listener, point, &firing, &mut paths)?;
                    unknown.insert(possible).clone()
                }
            };
            Ok(ReadingModel { measured: beam.outcome.outcome(self.reference_m_s), possible })
        };
        let mut turned =
            |by_deg: &f64| sweep.beams.iter().map(|beam| readings(beam, *by_deg)).collect();
        turns_deg.iter().map(&mut turned).collect()
    }

    fn all_possible(
        &self,
        listener: &ThresholdScan,
        point: &ObservationPoint,
        firing: &FiringGeometry,
        known: &mut PathCache,
    ) -> Result<SmallVec<[CandidateReading; 2]>, TooCostly> {
        let mut found = CandidateList::new();
        listener.candidates(point, firing.direction_rad, &mut found)?;
        Ok(found.iter().map(|candidate| self.possible(candidate, firing, known)).collect())
    }

    fn possible(
        &self,
        candidate: &ThresholdCandidate,
        firing: &FiringGeometry,
        known: &mut PathCache,
    ) -> CandidateReading {
        let stretch = self.stretch(firing);
        let mut possible = CandidateReading {
            outcome: match candidate.range_m {
                Some(range_m) if !candidate.is_near => {
                    RangeOutcome::Echo { range_m: stretch * range_m + self.world.delay_m }
                }
                Some(_) => RangeOutcome::BelowMinRange,
                None => RangeOutcome::NoEcho,
            },
            range_rates: SparseRow::new(),
            margin_db: candidate.margin_db,
            until_db: candidate.until_db,
            until_rates: SparseRow::new(),
            spread_db: candidate.spread_db,
            further_reflections: candidate.arrival.as_ref().map_or(0.0, further_reflections),
        };
        let Some(arrival) = &candidate.arrival else { return possible };
        let path = known.get(arrival, firing);
        if let Some((longer_m, louder_db)) = self.off_axis(arrival, path, firing) {
            if let RangeOutcome::Echo { range_m } = &mut possible.outcome {
                *range_m += 0.5 * stretch * longer_m;
            }
            possible.until_db += louder_db;
        }
        if let Some(predicted_m) = candidate.range_m {
            let evaluated = (predicted_m, candidate.margin_db);
            // The threshold, the only parameter of rotated sweeps, needs no slopes.
            let is_sharp = candidate.is_of_one && self.phases == Phases::Known;
            let flanks = LazyCell::new(|| PatternSlopes::new(arrival, firing, is_sharp));
            for &(at, steady) in &path.steady {
                let moved = self.moved(at, steady, path, firing);
                let (by_range, by_db) =
                    self.rates(at, &moved, (arrival, evaluated), firing, &flanks);
                let has_range = by_range != 0.0 && !candidate.is_near;
                possible.range_rates.extend(has_range.then_some((at, by_range)));
                possible.until_rates.extend((by_db != 0.0).then_some((at, by_db)));
            }
        }
        possible
    }

    /// Derivative of a path by a parameter, given its direction-independent part.
    fn moved(
        &self,
        at: u32,
        steady: PathDerivative,
        path: &PathJacobian,
        firing: &FiringGeometry,
    ) -> PathDerivative {
        let parameter = self.parameters[at as usize];
        let turning = match &self.steady[at as usize] {
            Some(_) => None,
            None => self.world.turning_motion(parameter, firing.direction_rad, firing.azimuth_deg),
        };
        turning.map_or(steady, |motion| path.moved(firing, &motion))
    }

    /// Derivatives of an arrival's range and margin by a parameter, metres and decibels per unit.
    ///
    /// Time walk, the earlier detection of a stronger echo, is added by
    /// [`CandidateReading::rates_with_walk`] once the threshold variation is known.
    fn rates(
        &self,
        at: u32,
        moved: &PathDerivative,
        (arrival, (predicted_m, margin_db)): (&Arrival, (f64, f64)),
        firing: &FiringGeometry,
        flanks: &LazyCell<PatternSlopes, impl FnOnce() -> PatternSlopes>,
    ) -> (f64, f64) {
        let stretch = self.stretch(firing);
        // A rotating transducer rotates all directions backwards relative to its axis.
        let turned_back = |by_rad: f64| moved.turned_rad.map(|rad| rad - by_rad);
        let turned_rad = match self.parameters[at as usize] {
            Parameter::SoundSpeed => return (-stretch * predicted_m, 0.0),
            Parameter::Delay => return (1.0, 0.0),
            Parameter::Bandwidth => return (stretch * self.earlier_m(margin_db), 0.0),
            Parameter::ThresholdRise => return (0.0, -predicted_m),
            Parameter::Threshold => return (0.0, -1.0),
            Parameter::Aperture | Parameter::Skirts => {
                return (0.0, self.by_beam_db(at, arrival, firing));
            }
            Parameter::Heading(_) | Parameter::HeadingZero => turned_back(1f64.to_radians()),
            Parameter::Gear => turned_back(firing.azimuth_deg.to_radians()),
            _ => moved.turned_rad,
        };
        let by_directions_db = match turned_rad {
            [0.0, 0.0] => 0.0,
            turned_rad => flanks.rate_db(turned_rad),
        };
        (0.5 * stretch * moved.longer_m, moved.louder_db + by_directions_db)
    }

    /// Derivative of an arrival's level by a parameter of the beam, decibels per unit.
    fn by_beam_db(&self, at: u32, arrival: &Arrival, firing: &FiringGeometry) -> f64 {
        self.changed_beams[at as usize].as_ref().map_or(0.0, |(pattern, by)| {
            let gain =
                |off_rad| amplitude(pattern, off_rad) / amplitude(firing.simulator.beam(), off_rad);
            20.0 * firing.off_rad(arrival).map(gain).iter().product::<f64>().log10() / by
        })
    }

    /// Derivative of the range of an isolated echo by the bandwidth: its pulse rises faster. The
    /// margin is determined by the peak, which is unchanged.
    fn earlier_m(&self, margin_db: f64) -> f64 {
        let moving = self.other_bands.as_ref().filter(|_| margin_db.is_finite());
        moving.map_or(0.0, |bands| {
            let [[narrower_m, _], [wider_m, _]] = bands.each_ref().map(|walk| walk.at(margin_db));
            (wider_m - narrower_m) / (2.0 * BY_BAND)
        })
    }

    /// Ratio of the reference speed of sound to that of the prediction.
    fn stretch(&self, firing: &FiringGeometry) -> f64 {
        self.reference_m_s / firing.simulator.sound_speed_m_s()
    }

    /// Time walk of the ranges of a receiver.
    pub(crate) fn time_walk(&self, receiver: &Receiver) -> TimeWalk {
        time_walk(receiver, self.world, self.reference_m_s / receiver.sound_speed_m_s)
    }

    /// First-order correction of a path found from the axis for the transducer offset: length,
    /// metres, and level by the beam pattern, decibels. `None` for a path found from the transducer
    /// itself.
    fn off_axis(
        &self,
        arrival: &Arrival,
        path: &PathJacobian,
        firing: &FiringGeometry,
    ) -> Option<(f64, f64)> {
        let mounting = &self.world.sensor.mounting;
        if mounting.is_on_axis() || !firing.simulator.sensor().mounting.is_on_axis() {
            return None;
        }
        let places = mounting.transducer_positions(DVec2::ZERO, firing.direction_rad);
        let moved =
            path.moved(firing, &SceneMotion { transducer: places, ..SceneMotion::default() });
        let louder_db = |(off_rad, turn_rad): (f64, f64)| {
            level_db(firing.simulator.beam(), off_rad, off_rad + turn_rad)
        };
        let ends = firing.off_rad(arrival).into_iter().zip(moved.turned_rad);
        Some((moved.longer_m, ends.map(louder_db).sum()))
    }
}

/// Number of mirror reflections of an arrival after its first.
fn further_reflections(arrival: &Arrival) -> f64 {
    arrival.path.order().saturating_sub(1) as f64
}

/// Beam pattern after a small change of a parameter of the beam, and the change.
fn changed_beam(world: &World, parameter: &Parameter) -> Option<(BeamPattern, f64)> {
    let by = match parameter {
        Parameter::Aperture => 0.01,
        // Downwards, which is always possible.
        Parameter::Skirts => -0.1,
        _ => return None,
    };
    let changed = world.changed(&[(parameter, by)]).ok()?;
    Some((BeamPattern::new(&changed.sensor, changed.air.sound_speed_m_s()), by))
}

/// Time walk with a slightly narrower and a slightly wider band, if that is a parameter.
fn other_bands(world: &World, parameters: &[&Parameter]) -> Option<[TimeWalk; 2]> {
    let parameter = parameters.iter().find(|of| ***of == Parameter::Bandwidth)?;
    let with_band = |by: f64| {
        let changed = world.changed(&[(*parameter, by)]).ok()?;
        let receiver = receiver(&changed.sensor, &changed.air, &changed.options);
        Some(time_walk(&receiver, &changed, 1.0))
    };
    Some([with_band(-BY_BAND)?, with_band(BY_BAND)?])
}

fn time_walk(receiver: &Receiver, world: &World, stretch: f64) -> TimeWalk {
    TimeWalk::new(receiver, receiver.sound_speed_m_s / world.sensor.frequency_hz, stretch)
}

/// Derivative of the level of a path by a parameter of a material, decibels per unit; 0 for others.
pub(crate) fn material_rate_db(parameter: &Parameter, scene: &Scene, path: &Path) -> f64 {
    let (name, property) = match parameter {
        Parameter::Reflectance(name) => (name, MaterialProperty::LogReflectance),
        Parameter::Roughness(name) => (name, MaterialProperty::Roughness),
        _ => return 0.0,
    };
    let Some(material) = scene.materials.get(name) else { return 0.0 };
    let [by_mirror, by_scattering] = material.log_amplitude_rates(property);
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
    20.0 * std::f64::consts::LOG10_E * path.mechanisms().map(rate).sum::<f64>()
}
