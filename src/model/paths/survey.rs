//! The echoes of one place, weighed for an azimuth.

use std::f64::consts::{PI, TAU};

use super::{Echo, Paths, Settings, trace::Tree};
use crate::{
    acoustics::{BeamPattern, Sound},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, Engine, Survey},
    scene::Scene,
};

/// The exact engine: echo paths and a beam pattern.
///
/// [`Settings::floor`] is also the weakest sound that [`Survey::listen`] gives.
#[derive(Debug)]
pub struct PathEngine {
    paths: Paths,
    beam: BeamPattern,
    envelope: Envelope,
}

impl PathEngine {
    /// Prepares a scene for a ranger.
    #[must_use]
    pub fn new(scene: &Scene, beam: BeamPattern, settings: Settings) -> Self {
        let envelope = Envelope::of(&beam);
        Self { paths: Paths::new(scene, settings), beam, envelope }
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

/// Directions are sorted into this many bins.
const BINS: usize = 360;

/// The echo paths of a place, by the direction in which they leave.
struct PathSurvey<'a> {
    engine: &'a PathEngine,
    tree: Tree,
    /// Shortest first.
    echoes: Vec<Echo>,
    /// Bin by bin.
    spokes: Vec<Spoke>,
    /// Where each bin begins in `spokes`, and the end of the last.
    bins: Vec<u32>,
    /// The widest reach of all.
    reach_rad: f64,
}

/// What an azimuth needs to know of an echo.
#[derive(Debug, Clone, Copy)]
struct Spoke {
    departure_rad: f64,
    arrival_rad: f64,
    amplitude: f64,
    /// Farther off the axis, at either end, it is too weak.
    reach_rad: f64,
    echo: u32,
}

impl<'a> PathSurvey<'a> {
    fn new(engine: &'a PathEngine, position: DVec2) -> Self {
        let (tree, echoes) = engine.paths.echoes(position);
        let floor = engine.paths.settings.floor;
        let mut spokes: Vec<Spoke> = echoes
            .iter()
            .zip(0..)
            .map(|(echo, index)| Spoke {
                departure_rad: echo.departure.to_angle(),
                arrival_rad: echo.arrival.to_angle(),
                amplitude: echo.amplitude,
                reach_rad: engine.envelope.reach_rad(floor / echo.amplitude),
                echo: index,
            })
            .collect();
        spokes.sort_unstable_by_key(|spoke| (bin(spoke.departure_rad), spoke.echo));
        let bins = (0..=BINS)
            .map(|edge| spokes.partition_point(|spoke| bin(spoke.departure_rad) < edge) as u32)
            .collect();
        let reach_rad = spokes.iter().map(|spoke| spoke.reach_rad).fold(0.0, f64::max);
        Self { engine, tree, echoes, spokes, bins, reach_rad }
    }

    /// The spokes that leave within the widest reach of a direction, and a few more.
    fn near(&self, direction_rad: f64) -> impl Iterator<Item = &Spoke> {
        let middle = bin(wrap_pi(direction_rad)) as i64;
        let reach = (self.reach_rad / TAU * BINS as f64).ceil() as i64;
        let bins = BINS as i64;
        let (from, to) =
            if 2 * reach + 1 >= bins { (0, bins) } else { (middle - reach, middle + reach + 1) };
        let part = move |from: i64, to: i64| {
            let at = |bin: i64| self.bins[bin.clamp(0, bins) as usize] as usize;
            &self.spokes[at(from)..at(to)]
        };
        // What leaves the circle on one side comes in on the other.
        let wrapped = [part(from + bins, bins), part(from, to), part(0, to - bins)];
        wrapped.into_iter().flatten()
    }

    fn weight(&self, spoke: &Spoke, direction_rad: f64) -> Option<f64> {
        let leaving = wrap_once(spoke.departure_rad - direction_rad).abs();
        let arriving = wrap_once(spoke.arrival_rad - direction_rad).abs();
        if leaving.max(arriving) > spoke.reach_rad {
            return None;
        }
        let beam = &self.engine.beam;
        let amplitude = spoke.amplitude * beam.one_way(leaving) * beam.one_way(arriving);
        (amplitude >= self.engine.paths.settings.floor).then_some(amplitude)
    }
}

impl Survey for PathSurvey<'_> {
    fn listen(&self, direction_rad: f64, sounds: &mut Vec<Sound>) {
        sounds.clear();
        let direction_rad = wrap_pi(direction_rad);
        for spoke in self.near(direction_rad) {
            if let Some(amplitude) = self.weight(spoke, direction_rad) {
                let echo = &self.echoes[spoke.echo as usize];
                sounds.push(Sound {
                    length_m: echo.length_m,
                    amplitude,
                    phase_rad: echo.phase_rad,
                    index: spoke.echo,
                });
            }
        }
        // Echoes are numbered by length.
        sounds.sort_unstable_by_key(|sound| sound.index);
    }

    fn arrival(&self, _direction_rad: f64, sound: &Sound) -> Arrival {
        let echo = &self.echoes[sound.index as usize];
        let path = self.engine.paths.path(&self.tree, echo);
        Arrival {
            length_m: path.length_m,
            amplitude: sound.amplitude,
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
fn wrap_once(angle_rad: f64) -> f64 {
    if angle_rad > PI {
        angle_rad - TAU
    } else if angle_rad < -PI {
        angle_rad + TAU
    } else {
        angle_rad
    }
}
