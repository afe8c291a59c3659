//! Thin cylinders of the floor plan, which sound passes: they scatter as a whole from their axes.

use super::PlanCircle;
use crate::{
    acoustics::edge::Post,
    geometry::{Arrangement, DVec2},
};

/// Minimum distance, in radii of a post, from its surface to every wall and every other cylinder:
/// multiple reflections between them are omitted.
const GAP_RADII: f64 = 4.0;

/// A thin cylinder in the floor plan.
#[derive(Debug)]
pub(crate) struct PlanPost {
    /// Point of the axis.
    pub(crate) point: u32,
    pub(crate) cylinder: u32,
    pub(crate) post: Post,
}

/// Removes thin cylinders from `circles`, where they remain with radius 0, and adds a point at the
/// axis of each to the floor plan.
pub(crate) fn extract_posts(
    plan: &mut Arrangement,
    circles: &mut [PlanCircle],
    wave_number_per_m: f64,
) -> Vec<PlanPost> {
    let ends = |end: u32| plan.points[end as usize];
    let walls: Vec<[DVec2; 2]> = plan.pieces.iter().map(|piece| piece.ends.map(ends)).collect();
    let thin = circles.iter().zip(0..).filter_map(|(circle, cylinder)| {
        let post = Post::new(circle.radius_m, circle.gain, wave_number_per_m)?;
        is_isolated(circle, cylinder, circles, &walls).then_some((cylinder, post))
    });
    let thin: Vec<(u32, Post)> = thin.collect();
    let add = |(cylinder, post): (u32, Post)| {
        let circle = &mut circles[cylinder as usize];
        circle.radius_m = 0.0;
        plan.points.push(circle.center);
        PlanPost { point: plan.points.len() as u32 - 1, cylinder, post }
    };
    thin.into_iter().map(add).collect()
}

fn is_isolated(
    circle: &PlanCircle,
    number: u32,
    circles: &[PlanCircle],
    walls: &[[DVec2; 2]],
) -> bool {
    let gap_m = GAP_RADII * circle.radius_m;
    let far_from_circles = circles.iter().zip(0..).all(|(other, index)| {
        let apart_m = circle.center.distance(other.center);
        index == number
            || other.radius_m == 0.0
            || apart_m - other.radius_m - circle.radius_m >= gap_m
    });
    let is_far = |&[a, b]: &[DVec2; 2]| {
        let along = b - a;
        let share = ((circle.center - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        (a + share * along).distance(circle.center) - circle.radius_m >= gap_m
    };
    far_from_circles && walls.iter().all(is_far)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thin(x: f64, radius_m: f64) -> PlanCircle {
        PlanCircle { center: DVec2::new(x, 0.0), radius_m, gain: 1.0, is_opaque: true }
    }

    /// Four radii of the thin cylinder, from surface to surface, from cylinders and from walls.
    #[test]
    fn thin_free_cylinders_are_posts() {
        let wave_number_per_m = std::f64::consts::TAU * 49_400.0 / 343.2;
        let taken = |others: &[PlanCircle], walls: &[(DVec2, DVec2)]| {
            let mut circles = [&[thin(0.0, 0.004)], others].concat();
            let mut plan = Arrangement::from_segments(walls);
            let posts = extract_posts(&mut plan, &mut circles, wave_number_per_m);
            for post in &posts {
                assert_eq!(
                    plan.points[post.point as usize],
                    circles[post.cylinder as usize].center
                );
                assert_eq!(circles[post.cylinder as usize].radius_m, 0.0);
            }
            posts.iter().map(|post| post.cylinder).collect::<Vec<_>>()
        };
        assert_eq!(taken(&[], &[]), [0]);
        assert_eq!(taken(&[thin(0.3, 0.004), thin(1.0, 0.2)], &[]), [0, 1]);
        assert_eq!(taken(&[thin(0.2 + 0.021, 0.2)], &[]), [0]);
        assert_eq!(taken(&[thin(0.2 + 0.019, 0.2)], &[]), [] as [u32; 0]);
        let wall = |x: f64| [(DVec2::new(x, -1.0), DVec2::new(x, 1.0))];
        assert_eq!(taken(&[], &wall(0.021)), [0]);
        assert_eq!(taken(&[], &wall(0.019)), [] as [u32; 0]);
    }
}
