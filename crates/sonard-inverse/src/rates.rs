//! What could have been reported of each firing, and how that moves with the parameters.

mod firing;
mod known;

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
    scene::Scene,
};

use self::{
    firing::{Firing, Flanks, amplitude, level_db},
    known::{KnownPaths, Moved, PathRates},
};
use crate::{
    candidates::{Candidate, Candidates, Listener, Phases, SPAN_DB},
    judged::{Judged, Possible, Rates},
    motion::Motion,
    parameter::Parameter,
    sweep::{Beam, Outcome, Sweep},
    walk::TimeWalk,
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
    /// Time walk with a slightly narrower and a slightly wider band, if that is a parameter.
    other_bands: Option<[TimeWalk; 2]>,
    reference_m_s: f64,
    phases: Phases,
    /// Thresholds that are looked at, decibels to both sides of the nominal one.
    span_db: f64,
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
        /// Beyond so many standard deviations there is less than 2e-12.
        const SIGMAS: f64 = 7.0;
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
        let mut known = KnownPaths::new(self, concerning);
        let mut judged = Vec::with_capacity(sweep.beams.len());
        for beam in &sweep.beams {
            let direction_rad = self.world.direction_rad(pose, beam.azimuth_deg);
            let firing = Firing::new(simulator, pose, direction_rad, beam);
            let possible = self.all_possible(&listener, point, &firing, &mut known)?;
            judged.push(Judged { heard: beam.heard.outcome(self.reference_m_s), possible });
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
        let mut paths = KnownPaths::new(self, all);
        let mut known: HashMap<i64, SmallVec<[Possible; 2]>> = HashMap::new();
        let mut judged = |beam: &Beam, by_deg: f64| {
            let direction_rad = self.world.direction_rad(pose, beam.azimuth_deg);
            let place = (wrap_360(direction_rad.to_degrees() + by_deg) / GRID_DEG).round() as i64;
            let possible = match known.entry(place) {
                Entry::Occupied(known) => known.get().clone(),
                Entry::Vacant(unknown) => {
                    let direction_rad = (place as f64 * GRID_DEG).to_radians();
                    let firing = Firing::new(simulator, pose, direction_rad, beam);
                    let possible = self.all_possible(&listener, point, &firing, &mut paths)?;
                    unknown.insert(possible).clone()
                }
            };
            Ok(Judged { heard: beam.heard.outcome(self.reference_m_s), possible })
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
        known: &mut KnownPaths,
    ) -> Result<SmallVec<[Possible; 2]>, TooCostly> {
        let mut found = Candidates::new();
        listener.candidates(point, firing.direction_rad, &mut found)?;
        Ok(found.iter().map(|candidate| self.possible(candidate, firing, known)).collect())
    }

    fn possible(&self, candidate: &Candidate, firing: &Firing, known: &mut KnownPaths) -> Possible {
        let stretch = self.stretch(firing);
        let mut possible = Possible {
            outcome: match candidate.range_m {
                Some(range_m) if !candidate.is_near => {
                    Outcome::Echo { range_m: stretch * range_m + self.world.delay_m }
                }
                Some(_) => Outcome::Near,
                None => Outcome::Silence,
            },
            range_rates: Rates::new(),
            margin_db: candidate.margin_db,
            until_db: candidate.until_db,
            until_rates: Rates::new(),
            spread_db: candidate.spread_db,
            further_reflections: candidate.arrival.as_ref().map_or(0.0, further_reflections),
        };
        let Some(arrival) = &candidate.arrival else { return possible };
        let path = known.of(arrival, firing);
        if let Some((longer_m, louder_db)) = self.beside_axis(arrival, path, firing) {
            if let Outcome::Echo { range_m } = &mut possible.outcome {
                *range_m += 0.5 * stretch * longer_m;
            }
            possible.until_db += louder_db;
        }
        if let Some(predicted_m) = candidate.range_m {
            let told = (predicted_m, candidate.margin_db);
            // A threshold alone, as turned sweeps are asked about, needs none.
            let is_sharp = candidate.is_of_one && self.phases == Phases::Known;
            let flanks = LazyCell::new(|| Flanks::of(arrival, firing, is_sharp));
            for &(at, steady) in &path.steady {
                let moved = self.moved(at, steady, path, firing);
                let (by_range, by_db) = self.rates(at, &moved, (arrival, told), firing, &flanks);
                let has_range = by_range != 0.0 && !candidate.is_near;
                possible.range_rates.extend(has_range.then_some((at, by_range)));
                possible.until_rates.extend((by_db != 0.0).then_some((at, by_db)));
            }
        }
        possible
    }

    /// What a path gains with a parameter, if in all directions it gains so much with it.
    fn moved(&self, at: u32, steady: Moved, path: &PathRates, firing: &Firing) -> Moved {
        let parameter = self.parameters[at as usize];
        let turning = match &self.steady[at as usize] {
            Some(_) => None,
            None => self.world.turning_motion(parameter, firing.direction_rad, firing.azimuth_deg),
        };
        turning.map_or(steady, |motion| path.moved(firing, &motion))
    }

    /// What an arrival's range and its margin above the threshold, which are told as they are, gain with a parameter by which
    /// its path moves so, metres and decibels for each unit.
    ///
    /// That a stronger echo is also earlier (time walk) comes on top, once it is known how thresholds vary: see
    /// [`Possible::rates_with_walk`].
    fn rates(
        &self,
        at: u32,
        moved: &Moved,
        (arrival, (predicted_m, margin_db)): (&Arrival, (f64, f64)),
        firing: &Firing,
        flanks: &LazyCell<Flanks, impl FnOnce() -> Flanks>,
    ) -> (f64, f64) {
        let stretch = self.stretch(firing);
        // A transducer that turns has all directions turn back beside its axis.
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

    /// What an arrival's level gains with a parameter of the beam, decibels for each unit.
    fn by_beam_db(&self, at: u32, arrival: &Arrival, firing: &Firing) -> f64 {
        self.changed_beams[at as usize].as_ref().map_or(0.0, |(pattern, by)| {
            let gain =
                |off_rad| amplitude(pattern, off_rad) / amplitude(firing.simulator.beam(), off_rad);
            20.0 * firing.off_rad(arrival).map(gain).iter().product::<f64>().log10() / by
        })
    }

    /// What the range of a lone echo gains with the width of the band: its pulse rises faster, so that it is less late. How far it
    /// reaches above the threshold is by its peak, which stays.
    fn earlier_m(&self, margin_db: f64) -> f64 {
        let moving = self.other_bands.as_ref().filter(|_| margin_db.is_finite());
        moving.map_or(0.0, |bands| {
            let [[narrower_m, _], [wider_m, _]] = bands.each_ref().map(|walk| walk.at(margin_db));
            (wider_m - narrower_m) / (2.0 * BY_BAND)
        })
    }

    /// What a predicted range is longer at the speed of sound that ranges are told at.
    fn stretch(&self, firing: &Firing) -> f64 {
        self.reference_m_s / firing.simulator.sound_speed_m_s()
    }

    /// How ranges that a receiver tells move with the threshold.
    pub(crate) fn time_walk(&self, receiver: &Receiver) -> TimeWalk {
        time_walk(receiver, self.world, self.reference_m_s / receiver.sound_speed_m_s)
    }

    /// What a path from the axis gains where the face is beside it: in length, to first order, and by the beam pattern in
    /// the directions in which it leaves and comes then, decibels. `None` where it was found from the face.
    fn beside_axis(
        &self,
        arrival: &Arrival,
        path: &PathRates,
        firing: &Firing,
    ) -> Option<(f64, f64)> {
        let mounting = &self.world.sensor.mounting;
        if mounting.is_on_axis() || !firing.simulator.sensor().mounting.is_on_axis() {
            return None;
        }
        let places = mounting.places(DVec2::ZERO, firing.direction_rad);
        let moved = path.moved(firing, &Motion { transducer: places, ..Motion::default() });
        let louder_db = |(off_rad, turn_rad): (f64, f64)| {
            level_db(firing.simulator.beam(), off_rad, off_rad + turn_rad)
        };
        let ends = firing.off_rad(arrival).into_iter().zip(moved.turned_rad);
        Some((moved.longer_m, ends.map(louder_db).sum()))
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
    TimeWalk::of(receiver, receiver.sound_speed_m_s / world.sensor.frequency_hz, stretch)
}

/// What the strength of a path gains with a parameter of a material, decibels for each unit; 0 for others.
pub(crate) fn material_rate_db(parameter: &Parameter, scene: &Scene, path: &Path) -> f64 {
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
    20.0 * std::f64::consts::LOG10_E * path.mechanisms().map(rate).sum::<f64>()
}
