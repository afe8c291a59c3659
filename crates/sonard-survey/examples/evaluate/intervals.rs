//! Intervals of a survey compared with the truth.

use sonard_model::geometry::{DVec2, Pose, distance_to_segment, wrap_180};
use sonard_survey::{
    PieceStatus, PostShape, Survey,
    trial::{Ends, is_post_at},
};

/// Quantities with intervals.
const QUANTITIES: [&str; 9] = [
    "x",
    "y",
    "heading",
    "wall's position",
    "wall's direction",
    "corner",
    "post's x",
    "post's y",
    "post's radius",
];

/// Numbers of 95 % intervals that hold the truth, each with that of all, by [`QUANTITIES`].
pub(crate) type Intervals = [[usize; 2]; QUANTITIES.len()];

/// Counts the 95 % intervals of poses, walls and posts that hold the truth.
pub(crate) fn count_intervals(
    found: &Survey,
    poses: &[Pose],
    truth: &[Ends],
    posts: &[PostShape],
) -> Intervals {
    let of_poses = pose_deviations(found, poses);
    let of_walls = wall_deviations(found, truth);
    let [x, y, heading] = [0, 1, 2].map(|at| count_inside(of_poses.iter().map(|of| of[at])));
    let [position, direction] = [0, 1].map(|at| count_inside(of_walls.iter().map(|of| of[at])));
    let corner = count_inside(corner_deviations(found, truth).into_iter());
    let of_posts = post_deviations(found, posts);
    let [post_x, post_y, radius] =
        [0, 1, 2].map(|at| count_inside(of_posts.iter().map(|of| of[at])));
    [x, y, heading, position, direction, corner, post_x, post_y, radius]
}

/// Deviations of x, y and heading of poses, in standard deviations.
fn pose_deviations(found: &Survey, truth: &[Pose]) -> Vec<[f64; 3]> {
    let deviations = found.poses.iter().zip(truth).skip(1).filter_map(|(of, truth)| {
        let [x_m, y_m] = of.sigma_m?;
        let turn_deg = wrap_180(of.pose.heading_deg - truth.heading_deg);
        Some([
            (of.pose.x_m - truth.x_m) / x_m,
            (of.pose.y_m - truth.y_m) / y_m,
            turn_deg / of.sigma_heading_deg?,
        ])
    });
    deviations.collect()
}

/// Deviations of the middles of walls from the true wall near them, and of their directions, in
/// standard deviations.
fn wall_deviations(found: &Survey, truth: &[Ends]) -> Vec<[f64; 2]> {
    const NEAR_M: f64 = 0.02;
    let deviations = found.walls.iter().filter_map(|wall| {
        let [a, b] = [wall.from, wall.to].map(|end| DVec2::from(end.at_m));
        let middle = a.midpoint(b);
        let is_near = |[c, d]: &&Ends| distance_to_segment(middle, *c, *d) < NEAR_M;
        let [c, d] = truth.iter().find(is_near)?;
        let along = (*d - *c).normalize();
        let turn_deg = (b - a).angle_to(along).to_degrees();
        let turn_deg = turn_deg - 180.0 * (turn_deg / 180.0).round();
        Some([
            along.perp_dot(middle - *c) / wall.sigma_across_m?,
            turn_deg / wall.sigma_direction_deg?,
        ])
    });
    deviations.collect()
}

/// Deviations of ends of walls from the true corners near them, as quantiles of a normal
/// distribution with the same probability as that of the distance.
fn corner_deviations(found: &Survey, truth: &[Ends]) -> Vec<f64> {
    /// Quantile of the chi-square distribution with two degrees of freedom.
    const CHI_SQUARE_95: f64 = 5.991;
    const NEAR_M: f64 = 0.02;
    let ends = found.walls.iter().flat_map(|wall| [&wall.from, &wall.to]);
    let deviations = ends.filter_map(|end| {
        let [xx, xy, yy] = end.covariance_m2?;
        let corners = truth.iter().flatten().map(|corner| DVec2::from(end.at_m) - *corner);
        let off = corners.min_by(|a, b| a.length().total_cmp(&b.length()))?;
        let square = yy * off.x * off.x - 2.0 * xy * off.x * off.y + xx * off.y * off.y;
        let square = square / (xx * yy - xy * xy);
        (off.length() < NEAR_M).then_some(NORMAL_95 * (square / CHI_SQUARE_95).sqrt())
    });
    deviations.collect()
}

/// Quantile of the normal distribution that bounds 95 % on both sides.
const NORMAL_95: f64 = 1.96;

/// Numbers of deviations within 95 % intervals, and of all.
fn count_inside(deviations: impl Iterator<Item = f64>) -> [usize; 2] {
    deviations
        .fold([0, 0], |[inside, all], off| [inside + usize::from(off.abs() <= NORMAL_95), all + 1])
}

/// Deviations of x, y and radius of observed posts from the true ones near them, in standard
/// deviations.
fn post_deviations(found: &Survey, truth: &[PostShape]) -> Vec<[f64; 3]> {
    let observed = found.posts.iter().filter(|post| post.status == PieceStatus::Observed);
    let deviations = observed.filter_map(|post| {
        let center = DVec2::from(post.center_m);
        let own = truth.iter().find(|of| is_post_at(center, of))?;
        let off = center - own.center;
        let [x_m, y_m] = post.sigma_m?;
        let radius_m = post.radius_m - own.radius_m;
        Some([off.x / x_m, off.y / y_m, radius_m / post.sigma_radius_m?])
    });
    deviations.collect()
}

/// Prints how many of the 95 % intervals hold the truth.
pub(crate) fn print_intervals(trials: &[Intervals]) {
    for (at, quantity) in QUANTITIES.iter().enumerate() {
        let sum = |of: usize| trials.iter().map(|trial| trial[at][of]).sum::<usize>();
        let [inside, all] = [sum(0), sum(1)];
        println!("95 % intervals of {quantity}: {inside} of {all} hold the truth");
    }
}
