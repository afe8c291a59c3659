//! The echoes of one place, weighed for an azimuth.

use std::f64::consts::PI;

use super::{
    Echo, Paths, Settings, Trees,
    trains::{FLOOR_ABOVE, Loops, Round, Train},
    wheel::{Both, Envelope, Spoke, Wheel},
};
use crate::{
    acoustics::{BeamPattern, Disc, Image, Incidence, Incident, Sound},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, Engine, Interaction, Mechanism, Path, Survey, mirrored},
    reading::PathKind,
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
    /// What echoes by cylinders are kept by; all are where the axis is tilted, and may be nearer to
    /// a rising path than its azimuth is.
    both: Option<Both>,
    /// See [`Self::through_nulls`].
    through_nulls: bool,
}

impl PathEngine {
    /// Prepares a scene for a ranger; without a face, sound passes it as if it were not there.
    #[must_use]
    pub fn new(scene: &Scene, beam: BeamPattern, face: Option<Disc>, settings: Settings) -> Self {
        let envelope = Envelope::of(&beam);
        let is_wanted = !scene.cylinders.is_empty() && settings.tilt_rad == 0.0;
        // A round that the face turns into another loses at least this.
        let turned = face.map_or(0.0, |face| 2.0 * face.face.reflectance / FLOOR_ABOVE);
        let both = is_wanted.then(|| Both::of(&envelope, turned));
        let paths = Paths::new(scene, settings);
        Self { paths, beam, face, envelope, both, through_nulls: false }
    }

    /// Gives also what a steady tone could not be heard of because it falls into a null of the beam
    /// pattern: what the full response of the face to a pulse still hears.
    #[must_use]
    pub fn through_nulls(self, through_nulls: bool) -> Self {
        Self { through_nulls, ..self }
    }

    /// Whether all sound stays in the plane of the scan.
    fn is_flat(&self) -> bool {
        self.paths.images.is_empty() && self.paths.settings.tilt_rad == 0.0
    }

    /// Angle between the transducer's axis and a direction that is `azimuth_rad` beside it in the
    /// plan and points up by `rise_rad`, radians.
    fn off_axis(&self, azimuth_rad: f64, rise_rad: f64) -> f64 {
        let (tilt_sin, tilt_cos) = self.paths.settings.tilt_rad.sin_cos();
        let (rise_sin, rise_cos) = rise_rad.sin_cos();
        (tilt_cos * rise_cos * azimuth_rad.cos() + tilt_sin * rise_sin).clamp(-1.0, 1.0).acos()
    }
}

impl Engine for PathEngine {
    fn survey<'a>(&'a self, position: DVec2) -> Box<dyn Survey + 'a> {
        self.survey_pair(position, position)
    }

    fn survey_pair<'a>(&'a self, transmitter: DVec2, receiver: DVec2) -> Box<dyn Survey + 'a> {
        Box::new(PathSurvey::new(self, self.paths.clone(), [transmitter, receiver]))
    }

    fn survey_within<'a>(
        &'a self,
        places: [DVec2; 2],
        max_path_m: f64,
    ) -> Option<Box<dyn Survey + 'a>> {
        Some(Box::new(PathSurvey::new(self, self.paths.within(max_path_m), places)))
    }
}

/// Widest reach of each wheel, degrees.
const REACHES_DEG: [f64; 5] = [6.0, 10.0, 16.0, 30.0, 180.0];

/// The echo paths of a place.
struct PathSurvey<'a> {
    engine: &'a PathEngine,
    /// The engine's, perhaps for shorter paths.
    paths: Paths,
    trees: Trees,
    /// Shortest first.
    echoes: Vec<Echo>,
    /// From narrow to wide reach: the many weak echoes are heard in few directions only.
    wheels: [Wheel; REACHES_DEG.len()],
    /// What the face can send round again.
    loops: Option<Loops>,
}

impl<'a> PathSurvey<'a> {
    fn new(engine: &'a PathEngine, paths: Paths, [transmitter, receiver]: [DVec2; 2]) -> Self {
        let (trees, echoes) = paths.echoes(transmitter, receiver, engine.both.as_ref());
        let settings = &paths.settings;
        let mut spokes: [Vec<Spoke>; REACHES_DEG.len()] = Default::default();
        for (echo, index) in echoes.iter().zip(0..) {
            if let Some(mut spoke) = Spoke::of(echo, index, &engine.envelope, settings.floor) {
                if settings.tilt_rad != 0.0 {
                    // A tilted axis may be nearer to a rising path than its azimuth is.
                    spoke.reach_rad = PI;
                }
                let reach_deg = spoke.reach_rad.to_degrees();
                let wheel = REACHES_DEG.iter().position(|most| reach_deg <= *most);
                spokes[wheel.unwrap_or(REACHES_DEG.len() - 1)].push(spoke);
            }
        }
        let wheels = spokes.map(|spokes| Wheel::new(&spokes));
        // Transmitter and receiver apart have a face each, and a tilted one turns sound up or down:
        // what runs between them and the walls is left out.
        let faces_level = transmitter == receiver && settings.tilt_rad == 0.0;
        let loops = engine
            .face
            .filter(|_| faces_level)
            .map(|face| Loops::new(face, &echoes, &engine.envelope, settings));
        Self { engine, paths, trees, echoes, wheels, loops }
    }

    /// Echoes by way of the face, in a direction in (-pi, pi].
    fn trains(&self, direction_rad: f64) -> Vec<Train> {
        let settings = &self.paths.settings;
        self.loops
            .as_ref()
            .map_or_else(Vec::new, |loops| loops.trains(direction_rad, &self.engine.beam, settings))
    }

    fn train_arrival(&self, direction_rad: f64, train: &Train, amplitude: f64) -> Arrival {
        let path = |round: &Round| {
            let echo = &self.echoes[round.echo as usize];
            let path = self.paths.path(&self.trees, echo).path;
            if round.reversed { path.reversed() } else { path }
        };
        let at_face = Interaction {
            mechanism: Mechanism::Transducer,
            point: self.trees.ends[0],
            z_m: self.paths.sensor_z_m(),
        };
        let mut interactions = Vec::new();
        for (number, round) in train.rounds.iter().enumerate() {
            interactions.extend((number > 0).then_some(at_face));
            interactions.extend(path(round).interactions);
        }
        let (path_amplitude, [departure_rad, arrival_rad]) =
            self.train_ends(direction_rad, train, amplitude);
        Arrival {
            length_m: train.length_m,
            amplitude,
            path_amplitude,
            phase_rad: train.phase_rad,
            departure_rad,
            arrival_rad,
            path: Path { interactions },
        }
    }

    /// A train's amplitude before the beam pattern, and the directions in which it leaves and comes back.
    fn train_ends(&self, direction_rad: f64, train: &Train, amplitude: f64) -> (f64, [f64; 2]) {
        let ends_rad = |round: &Round| {
            let echo = &self.echoes[round.echo as usize];
            let ends_rad = [echo.departure, echo.arrival].map(DVec2::to_angle);
            if round.reversed { [ends_rad[1], ends_rad[0]] } else { ends_rad }
        };
        let [first, last] = [&train.rounds[0], &train.rounds[train.rounds.len() - 1]].map(ends_rad);
        let ends_rad = [first[0], last[1]];
        let [leaving, arriving] =
            ends_rad.map(|end| self.engine.beam.one_way(wrap_pi(end - direction_rad)));
        (amplitude / (leaving * arriving), ends_rad)
    }

    /// How the face looks over a train.
    fn train_image(&self, train: &Train) -> Image {
        let echoes = train.rounds.iter().map(|round| &self.echoes[round.echo as usize]);
        let passages = train.rounds.len() - 1;
        echoes
            .map(|echo| match echo.via.kind() {
                PathKind::Specular => Some(self.paths.mirrors_met(&self.trees, echo)),
                PathKind::Diffracted | PathKind::Scattered => None,
            })
            .try_fold(passages, |met, more| Some(met + more?))
            .map_or(Image::Lost, mirrored)
    }
}

impl Survey for PathSurvey<'_> {
    fn listen(&self, direction_rad: f64, sounds: &mut Vec<Sound>) {
        sounds.clear();
        let direction_rad = wrap_pi(direction_rad);
        let (beam, floor) = (&self.engine.beam, self.paths.settings.floor);
        let is_flat = self.engine.is_flat();
        for wheel in &self.wheels {
            wheel.near(direction_rad, |spoke, off_rad| {
                let mut ends = [off_rad + spoke.half_rad, off_rad - spoke.half_rad];
                if !is_flat {
                    let rise_rad = self.echoes[spoke.echo as usize].rise_rad;
                    ends = [0, 1].map(|end| self.engine.off_axis(ends[end], rise_rad[end]));
                }
                let [leaving, arriving] = ends.map(|angle| beam.one_way(angle));
                let amplitude = spoke.amplitude * leaving * arriving;
                let most = if self.engine.through_nulls {
                    spoke.amplitude * self.engine.envelope.beyond(&ends)
                } else {
                    amplitude
                };
                if most >= floor {
                    let Echo { length_m, phase_rad, .. } = self.echoes[spoke.echo as usize];
                    sounds.push(Sound { length_m, amplitude, phase_rad, index: spoke.echo });
                }
            });
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

    fn incident(&self, direction_rad: f64, sound: &Sound) -> Incident {
        let (paths, trees) = (&self.paths, &self.trees);
        let index = sound.index as usize;
        let (strength, ends_rad, length_m, image) = if let Some(echo) = self.echoes.get(index) {
            let image = match echo.via.kind() {
                PathKind::Specular => mirrored(paths.mirrors_met(trees, echo)),
                PathKind::Diffracted => {
                    let view = paths.edges.view(trees, echo, &paths.settings);
                    view.map_or(Image::Lost, Image::Bent)
                }
                PathKind::Scattered => Image::Lost,
            };
            let ends_rad = [echo.departure, echo.arrival].map(DVec2::to_angle);
            (echo.amplitude, ends_rad, echo.length_m, image)
        } else {
            let train = &self.trains(wrap_pi(direction_rad))[index - self.echoes.len()];
            let (strength, ends_rad) = self.train_ends(direction_rad, train, sound.amplitude);
            (strength, ends_rad, train.length_m, self.train_image(train))
        };
        let [leaving_rad, arriving_rad] = ends_rad.map(|end_rad| wrap_pi(end_rad - direction_rad));
        Incident { strength, incidence: Incidence { leaving_rad, arriving_rad, length_m, image } }
    }

    fn arrival(&self, direction_rad: f64, sound: &Sound) -> Arrival {
        let index = sound.index as usize;
        if let Some(train) = index.checked_sub(self.echoes.len()) {
            let trains = self.trains(wrap_pi(direction_rad));
            return self.train_arrival(direction_rad, &trains[train], sound.amplitude);
        }
        let echo = &self.echoes[index];
        let path = self.paths.path(&self.trees, echo);
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
