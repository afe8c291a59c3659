//! Plan with its poses, and the columns of both in normal equations.

use nalgebra::DVector;
use sonard_model::geometry::{DVec2, Pose, wrap_180};

use crate::{
    arrangement::{LineArrangement, PieceSet, Run},
    line::{off_square_rad, square_axis},
    normal::{NormalEquations, move_pose, pose_column},
    post::PostShape,
    square::MAX_OFF_RAD,
};

/// Plan with its poses.
#[derive(Debug, Clone)]
pub(crate) struct PosedPlan {
    pub(crate) plan: LineArrangement,
    pub(crate) walls: PieceSet,
    pub(crate) posts: Vec<PostShape>,
    pub(crate) poses: Vec<Pose>,
}

impl PosedPlan {
    /// Poses without lines and walls.
    pub(crate) fn without_walls(poses: Vec<Pose>) -> Self {
        let plan = LineArrangement::new(Vec::new(), &poses, 0.0);
        Self { plan, walls: PieceSet::default(), posts: Vec::new(), poses }
    }

    /// Plan after a step of its numbers, by column, with lines as long as the range `reach_m`.
    pub(crate) fn moved(&self, columns: &LineColumns, step: &DVector<f64>, reach_m: f64) -> Self {
        let three = |column: usize| [0, 1, 2].map(|offset| step[column + offset]);
        let mut poses = self.poses.clone();
        for (at, pose) in poses.iter_mut().enumerate() {
            if let Some(column) = pose_column(at) {
                move_pose(pose, three(column));
            }
        }
        let mut lines = self.plan.lines.clone();
        for (line, column) in lines.iter_mut().zip(columns.lines()) {
            if let Some(column) = column {
                line.normal_rad += step[column];
                line.distance_m += step[column + 1];
            }
            line.update_feet(&poses);
        }
        let (plan, walls) = self.plan.rebuilt(&self.walls, lines, &poses, reach_m);
        let posts = self.posts.iter().enumerate();
        let posts = posts.map(|(at, post)| post.moved(three(columns.of_post(at)))).collect();
        Self { plan, walls, posts, poses }
    }

    /// Plan with other poses, with lines as long as the range `reach_m`.
    pub(crate) fn with_poses(self, poses: Vec<Pose>, reach_m: f64) -> Self {
        let mut lines = self.plan.lines.clone();
        lines.iter_mut().for_each(|line| line.update_feet(&poses));
        let (plan, walls) = self.plan.rebuilt(&self.walls, lines, &poses, reach_m);
        Self { plan, walls, poses, ..self }
    }

    /// Plan and poses moved together so that the first pose is `frame`.
    pub(crate) fn in_frame(mut self, frame: &Pose) -> Self {
        let Some(&first) = self.poses.first() else { return self };
        let turned_deg = frame.heading_deg - first.heading_deg;
        let turn = DVec2::from_angle(turned_deg.to_radians());
        let by = frame.position() - turn.rotate(first.position());
        for pose in &mut self.poses {
            let place = turn.rotate(pose.position()) + by;
            (pose.x_m, pose.y_m) = (place.x, place.y);
            pose.heading_deg = wrap_180(pose.heading_deg + turned_deg);
        }
        self.poses[0] = *frame;
        for post in &mut self.posts {
            post.center = turn.rotate(post.center) + by;
        }
        self.plan.move_by(turned_deg.to_radians(), by);
        self
    }

    /// Plan without walls shorter than `max_m` metres.
    pub(crate) fn without_short_walls(&self, max_m: f64) -> Self {
        let mut fewer = self.clone();
        for run in self.plan.runs(&self.walls) {
            if self.plan.segment(&run).length_m() < max_m {
                fewer.set_run(&run, false);
            }
        }
        fewer
    }

    /// Adds or removes the pieces of a run.
    pub(crate) fn set_run(&mut self, run: &Run, is_wall: bool) {
        for at in run.first..=run.last {
            self.walls.set(self.plan.piece(run.line, at), is_wall);
        }
    }
}

/// Columns of the lines with walls in normal equations, after those of the poses: direction, then
/// distance; last those of the posts: x and y of the centre, then radius.
#[derive(Debug, Clone)]
pub(crate) struct LineColumns {
    lines: Vec<Option<usize>>,
    first_post: usize,
    count: usize,
}

impl LineColumns {
    pub(crate) fn new(posed: &PosedPlan) -> Self {
        let mut count = 3 * posed.poses.len().saturating_sub(1);
        let mut lines = vec![None; posed.plan.lines.len()];
        for run in posed.plan.runs(&posed.walls) {
            lines[run.line].get_or_insert_with(|| {
                count += 2;
                count - 2
            });
        }
        Self { lines, first_post: count, count: count + 3 * posed.posts.len() }
    }

    /// Number of columns in all.
    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// Column of the direction of a line; `None` without walls on it.
    pub(crate) fn of(&self, line: usize) -> Option<usize> {
        self.lines.get(line).copied().flatten()
    }

    /// Column of the x of a post.
    pub(crate) const fn of_post(&self, post: usize) -> usize {
        self.first_post + 3 * post
    }

    /// Column of the direction of each line.
    pub(crate) fn lines(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        self.lines.iter().copied()
    }

    /// Columns of all directions.
    pub(crate) fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.lines.iter().flatten().copied()
    }

    /// Ties the directions of lines to their common square axis, with a standard deviation in
    /// radians.
    pub(crate) fn add_square(
        &self,
        normal: &mut NormalEquations,
        plan: &LineArrangement,
        sigma_rad: f64,
    ) {
        let used = plan.lines.iter().zip(self.lines()).filter(|(_, at)| at.is_some());
        let lines: Vec<_> = used.map(|(line, _)| line.clone()).collect();
        let Some(axis_rad) = square_axis(&lines) else { return };
        for (line, at) in plan.lines.iter().zip(self.lines()) {
            let off_rad = off_square_rad(line.normal_rad, axis_rad);
            if let Some(at) = at
                && off_rad.abs() < MAX_OFF_RAD
            {
                normal.add(&[(at, 1.0)], -off_rad, sigma_rad, 1e3);
            }
        }
    }
}
