//! Sweeps of the arena by run, as a survey takes them.

use std::{error::Error, fs, path::Path};

use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use sonard_inverse::{FiringOutcome, FitSweep, SweepFiring};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::Pose,
    scene::Scene,
};
use uuid::Uuid;

/// Standard deviation of the headings by odometry, degrees.
const HEADING_DEG: f64 = 5.0;
/// Range up to which one of the robots detects its own body, metres.
const BODY_M: f64 = 0.265;
const ROBOT_WITH_BODY: &str = "roberto";

/// Sweep as in `arena-sweeps.json`.
#[derive(Deserialize)]
struct RecordedSweep {
    group: String,
    waypoint_m: [f64; 2],
    /// Directions in the frame of the arena, by the heading fitted by hand.
    bearing_deg: Vec<f64>,
    /// `None` for no echo.
    range_m: Vec<Option<f64>>,
    fit_m: [f64; 2],
    /// Distance of the face ahead of the axis.
    radial_offset_m: f64,
}

/// Sweeps of one run of a robot.
pub(crate) struct Run {
    pub(crate) name: String,
    pub(crate) sensor: Sensor,
    /// Sweeps with their poses by odometry: waypoints, and headings drawn around those fitted by
    /// hand. The heading of the first sweep is the frame's.
    pub(crate) sweeps: Vec<FitSweep>,
    /// Poses fitted by hand. Azimuths are bearings in the frame of the arena, so headings are 0.
    pub(crate) poses: Vec<Pose>,
}

/// Arena with its runs.
pub(crate) struct Arena {
    pub(crate) scene: Scene,
    pub(crate) runs: Vec<Run>,
}

impl Arena {
    /// Reads `arena.json` and `arena-sweeps.json` of a folder.
    pub(crate) fn load(folder: &Path, seed: u64) -> Result<Self, Box<dyn Error>> {
        let scene = Scene::from_json(&fs::read_to_string(folder.join("arena.json"))?)?;
        let text = fs::read_to_string(folder.join("arena-sweeps.json"))?;
        let recorded: Vec<RecordedSweep> = serde_json::from_str(&text)?;
        let runs = recorded.chunk_by(|a, b| a.group == b.group);
        Ok(Self { scene, runs: runs.map(|of| run(of, seed)).collect::<Result<_, _>>()? })
    }
}

fn run(recorded: &[RecordedSweep], seed: u64) -> Result<Run, Box<dyn Error>> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let errors = Normal::new(0.0, HEADING_DEG)?;
    let name = recorded[0].group.clone();
    let mut sensor = Sensor::preset("lego-nxt")?;
    sensor.mounting.ahead_m = recorded[0].radial_offset_m;
    let pose = |[x_m, y_m]: [f64; 2], heading_deg| Pose { x_m, y_m, heading_deg };
    let sound_speed_m_s = Air::default().sound_speed_m_s();
    let is_body = |range_m: Option<f64>| {
        name.starts_with(ROBOT_WITH_BODY) && range_m.is_some_and(|range_m| range_m <= BODY_M)
    };
    let firing = |(&azimuth_deg, &range_m): (&f64, &Option<f64>)| SweepFiring {
        azimuth_deg,
        outcome: range_m.map_or(FiringOutcome::NoEcho, |range_m| FiringOutcome::Echo {
            tof_us: 2e6 * range_m / sound_speed_m_s,
        }),
    };
    let sweeps = recorded.iter().zip(1u128..).map(|(of, number)| {
        let error_deg = errors.sample(&mut random);
        let readings = of.bearing_deg.iter().zip(&of.range_m);
        FitSweep {
            scan: Uuid::from_u128(number),
            pose: pose(of.waypoint_m, if number == 1 { 0.0 } else { error_deg }),
            beams: readings.filter(|(_, range_m)| !is_body(**range_m)).map(firing).collect(),
        }
    });
    let sweeps = sweeps.collect();
    let poses = recorded.iter().map(|of| pose(of.fit_m, 0.0)).collect();
    Ok(Run { name, sensor, sweeps, poses })
}
