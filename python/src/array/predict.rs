//! Readings of many poses of a robot with an array.

use pyo3::prelude::*;
use sonard_model::{
    geometry::Pose,
    model::{self, ModelError},
};

use super::{ArrayModel, checked_rounds};
use crate::{
    arrays::{self, Poses, READING_WORDS},
    error, firing,
};

/// Firings of a round one after the other, from a pose.
struct FiringPose {
    pose: Pose,
    /// Place in the round of the first of them.
    first: usize,
}

pub(super) fn predict<'py>(
    model: &ArrayModel,
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    rounds: u32,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = Poses::of(poses)?;
    let rounds = checked_rounds(rounds)?;
    let array = model.rangers();
    let stands: Vec<Pose> = poses.list.iter().flat_map(|pose| array.turned(pose, rounds)).collect();
    checked(model, py, &stands, |at| poses.index(at / rounds as usize))?;
    let stands: Vec<FiringPose> =
        stands.into_iter().map(|pose| FiringPose { pose, first: 0 }).collect();
    let firings = array.round().count();
    let mut shape = poses.shape;
    shape.push(firings * rounds as usize);
    readings(model, py, &stands, firings, threads, shape)
}

/// One firing a pose.
pub(super) fn fire<'py>(
    model: &ArrayModel,
    py: Python<'py>,
    poses: &Bound<'py, PyAny>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let poses = Poses::of(poses)?;
    checked(model, py, &poses.list, |at| poses.index(at))?;
    // A single pose is that of the first firing.
    let along = poses.shape.last().copied().unwrap_or(1).max(1);
    let firings = model.rangers().round().count();
    let stand =
        |(at, pose): (usize, &Pose)| FiringPose { pose: *pose, first: at % along % firings };
    let stands: Vec<FiringPose> = poses.list.iter().enumerate().map(stand).collect();
    readings(model, py, &stands, 1, threads, poses.shape)
}

/// Whether the robot can stand everywhere.
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
    stands: &[FiringPose],
    each: usize,
    threads: Option<usize>,
    shape: Vec<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let simulated = model.simulated(py)?;
    let fire = |stand: &FiringPose, row: &mut [f64]| fire_at(&simulated, stand, row);
    let table = firing::table(py, stands, each, threads, fire)?;
    firing::shaped(py, table, arrays::array_reading_dtype(py)?, shape)
}

fn fire_at(
    model: &model::ArrayModel,
    stand: &FiringPose,
    row: &mut [f64],
) -> Result<(), ModelError> {
    let here = model.at(stand.pose)?;
    for (firing, words) in (stand.first..).zip(row.chunks_exact_mut(READING_WORDS)) {
        words.copy_from_slice(&arrays::words_of_array(&here.ping_in_round(firing)?));
    }
    Ok(())
}
