//! The echoes of one place, weighed for an azimuth.

use std::f64::consts::{PI, TAU};

use smallvec::SmallVec;

use super::{
    Echo, EchoPath, Paths, Settings,
    trace::Tree,
    trains::{Loops, Train},
};
use crate::{
    acoustics::{BeamPattern, Disc, Sound},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, Engine, Path, Reflector, Survey},
    scan::PathKind,
    scene::Scene,
};

/// The exact engine: echo paths, a beam pattern and a face that reflects.
///
/// [`Settings::floor`] is also the weakest sound that [`Survey::listen`] gives.
#[derive(Debug)]
pub struct PathEngine {
    pub(super) paths: Paths,
    pub(super) beam: BeamPattern,
    pub(super) face: Option<Disc>,
    envelope: Envelope,
}

impl PathEngine {
    /// Prepares a scene for a ranger; without a face, sound passes it as if it were not there.
    #[must_use]
    pub fn new(scene: &Scene, beam: BeamPattern, face: Option<Disc>, settings: Settings) -> Self {
        let envelope = Envelope::of(&beam);
        Self { paths: Paths::new(scene, settings), beam, face, envelope }
    }
}

impl Engine for PathEngine {
    fn survey<'a>(&'a self, position: DVec2) -> Box<dyn Survey + 'a> {
        Box::new(PathSurvey::new(self, position))
    }
}

/// Steps of the envelope, half a degree.
const ENVELOPE_STEPS: usize = 360;

/// For each angle from the axis the strongest that a beam pattern still gets beyond it.
#[derive(Debug)]
struct Envelope(Vec<f64>);

impl Envelope {
    fn of(beam: &BeamPattern) -> Self {
        // Ten samples a step: a tenth of a lobe's width even at twenty wavelengths across.
        let sample = |i: usize| beam.one_way(PI * i as f64 / (10 * ENVELOPE_STEPS) as f64);
        let mut strongest: f64 = 0.0;
        let mut steps: Vec<f64> = (0..ENVELOPE_STEPS)
            .rev()
            .map(|step| {
                let here = (10 * step..=10 * step + 10).map(sample).fold(0.0, f64::max);
                strongest = strongest.max(here);
                strongest
            })
            .collect();
        steps.reverse();
        Self(steps)
    }

    /// The angle beyond which the pattern stays below `level`, rounded up to a step, radians.
    fn reach_rad(&self, level: f64) -> f64 {
        // A thousandth more than sampled, for what lies between the samples.
        let steps = self.0.partition_point(|strongest| 1.001 * strongest >= level);
        PI * steps as f64 / ENVELOPE_STEPS as f64
    }
}

/// The echo paths of a place.
struct PathSurvey<'a> {
    engine: &'a PathEngine,
    tree: Tree,
    /// Shortest first.
    echoes: Vec<Echo>,
    /// From narrow to wide reach: the many weak echoes are heard in few directions only.
    wheels: [Wheel; REACHES_DEG.len()],
    /// What the face can send round again.
    loops: Option<Loops>,
}

/// Widest reach of each wheel, degrees.
const REACHES_DEG: [f64; 5] = [6.0, 10.0, 16.0, 30.0, 180.0];

/// Directions are sorted into this many bins.
const BINS: usize = 360;

/// Echoes by the direction in which they are heard best.
#[derive(Debug, Default)]
struct Wheel {
    /// Bin by bin.
    spokes: Vec<Spoke>,
    /// Where each bin begins in `spokes`, and the end of the last.
    bins: Vec<u32>,
    /// The widest reach of its spokes.
    reach_rad: f64,
}

/// What an azimuth needs to know of an echo.
#[derive(Debug, Clone, Copy)]
struct Spoke {
    /// Half way between departure and arrival.
    middle_rad: f64,
    /// Departure is this far on one side of the middle, arrival on the other.
    half_rad: f64,
    amplitude: f64,
    /// Farther off the middle it is too weak.
    reach_rad: f64,
    echo: u32,
}

impl Spoke {
    /// `None` if it is too weak in all directions.
    ///
    /// `y` off the middle, the axis is `|y| + h` off one end and at least `||y| - h|` off the
    /// other. The pattern's product reaches a level only if its smaller factor does, and its
    /// larger one reaches the root of it.
    fn of(echo: &Echo, index: u32, envelope: &Envelope, floor: f64) -> Option<Self> {
        let half_rad = 0.5 * echo.departure.angle_to(echo.arrival);
        let level = floor / echo.amplitude;
        let wide = envelope.reach_rad(level) - half_rad.abs();
        if wide < 0.0 {
            return None;
        }
        let reach_rad = wide.min(envelope.reach_rad(level.sqrt()) + half_rad.abs());
        let middle_rad = wrap_pi(echo.departure.to_angle() + half_rad);
        Some(Self { middle_rad, half_rad, amplitude: echo.amplitude, reach_rad, echo: index })
    }
}

impl Wheel {
    fn new(spokes: &[Spoke]) -> Self {
        let mut bins = vec![0_u32; BINS + 1];
        for spoke in spokes {
            bins[bin(spoke.middle_rad) + 1] += 1;
        }
        for i in 0..BINS {
            bins[i + 1] += bins[i];
        }
        let mut next = bins.clone();
        let mut sorted = spokes.to_vec();
        for spoke in spokes {
            let place = &mut next[bin(spoke.middle_rad)];
            sorted[*place as usize] = *spoke;
            *place += 1;
        }
        let reach_rad = spokes.iter().map(|spoke| spoke.reach_rad).fold(0.0, f64::max);
        Self { spokes: sorted, bins, reach_rad }
    }

    /// The spokes within their reach of a direction in (-pi, pi].
    fn near(&self, direction_rad: f64) -> impl Iterator<Item = (&Spoke, f64)> {
        let bins = BINS as i64;
        let (middle, reach) =
            (bin(direction_rad) as i64, (self.reach_rad / TAU * BINS as f64).ceil() as i64);
        let (from, to) =
            if 2 * reach + 1 >= bins { (0, bins) } else { (middle - reach, middle + reach + 1) };
        let part = move |from: i64, to: i64| {
            let at = |bin: i64| self.bins[bin.clamp(0, bins) as usize] as usize;
            &self.spokes[at(from)..at(to)]
        };
        // What leaves the circle on one side comes in on the other.
        let wrapped = [part(from + bins, bins), part(from, to), part(0, to - bins)];
        wrapped.into_iter().flatten().filter_map(move |spoke| {
            let off_rad = wrap_once(direction_rad - spoke.middle_rad);
            (off_rad.abs() <= spoke.reach_rad).then_some((spoke, off_rad))
        })
    }
}

impl<'a> PathSurvey<'a> {
    fn new(engine: &'a PathEngine, position: DVec2) -> Self {
        let (tree, echoes) = engine.paths.echoes(position);
        let floor = engine.paths.settings.floor;
        let mut spokes: [Vec<Spoke>; REACHES_DEG.len()] = Default::default();
        for (echo, index) in echoes.iter().zip(0..) {
            if let Some(spoke) = Spoke::of(echo, index, &engine.envelope, floor) {
                let reach_deg = spoke.reach_rad.to_degrees();
                let wheel = REACHES_DEG.iter().position(|most| reach_deg <= *most);
                spokes[wheel.unwrap_or(REACHES_DEG.len() - 1)].push(spoke);
            }
        }
        let wheels = spokes.map(|spokes| Wheel::new(&spokes));
        let loops = engine.face.map(|face| Loops::new(face, &echoes));
        Self { engine, tree, echoes, wheels, loops }
    }

    /// Echoes by way of the face, in a direction in (-pi, pi].
    fn trains(&self, direction_rad: f64) -> Vec<Train> {
        let settings = &self.engine.paths.settings;
        self.loops
            .as_ref()
            .map_or_else(Vec::new, |loops| loops.trains(direction_rad, &self.engine.beam, settings))
    }

    fn train_arrival(&self, direction_rad: f64, train: &Train, amplitude: f64) -> Arrival {
        let paths = &self.engine.paths;
        let echoes = train.rounds.iter().map(|round| {
            let echo = &self.echoes[round.echo as usize];
            if round.reversed { echo.reversed() } else { *echo }
        });
        let ways: Vec<EchoPath> = echoes.map(|echo| paths.path(&self.tree, &echo)).collect();
        let bent = ways.iter().find_map(|way| way.path.edge);
        let kind = if bent.is_some() { PathKind::Diffracted } else { PathKind::Specular };
        let mut walls = SmallVec::new();
        for way in &ways {
            if !walls.is_empty() {
                walls.push(Reflector::Face);
            }
            walls.extend_from_slice(&way.path.walls);
        }
        let (departure_rad, arrival_rad) =
            (ways[0].departure_rad, ways[ways.len() - 1].arrival_rad);
        let [leaving, arriving] =
            [departure_rad, arrival_rad].map(|end| self.engine.beam.one_way(end - direction_rad));
        Arrival {
            length_m: train.length_m,
            amplitude,
            path_amplitude: amplitude / (leaving * arriving),
            phase_rad: train.phase_rad,
            departure_rad,
            arrival_rad,
            path: Path { kind, walls, edge: bent },
        }
    }
}

impl Survey for PathSurvey<'_> {
    fn listen(&self, direction_rad: f64, sounds: &mut Vec<Sound>) {
        sounds.clear();
        let direction_rad = wrap_pi(direction_rad);
        let (beam, floor) = (&self.engine.beam, self.engine.paths.settings.floor);
        for wheel in &self.wheels {
            for (spoke, off_rad) in wheel.near(direction_rad) {
                let ends = [off_rad + spoke.half_rad, off_rad - spoke.half_rad];
                let [leaving, arriving] = ends.map(|angle| beam.one_way(angle));
                let amplitude = spoke.amplitude * leaving * arriving;
                if amplitude >= floor {
                    let echo = &self.echoes[spoke.echo as usize];
                    sounds.push(Sound {
                        length_m: echo.length_m,
                        amplitude,
                        phase_rad: echo.phase_rad,
                        index: spoke.echo,
                    });
                }
            }
        }
        // Echoes are numbered by length; trains come after all of them.
        sounds.sort_unstable_by_key(|sound| sound.index);
        let trains = self.trains(direction_rad);
        if !trains.is_empty() {
            let numbers = self.echoes.len() as u32..;
            sounds.extend(trains.iter().zip(numbers).map(|(train, index)| train.sound(index)));
            sounds.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
        }
    }

    fn arrival(&self, direction_rad: f64, sound: &Sound) -> Arrival {
        let index = sound.index as usize;
        if let Some(train) = index.checked_sub(self.echoes.len()) {
            let trains = self.trains(wrap_pi(direction_rad));
            return self.train_arrival(direction_rad, &trains[train], sound.amplitude);
        }
        let echo = &self.echoes[index];
        let path = self.engine.paths.path(&self.tree, echo);
        Arrival {
            length_m: path.length_m,
            amplitude: sound.amplitude,
            path_amplitude: path.amplitude,
            phase_rad: path.phase_rad,
            departure_rad: path.departure_rad,
            arrival_rad: path.arrival_rad,
            path: path.path,
        }
    }
}

/// The bin of an angle in (-pi, pi].
fn bin(angle_rad: f64) -> usize {
    (((angle_rad + PI) / TAU * BINS as f64) as usize).min(BINS - 1)
}

/// The difference of two angles in (-pi, pi], brought into that range.
pub(super) fn wrap_once(angle_rad: f64) -> f64 {
    if angle_rad > PI {
        angle_rad - TAU
    } else if angle_rad < -PI {
        angle_rad + TAU
    } else {
        angle_rad
    }
}
