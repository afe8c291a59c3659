//! Batch prediction for a robot with an array.

use pyo3::prelude::*;
use sonard_model::{
    geometry::Pose,
    model::{self, ModelError},
};

use super::{ArrayModel, checked_rounds};
use crate::{
    arrays::{self, PoseArray, READING_WORDS},
    error, firing,
};

/// Consecutive firings of a round from a pose.
struct FiringPose {
    pose: Pose,
    /// Index of the first firing in the round.
    first: usize,
}

pub(super) fn predict<'py>(
    model: &ArrayModel,
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    rounds: u32,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = PoseArray::from_python(poses)?;
    let rounds = checked_rounds(rounds)?;
    let array = model.rangers();
    let firing_poses: Vec<Pose> =
        poses.list.iter().flat_map(|pose| array.rotated_poses(pose, rounds)).collect();
    checked(model, py, &firing_poses, |at| poses.index(at / rounds as usize))?;
    let firing_poses: Vec<FiringPose> =
        firing_poses.into_iter().map(|pose| FiringPose { pose, first: 0 }).collect();
    let firings = array.round().count();
    let mut shape = poses.shape;
    shape.push(firings * rounds as usize);
    readings(model, py, &firing_poses, firings, threads, shape)
}

/// Predicts one firing per pose.
pub(super) fn fire<'py>(
    model: &ArrayModel,
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = PoseArray::from_python(poses)?;
    checked(model, py, &poses.list, |at| poses.index(at))?;
    // A single pose is that of the first firing.
    let along = poses.shape.last().copied().unwrap_or(1).max(1);
    let firings = model.rangers().round().count();
    let firing_pose =
        |(at, pose): (usize, &Pose)| FiringPose { pose: *pose, first: at % along % firings };
    let firing_poses: Vec<FiringPose> = poses.list.iter().enumerate().map(firing_pose).collect();
    readings(model, py, &firing_poses, 1, threads, poses.shape)
}

/// Checks that the robot can be placed at every pose.
fn checked(
    model: &ArrayModel,
    py: Python<'_>,
    poses: &[Pose],
    index: impl Fn(usize) -> Vec<usize>,
) -> PyResult<()> {
    let (array, scene) = (model.rangers(), model.bare_scene());
    let checked = py.detach(|| array.check_poses(scene, poses));
    checked.map_err(|(at, error)| error::array_pose(py, &index(at), &error))
}

fn readings<'py>(
    model: &ArrayModel,
    py: Python<'py>,
    firing_poses: &[FiringPose],
    each: usize,
    threads: Option<usize>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let simulated = model.simulated(py)?;
    let fire = |firing_pose: &FiringPose, row: &mut [f64]| fire_at(&simulated, firing_pose, row);
    let table = firing::table(py, firing_poses, each, threads, fire)?;
    firing::shaped(py, table, arrays::array_reading_dtype(py)?, shape)
}

fn fire_at(
    model: &model::ArrayModel,
    firing_pose: &FiringPose,
    row: &mut [f64],
) -> Result<(), ModelError> {
    let here = model.at(firing_pose.pose)?;
    for (firing, words) in (firing_pose.first..).zip(row.chunks_exact_mut(READING_WORDS)) {
        words.copy_from_slice(&arrays::encode_array_reading(&here.ping_in_round(firing)?));
    }
    Ok(())
}
