//! Trains of echoes: sound that the transducer's face sends round again.
//!
//! An echo that comes back to the face is partly turned back by it ([`Disc::reflection`]) and
//! goes out once more, over the same walls or others. Such a train is a row of the place's echo
//! paths, here called rounds, with the face between them. The rounds do not depend on the
//! azimuth; what the face does with them does, because it turns.
//!
//! A round spreads from the disc, not from the image behind it, so over rounds `L1, L2, ...` the
//! field is `1/L1 S1 1/L2 S2 1/L3 ...` with `S = F L1 L2 / (L1 + L2)` of each passage. With one
//! passage that is the disc's field itself. With more it holds for discs of few Fresnel zones:
//! beside Kirchhoff's integral over each passage, fourth echoes are 1.15 dB too strong over rounds
//! of 0.4 m and 3.9 dB over rounds of 0.19 m (a 21.5 mm disc at 49.4 kHz; a test computes them).
//! Rounds by floor and ceiling are left out. The beam pattern weighs the first departure and the
//! last arrival only.
//!
//! The sound that passes beside the face goes on behind it: in the middle of a disc's shadow it
//! is as strong as without the disc (Arago's spot, `|exp(-i p)| = 1`), so nothing is taken from
//! the paths that run past the ranger.

use std::f64::consts::FRAC_PI_2;

use num_complex::Complex64;
use smallvec::{SmallVec, smallvec};

use super::{
    Echo, Settings,
    echo::SAME_RAD,
    wheel::{Envelope, Spoke, Wheel, wrap_once},
};
use crate::acoustics::{BeamPattern, Disc, FaceAspect, Sound};

/// Trains are listed from this much above the weakest sound of the survey, which lies 20 dB below
/// the threshold: only those that can be detected. There are a great many of the others.
pub(super) const FLOOR_ABOVE: f64 = 10.0;

/// Rounds longer than this in all would not be told apart any more.
const MOST_ROUNDS: usize = 32;

/// More trains than this come only from a face that all but touches several walls, where rays
/// no longer say much; the search ends there.
const MOST_TRAINS: usize = 4096;

/// The echo paths of a place as rounds between face and walls.
pub(super) struct Loops {
    face: Disc,
    rounds: Vec<Loop>,
    /// By direction of departure.
    departures: Wheel,
}

/// An echo path, run through in one of its directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Round {
    pub(super) echo: u32,
    pub(super) reversed: bool,
}

/// A row of rounds, with the face between them.
#[derive(Debug, Clone)]
pub(super) struct Train {
    pub(super) rounds: SmallVec<[Round; 4]>,
    pub(super) length_m: f64,
    pub(super) phase_rad: f64,
    /// With the beam pattern.
    amplitude: f64,
}

/// What an azimuth needs to know of a round.
#[derive(Debug, Clone, Copy)]
struct Loop {
    round: Round,
    /// World directions in which it leaves and comes back.
    leaves_rad: f64,
    returns_rad: f64,
    length_m: f64,
    /// Its strength and phase, apart.
    amplitude: f64,
    phase: Complex64,
    /// Whether it is its own reverse.
    own_reverse: bool,
}

impl Train {
    /// As the receiver notices it.
    pub(super) fn sound(&self, index: u32) -> Sound {
        let &Self { length_m, amplitude, phase_rad, .. } = self;
        Sound { length_m, amplitude, phase_rad, index }
    }
}

impl Loops {
    pub(super) fn new(
        face: Disc,
        echoes: &[Echo],
        envelope: &Envelope,
        settings: &Settings,
    ) -> Self {
        let floor = FLOOR_ABOVE * settings.floor;
        // A wall nearer than that is not one to see the disc's zones from.
        let far = || {
            let far = |(echo, _): &(&Echo, u32)| {
                let is_level = echo.rise_rad == [0.0; 2];
                echo.length_m > 2.0 * face.face.radius_m && is_level
            };
            echoes.iter().zip(0..).filter(far)
        };
        let best = Best::of(far().map(|(echo, _)| (echo.length_m, echo.amplitude)));
        let mut rounds = Vec::new();
        let mut spokes = Vec::new();
        for (echo, index) in far() {
            // What it can at most become, when the face looks into its departure.
            let most = best.after(&face, echo.length_m, echo.amplitude);
            let reach_rad = envelope.reach_rad(floor / most);
            if most < floor || reach_rad == 0.0 {
                continue;
            }
            let leaves_rad = echo.departure.to_angle();
            spokes.push(Spoke {
                middle_rad: leaves_rad,
                half_rad: 0.0,
                amplitude: echo.amplitude,
                reach_rad,
                echo: rounds.len() as u32,
            });
            rounds.push(Loop {
                round: Round { echo: index, reversed: false },
                leaves_rad,
                returns_rad: echo.arrival.to_angle(),
                length_m: echo.length_m,
                amplitude: echo.amplitude,
                phase: Complex64::cis(echo.phase_rad),
                own_reverse: echo.departure.distance(echo.arrival) < SAME_RAD,
            });
        }
        Self { face, rounds, departures: Wheel::new(&spokes) }
    }

    /// All trains with at least one passage at the face, which looks into `direction_rad`.
    pub(super) fn trains(
        &self,
        direction_rad: f64,
        beam: &BeamPattern,
        settings: &Settings,
    ) -> Vec<Train> {
        let floor = FLOOR_ABOVE * settings.floor;
        let mut near: SmallVec<[(&Loop, f64); 16]> = SmallVec::new();
        self.departures.near(direction_rad, |spoke, _| {
            let round = &self.rounds[spoke.echo as usize];
            let leaves_rad = wrap_once(round.leaves_rad - direction_rad);
            let returns_rad = wrap_once(round.returns_rad - direction_rad);
            if returns_rad.abs() < FRAC_PI_2 {
                near.push((round, spoke.amplitude * beam.one_way(leaves_rad)));
            }
        });
        // Each needs another that it can be joined to.
        let best = Best::of(near.iter().map(|(out, leaving)| (out.length_m, *leaving)));
        near.retain(|(out, leaving)| best.after(&self.face, out.length_m, *leaving) >= floor);
        if near.is_empty() {
            return Vec::new();
        }
        let turned = |&(round, leaving): &(&Loop, f64)| {
            let leaves_rad = wrap_once(round.leaves_rad - direction_rad);
            let returns_rad = wrap_once(round.returns_rad - direction_rad);
            (Loop { leaves_rad, returns_rad, ..*round }, leaving)
        };
        let outs: SmallVec<[(Loop, f64); 16]> = near.iter().map(turned).collect();
        Search::new(self.face, &outs, floor, settings).run()
    }
}

/// The strongest that any last round adds.
#[derive(Clone, Copy)]
struct Best {
    weight: f64,
    weight_per_m: f64,
}

impl Best {
    /// Of rounds by length and weight.
    fn of(rounds: impl Iterator<Item = (f64, f64)>) -> Self {
        rounds.fold(Self { weight: 0.0, weight_per_m: 0.0 }, |best, (length_m, weight)| Self {
            weight: best.weight.max(weight),
            weight_per_m: best.weight_per_m.max(weight / length_m),
        })
    }

    /// Most that a last round makes of rounds of this length: `weight / L (length + L)`.
    fn beside(&self, length_m: f64) -> f64 {
        self.weight + self.weight_per_m * length_m
    }

    /// The strongest train that begins with a round of this length and weight and turns at the
    /// face once.
    fn after(&self, face: &Disc, length_m: f64, weight: f64) -> f64 {
        // A passage scatters at most like the whole disc in phase, and at most twice a mirror.
        let scatters = face.strength_m() / length_m * self.beside(length_m);
        weight * scatters.min(2.0 * face.face.reflectance * self.weight)
    }
}

/// Rows of rounds, each longer one from a shorter one.
struct Search<'a> {
    face: Disc,
    settings: &'a Settings,
    floor: f64,
    best: Best,
    /// The ways out run backwards, which a row may end with, and then the ways out themselves.
    rounds: Vec<Loop>,
    /// What the beam pattern makes of each ending.
    weights: Vec<f64>,
    /// Rounds that leave or come back within the beam, by their place.
    middles: Vec<usize>,
    /// What the disc makes of each round into each, once it is known: rows meet the same pairs
    /// again and again.
    passages_m: Vec<Option<Complex64>>,
    found: Vec<Train>,
}

impl<'a> Search<'a> {
    fn new(face: Disc, outs: &[(Loop, f64)], floor: f64, settings: &'a Settings) -> Self {
        let backwards = |(round, _): &(Loop, f64)| Loop {
            round: Round { echo: round.round.echo, reversed: !round.own_reverse },
            leaves_rad: round.returns_rad,
            returns_rad: round.leaves_rad,
            ..*round
        };
        let count = outs.len();
        let others = (0..count).filter(|at| !outs[*at].0.own_reverse).map(|at| count + at);
        Self {
            face,
            settings,
            floor,
            best: Best::of(outs.iter().map(|(out, weight)| (out.length_m, *weight))),
            rounds: outs.iter().map(backwards).chain(outs.iter().map(|(out, _)| *out)).collect(),
            weights: outs.iter().map(|(_, weight)| *weight).collect(),
            middles: (0..count).chain(others).collect(),
            passages_m: vec![None; 4 * count * count],
            found: Vec::new(),
        }
    }

    /// All rows.
    fn run(mut self) -> Vec<Train> {
        for (at, leaving) in self.weights.clone().into_iter().enumerate() {
            let first = self.weights.len() + at;
            let out = self.rounds[first];
            let strength = out.phase * (leaving / out.length_m);
            self.extend(&smallvec![out.round], first, strength, out.length_m);
        }
        self.found
    }

    /// Ends a row of rounds, and goes on with it. `strength` is its field over its spreading,
    /// one over metres.
    fn extend(
        &mut self,
        rounds: &SmallVec<[Round; 4]>,
        last: usize,
        strength: Complex64,
        length_m: f64,
    ) {
        let disc_m = self.face.strength_m();
        let bound = strength.norm() * disc_m;
        let too_many = rounds.len() >= MOST_ROUNDS || self.found.len() >= MOST_TRAINS;
        if too_many || bound * self.best.beside(length_m) < self.floor {
            return;
        }
        for at in 0..self.weights.len() {
            let (end, weight) = (self.rounds[at], self.weights[at]);
            let total_m = length_m + end.length_m;
            if bound * weight / end.length_m * total_m < self.floor
                || total_m > self.settings.max_path_m
            {
                continue;
            }
            let field =
                strength * self.passage_m(last, at) * end.phase * (weight / end.length_m * total_m);
            if field.norm() >= self.floor {
                let mut rounds = rounds.clone();
                rounds.push(end.round);
                let (amplitude, phase_rad) = field.to_polar();
                self.found.push(Train { rounds, length_m: total_m, phase_rad, amplitude });
            }
        }
        for place in 0..self.middles.len() {
            let at = self.middles[place];
            let middle = self.rounds[at];
            let total_m = length_m + middle.length_m;
            let per_m = middle.amplitude / middle.length_m;
            if bound * per_m * disc_m * self.best.beside(total_m) < self.floor
                || total_m >= self.settings.max_path_m
            {
                continue;
            }
            let mut rounds = rounds.clone();
            rounds.push(middle.round);
            let next = strength * self.passage_m(last, at) * middle.phase * per_m;
            self.extend(&rounds, at, next, total_m);
        }
    }

    /// How strongly the disc scatters from one round into the next, metres.
    fn passage_m(&mut self, last: usize, next: usize) -> Complex64 {
        let [from, to] = [last, next].map(|at| &self.rounds[at]);
        let face = self.face;
        let of_pair = &mut self.passages_m[last * self.rounds.len() + next];
        *of_pair.get_or_insert_with(|| {
            let aspect = FaceAspect {
                in_m: from.length_m,
                out_m: to.length_m,
                in_rad: from.returns_rad,
                out_rad: to.leaves_rad,
            };
            let apart = from.length_m * to.length_m / (from.length_m + to.length_m);
            apart * face.reflection(&aspect)
        })
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::{
        acoustics::{Face, Sensor},
        geometry::DVec2,
        model::paths::Via,
    };

    const DISC: Disc = Disc {
        face: Face { radius_m: 0.0215, reflectance: 1.0 },
        wave_number_per_m: TAU * 49_400.0 / 343.99,
    };

    fn settings(max_path_m: f64) -> Settings {
        Settings {
            max_path_m,
            max_order: None,
            floor: 1e-3,
            rounds_above: 1.0,
            crowded_m: 0.0,
            edge_law: None,
            double_diffraction: false,
            absorption_np_per_m: 0.0,
            wave_number_per_m: DISC.wave_number_per_m,
            sensor_z_m: None,
            tilt_rad: 0.0,
            scatter_height_rad: 0.0,
        }
    }

    /// Trains between a face and one head-on wall, by number of rounds from 2.
    fn before_a_wall(disc: Disc, round_m: f64, direction_rad: f64) -> Vec<Train> {
        let echo = Echo {
            length_m: round_m,
            amplitude: 1.0,
            phase_rad: 0.0,
            departure: DVec2::X,
            arrival: DVec2::X,
            rise_rad: [0.0; 2],
            image: 0,
            via: Via::Walls { node: 0 },
        };
        let beam = BeamPattern::new(&Sensor::preset("senscomp-6500").expect("a preset"), 343.99);
        let mut trains = Loops::new(disc, &[echo], &Envelope::of(&beam), &settings(4.5 * round_m))
            .trains(direction_rad, &beam, &settings(4.5 * round_m));
        trains.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
        trains
    }

    /// The middle of the field that has run `rounds` times between a point on a disc's axis, an
    /// endless wall and the disc: Kirchhoff's integral, passage by passage.
    fn kirchhoff(round_m: f64, rounds: usize) -> f64 {
        const RINGS: usize = 120;
        let k = DISC.wave_number_per_m;
        let a = DISC.face.radius_m;
        let radius = |ring: usize| a * ((ring as f64 + 0.5) / RINGS as f64).sqrt();
        let area = a * a / 2.0 / RINGS as f64;
        let step = |from: f64, to: f64| {
            Complex64::new(0.0, k / round_m * area)
                * libm::j0(k * from * to / round_m)
                * Complex64::cis(-k * (from * from + to * to) / (2.0 * round_m))
        };
        let point = |r: f64| Complex64::cis(-k * r * r / (2.0 * round_m)) / round_m;
        let mut field: Vec<Complex64> = (0..RINGS).map(|ring| point(radius(ring))).collect();
        for _ in 2..rounds {
            let next = |to: f64| (0..RINGS).map(|ring| step(radius(ring), to) * field[ring]).sum();
            field = (0..RINGS).map(|ring| next(radius(ring))).collect();
        }
        let middle: Complex64 = (0..RINGS).map(|ring| step(radius(ring), 0.0) * field[ring]).sum();
        middle.norm() * rounds as f64 * round_m
    }

    #[test]
    fn rounds_before_a_wall_follow_kirchhoffs_integral() {
        for (round_m, most_db) in [(0.188, [0.1, 2.1, 3.9]), (0.4, [0.1, 0.6, 1.15])] {
            let trains = before_a_wall(DISC, round_m, 0.0);
            assert_eq!(trains.len(), 3);
            for ((train, rounds), most_db) in trains.iter().zip(2..).zip(most_db) {
                assert!((train.length_m - round_m * rounds as f64).abs() < 1e-12);
                let off_db = 20.0 * (train.amplitude / kirchhoff(round_m, rounds)).log10();
                assert!(off_db.abs() < most_db, "{rounds} of {round_m} m: {off_db} dB");
            }
        }
    }

    #[test]
    fn each_passage_costs_the_faces_reflectance_and_turning_away_the_rest() {
        let dull = Disc { face: Face { reflectance: 0.5, ..DISC.face }, ..DISC };
        let (bright, dull) = (before_a_wall(DISC, 0.3, 0.0), before_a_wall(dull, 0.3, 0.0));
        for ((one, other), passages) in bright.iter().zip(&dull).zip(1..) {
            assert!((other.amplitude / one.amplitude - 0.5_f64.powi(passages)).abs() < 1e-12);
        }
        let turned = before_a_wall(DISC, 0.3, 6_f64.to_radians());
        assert!(turned[0].amplitude < 0.3 * bright[0].amplitude);
        assert!(before_a_wall(DISC, 0.3, 3.0).is_empty());
        // A wall that touches the face is left to the ringing of the transducer.
        assert!(before_a_wall(DISC, 0.04, 0.0).is_empty());
    }
}
