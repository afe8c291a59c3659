//! Next view of a survey as text.

use crate::survey::{NextView, OpenPart, ResolvedPart, Survey, SurveyCourse};

/// Place and expected gain of the next view in a sentence, and one for each part that it resolves.
pub(super) fn sentences(course: &SurveyCourse, found: &Survey) -> (String, Vec<String>) {
    let open = format!("{:.2} nats", found.open_nats);
    let (readings, heading) = match course {
        SurveyCourse::Sweeps(_) => ("a full turn", None),
        SurveyCourse::Rounds(_) => {
            ("a round", found.next_view.as_ref().map(|of| of.pose.heading_deg))
        }
    };
    let heading = heading.map_or_else(String::new, |deg| format!(" with heading {deg:.0} degrees"));
    match &found.next_view {
        None if found.open_nats < 0.005 => ("none: nothing is open".to_owned(), Vec::new()),
        None => (format!("none: no reachable place resolves the {open} that are open"), Vec::new()),
        Some(NextView { pose, gain_nats, resolves }) => {
            let at = format!("{readings} at {}{heading}", place([pose.x_m, pose.y_m]));
            if let [ResolvedPart { part: OpenPart::UnexplainedArcs { count }, .. }] = resolves[..] {
                let arcs =
                    if count == 1 { "1 arc is".to_owned() } else { format!("{count} arcs are") };
                let text =
                    format!("{at}, far from the stops: {arcs} unexplained by the plans found");
                return (text, Vec::new());
            }
            let text = format!("{at} resolves {gain_nats:.2} of {open} that are open");
            (text, resolves.iter().map(part).collect())
        }
    }
}

fn part(of: &ResolvedPart) -> String {
    let question = match &of.part {
        OpenPart::Wall { wall, from_m, to_m } => {
            format!("no {wall} from {} to {}", place(*from_m), place(*to_m))
        }
        OpenPart::Gap { walls } => {
            let ends = walls.iter().map(|[a, b]| format!("{} to {}", place(*a), place(*b)));
            format!("a wall from {}", ends.collect::<Vec<_>>().join(" and "))
        }
        OpenPart::Post { post } => format!("no {post}"),
        OpenPart::Alternative { number } => format!("alternative {number}"),
        OpenPart::UnexplainedArcs { .. } => "another that was not found".to_owned(),
    };
    format!(
        "{:.0} % of it: the plan, or {question} (probability {:.2})",
        100.0 * of.share,
        of.probability
    )
}

fn place([x, y]: [f64; 2]) -> String {
    format!("({x:.2}, {y:.2})")
}
