//! Tests of the stages against known rooms.

mod array;
mod boxes;
mod coarse;
mod next_view;
mod posts;
mod rectangle;
mod reference;
mod sensor_fit;
mod stages;
mod undetermined;

use std::sync::Arc;

use sonard_inverse::{FiringOutcome, FitSweep, SweepFiring, World};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::Options,
    reading::PingStatus,
    scene::Scene,
};
use uuid::Uuid;

use crate::{
    arrangement::{LineArrangement, PieceSet},
    line::Line,
    odometry::OdometrySigma,
    options::SurveyOptions,
    progress::SurveyObserver,
    scores::PlanScores,
    survey::workspace,
    workspace::Workspace,
};

/// Rectangle without a right angle to the axes of the plane.
const TURN_RAD: f64 = 0.4;
const SIZE_M: [f64; 2] = [2.8, 2.3];

/// Places in the frame of the rectangle, with world headings.
const STOPS: [[f64; 3]; 4] =
    [[0.7, 0.6, 20.0], [1.2, 0.9, 65.0], [1.9, 1.3, 100.0], [1.4, 1.6, 190.0]];

fn rectangle() -> Vec<DVec2> {
    let turn = DVec2::from_angle(TURN_RAD);
    let [w, d] = SIZE_M;
    [[0.0, 0.0], [w, 0.0], [w, d], [0.0, d]].map(|at| turn.rotate(at.into())).to_vec()
}

fn stops() -> Vec<Pose> {
    let turn = DVec2::from_angle(TURN_RAD);
    let pose = |[x, y, heading_deg]: [f64; 3]| {
        let at = turn.rotate(DVec2::new(x, y));
        Pose { x_m: at.x, y_m: at.y, heading_deg }
    };
    STOPS.map(pose).to_vec()
}

/// World of a room with these corners.
fn world(corners: &[DVec2]) -> World {
    let corners: Vec<[f64; 2]> = corners.iter().map(|corner| corner.to_array()).collect();
    let room = Scene::builder("room").material("wall", 0.97).room("wall", &corners, "wall");
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let options = Options { max_range_m: Some(4.0), ..Options::default() };
    World::new(Arc::new(room.build().expect("a room")), sensor, Air::default(), options)
}

/// Sweeps predicted from true poses, with other poses as odometry.
fn sweeps(world: &World, poses: &[Pose], odometry: &[Pose]) -> Vec<FitSweep> {
    let simulator = world.simulator(&poses[0]).expect("a simulator");
    let tof_us_per_m = 2e6 / world.air.sound_speed_m_s();
    let firing = |pose: &Pose, azimuth_deg: f64| {
        let reading = simulator.at(pose.position()).ping(pose.direction_rad(azimuth_deg));
        let reading = reading.expect("few paths");
        let outcome = match (reading.status, reading.range_m) {
            (PingStatus::Echo, Some(range_m)) => {
                FiringOutcome::Echo { tof_us: range_m * tof_us_per_m }
            }
            (PingStatus::MinRange, _) => FiringOutcome::BelowMinRange,
            _ => FiringOutcome::NoEcho,
        };
        SweepFiring { azimuth_deg, outcome }
    };
    let sweep = |(number, (pose, odometry)): (u128, (&Pose, &Pose))| FitSweep {
        scan: Uuid::from_u128(number),
        pose: *odometry,
        beams: (0..200).map(|at| firing(pose, 1.8 * f64::from(at))).collect(),
    };
    (1..).zip(poses.iter().zip(odometry)).map(sweep).collect()
}

/// Odometry with errors of some centimetres and degrees.
fn drifted(poses: &[Pose]) -> Vec<Pose> {
    let off = |(at, pose): (usize, &Pose)| Pose {
        x_m: pose.x_m + 0.012 * at as f64,
        y_m: pose.y_m - 0.009 * at as f64,
        heading_deg: pose.heading_deg + 1.1 * at as f64,
    };
    poses.iter().enumerate().map(off).collect()
}

fn options() -> SurveyOptions {
    SurveyOptions { odometry: Some(OdometrySigma::default()), ..SurveyOptions::default() }
}

/// Corners of the rectangle, stops, the room as a world, and sweeps with true poses as odometry.
fn true_rectangle() -> (Vec<DVec2>, Vec<Pose>, World, Vec<FitSweep>) {
    let (corners, poses) = (rectangle(), stops());
    let world = world(&corners);
    let sweeps = sweeps(&world, &poses, &poses);
    (corners, poses, world, sweeps)
}

/// Workspace of sweeps with true poses as odometry.
fn true_workspace<'a>(
    world: &World,
    sweeps: &'a [FitSweep],
    watched: (&'a dyn SurveyObserver, &'a PlanScores),
) -> Workspace<'a> {
    workspace(world, (sweeps.into(), sweeps), &options(), watched).expect("sweeps with arcs")
}

/// Arrangement of the lines through pairs of points, with the pieces between the points as walls.
fn plan_of(walls: &[[DVec2; 2]], poses: &[Pose]) -> (LineArrangement, PieceSet) {
    let line = |[a, b]: &[DVec2; 2]| {
        let mut line = Line::through((*b - *a).perp().to_angle(), *a);
        let mut points = [*a, *b].map(|end| line.along_m(end));
        points.sort_by(f64::total_cmp);
        line.points = points.to_vec();
        line
    };
    let plan = LineArrangement::new(walls.iter().map(line).collect(), poses, 4.0);
    let mut set = PieceSet::new(plan.pieces());
    for (at, [a, b]) in walls.iter().enumerate() {
        let line = &plan.lines[at];
        let mut ends = [*a, *b].map(|end| line.along_m(end));
        ends.sort_by(f64::total_cmp);
        for piece in 0..plan.pieces_of(at) {
            let middle = 0.5 * (plan.cuts[at][piece].along_m + plan.cuts[at][piece + 1].along_m);
            set.set(plan.piece(at, piece), ends[0] < middle && middle < ends[1]);
        }
    }
    (plan, set)
}

/// Walls between neighbouring corners.
fn sides(corners: &[DVec2]) -> Vec<[DVec2; 2]> {
    (0..corners.len()).map(|at| [corners[at], corners[(at + 1) % corners.len()]]).collect()
}
