//! Readings beside what could have been reported, and how that moves with the parameters to first order.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use smallvec::SmallVec;
use sonard_model::{
    acoustics::BeamPattern,
    geometry::{DVec2, Pose, wrap_pi},
    model::{Arrival, Mechanism, ObservationPoint, Reflector, Simulator, TooCostly},
    scene::{Material, Scene},
};

use crate::{
    candidates::{Candidate, Listener},
    likelihood::{ErrorModel, normal_density, normal_up_to},
    motion::{Motion, length_rate},
    parameter::Parameter,
    sweep::{Beam, Heard, Sweep},
    world::{World, WorldError},
};

/// What a number gains for each unit of some of the parameters.
type Rates = SmallVec<[(u32, f64); 6]>;

/// One of the readings that a firing could have had.
#[derive(Debug, Clone)]
struct Possible {
    /// Its range, metres at the reference speed of sound; `None` of silence.
    range_m: Option<f64>,
    range_rates: Rates,
    /// The threshold up to which it is, decibels above the nominal one.
    until_db: f64,
    until_rates: Rates,
    /// What the range gains with the threshold, metres a decibel.
    walk_m_per_db: f64,
}

/// A reading beside what it could have been.
#[derive(Debug, Clone)]
struct Judged {
    /// Metres at the reference speed of sound; `None` of silence.
    heard_m: Option<f64>,
    possible: SmallVec<[Possible; 3]>,
}

/// All readings, about one hypothesis.
#[derive(Debug, Clone)]
pub(crate) struct Linear {
    beams: Vec<Judged>,
    /// How many parameters there are.
    count: usize,
}

/// Log-likelihood with its gradient and curvature.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    pub(crate) value: f64,
    pub(crate) gradient: DVector<f64>,
    /// Fisher's information: of ranges as Gauss and Newton have it, of thresholds what a reading is expected to say. What
    /// single surprising readings seem to say would make far too sure.
    pub(crate) information: DMatrix<f64>,
}

impl Linear {
    /// Predicts all sweeps, each from its pose. Ranges are in metres at `reference_m_s`.
    ///
    /// A transducer beside its axis has paths of its own in each direction, some hundred times more work. Unless it is
    /// to be exact they are found once, from the axis, and made longer to first order: a millimetre off for one that is
    /// 3 cm beside it and half a metre before a wall.
    pub(crate) fn about(
        world: &World,
        sweeps: &[Sweep],
        poses: &[Pose],
        parameters: &[&Parameter],
        reference_m_s: f64,
        is_exact: bool,
    ) -> Result<Self, WorldError> {
        let traced = if is_exact { world.clone() } else { world.with_face_on_axis() };
        let shared = match world.scene.robot {
            Some(_) => None,
            None => Some(traced.simulator(&Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 })?),
        };
        let wider = wider(world, parameters);
        let of = |(number, (sweep, pose)): (usize, (&Sweep, &Pose))| {
            let own;
            let simulator = match &shared {
                Some(simulator) => simulator,
                None => {
                    own = traced.simulator(pose)?;
                    &own
                }
            };
            let rates = RateFinder {
                world,
                simulator,
                parameters,
                number,
                wider: wider.as_ref(),
                reference_m_s,
            };
            Ok(rates.sweep(&simulator.at(pose.position()), sweep, pose)?)
        };
        let beams: Result<Vec<Vec<Judged>>, WorldError> =
            sweeps.par_iter().zip(poses).enumerate().map(of).collect();
        Ok(Self { beams: beams?.into_iter().flatten().collect(), count: parameters.len() })
    }

    /// Log-likelihoods of one sweep from a pose turned by so many degrees each and at thresholds higher by so many
    /// decibels each: the turn, the threshold, and how likely that is.
    pub(crate) fn turned(
        world: &World,
        sweep: &Sweep,
        pose: &Pose,
        turns_deg: impl Iterator<Item = f64>,
        thresholds_db: &[f64],
        errors: &ErrorModel,
    ) -> Result<Vec<(f64, f64, f64)>, WorldError> {
        let turned = |by: f64| Pose { heading_deg: pose.heading_deg + by, ..*pose };
        let reference_m_s = world.air.sound_speed_m_s();
        let traced = world.with_face_on_axis();
        let likely = |simulator: &Simulator, point: &ObservationPoint, by: f64| {
            let parameters = &[&Parameter::Threshold];
            let rates =
                RateFinder { world, simulator, parameters, number: 0, wider: None, reference_m_s };
            let beams = rates.sweep(point, sweep, &turned(by))?;
            let linear = Self { beams, count: 1 };
            let at = |db: f64| linear.log_likelihood(&DVector::from_element(1, db), errors);
            Ok::<_, WorldError>(
                thresholds_db.iter().map(|db| (by, *db, at(*db))).collect::<Vec<_>>(),
            )
        };
        let mut found = Vec::new();
        let alone = match world.scene.robot {
            Some(_) => None,
            None => Some(traced.simulator(pose)?),
        };
        let point = alone.as_ref().map(|simulator| simulator.at(pose.position()));
        for by in turns_deg {
            match (&alone, &point) {
                (Some(simulator), Some(point)) => found.extend(likely(simulator, point, by)?),
                _ => {
                    let simulator = traced.simulator(&turned(by))?;
                    found.extend(likely(&simulator, &simulator.at(pose.position()), by)?);
                }
            }
        }
        Ok(found)
    }

    /// Log-likelihood of all readings after a change of the parameters.
    pub(crate) fn log_likelihood(&self, change: &DVector<f64>, errors: &ErrorModel) -> f64 {
        self.beams.iter().map(|beam| beam.terms(change, errors).density.ln()).sum()
    }

    /// The same with what it takes to improve it.
    pub(crate) fn curve(&self, change: &DVector<f64>, errors: &ErrorModel) -> Curve {
        let mut curve = Curve {
            value: 0.0,
            gradient: DVector::zeros(self.count),
            information: DMatrix::zeros(self.count, self.count),
        };
        let of_range = errors.range_information();
        for beam in &self.beams {
            let terms = beam.terms(change, errors);
            curve.value += terms.density.ln();
            for (possible, term) in beam.possible.iter().zip(&terms.of) {
                for &(at, rate) in &possible.range_rates {
                    curve.gradient[at as usize] += term.by_range * rate;
                }
                for &(at, rate) in &possible.until_rates {
                    curve.gradient[at as usize] += term.by_until * rate;
                }
                let weight = term.share * of_range;
                add_outer(&mut curve.information, &possible.range_rates, weight);
                add_outer(&mut curve.information, &possible.until_rates, term.expected_of_until);
            }
        }
        curve
    }

    /// What the gradient would gain by each decibel that the threshold is wrong, because of time walk.
    pub(crate) fn walk(&self, errors: &ErrorModel) -> DVector<f64> {
        let still = DVector::zeros(self.count);
        let mut walk = DVector::zeros(self.count);
        let of_range = errors.range_information();
        for beam in &self.beams {
            let terms = beam.terms(&still, errors);
            for (possible, term) in beam.possible.iter().zip(&terms.of) {
                for &(at, rate) in &possible.range_rates {
                    walk[at as usize] += term.share * of_range * rate * possible.walk_m_per_db;
                }
            }
        }
        walk
    }

    /// Ranges of echoes that are explained, as differences from the likeliest explanation, with the probability that
    /// it is the right one; and the share of readings that nothing explains.
    pub(crate) fn residuals(&self, errors: &ErrorModel) -> (Vec<(f64, f64)>, f64) {
        let still = DVector::zeros(self.count);
        let mut unexplained = 0.0;
        let residuals = self.beams.iter().filter_map(|beam| {
            let terms = beam.terms(&still, errors);
            unexplained += terms.unexplained;
            let best = (0..beam.possible.len())
                .max_by(|&one, &other| terms.of[one].share.total_cmp(&terms.of[other].share))?;
            Some((beam.heard_m? - beam.possible[best].range_m?, terms.of[best].share))
        });
        let residuals = residuals.collect();
        (residuals, unexplained / self.beams.len().max(1) as f64)
    }

    /// How many readings there are.
    pub(crate) const fn len(&self) -> usize {
        self.beams.len()
    }
}

fn add_outer(to: &mut DMatrix<f64>, rates: &Rates, weight: f64) {
    for &(one, by) in rates {
        for &(other, beside) in rates {
            to[(one as usize, other as usize)] += weight * by * beside;
        }
    }
}

/// A reading's density and its derivatives.
struct Terms {
    density: f64,
    /// Probability that the scene does not explain it.
    unexplained: f64,
    of: SmallVec<[Term; 3]>,
}

/// What one of the possible readings has to do with it.
struct Term {
    /// Probability that the reading is this one.
    share: f64,
    /// Derivative of the log-density by its range.
    by_range: f64,
    /// By the threshold up to which it is.
    by_until: f64,
    /// What a reading is expected to say about that threshold, as information.
    expected_of_until: f64,
}

impl Judged {
    fn terms(&self, change: &DVector<f64>, errors: &ErrorModel) -> Terms {
        let after = |value: f64, rates: &Rates| {
            value + rates.iter().map(|&(at, rate)| rate * change[at as usize]).sum::<f64>()
        };
        let explained = 1.0 - errors.clutter;
        let unexplained = errors.of_clutter(self.heard_m.is_some());
        // Density of the reading if it is this one, and its derivative by the range.
        let densities: SmallVec<[[f64; 2]; 3]> = self
            .possible
            .iter()
            .map(|possible| match (self.heard_m, possible.range_m) {
                (Some(heard_m), Some(range_m)) => {
                    let [density, slope] =
                        errors.range(heard_m - after(range_m, &possible.range_rates));
                    [density, -slope]
                }
                (None, None) => [1.0, 0.0],
                _ => [0.0, 0.0],
            })
            .collect();
        let mut below = 0.0;
        let mut density = unexplained;
        let mut of: SmallVec<[Term; 3]> = SmallVec::new();
        for (at, (possible, &[own, slope])) in self.possible.iter().zip(&densities).enumerate() {
            let is_last = at + 1 == self.possible.len();
            let until = after(possible.until_db, &possible.until_rates) / errors.sigma_db;
            let up_to = if is_last { 1.0 } else { normal_up_to(until).max(below) };
            let probability = up_to - below;
            below = up_to;
            let gain = if is_last { 0.0 } else { own - densities[at + 1][0] };
            let by_until = explained * normal_density(until) / errors.sigma_db * gain;
            density += explained * probability * own;
            of.push(Term {
                share: explained * probability * own,
                by_range: explained * probability * slope,
                by_until: if by_until.is_finite() { by_until } else { 0.0 },
                expected_of_until: match is_last {
                    true => 0.0,
                    false => {
                        explained * expected_of_step(until) * self.distinct(at, errors.sigma_m)
                            / errors.sigma_db.powi(2)
                    }
                },
            });
        }
        for term in &mut of {
            term.share /= density;
            term.by_range /= density;
            term.by_until /= density;
        }
        Terms { density, unexplained: unexplained / density, of }
    }
}

impl Judged {
    /// How well one of the possible readings can be told from the next, from 0 to 1.
    fn distinct(&self, at: usize, sigma_m: f64) -> f64 {
        match (self.possible[at].range_m, self.possible[at + 1].range_m) {
            (Some(one_m), Some(other_m)) => {
                1.0 - (-((one_m - other_m) / sigma_m).powi(2) / 8.0).exp()
            }
            (None, None) => 0.0,
            _ => 1.0,
        }
    }
}

/// What one reading, of either side of a step of the probability at `place` standard deviations, is expected to say
/// about the step's place: `density^2 / (up_to (1 - up_to))`.
fn expected_of_step(place: f64) -> f64 {
    let up_to = normal_up_to(place);
    let spread = up_to * (1.0 - up_to);
    if spread > 1e-12 { normal_density(place).powi(2) / spread } else { 0.0 }
}

/// Beam patterns of a slightly wider face, if that is asked for, and by how much.
fn wider(world: &World, parameters: &[&Parameter]) -> Option<(BeamPattern, f64)> {
    const BY: f64 = 0.01;
    let is_asked = parameters.iter().any(|parameter| **parameter == Parameter::Aperture);
    let changed = is_asked.then(|| world.changed(&[(&Parameter::Aperture, BY)]).ok())??;
    Some((BeamPattern::new(&changed.sensor, changed.air.sound_speed_m_s()), BY))
}

/// Predicts a sweep, with rates.
struct RateFinder<'a> {
    world: &'a World,
    simulator: &'a Simulator,
    parameters: &'a [&'a Parameter],
    /// The sweep's.
    number: usize,
    wider: Option<&'a (BeamPattern, f64)>,
    reference_m_s: f64,
}

impl RateFinder<'_> {
    fn sweep(
        &self,
        point: &ObservationPoint,
        sweep: &Sweep,
        pose: &Pose,
    ) -> Result<Vec<Judged>, TooCostly> {
        let mut listener = Listener::new(self.simulator.receiver());
        sweep
            .beams
            .iter()
            .map(|beam| {
                let direction_rad = self.world.direction_rad(pose, beam.azimuth_deg);
                let found = listener.candidates(point, direction_rad)?;
                let possible = found
                    .iter()
                    .map(|candidate| self.possible(candidate, pose.position(), direction_rad, beam))
                    .collect();
                let heard_m = match beam.heard {
                    Heard::Echo { tof_us } => Some(0.5e-6 * self.reference_m_s * tof_us),
                    Heard::Silence => None,
                };
                Ok(Judged { heard_m, possible })
            })
            .collect()
    }

    fn possible(
        &self,
        candidate: &Candidate,
        axis: DVec2,
        direction_rad: f64,
        beam: &Beam,
    ) -> Possible {
        let prediction = &candidate.prediction;
        let stretch = self.reference_m_s / self.simulator.sound_speed_m_s();
        let beside_m = prediction
            .arrival
            .as_ref()
            .map_or(0.0, |arrival| 0.5 * self.longer_m(arrival, axis, direction_rad));
        let range_m =
            prediction.range_m.map(|range_m| stretch * (range_m + beside_m) + self.world.delay_m);
        let (mut range_rates, mut until_rates) = (Rates::new(), Rates::new());
        if let (Some(arrival), Some(predicted_m)) = (&prediction.arrival, prediction.range_m) {
            let ends = self.simulator.sensor().mounting.places(axis, direction_rad);
            for (&parameter, at) in self.parameters.iter().zip(0u32..) {
                if parameter.sweep().is_some_and(|sweep| sweep != self.number) {
                    continue;
                }
                let by_db = self.margin_rate(parameter, arrival, direction_rad, beam);
                let by_range = match parameter {
                    Parameter::SoundSpeed => -stretch * predicted_m,
                    Parameter::Delay => 1.0,
                    _ => {
                        0.5 * stretch
                            * self.length_rate(parameter, arrival, ends, direction_rad, beam)
                    }
                };
                if by_range != 0.0 {
                    range_rates.push((at, by_range));
                }
                if by_db != 0.0 {
                    until_rates.push((at, by_db));
                }
            }
        }
        Possible {
            range_m,
            range_rates,
            until_db: candidate.until_db,
            until_rates,
            walk_m_per_db: stretch * candidate.walk_m_per_db,
        }
    }

    /// What a path from the axis gains where the face is beside it, to first order.
    fn longer_m(&self, arrival: &Arrival, axis: DVec2, direction_rad: f64) -> f64 {
        let mounting = &self.world.sensor.mounting;
        if mounting.is_on_axis() || !self.simulator.sensor().mounting.is_on_axis() {
            return 0.0;
        }
        let places = mounting.places(DVec2::ZERO, direction_rad);
        let motion = Motion { transducer: places, ..Motion::default() };
        let z_m = self.simulator.sensor_z_m().unwrap_or(0.0);
        length_rate(arrival, [axis; 2], z_m, self.simulator.scene(), &motion)
    }

    fn length_rate(
        &self,
        parameter: &Parameter,
        arrival: &Arrival,
        ends: [DVec2; 2],
        direction_rad: f64,
        beam: &Beam,
    ) -> f64 {
        let z_m = self.simulator.sensor_z_m().unwrap_or(0.0);
        let motion = match parameter {
            Parameter::Gear => self.world.turned(direction_rad, beam.azimuth_deg.to_radians()),
            _ => self.world.motion(parameter, direction_rad),
        };
        motion
            .map_or(0.0, |motion| length_rate(arrival, ends, z_m, self.simulator.scene(), &motion))
    }

    /// What an arrival's margin above the threshold gains, decibels for each unit. That a stronger echo is also a little
    /// earlier (time walk) is in the predictions and not in the rates: where several arrivals overlap they are not
    /// known so well that tenths of a millimetre could be believed. See [`Linear::walk`].
    fn margin_rate(
        &self,
        parameter: &Parameter,
        arrival: &Arrival,
        direction_rad: f64,
        beam: &Beam,
    ) -> f64 {
        let off_rad =
            [arrival.departure_rad, arrival.arrival_rad].map(|end| wrap_pi(end - direction_rad));
        let level_db = |pattern: &BeamPattern, by_rad: f64| {
            off_rad.map(|off| decibels(pattern.one_way(wrap_pi(off - by_rad)))).iter().sum::<f64>()
        };
        let by_turn = |turn_rad: f64| {
            // Over half a degree to both sides, and no steeper than a main lobe's flank: a null is steeper, but what is
            // heard there is the sum of several arrivals.
            const BY_RAD: f64 = 0.01;
            const STEEPEST_DB_PER_RAD: f64 = 250.0;
            let pattern = self.simulator.beam();
            let slope = (level_db(pattern, BY_RAD) - level_db(pattern, -BY_RAD)) / (2.0 * BY_RAD);
            turn_rad * slope.clamp(-STEEPEST_DB_PER_RAD, STEEPEST_DB_PER_RAD)
        };
        match parameter {
            Parameter::Heading(_) | Parameter::HeadingZero => by_turn(1f64.to_radians()),
            Parameter::Gear => by_turn(beam.azimuth_deg.to_radians()),
            Parameter::Threshold => -1.0,
            Parameter::Aperture => self.wider.map_or(0.0, |(pattern, by)| {
                (level_db(pattern, 0.0) - level_db(self.simulator.beam(), 0.0)) / by
            }),
            Parameter::Reflectance(name) => {
                let scene = self.simulator.scene();
                let times =
                    scene.materials.get(name).map_or(0, |of| reflections(scene, arrival, of));
                20.0 * std::f64::consts::LOG10_E * times as f64
            }
            _ => 0.0,
        }
    }
}

fn decibels(amplitude: f64) -> f64 {
    20.0 * amplitude.max(1e-6).log10()
}

/// How often an arrival was reflected by a material.
fn reflections(scene: &Scene, arrival: &Arrival, material: &Material) -> usize {
    let is_of = |mechanism: Mechanism| match mechanism {
        Mechanism::Reflection(Reflector::Wall(wall)) => {
            scene.walls.get(wall as usize).is_some_and(|wall| wall.material == *material)
        }
        Mechanism::Reflection(Reflector::Cylinder(cylinder)) => {
            scene.cylinders.get(cylinder as usize).is_some_and(|of| of.material == *material)
        }
        Mechanism::Reflection(Reflector::Floor) => scene.floor_material == *material,
        Mechanism::Reflection(Reflector::Ceiling) => scene.ceiling_material == *material,
        _ => false,
    };
    arrival.path.mechanisms().filter(|&mechanism| is_of(mechanism)).count()
}
