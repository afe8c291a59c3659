//! Exact engine: the echo paths of an observation point, weighted for an azimuth.

use std::{f64::consts::PI, sync::Arc};

use super::{
    direction_index::{DirectionEntry, DirectionIndex},
    echo_set::EchoSet,
    floor::TracingPlan,
    found::{EchoPulse, FoundEchoes},
    pattern::{BoundedPattern, TwoWayBound},
    prepare::Paths,
    settings::PathSettings,
    transducer::{DirectedPath, FaceEchoes, MultipleEcho},
};
use crate::{
    acoustics::{BeamPattern, Disc, Image, Incidence, Incident, PulseArrival},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, Arrivals, Engine, Interaction, Mechanism, Path, TooCostly, engine::mirrored},
    reading::PathKind,
    scene::Scene,
};

/// Exact engine: echo paths, a beam pattern and a reflecting transducer face.
///
/// [`PathSettings::floor`] is also the smallest amplitude that
/// [`Arrivals::collect_arrivals`] returns.
#[derive(Debug)]
pub struct PathEngine {
    pub(super) paths: Paths,
    pub(super) pattern: Arc<BoundedPattern>,
    pub(super) face: Option<Disc>,
    /// Lists only those echoes by cylinders that the pattern can leave detectable.
    bounds_cylinders: bool,
    /// See [`Self::through_nulls`].
    through_nulls: bool,
}

impl PathEngine {
    /// Prepares a scene for a ranger. Without a face, sound passes the transducer unhindered.
    #[must_use]
    pub fn new(
        scene: &Scene,
        beam: BeamPattern,
        face: Option<Disc>,
        settings: PathSettings,
    ) -> Self {
        let pattern = Arc::new(BoundedPattern::new(beam, face));
        Self::with_pattern(scene, pattern, face, settings)
    }

    /// Prepares a scene for a ranger whose pattern is prepared already.
    pub(crate) fn with_pattern(
        scene: &Scene,
        pattern: Arc<BoundedPattern>,
        face: Option<Disc>,
        settings: PathSettings,
    ) -> Self {
        // A tilted axis may be nearer to a rising path than its azimuth is.
        let bounds_cylinders = !scene.cylinders.is_empty() && settings.tilt_rad == 0.0;
        let paths = Paths::new(scene, settings);
        Self { paths, pattern, face, bounds_cylinders, through_nulls: false }
    }

    /// Returns the pattern's bound for echoes by cylinders; `None` if all of them are listed.
    fn cylinder_bound(&self) -> Option<&TwoWayBound> {
        self.bounds_cylinders.then(|| self.pattern.two_way())
    }

    /// Also returns arrivals in a null of the beam pattern, where a steady tone is not detectable
    /// but the full response of the face to a pulse is.
    #[must_use]
    pub fn through_nulls(self, through_nulls: bool) -> Self {
        Self { through_nulls, ..self }
    }

    /// Returns `true` if all sound stays in the plane of the scan.
    fn is_flat(&self) -> bool {
        self.paths.heights.images.is_empty() && self.paths.plan.settings.tilt_rad == 0.0
    }

    /// Returns the paths whose pulses have run up to a length, metres.
    pub(super) fn within(&self, length_m: f64) -> Paths {
        let TracingPlan { settings, corners, .. } = &self.paths.plan;
        self.paths.within(settings.max_path_m.min(length_m + corners.max_lead_m))
    }

    /// Smallest amplitude of an arrival.
    pub(crate) fn floor(&self) -> f64 {
        self.paths.plan.settings.floor
    }

    /// Upper bound of an echo's pulse. `amplitude` is that of a steady tone with the beam pattern
    /// at its ends, radians off the axis.
    pub(super) fn upper_bound(
        &self,
        path_amplitude: f64,
        amplitude: f64,
        ends_rad: &[f64; 2],
    ) -> f64 {
        if self.through_nulls {
            path_amplitude * self.pattern.envelope.beyond(ends_rad)
        } else {
            amplitude
        }
    }

    /// Angle, radians, between the transducer's axis and a direction at `azimuth_rad` from it in
    /// the plane and at an elevation of `rise_rad`.
    pub(super) fn off_axis(&self, azimuth_rad: f64, rise_rad: f64) -> f64 {
        let (tilt_sin, tilt_cos) = self.paths.plan.settings.tilt_rad.sin_cos();
        let (rise_sin, rise_cos) = rise_rad.sin_cos();
        (tilt_cos * rise_cos * azimuth_rad.cos() + tilt_sin * rise_sin).clamp(-1.0, 1.0).acos()
    }
}

impl Engine for PathEngine {
    fn arrivals_at<'a>(&'a self, position: DVec2) -> Result<Box<dyn Arrivals + 'a>, TooCostly> {
        self.arrivals_between(position, position)
    }

    fn arrivals_between<'a>(
        &'a self,
        transmitter: DVec2,
        receiver: DVec2,
    ) -> Result<Box<dyn Arrivals + 'a>, TooCostly> {
        let arrivals = PathArrivals::new(self, self.paths.clone(), [transmitter, receiver])?;
        Ok(Box::new(arrivals))
    }

    fn arrivals_within<'a>(
        &'a self,
        ends: [DVec2; 2],
        max_path_m: f64,
    ) -> Result<Option<Box<dyn Arrivals + 'a>>, TooCostly> {
        Ok(Some(Box::new(PathArrivals::new(self, self.within(max_path_m), ends)?)))
    }
}

/// Largest reach of the entries of each index, degrees.
const REACHES_DEG: [f64; 5] = [6.0, 10.0, 16.0, 30.0, 180.0];

/// Echo paths of an observation point, by direction.
struct PathArrivals<'a> {
    engine: &'a PathEngine,
    /// Paths in the engine's floor plan, possibly up to a shorter length.
    found: FoundEchoes,
    /// From small to large reach: the many weak echoes are detectable in few directions only.
    indexes: [DirectionIndex; REACHES_DEG.len()],
    /// Echoes that the face can reflect.
    face_echoes: Option<FaceEchoes>,
}

impl<'a> PathArrivals<'a> {
    fn new(
        engine: &'a PathEngine,
        paths: Paths,
        [transmitter, receiver]: [DVec2; 2],
    ) -> Result<Self, TooCostly> {
        let found = FoundEchoes::between(paths, [transmitter, receiver], engine.cylinder_bound())?;
        let (settings, echoes) = (&found.paths.plan.settings, &found.echoes);
        let mut entries: [Vec<DirectionEntry>; REACHES_DEG.len()] = Default::default();
        for (echo, index) in echoes.iter().zip(0..) {
            if let Some(mut entry) =
                DirectionEntry::new(echo, index, &engine.pattern.envelope, settings.floor)
            {
                if settings.tilt_rad != 0.0 {
                    // A tilted axis may be nearer to a rising path than its azimuth is.
                    entry.reach_rad = PI;
                }
                let reach_deg = entry.reach_rad.to_degrees();
                let index = REACHES_DEG.iter().position(|bound| reach_deg <= *bound);
                entries[index.unwrap_or(REACHES_DEG.len() - 1)].push(entry);
            }
        }
        let indexes = entries.map(|entries| DirectionIndex::new(&entries));
        // A separate transmitter and receiver have a face each, and a tilted face turns sound up or
        // down. Multiple echoes between these and the walls are omitted.
        let faces_level = transmitter == receiver && settings.tilt_rad == 0.0;
        let face_echoes = engine
            .face
            .filter(|_| faces_level)
            .map(|face| FaceEchoes::new(face, echoes, &engine.pattern.envelope, settings));
        Ok(Self { engine, found, indexes, face_echoes })
    }

    /// Multiple echoes by way of the face up to a length, metres, in a direction in (-pi, pi].
    fn multiple_echoes(&self, direction_rad: f64, length_m: f64) -> Vec<MultipleEcho> {
        let (beam, settings) = (&self.engine.pattern.beam, &self.found.paths.plan.settings);
        let max_m = length_m.min(settings.max_path_m);
        let found = |echoes: &FaceEchoes| {
            echoes.multiple_echoes(direction_rad, beam, settings.floor, max_m)
        };
        self.face_echoes.as_ref().map_or_else(Vec::new, found)
    }

    fn multiple_arrival(
        &self,
        direction_rad: f64,
        multiple: &MultipleEcho,
        amplitude: f64,
    ) -> Arrival {
        let FoundEchoes { paths, traced, echoes, .. } = &self.found;
        let run_through = |directed: &DirectedPath| {
            let echo = &echoes[directed.echo as usize];
            let path = paths.path(traced, echo).path;
            if directed.reversed { path.reversed() } else { path }
        };
        let at_face = Interaction {
            mechanism: Mechanism::Transducer,
            point: traced.ends[0],
            z_m: paths.sensor_z_m(),
        };
        let mut interactions = Vec::new();
        for (number, path) in multiple.paths.iter().enumerate() {
            interactions.extend((number > 0).then_some(at_face));
            interactions.extend(run_through(path).interactions.iter());
        }
        let (path_amplitude, [departure_rad, arrival_rad]) =
            self.multiple_ends(direction_rad, multiple, amplitude);
        Arrival {
            length_m: multiple.length_m,
            amplitude,
            path_amplitude,
            phase_rad: multiple.phase_rad,
            departure_rad,
            arrival_rad,
            path: Path { interactions: interactions.into() },
        }
    }

    /// Amplitude of a multiple echo before the beam pattern, and its directions of departure and
    /// arrival.
    fn multiple_ends(
        &self,
        direction_rad: f64,
        multiple: &MultipleEcho,
        amplitude: f64,
    ) -> (f64, [f64; 2]) {
        let ends_rad = |path: &DirectedPath| {
            let echo = &self.found.echoes[path.echo as usize];
            let ends_rad = [echo.departure, echo.arrival].map(DVec2::to_angle);
            if path.reversed { [ends_rad[1], ends_rad[0]] } else { ends_rad }
        };
        let [first, last] =
            [&multiple.paths[0], &multiple.paths[multiple.paths.len() - 1]].map(ends_rad);
        let ends_rad = [first[0], last[1]];
        let [leaving, arriving] =
            ends_rad.map(|end| self.engine.pattern.beam.one_way(wrap_pi(end - direction_rad)));
        (amplitude / (leaving * arriving), ends_rad)
    }

    /// Image of the face over a multiple echo.
    fn multiple_image(&self, multiple: &MultipleEcho) -> Image {
        let FoundEchoes { paths, traced, echoes, .. } = &self.found;
        let parts = multiple.paths.iter().map(|path| &echoes[path.echo as usize]);
        let passages = multiple.paths.len() - 1;
        parts
            .map(|echo| match echo.via.kind() {
                PathKind::Specular => Some(paths.reflection_count(traced, echo)),
                PathKind::Diffracted | PathKind::Scattered => None,
            })
            .try_fold(passages, |sum, count| Some(sum + count?))
            .map_or(Image::PointScatterer, mirrored)
    }
}

impl Arrivals for PathArrivals<'_> {
    fn echo_set(&self, length_m: f64) -> Option<EchoSet> {
        let envelope = &self.engine.pattern.envelope;
        Some(EchoSet::new(&self.found, self.face_echoes.as_ref(), envelope, length_m))
    }

    fn collect_arrivals(&self, direction_rad: f64, arrivals: &mut Vec<PulseArrival>) {
        self.collect_arrivals_within(direction_rad, f64::INFINITY, arrivals);
    }

    fn collect_arrivals_within(
        &self,
        direction_rad: f64,
        length_m: f64,
        arrivals: &mut Vec<PulseArrival>,
    ) {
        arrivals.clear();
        let direction_rad = wrap_pi(direction_rad);
        let FoundEchoes { paths, echoes, .. } = &self.found;
        let within = self.found.count_within(length_m) as u32;
        let (beam, floor) = (&self.engine.pattern.beam, paths.plan.settings.floor);
        let is_flat = self.engine.is_flat();
        for directions in &self.indexes {
            directions.near(direction_rad, within, |entry, off_rad| {
                let mut ends = [off_rad + entry.half_rad, off_rad - entry.half_rad];
                if !is_flat {
                    let rise_rad = echoes[entry.echo as usize].rise_rad;
                    ends = [0, 1].map(|end| self.engine.off_axis(ends[end], rise_rad[end]));
                }
                let leaving = beam.one_way(ends[0]);
                // Most paths return along themselves.
                let arriving = if ends[1] == ends[0] { leaving } else { beam.one_way(ends[1]) };
                let EchoPulse { length_m, phase_rad, gain } = self.found.pulse(entry.echo);
                let amplitude = gain * entry.amplitude * leaving * arriving;
                if self.engine.upper_bound(entry.amplitude, amplitude, &ends) >= floor {
                    arrivals.push(PulseArrival {
                        length_m,
                        amplitude,
                        phase_rad,
                        index: entry.echo,
                    });
                }
            });
        }
        // Echoes are numbered by the lengths of their paths; multiple echoes come after all of
        // them.
        arrivals.sort_unstable_by_key(|arrival| arrival.index);
        let multiple = self.multiple_echoes(direction_rad, length_m);
        if !multiple.is_empty() || self.found.is_reordered() {
            let numbers = echoes.len() as u32..;
            arrivals.extend(multiple.iter().zip(numbers).map(|(echo, index)| echo.arrival(index)));
            arrivals.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
        }
    }

    fn incident(&self, direction_rad: f64, arrival: &PulseArrival) -> Incident {
        self.incident_within(direction_rad, f64::INFINITY, arrival)
    }

    fn arrival(&self, direction_rad: f64, arrival: &PulseArrival) -> Arrival {
        self.arrival_within(direction_rad, f64::INFINITY, arrival)
    }

    fn incident_within(
        &self,
        direction_rad: f64,
        length_m: f64,
        arrival: &PulseArrival,
    ) -> Incident {
        let (echoes, index) = (&self.found.echoes, arrival.index as usize);
        if index < echoes.len() {
            return self.found.incident(arrival.index, [direction_rad; 2]);
        }
        let multiple = self.multiple_echoes(wrap_pi(direction_rad), length_m);
        let multiple = &multiple[index - echoes.len()];
        let (strength, ends_rad) = self.multiple_ends(direction_rad, multiple, arrival.amplitude);
        let [leaving_rad, arriving_rad] = ends_rad.map(|end_rad| wrap_pi(end_rad - direction_rad));
        let (length_m, image) = (multiple.length_m, self.multiple_image(multiple));
        Incident { strength, incidence: Incidence { leaving_rad, arriving_rad, length_m, image } }
    }

    fn arrival_within(&self, direction_rad: f64, length_m: f64, arrival: &PulseArrival) -> Arrival {
        let (echoes, index) = (&self.found.echoes, arrival.index as usize);
        if index < echoes.len() {
            return self.found.arrival(arrival.index, arrival.amplitude);
        }
        let multiple = self.multiple_echoes(wrap_pi(direction_rad), length_m);
        self.multiple_arrival(direction_rad, &multiple[index - echoes.len()], arrival.amplitude)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        acoustics::{PulseArrival, Sensor},
        model::paths::tests::LOSSLESS,
        scene::{Scene, shipped},
    };

    /// With `through_nulls`, echoes in a null of the beam are added and all others are unchanged.
    #[test]
    fn through_nulls_only_adds() {
        let scene = Scene::from_json(shipped::text("two-surface-room").expect("shipped"));
        let scene = scene.expect("a scene");
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let settings = PathSettings { max_path_m: 3.0, floor: 2e-3, ..LOSSLESS };
        let described = |through_nulls: bool, direction_rad: f64| {
            let beam = BeamPattern::new(&sensor, 343.0);
            let engine = PathEngine::new(&scene, beam, None, settings.clone());
            let engine = engine.through_nulls(through_nulls);
            let mut described: Vec<PulseArrival> = Vec::new();
            let arrivals = engine.arrivals_at(DVec2::new(1.2, 0.9)).expect("few paths");
            arrivals.collect_arrivals(direction_rad, &mut described);
            described.len()
        };
        let mut more = 0;
        for at in 0..40 {
            let direction_rad = 0.15 * f64::from(at) - 3.0;
            let [steady, through] = [false, true].map(|nulls| described(nulls, direction_rad));
            assert!(through >= steady, "{direction_rad}: {through} of {steady}");
            more += through - steady;
        }
        assert!(more > 0);
    }
}
