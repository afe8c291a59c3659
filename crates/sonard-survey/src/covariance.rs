//! Covariance of poses and lines.

use nalgebra::DMatrix;
use sonard_model::geometry::DVec2;

use crate::{arrangement::LineArrangement, normal::pose_column, posed::LineColumns};

/// Covariance of a refinement with its columns.
#[derive(Debug, Clone)]
pub(crate) struct PlanCovariance {
    matrix: DMatrix<f64>,
    columns: LineColumns,
}

impl PlanCovariance {
    pub(crate) const fn new(matrix: DMatrix<f64>, columns: LineColumns) -> Self {
        Self { matrix, columns }
    }

    /// Covariance with all entries multiplied.
    pub(crate) fn scaled(&self, by: f64) -> Self {
        Self { matrix: by * &self.matrix, columns: self.columns.clone() }
    }

    /// Standard deviations of a pose: x, y in metres and heading in degrees; 0 for the first.
    pub(crate) fn pose_sigma(&self, pose: usize) -> [f64; 3] {
        let Some(at) = pose_column(pose) else { return [0.0; 3] };
        let sigma = |at: usize| self.matrix[(at, at)].max(0.0).sqrt();
        [sigma(at), sigma(at + 1), sigma(at + 2).to_degrees()]
    }

    /// Standard deviations of a post: x and y of its centre and radius, metres; `None` for a post
    /// added since the estimate.
    pub(crate) fn post_sigma(&self, post: usize) -> Option<[f64; 3]> {
        let at = self.columns.of_post(post);
        let sigma = |at: usize| self.matrix[(at, at)].max(0.0).sqrt();
        (at + 3 <= self.columns.count()).then(|| [at, at + 1, at + 2].map(sigma))
    }

    /// Standard deviations of a line's direction, degrees, and of its distance at a position along
    /// it, metres.
    pub(crate) fn line_sigma(&self, line: usize, along_m: f64) -> Option<[f64; 2]> {
        let at = self.columns.of(line)?;
        let of = |a: usize, b: usize| self.matrix[(at + a, at + b)];
        let offset = of(1, 1) + along_m * along_m * of(0, 0) - 2.0 * along_m * of(0, 1);
        Some([of(0, 0).max(0.0).sqrt().to_degrees(), offset.max(0.0).sqrt()])
    }

    /// Covariance of the intersection of two lines, metres squared: xx, xy, yy.
    pub(crate) fn corner(&self, lines: [usize; 2], plan: &LineArrangement) -> Option<[f64; 3]> {
        let [a, b] = lines.map(|line| &plan.lines[line]);
        let point = a.meet(b)?;
        let mut rows: Vec<(usize, DVec2)> = Vec::new();
        for (own, other) in [(0, 1), (1, 0)] {
            let at = self.columns.of(lines[own])?;
            let [own, other] = [own, other].map(|of| &plan.lines[lines[of]]);
            // n_own . dx = change of the offset, n_other . dx = 0.
            let by_distance = other.along() / own.normal().dot(other.along());
            rows.push((at, -own.along_m(point) * by_distance));
            rows.push((at + 1, by_distance));
        }
        let mut sums = [0.0; 3];
        for &(at, by) in &rows {
            for &(other, by_other) in &rows {
                let of = self.matrix[(at, other)];
                sums[0] += of * by.x * by_other.x;
                sums[1] += of * by.x * by_other.y;
                sums[2] += of * by.y * by_other.y;
            }
        }
        Some(sums)
    }
}
