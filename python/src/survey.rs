//! Surveys of unknown rooms.

use std::{
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    thread,
    time::Duration,
};

use pyo3::{exceptions::PyValueError, prelude::*, types::PyTuple};
use sonard::{
    inverse::{ArrayFiring, ArrayRound, FiringOutcome, FitSweep, World},
    survey::{
        OdometrySigma, Survey, SurveyCourse, SurveyError, SurveyObserver, SurveyOptions,
        SurveyProgress, unknown_room,
    },
};
use sonard_model::{
    acoustics, array as model_array,
    geometry::{DVec2, Pose},
    model::Options,
};
use uuid::Uuid;

use crate::{
    air::Air,
    array,
    arrays::PoseArray,
    error::{LogError, SonardError, new_error},
    json,
    log::{Log, Scan, scans_of},
    options::parse_name,
    pool::pool,
    readings::BeamReadings,
    scene::Scene,
    sense::warn,
    sensor,
};

/// Interval between checks for interrupts.
const INTERRUPT_INTERVAL: Duration = Duration::from_millis(50);

/// Reconstructs an unknown room and the poses of sweeps, or of an array on a moving robot, as
/// ``sonard survey`` does.
///
/// Parameters
/// ----------
/// sweeps : Log, Scan, sequence of them, or array_like of shape (sweeps, beams)
///     Full turns of a ranger at two places or more, in the order of the course: scans of logs,
///     readings as returned by ``Model.predict``, or ranges in metres, with ``inf`` for no echo and
///     ``nan`` for a missing measurement. Unusable scans are skipped with a warning. Or scans of an
///     array on a moving robot; or, with ``array``, its rounds, of shape (rounds, firings) in the
///     order of ``array.round``, as returned by ``ArrayModel.predict``.
/// poses : array_like, shape (sweeps, 3), optional
///     Poses by odometry: x and y (metres) and heading (degrees). The first one is the frame of the
///     result. Default to those of the scans, and must be omitted for scans of an array; required
///     for ndarrays, unless ``odometry`` is ``None``.
/// array : RangerArray or str, optional
///     Array that took the rounds, or the name of a preset; must be omitted for scans.
/// azimuths_deg : array_like, shape (beams,), optional
///     Azimuths of the beams of an ndarray, degrees. Default to 400 azimuths from 0 to 359.1.
/// sensor : Sensor or str, optional
///     Defaults to that of the scans or of ``array``, else to ``"senscomp-6500"``.
/// air : Air, optional
///     Defaults to that of the scans, for ndarrays to 20 degrees.
/// odometry : tuple of float, optional
///     Standard deviations of the poses per metre driven: of the position (metres) and of the
///     heading (degrees). ``None`` ignores the poses.
/// square : bool
///     ``True`` if most walls are square to each other.
/// max_range_m : float
///     Maximum range, metres, 0.3 to 20; longer ranges count as no echo.
/// reflectance : float
///     Amplitude reflection coefficient of all walls, above 0, up to 1.
/// fit : sequence of str
///     Numbers of sensor and air to fit together with the plan: ``"threshold"``, ``"rise"`` (of the
///     threshold with range), ``"mounting"``, ``"materials"`` (the reflectance), ``"air"`` (speed
///     of sound), ``"delay"``, ``"gear"``, ``"beam"``, ``"skirts"``, ``"pulse"``.
/// round_spacing_m : float
///     Minimum distance between rounds of a logged array that are used, metres, 0 to 5, unless the
///     robot turns by 5 degrees. A survey takes 200 rounds at most.
/// view_reach_m : float
///     Maximum distance of the next view from a stop, metres, 0 to 20.
/// max_scenes : int
///     Budget of the search: maximum number of floor plans whose readings are predicted.
/// closed : bool
///     Keep conjectured stretches of walls in the scene.
/// progress : callable, optional
///     Called with a dict at each stage of the search: ``stage`` (``"course"``, ``"walls"``,
///     ``"alternatives"``), with ``"walls"`` also ``round`` (from 1), ``scored_scenes``, ``walls``
///     and ``score`` (nats, or ``None``). An exception ends the search and is raised.
///
/// Returns
/// -------
/// Survey
///
/// Raises
/// ------
/// SonardError
///     With fewer than two sweeps, a sweep without arcs, a number that cannot be fitted, or no wall
///     found.
/// LogError
///     If no scan can be used, or the scans differ in sensor.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are keywords where they are used")]
#[pyo3(signature = (sweeps, poses = None, *, array = None, azimuths_deg = None, sensor = None, air = None,
    odometry = Some((0.05, 5.0)), square = false, max_range_m = 5.0, reflectance = 0.97, fit = Vec::new(),
    round_spacing_m = SurveyCourse::ROUND_SPACING_M, view_reach_m = 1.5, max_scenes = 60_000,
    closed = false, progress = None),
    text_signature = "(sweeps, poses=None, *, array=None, azimuths_deg=None, sensor=None, air=None, odometry=(0.05, 5.0), square=False, max_range_m=5.0, reflectance=0.97, fit=(), round_spacing_m=0.1, view_reach_m=1.5, max_scenes=60000, closed=False, progress=None)")]
pub(crate) fn survey<'py>(
    py: Python<'py>,
    sweeps: &Bound<'py, PyAny>,
    poses: Option<&Bound<'py, PyAny>>,
    array: Option<&Bound<'py, PyAny>>,
    azimuths_deg: Option<&Bound<'py, PyAny>>,
    sensor: Option<&Bound<'py, PyAny>>,
    air: Option<&Bound<'py, Air>>,
    odometry: Option<(f64, f64)>,
    square: bool,
    max_range_m: f64,
    reflectance: f64,
    fit: Vec<String>,
    round_spacing_m: f64,
    view_reach_m: f64,
    max_scenes: i64,
    closed: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(max_scenes) = usize::try_from(max_scenes).ok().filter(|max| *max > 0) else {
        let message = format!("max_scenes is {max_scenes}: it must be at least 1");
        return Err(PyValueError::new_err(message));
    };
    let fit = fit.into_iter().map(|name| parse_name(py, "fit", &name)).collect::<PyResult<_>>()?;
    let options = SurveyOptions {
        odometry: odometry.map(|(m_per_m, deg_per_m)| OdometrySigma {
            m_per_m,
            deg_per_m,
            ..OdometrySigma::default()
        }),
        square_deg: square.then_some(SurveyOptions::SQUARE_DEG),
        reflectance,
        fit,
        view_reach_m,
        max_scenes,
        ..SurveyOptions::default()
    };
    if !(0.0..=5.0).contains(&round_spacing_m) {
        let message = format!("round_spacing_m is {round_spacing_m}: it must be from 0 to 5");
        return Err(PyValueError::new_err(message));
    }
    let mut given = Given {
        poses: None,
        array: array.map(array::resolve).transpose()?,
        azimuths_deg,
        sensor: None,
        air: None,
        max_range_m,
        round_spacing_m,
    };
    given.air = air.map(|air| *air.get());
    given.poses = poses.map(PoseArray::from_python).transpose()?;
    given.sensor = sensor.map(sensor::resolve).transpose()?;
    let (world, course) = match given.is_of_logs(sweeps)? {
        true => given.logged(py, sweeps)?,
        false => given.measured(sweeps, odometry.is_some())?,
    };
    let found = find(py, &world, &course, &options, progress)?;
    let scene = found.scene("survey", closed);
    scene.build().map_err(|error| {
        let message = format!("the survey found no walls: {error}");
        new_error::<SonardError>(py, &message, "pass sweeps with more echoes")
    })?;
    let scene = Py::new(py, Scene::from_json(py, &scene.text())?)?;
    let sensor = found.fitted.as_ref().map(|fitted| fitted.sensor.clone());
    let sensor = sensor.map(|sensor| Py::new(py, sensor::Sensor { sensor })).transpose()?;
    let class = py.import("sonard._results")?.getattr("Survey")?;
    class.call_method1("_from_dict", (json::to_python(py, &found)?, scene, sensor))
}

/// Arguments that describe the sweeps.
struct Given<'a, 'py> {
    poses: Option<PoseArray>,
    array: Option<Py<array::RangerArray>>,
    azimuths_deg: Option<&'a Bound<'py, PyAny>>,
    sensor: Option<Py<sensor::Sensor>>,
    air: Option<Air>,
    max_range_m: f64,
    round_spacing_m: f64,
}

impl<'py> Given<'_, 'py> {
    /// Returns `true` for scans of logs.
    fn is_of_logs(&self, sweeps: &Bound<'py, PyAny>) -> PyResult<bool> {
        let is_logged = |given: &Bound<'py, PyAny>| {
            given.is_instance_of::<Log>() || given.is_instance_of::<Scan>()
        };
        let is_list =
            sweeps.is_instance_of::<pyo3::types::PyList>() || sweeps.is_instance_of::<PyTuple>();
        let first = || sweeps.get_item(0);
        Ok(is_logged(sweeps) || is_list && (sweeps.len()? == 0 || is_logged(&first()?)))
    }

    /// World and readings of scans.
    fn logged(
        &self,
        py: Python<'py>,
        scans: &Bound<'py, PyAny>,
    ) -> PyResult<(World, SurveyCourse)> {
        let given =
            [("azimuths_deg", self.azimuths_deg.is_some()), ("array", self.array.is_some())];
        if let Some((name, _)) = given.iter().find(|(_, is_given)| *is_given) {
            return Err(PyValueError::new_err(format!("{name} must be omitted for scans")));
        }
        let scans = scans_of(scans)?;
        self.check_poses(py, scans.len())?;
        let mut used: Vec<&Scan> = Vec::new();
        let mut course: Option<SurveyCourse> = None;
        for (at, scan) in scans.iter().map(Py::get).enumerate() {
            let mut found = match SurveyCourse::from_scan(scan.view()) {
                Ok(found) => found,
                Err(error) => {
                    warn(py, &format!("{error}; scan skipped"))?;
                    continue;
                }
            };
            match (&mut found, &self.poses) {
                (_, None) => {}
                (SurveyCourse::Sweeps(sweeps), Some(poses)) => {
                    sweeps.iter_mut().for_each(|sweep| sweep.pose = poses.list[at]);
                }
                (SurveyCourse::Rounds(_), Some(_)) => {
                    let message = "poses must be omitted for scans of an array, which have one in each reading";
                    return Err(PyValueError::new_err(message));
                }
            }
            used.push(scan);
            match &mut course {
                None => course = Some(found),
                Some(course) => {
                    course.extend(found).map_err(|error| survey_error(py, &[], &error))?;
                }
            }
        }
        let (Some(first), Some(mut course)) = (used.first(), course) else {
            let help = "pass scans of a ranger on a stepper, or of an array on a moving robot";
            return Err(new_error::<LogError>(py, "no sweep to survey", help));
        };
        course.thin(self.round_spacing_m);
        let session = first.session_of(py)?;
        for scan in &used {
            if self.sensor.is_none() && scan.session_of(py)?.sensor != session.sensor {
                let help = "survey the scans of one sensor together, or pass a sensor";
                return Err(new_error::<LogError>(py, "the scans have different sensors", help));
            }
        }
        let sensor = match &self.sensor {
            Some(sensor) => sensor.get().sensor.clone(),
            None => session.sensor.clone(),
        };
        let air = match self.air {
            Some(air) => air.air,
            None => first.air(py)?.air,
        };
        let world = self.world(py, sensor, air, first.options(py)?)?;
        Ok((world, course))
    }

    /// World and readings of an ndarray, or of a sequence of them.
    fn measured(
        &self,
        sweeps: &Bound<'py, PyAny>,
        has_odometry: bool,
    ) -> PyResult<(World, SurveyCourse)> {
        let py = sweeps.py();
        let Ok(rows) = sweeps.try_iter() else {
            let kind = sweeps.get_type();
            return Err(PyValueError::new_err(format!(
                "sweeps is a {kind}: it must be scans or an array of shape (sweeps, beams)"
            )));
        };
        let rows = rows.collect::<PyResult<Vec<_>>>()?;
        if self.poses.is_none() && has_odometry {
            return Err(PyValueError::new_err(
                "poses is missing: pass the pose of each sweep by odometry, or odometry=None",
            ));
        }
        self.check_poses(py, rows.len())?;
        let sensor = match (&self.sensor, &self.array) {
            (Some(sensor), _) => sensor.clone_ref(py),
            (None, Some(array)) => Py::new(py, array::own_sensor(py, &array.get().array.sensor)?)?,
            (None, None) => sensor::default(py)?,
        };
        let air = self.air.map_or_else(acoustics::Air::default, |air| air.air);
        let world = self.world(py, sensor.get().sensor.clone(), air, Options::default())?;
        let origin = Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 };
        let pose = |at: usize| self.poses.as_ref().map_or(origin, |poses| poses.list[at]);
        let scan = |at: usize| Uuid::from_u128(at as u128);
        let sound_speed_m_s = air.sound_speed_m_s();
        let numbered = rows.iter().enumerate();
        if let Some(array) = &self.array {
            if self.azimuths_deg.is_some() {
                let message =
                    "azimuths_deg must be omitted with an array, which has its directions";
                return Err(PyValueError::new_err(message));
            }
            let array = &array.get().array;
            let round = |(at, row): (usize, &Bound<'py, PyAny>)| {
                let firings = array_firings(array, row, sound_speed_m_s);
                let firings = firings.map_err(|error| in_sweep(py, at, &error))?;
                Ok(ArrayRound { scan: scan(at), pose: pose(at), firings })
            };
            let rounds = numbered.map(round).collect::<PyResult<_>>()?;
            return Ok((world, SurveyCourse::Rounds(rounds)));
        }
        let sweep = |(at, row): (usize, &Bound<'py, PyAny>)| {
            let beams = BeamReadings::from_python(row)
                .and_then(|readings| readings.firings(self.azimuths_deg, sound_speed_m_s));
            let beams = beams.map_err(|error| in_sweep(py, at, &error))?;
            Ok(FitSweep { scan: scan(at), pose: pose(at), beams })
        };
        let sweeps = numbered.map(sweep).collect::<PyResult<_>>()?;
        Ok((world, SurveyCourse::Sweeps(sweeps)))
    }

    fn world(
        &self,
        py: Python<'py>,
        sensor: acoustics::Sensor,
        air: acoustics::Air,
        options: Options,
    ) -> PyResult<World> {
        let world = unknown_room(sensor, air, options, self.max_range_m);
        world.map_err(|error| survey_error(py, &[], &error))
    }

    fn check_poses(&self, py: Python<'py>, sweeps: usize) -> PyResult<()> {
        let Some(PoseArray { shape, list }) = &self.poses else { return Ok(()) };
        if **shape != [sweeps] {
            let shape = PyTuple::new(py, [&**shape, &[3]].concat())?;
            return Err(PyValueError::new_err(format!(
                "poses has the shape {shape}: it must be ({sweeps}, 3), a pose for each sweep"
            )));
        }
        let is_finite =
            |pose: &Pose| [pose.x_m, pose.y_m, pose.heading_deg].iter().all(|n| n.is_finite());
        match list.iter().position(|pose| !is_finite(pose)) {
            Some(at) => {
                let message =
                    format!("poses[{at}]: values must be finite; odometry=None ignores poses");
                Err(PyValueError::new_err(message))
            }
            None => Ok(()),
        }
    }
}

/// Firings of a round, given in the order of firing; without those that have no outcome.
fn array_firings(
    array: &model_array::RangerArray,
    row: &Bound<'_, PyAny>,
    sound_speed_m_s: f64,
) -> PyResult<Vec<ArrayFiring>> {
    let readings = BeamReadings::from_python(row)?;
    let order: Vec<usize> = array.round().collect();
    if order.len() != readings.len() {
        return Err(PyValueError::new_err(format!(
            "{} readings, but a round of the array has {} firings",
            readings.len(),
            order.len()
        )));
    }
    let firing = |(at, outcome): (usize, Option<FiringOutcome>)| {
        let ranger = &array.rangers[at];
        Some(ArrayFiring {
            position: DVec2::new(ranger.x_m, ranger.y_m),
            azimuth_deg: ranger.azimuth_deg(),
            outcome: outcome?,
        })
    };
    Ok(order.into_iter().zip(readings.outcomes(sound_speed_m_s)).filter_map(firing).collect())
}

/// Adds the index of a sweep to an error in its readings.
fn in_sweep(py: Python<'_>, at: usize, error: &PyErr) -> PyErr {
    PyValueError::new_err(format!("sweeps[{at}]: {}", error.value(py)))
}

fn survey_error(py: Python<'_>, sweeps: &[FitSweep], error: &SurveyError) -> PyErr {
    let (message, help) = match error {
        SurveyError::NoArcs(scan) => {
            let at = sweeps.iter().position(|sweep| sweep.scan == *scan).unwrap_or_default();
            let message =
                format!("sweeps[{at}] has no arc of equal ranges, by which it could be located");
            (message, "leave this sweep out, or raise max_range_m")
        }
        SurveyError::TooFewSweeps(_) => (error.to_string(), ""),
        SurveyError::MixedCourse => (error.to_string(), "survey them separately"),
        SurveyError::TooManyRounds { .. } => {
            (error.to_string(), "pass fewer rounds, or raise round_spacing_m")
        }
        SurveyError::Option { name, value, expected } => {
            let name = match *name {
                "m_per_m" => "odometry[0]",
                "deg_per_m" => "odometry[1]",
                other => other,
            };
            (format!("{name} is {value}: it must be {expected}"), "")
        }
        SurveyError::World(_) | SurveyError::Scene(_) => {
            (error.to_string(), "check sensor, air and max_range_m")
        }
        SurveyError::Group(_) | SurveyError::NotFittable { .. } => {
            (error.to_string(), "poses, walls and posts are estimated in any case")
        }
    };
    new_error::<SonardError>(py, &message, help)
}

/// Surveys on the pool, while this thread calls back and checks for interrupts.
fn find(
    py: Python<'_>,
    world: &World,
    course: &SurveyCourse,
    options: &SurveyOptions,
    progress: Option<Py<PyAny>>,
) -> PyResult<Survey> {
    let pool = pool(py, None)?;
    let is_cancelled = &AtomicBool::new(false);
    let (sender, receiver) = channel();
    let observer = Observer { sender, is_cancelled };
    let (found, watched) = py.detach(move || {
        thread::scope(|scope| {
            let working = scope.spawn(move || {
                // The channel closes when the search ends.
                let observer = observer;
                pool.install(|| sonard::survey::survey(world, course, options, &observer))
            });
            let watched = watch(&receiver, progress.as_ref(), is_cancelled);
            (working.join(), watched)
        })
    });
    watched?;
    let found = found.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let sweeps = match course {
        SurveyCourse::Sweeps(sweeps) => sweeps.as_slice(),
        SurveyCourse::Rounds(_) => &[],
    };
    found.map_err(|error| survey_error(py, sweeps, &error))
}

/// Reports progress until the search ends. The first exception, of the callback or by a signal,
/// cancels the search.
fn watch(
    progress: &Receiver<SurveyProgress>,
    callback: Option<&Py<PyAny>>,
    is_cancelled: &AtomicBool,
) -> PyResult<()> {
    let mut watched = Ok(());
    loop {
        let progress = match progress.recv_timeout(INTERRUPT_INTERVAL) {
            Ok(progress) => Some(progress),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return watched,
        };
        if watched.is_err() {
            continue;
        }
        watched = Python::attach(|py| {
            if let Some((callback, progress)) = callback.zip(progress) {
                callback.call1(py, (json::to_python(py, &progress)?,))?;
            }
            py.check_signals()
        });
        is_cancelled.store(watched.is_err(), Ordering::Relaxed);
    }
}

/// Observer that sends progress to the thread that called.
struct Observer<'a> {
    sender: Sender<SurveyProgress>,
    is_cancelled: &'a AtomicBool,
}

impl SurveyObserver for Observer<'_> {
    fn progress(&self, progress: SurveyProgress) {
        // The receiver lives until the search ends.
        let _ = self.sender.send(progress);
    }

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}
