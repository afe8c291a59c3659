//! Floor plan with the features found by the interpretation.

use super::{
    canvas::{Anchor, Layer, MarkShape, Px},
    floor::Floor,
    legend::{LegendEntry, LegendSample},
    legend_entries, lines, overlay,
    picture::Picture,
    plan::PlanProjection,
    readings::PlottedScan,
    scan_caption, theme,
};
use sonard_interpret::interpret::{Feature, FeatureKind};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::Scene,
};
use sonard_records::ScanView;

const KINDS: [FeatureKind; 4] =
    [FeatureKind::Plane, FeatureKind::Corner, FeatureKind::Edge, FeatureKind::Unresolved];

/// Draws the features found in scans: an arc and a mark in the style of its class for each, over
/// the floor plan with the readings as small dots; lines lead to the proposed next poses.
#[must_use]
pub fn draw_features(scans: &[ScanView], scene: Option<&Scene>, features: &[Feature]) -> Picture {
    let over = |plan: &PlanProjection| {
        let arcs = features.iter().map(|feature| arc(plan, scans, feature));
        arcs.chain([next_places(plan, scans, features)]).collect()
    };
    let labels = |plan: &PlanProjection| Some(names(plan, scene, scans, features));
    overlay::draw(
        scans,
        scene,
        counts(features),
        &[],
        over,
        labels,
        &entries(scans, features, scene),
    )
}

/// Number of features of each class.
fn counts(features: &[Feature]) -> String {
    let parts: Vec<String> = KINDS
        .iter()
        .map(|kind| (features.iter().filter(|f| f.kind == *kind).count(), name(*kind)))
        .filter(|(count, _)| *count > 0)
        .map(|(count, name)| format!("{count} {name}"))
        .collect();
    if parts.is_empty() { "no feature".to_owned() } else { format!("found: {}", parts.join(", ")) }
}

const fn name(kind: FeatureKind) -> &'static str {
    match kind {
        FeatureKind::Plane => "plane",
        FeatureKind::Corner => "corner",
        FeatureKind::Edge => "edge",
        FeatureKind::Unresolved => "unresolved",
    }
}

const fn colour(kind: FeatureKind) -> &'static str {
    match kind {
        FeatureKind::Plane => theme::BLUE,
        FeatureKind::Corner => theme::VERMILLION,
        FeatureKind::Edge => theme::GREEN,
        FeatureKind::Unresolved => theme::PURPLE,
    }
}

const fn shape(kind: FeatureKind) -> MarkShape {
    match kind {
        FeatureKind::Plane => MarkShape::Square,
        FeatureKind::Corner => MarkShape::Triangle,
        FeatureKind::Edge => MarkShape::Diamond,
        FeatureKind::Unresolved => MarkShape::Cross,
    }
}

fn entries(scans: &[ScanView], features: &[Feature], scene: Option<&Scene>) -> Vec<LegendEntry> {
    let present = KINDS.into_iter().filter(|kind| features.iter().any(|f| f.kind == *kind));
    let kinds = present.map(|kind| {
        LegendEntry::new(
            LegendSample::Mark { shape: shape(kind), colour: colour(kind) },
            name(kind),
        )
    });
    let dot = LegendSample::Mark { shape: MarkShape::Dot, colour: theme::NO_ECHO };
    let next = LegendSample::Line { colour: theme::ORANGE, width_px: 2.0, dash: "none" };
    let proposes = features.iter().any(|feature| feature.next.is_some());
    kinds
        .chain(lines::has_ranges(scans).then(|| LegendEntry::new(dot, "reading")))
        .chain(proposes.then(|| LegendEntry::new(next, "proposed next pose")))
        .chain(scene.map(legend_entries::materials).into_iter().flatten())
        .collect()
}

/// Pose of the scan that a feature belongs to.
fn pose_of(scans: &[ScanView], feature: &Feature) -> Option<Pose> {
    scans.iter().find(|scan| scan.scan == feature.scan).and_then(scan_caption::pose_of)
}

fn arc(plan: &PlanProjection, scans: &[ScanView], feature: &Feature) -> Layer {
    let colour = colour(feature.kind);
    let mut layer = Layer::new("feature").stroked(colour, 2.6);
    let (Some(pose), Some(range_m)) = (pose_of(scans, feature), feature.range_m) else {
        return layer;
    };
    layer.runs([arc_of(plan, scans, feature)]);
    let mut solid = Layer::new("mark").with("fill", colour).with("stroke", theme::PAPER);
    let at = plan.px(pose.point_at(feature.bearing_deg, range_m));
    solid.mark(shape(feature.kind), at, 6.0, Some(&hint(feature)));
    layer.add(solid);
    layer
}

/// Arc of a feature on the page; empty where only the direction is known.
fn arc_of(plan: &PlanProjection, scans: &[ScanView], feature: &Feature) -> Vec<Px> {
    let (Some(pose), Some(range_m)) = (pose_of(scans, feature), feature.range_m) else {
        return Vec::new();
    };
    let half_deg = feature.extent_deg / 2.0;
    (-8..=8)
        .map(|i| {
            let azimuth_deg = feature.bearing_deg + half_deg * f64::from(i) / 8.0;
            plan.px(pose.point_at(azimuth_deg, range_m))
        })
        .collect()
}

fn hint(feature: &Feature) -> String {
    let reason = feature.reason.map(|reason| format!(" ({reason:?})")).unwrap_or_default();
    format!(
        "{}{reason}: extent {:.1}\u{b0}, confidence {:.3}, other {:.3}",
        name(feature.kind),
        feature.extent_deg,
        feature.confidence,
        feature.probabilities.other
    )
}

/// Draws class, extent and, if known, beta next to each mark.
fn names(
    plan: &PlanProjection,
    scene: Option<&Scene>,
    scans: &[ScanView],
    features: &[Feature],
) -> Layer {
    let mut labels = plan.labels(scene);
    for feature in features {
        arc_of(plan, scans, feature).windows(2).for_each(|two| labels.keep_off(two[0], two[1]));
    }
    for scan in scans {
        let plotted = PlottedScan::from_scan(scan);
        if let Some(pose) = scan_caption::pose_of(scan) {
            Floor { plan, pose, scan: &plotted }.avoid_marks(&mut labels);
        }
    }
    for feature in features {
        if let (Some(pose), Some(range_m)) = (pose_of(scans, feature), feature.range_m) {
            labels.avoid_mark(plan.px(pose.point_at(feature.bearing_deg, range_m)), 7.0);
        }
    }
    let mut layer = Layer::new("names").haloed();
    for feature in features {
        let (Some(pose), Some(range_m)) = (pose_of(scans, feature), feature.range_m) else {
            continue;
        };
        let at = plan.px(pose.point_at(feature.bearing_deg, range_m));
        let beta =
            feature.beta_deg.map(|beta| format!(", \u{3b2} {:.1}\u{b0}", rounded(beta, 10.0)));
        let text = format!(
            "{} {:.1}\u{b0}{}",
            name(feature.kind),
            feature.extent_deg,
            beta.unwrap_or_default()
        );
        let places = [
            (Px::new(11.0, -8.0), Anchor::Start),
            (Px::new(11.0, 16.0), Anchor::Start),
            (Px::new(-11.0, -8.0), Anchor::End),
            (Px::new(-11.0, 16.0), Anchor::End),
            (Px::new(11.0, 4.0), Anchor::Start),
            (Px::new(-11.0, 4.0), Anchor::End),
            (Px::new(0.0, -16.0), Anchor::Middle),
            (Px::new(0.0, 24.0), Anchor::Middle),
            (Px::new(24.0, -22.0), Anchor::Start),
            (Px::new(24.0, 30.0), Anchor::Start),
            (Px::new(-24.0, -22.0), Anchor::End),
            (Px::new(-24.0, 30.0), Anchor::End),
        ];
        let places = places.map(|(shift, anchor)| (at + shift, anchor));
        if let Some((at, anchor)) = labels.place_at_one(places, theme::SMALL_PX, &text) {
            layer.text(at, anchor, theme::SMALL_PX, &text);
        }
    }
    layer
}

/// Rounds, without a minus sign before zero.
fn rounded(value: f64, digits: f64) -> f64 {
    (value * digits).round() / digits + 0.0
}

fn next_places(plan: &PlanProjection, scans: &[ScanView], features: &[Feature]) -> Layer {
    let mut layer = Layer::new("next").stroked(theme::ORANGE, 2.0);
    for feature in features {
        if let (Some(pose), Some(next)) = (pose_of(scans, feature), feature.next) {
            let to = plan.px(DVec2::new(next.x_m, next.y_m));
            layer.line(plan.px(pose.position()), to);
            layer.circle(to, 4.0);
        }
    }
    layer
}
