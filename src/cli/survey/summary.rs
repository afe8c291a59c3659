//! Summary of a survey as text and as Markdown.

use std::{
    fmt::Write as _,
    io::{self, Write},
};

use super::{Input, course, next_view};
use crate::{
    cli::table::{align_right, fit, ruled},
    scan::text::format_count,
    survey::{PieceStatus, ReadingCause, SearchEnd, Survey, SurveyedPost, SurveyedWall},
};

/// Walls, arcs and end of the search in a sentence.
pub(super) fn in_short(input: &Input, found: &Survey) -> String {
    let explained = found.arcs - found.unexplained.len();
    let walls = format_count(found.walls.len(), "wall");
    let posts = match found.posts.len() {
        0 => String::new(),
        count => format!(" and {}", format_count(count, "post")),
    };
    format!(
        "{walls}{posts} from {}; {explained} of {} explained",
        course::count(&input.course),
        format_count(found.arcs, "arc"),
    )
}

/// Findings beyond the tables, one sentence each.
fn remarks(found: &Survey) -> Vec<String> {
    let mut remarks =
        vec![format!("{:.1} % of the readings are explained", 100.0 * explained_share(found))];
    match found.end {
        SearchEnd::Complete => {}
        SearchEnd::UnexplainedArcs => remarks.push(format!(
            "warning: {} unexplained: the room has parts other than smooth upright walls, or walls are missing",
            format_count(found.unexplained.len(), "arc")
        )),
        SearchEnd::Budget => remarks.push(
            "warning: the budget is spent before the search ended: raise --max-scenes".to_owned(),
        ),
        SearchEnd::Cancelled => {
            remarks.push("warning: interrupted: this is the best plan so far".to_owned());
        }
    }
    let conjectured_m = length_m(found, PieceStatus::Conjectured);
    if conjectured_m > 0.005 {
        remarks.push(format!(
            "{conjectured_m:.2} m of walls are conjectured: readings hardly depend on them"
        ));
    }
    if found.oblique_nats > 0.05 {
        remarks.push(format!(
            "directions off right angles cost {:.1} nats of the score",
            found.oblique_nats
        ));
    }
    let is_settled = matches!(found.end, SearchEnd::Complete | SearchEnd::UnexplainedArcs);
    if found.alternatives.is_empty() && is_settled {
        remarks.push("no other plan is within 10 nats of this one".to_owned());
    }
    let open = found.poses.iter().filter(|of| !of.equivalent.is_empty()).count();
    if open > 0 {
        remarks.push(format!(
            "warning: {} explained as well by other poses, from which the room looks alike: see survey.json",
            format_count(open, "sweep")
        ));
    }
    for (other, number) in found.alternatives.iter().zip(1..) {
        remarks.push(format!(
            "alternative {number}: {}, probability {:.3} ({:+.1} nats)",
            format_count(other.walls.len(), "wall"),
            other.probability,
            other.score_difference
        ));
    }
    remarks
}

fn explained_share(found: &Survey) -> f64 {
    let causes = || found.causes.iter().flatten();
    let explained = causes().filter(|cause| **cause != ReadingCause::Unexplained).count();
    explained as f64 / causes().count().max(1) as f64
}

/// Length of all stretches with a status, metres.
fn length_m(found: &Survey, status: PieceStatus) -> f64 {
    found.walls.iter().map(|wall| status_length_m(wall, status)).sum()
}

fn status_length_m(wall: &SurveyedWall, status: PieceStatus) -> f64 {
    let pieces = wall.pieces.iter().filter(|piece| piece.status == status);
    pieces
        .map(|piece| {
            let [from, to] = [piece.from_m, piece.to_m];
            (to[0] - from[0]).hypot(to[1] - from[1])
        })
        .fold(0.0, |sum, length_m| sum + length_m)
}

const WALL_HEAD: [&str; 7] =
    ["wall", "from m", "to m", "across \u{b1} mm", "observed m", "implied m", "conjectured m"];
const POST_HEAD: [&str; 6] = ["post", "x m", "y m", "radius mm", "\u{b1} mm, radius", "status"];
const FIT_HEAD: [&str; 5] = ["fitted", "value", "\u{b1}", "assumed", "remark"];
const POSE_HEAD: [&str; 5] = ["stop", "x m", "y m", "heading deg", "\u{b1} mm, deg"];

fn wall_row(wall: &SurveyedWall) -> [String; 7] {
    let place = |[x, y]: [f64; 2]| format!("{x:.4}, {y:.4}");
    let across = wall.sigma_across_m.map_or_else(|| "-".to_owned(), |m| format!("{:.2}", 1e3 * m));
    let [observed, implied, conjectured] =
        [PieceStatus::Observed, PieceStatus::Implied, PieceStatus::Conjectured]
            .map(|status| format!("{:.2}", status_length_m(wall, status)));
    let ends = [wall.from.at_m, wall.to.at_m].map(place);
    let [from, to] = ends;
    [wall.id.clone(), from, to, across, observed, implied, conjectured]
}

fn post_row(post: &SurveyedPost) -> [String; 6] {
    let sigma = match (post.sigma_m, post.sigma_radius_m) {
        (Some([x, y]), Some(radius)) => format!("{:.2}, {:.2}", 1e3 * x.max(y), 1e3 * radius),
        _ => "-".to_owned(),
    };
    let status = match post.status {
        PieceStatus::Observed => "observed",
        PieceStatus::Implied => "implied",
        PieceStatus::Conjectured => "conjectured",
    };
    let [x, y] = post.center_m.map(|m| format!("{m:.4}"));
    [post.id.clone(), x, y, format!("{:.1}", 1e3 * post.radius_m), sigma, status.to_owned()]
}

/// Rows of fitted numbers; none without a fit.
fn fit_rows(found: &Survey) -> impl Iterator<Item = [String; 5]> + '_ {
    let numbers = found.fitted.iter().flat_map(|fitted| &fitted.numbers);
    numbers.map(|of| {
        let mut remarks = Vec::new();
        if !of.is_determined {
            remarks.push("left at its prior".to_owned());
        }
        if of.name == "sound_speed" && !of.is_determined {
            remarks.push("coupled to all dimensions".to_owned());
        }
        if !of.coupled_with.is_empty() {
            remarks.push(format!("coupled to {}", of.coupled_with.join(", ")));
        }
        let number = |value: f64| format!("{value:.4}");
        [
            of.name.clone(),
            number(of.value),
            number(of.sigma),
            number(of.assumed),
            remarks.join("; "),
        ]
    })
}

fn pose_rows(found: &Survey) -> impl Iterator<Item = [String; 5]> + '_ {
    found.poses.iter().zip(1..).map(|(of, number)| {
        let sigma = match (of.sigma_m, of.sigma_heading_deg) {
            (Some([x, y]), Some(deg)) => format!("{:.2}, {deg:.3}", 1e3 * x.max(y)),
            _ => "-".to_owned(),
        };
        [
            number.to_string(),
            format!("{:.4}", of.pose.x_m),
            format!("{:.4}", of.pose.y_m),
            format!("{:.3}", of.pose.heading_deg),
            sigma,
        ]
    })
}

/// Prints walls and poses as tables, followed by remarks and the next view.
pub(super) fn print(out: &mut impl Write, input: &Input, found: &Survey) -> io::Result<()> {
    writeln!(out, "{}", in_short(input, found))?;
    let mut walls = ruled(WALL_HEAD);
    found.walls.iter().for_each(|wall| {
        walls.add_row(wall_row(wall));
    });
    align_right(&mut walls, 3..usize::MAX);
    writeln!(out, "{}", fit(walls))?;
    if !found.posts.is_empty() {
        let mut posts = ruled(POST_HEAD);
        found.posts.iter().for_each(|post| {
            posts.add_row(post_row(post));
        });
        align_right(&mut posts, 1..5);
        writeln!(out, "{}", fit(posts))?;
    }
    if found.fitted.is_some() {
        let mut numbers = ruled(FIT_HEAD);
        fit_rows(found).for_each(|row| {
            numbers.add_row(row);
        });
        align_right(&mut numbers, 1..4);
        writeln!(out, "{}", fit(numbers))?;
    }
    let mut poses = ruled(POSE_HEAD);
    pose_rows(found).for_each(|row| {
        poses.add_row(row);
    });
    align_right(&mut poses, 0..usize::MAX);
    writeln!(out, "{}", fit(poses))?;
    remarks(found).iter().try_for_each(|remark| writeln!(out, "{remark}"))?;
    let (view, parts) = next_view::sentences(&input.course, found);
    writeln!(out, "next view: {view}")?;
    parts.iter().try_for_each(|part| writeln!(out, "  {part}"))
}

/// Report with the tables of [`print`].
pub(super) fn markdown(input: &Input, found: &Survey) -> String {
    let mut text = format!("# Survey\n\n{}.\n\n", in_short(input, found));
    for remark in remarks(found) {
        // Writing to a string never fails.
        let _ = writeln!(text, "- {remark}");
    }
    text += "\n![Floor plan](plan.png)\n\n";
    text += &table(&WALL_HEAD, found.walls.iter().map(|wall| wall_row(wall).to_vec()));
    text += "\n";
    if !found.posts.is_empty() {
        text += &table(&POST_HEAD, found.posts.iter().map(|post| post_row(post).to_vec()));
        text += "\n";
    }
    if found.fitted.is_some() {
        text += &table(&FIT_HEAD, fit_rows(found).map(|row| row.to_vec()));
        text += "\n";
    }
    text += &table(&POSE_HEAD, pose_rows(found).map(|row| row.to_vec()));
    let (view, parts) = next_view::sentences(&input.course, found);
    let _ = writeln!(text, "\n## Next view\n\nNext view: {view}.");
    for (part, start) in parts.iter().zip(["\n"].into_iter().chain(std::iter::repeat(""))) {
        let _ = writeln!(text, "{start}- {part}");
    }
    text
}

fn table(head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let heads: Vec<String> = head.iter().map(|cell| (*cell).to_owned()).collect();
    let rule: Vec<String> = head.iter().map(|_| "---".to_owned()).collect();
    let mut text = line(&heads) + &line(&rule);
    rows.for_each(|row| text += &line(&row));
    text
}
