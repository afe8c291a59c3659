//! Picture of a survey.

use super::{
    Args, Input,
    course::{self, BeamEcho},
};
use crate::{
    cli::{
        Failure, Outcome,
        output::{Overwrite, Product},
    },
    geometry::DVec2,
    plot::{EchoCause, SurveyView, WallCertainty, badge_among, draw_survey},
    survey::{PieceStatus, ReadingCause, Survey, SurveyedEnd},
};

/// Names of the picture in the output folder.
pub(super) const FILES: [(&str, Product); 2] =
    [("plan.svg", Product::Svg), ("plan.png", Product::Png)];
const WIDTH_PX: u32 = 1600;
/// Radius of the 95 % region of a normal distribution in the plane, in standard deviations along
/// the larger axis: sqrt(5.99).
const REGION_SIGMAS: f64 = 2.45;

/// Draws walls by status, intervals of corners, course and echoes by cause.
///
/// # Errors
///
/// Failure of rendering, or write errors.
pub(super) fn write(args: &Args, overwrite: Overwrite, input: &Input, found: &Survey) -> Outcome {
    let walls: Vec<(WallCertainty, [DVec2; 2])> = found
        .walls
        .iter()
        .flat_map(|wall| &wall.pieces)
        .map(|piece| (certainty(piece.status), [piece.from_m, piece.to_m].map(DVec2::from)))
        .collect();
    let posts: Vec<(WallCertainty, DVec2, f64)> = found
        .posts
        .iter()
        .map(|post| (certainty(post.status), post.center_m.into(), post.radius_m))
        .collect();
    let ends = found.walls.iter().flat_map(|wall| [&wall.from, &wall.to]);
    let corners: Vec<(DVec2, f64)> = ends.filter_map(corner).collect();
    let poses: Vec<_> = found.poses.iter().map(|of| of.pose).collect();
    let view = SurveyView {
        title: "Survey".to_owned(),
        lines: vec![super::summary::in_short(input, found)],
        badge: badge_among(input.provenances.iter().copied()),
        walls: &walls,
        posts: &posts,
        corners: &corners,
        poses: &poses,
        echoes: &echoes(input, found),
        next_view: found.next_view.as_ref().map(|view| view.pose.position()),
    };
    let picture = draw_survey(&view);
    let png = picture.to_png(WIDTH_PX).map_err(|error| {
        Failure::device(
            format!("cannot draw the survey: {error}"),
            "the other results are complete",
        )
    })?;
    let contents = [picture.to_svg().into_bytes(), png];
    FILES.iter().zip(contents).try_for_each(|((name, product), bytes)| {
        overwrite.save(&args.out.join(name), *product, &bytes)
    })
}

const fn certainty(status: PieceStatus) -> WallCertainty {
    match status {
        PieceStatus::Observed => WallCertainty::Observed,
        PieceStatus::Implied => WallCertainty::Implied,
        PieceStatus::Conjectured => WallCertainty::Conjectured,
    }
}

/// Position of a corner with the radius of its 95 % region.
fn corner(end: &SurveyedEnd) -> Option<(DVec2, f64)> {
    let [xx, xy, yy] = end.covariance_m2?;
    let largest = 0.5 * (xx + yy) + (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
    let radius_m = REGION_SIGMAS * largest.max(0.0).sqrt();
    radius_m.is_finite().then_some((end.at_m.into(), radius_m))
}

/// Echoes at the poses found.
fn echoes(input: &Input, found: &Survey) -> Vec<(DVec2, EchoCause)> {
    let all = course::echoes(&input.course, input.world.air.sound_speed_m_s());
    let mut echoes = Vec::new();
    for ((beams, of), causes) in all.into_iter().zip(&found.poses).zip(&found.causes) {
        for (BeamEcho { position, azimuth_deg, range_m }, cause) in beams.into_iter().zip(causes) {
            let cause = match cause {
                ReadingCause::First => EchoCause::First,
                ReadingCause::Multiple => EchoCause::Multiple,
                ReadingCause::Edge => EchoCause::Edge,
                ReadingCause::Unexplained => EchoCause::Unexplained,
                ReadingCause::NoRange => continue,
            };
            if let Some(range_m) = range_m {
                let from_axis = of.pose.point_at(azimuth_deg, range_m);
                echoes.push((from_axis + of.pose.rotate_to_world(position), cause));
            }
        }
    }
    echoes
}
