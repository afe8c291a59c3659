//! Invariants of every picture: well-formed, complete, and robust against any input.

use proptest::prelude::*;
use resvg::{
    tiny_skia::Pixmap,
    usvg::{self, roxmltree},
};
use uuid::Uuid;

use super::{
    MAX_WIDTH_PX, Picture, PlotError,
    fixtures::{furnished_room, reflection, room, scan_of_room, session, simulated},
    *,
};
use sonard_model::{
    geometry::{DVec2, Pose},
    scene::{Robot, RobotShape, Scene},
};
use sonard_records::{
    Event, EventKind, PathKind, PathRecord, Ping, PingStatus, ScanPlan, ScanStart, ScanView,
    SimRecord,
};

/// Draws scans as every kind of picture.
fn pictures(scans: &[ScanView], scene: Option<&Scene>) -> Vec<Picture> {
    vec![draw_scans(scans, scene), draw_polar(scans, scene), draw_residuals(scans, scene)]
}

/// Parses the SVG as a renderer does and returns its text.
fn well_formed(picture: &Picture) -> String {
    let svg = picture.to_svg();
    usvg::Tree::from_str(&svg, &usvg::Options::default()).expect("a renderer reads it");
    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    for attribute in document.descendants().flat_map(|node| node.attributes()) {
        let value = attribute.value();
        assert!(!value.contains("NaN") && !value.contains("inf"), "{attribute:?}");
    }
    svg
}

/// Number of marks (shapes with a tooltip) in the groups of a class inside `outer`.
fn marks(svg: &str, outer: &str, class: &str) -> usize {
    let document = roxmltree::Document::parse(svg).expect("well-formed");
    document
        .descendants()
        .filter(|node| node.attribute("class") == Some(class))
        .filter(|node| node.ancestors().any(|up| up.attribute("class") == Some(outer)))
        .flat_map(|group| group.children())
        .filter(|node| node.children().any(|child| child.has_tag_name("title")))
        .count()
}

/// All visible texts.
fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).expect("well-formed");
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.filter_map(|node| node.text().map(str::to_owned)).collect()
}

fn pose(name: &str) -> Pose {
    room().poses[name]
}

#[test]
fn every_reading_is_drawn() {
    let scan = scan_of_room(pose("fig9"), 0.9, 1);
    let svg = well_formed(&draw_scan(&scan, Some(&room())));
    let readings = readings::PlottedScan::from_scan(&scan);
    let count = |outer: &str| -> usize {
        let kinds = readings::ReadingKind::WITH_RANGE.iter();
        kinds.map(|kind| marks(&svg, outer, kind.label())).sum()
    };
    let on_plan = count("floor-plan");
    let legend = texts(&svg);
    let outside: usize = legend
        .iter()
        .find_map(|text| text.strip_prefix("outside the view (")?.strip_suffix(')'))
        .map_or(0, |n| n.parse().expect("a number"));
    let echoes = readings.beams.iter().filter(|beam| beam.range_m.is_some()).count();
    assert!(on_plan > 100 && outside > 0, "{on_plan} on the plan, {outside} outside");
    assert_eq!(on_plan + outside, echoes);
    // The strip next to the plan has all of them.
    assert_eq!(count("range-strip"), echoes);
}

#[test]
fn phantom_does_not_shrink_the_room() {
    let mut scan = scan_of_room(pose("fig9"), 0.9, 1);
    let view_of = |scan: &ScanView| {
        let readings = readings::PlottedScan::from_scan(scan);
        region::region(&[(pose("fig9"), &readings)], Some(&room()))
    };
    let before = view_of(&scan);
    assert!(before.min.y < 0.085 - 0.742, "the wall's mirror image is within {before:?}");
    scan.pings[0].status = PingStatus::Echo;
    scan.pings[0].range_m = Some(50.0);
    let after = view_of(&scan);
    assert!((after.size() - before.size()).length() < 0.05, "{before:?} became {after:?}");
}

#[test]
fn provenance_is_shown_unless_hardware() {
    let mut scan = scan_of_room(pose("fig7"), 4.5, 1);
    let has = |scan: &ScanView, label: &str| {
        let shown = |p: &Picture| texts(&well_formed(p)).iter().any(|text| text.contains(label));
        pictures(std::slice::from_ref(scan), Some(&room())).iter().all(shown)
    };
    assert!(has(&scan, "MOCK, not hardware"));
    assert!(has(&ScanView { session: None, ..scan.clone() }, "PROVENANCE UNKNOWN"));
    assert!(has(&simulated(scan.clone()), "SIMULATED, nothing measured"));
    let mut session = session();
    session.provenance = sonard_records::Provenance::Hardware;
    scan.session = Some(session.into());
    assert!(!has(&scan, "not hardware"));
}

#[test]
fn simulated_log_shows_margins() {
    let scan = simulated(scan_of_room(pose("fig9"), 0.9, 1));
    let svg = well_formed(&draw_scan(&scan, Some(&room())));
    assert!(marks(&svg, "floor-plan", "multiple reflection") > 50);
    assert!(marks(&svg, "margin-strip", "multiple reflection") > 50);
    assert!(!svg.contains("residual-strip"));
}

#[test]
fn log_without_predictions_shows_echoes() {
    let mut scan = scan_of_room(pose("fig9"), 0.9, 1);
    for ping in &mut scan.pings {
        (ping.sim, ping.residual_m) = (None, None);
    }
    let svg = well_formed(&draw_scan(&scan, None));
    assert!(marks(&svg, "floor-plan", "echo") > 100);
    assert!(!svg.contains("residual-strip") && !svg.contains("class=\"walls\""));
    let residuals = well_formed(&draw_residuals(&[scan], None));
    assert!(texts(&residuals).iter().any(|text| text.contains("no residuals")));
}

#[test]
fn overlaid_scans_show_all_marks() {
    let scans: Vec<ScanView> = (0..3).map(|seed| scan_of_room(pose("fig7"), 4.5, seed)).collect();
    let all = well_formed(&draw_scans(&scans, Some(&room())));
    let single: usize = scans
        .iter()
        .map(|scan| {
            marks(&well_formed(&draw_polar(std::slice::from_ref(scan), None)), "polar", "edge")
        })
        .sum();
    assert_eq!(marks(&well_formed(&draw_polar(&scans, None)), "polar", "edge"), single);
    assert!(texts(&all).iter().any(|text| text.starts_with("3 scans overlaid")));
}

#[test]
fn png_has_the_requested_size() {
    let picture = draw_scan(&scan_of_room(pose("fig9"), 0.9, 1), Some(&room()));
    for width_px in [1, 320, 1000] {
        let image = Pixmap::decode_png(&picture.to_png(width_px).expect("drawn")).expect("PNG");
        assert_eq!(image.width(), width_px);
    }
    let image = Pixmap::decode_png(&picture.to_png(1000).expect("drawn")).expect("PNG");
    let blue = image.pixels().iter().filter(|p| p.blue() > 150 && p.red() < 30).count();
    // Without the font the title would be blank.
    let title = (0..300).flat_map(|x| (15..45).map(move |y| (x, y)));
    let ink = title.filter_map(|(x, y)| image.pixel(x, y)).filter(|p| p.red() < 100).count();
    assert!(blue > 100, "{blue} pixels of direct echoes");
    assert!(ink > 200, "{ink} pixels of the title");
    for width_px in [0, MAX_WIDTH_PX + 1, u32::MAX] {
        assert!(matches!(picture.to_png(width_px), Err(PlotError::Width(w)) if w == width_px));
    }
}

#[test]
fn names_are_escaped() {
    let hostile = "</text><script>&\"'\u{0}\u{1b}\u{fffe} x";
    let mut scene = furnished_room();
    scene.name = hostile.into();
    scene.source = Some(hostile.into());
    scene.walls[0].id = hostile.into();
    scene.poses = [(hostile.to_owned(), pose("fig9"))].into();
    let mut scan = scan_of_room(pose("fig9"), 4.5, 1);
    scan.events.push(Event {
        time: jiff::Timestamp::UNIX_EPOCH,
        kind: EventKind::Fault,
        detail: hostile.into(),
    });
    for ping in &mut scan.pings {
        if let Some(path) = ping.sim.as_mut().and_then(|sim| sim.path.as_mut()) {
            path.interactions = vec![reflection(hostile)];
        }
    }
    let mut all = pictures(&[scan], Some(&scene));
    all.push(draw_scene(&scene));
    for picture in all {
        let svg = well_formed(&picture);
        assert!(!svg.contains("<script"));
        let shown = texts(&svg).iter().any(|text| text.contains("</text><script>&\"'"));
        assert!(shown, "the name is shown unchanged");
    }
}

#[test]
fn scene_shows_all_its_parts() {
    let mut scene = furnished_room();
    let svg = well_formed(&draw_scene(&scene));
    let shown = texts(&svg);
    for label in ["south", "leg", "fig7", "fig9", "wall, reflectance 0.7, roughness 0.4"] {
        assert!(shown.iter().any(|text| text == label), "{label} is missing in {shown:?}");
    }
    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    let lines = document
        .descendants()
        .filter(|node| node.attribute("class") == Some("material"))
        .flat_map(|node| node.children())
        .filter(|node| node.has_tag_name("line"))
        .count();
    assert_eq!(lines, scene.walls.len());
    let shape = RobotShape::Circle { center: DVec2::new(-0.1, 0.0), radius_m: 0.08 };
    let material = scene.walls[0].material;
    scene.robot = Some(Robot { id: "b12".into(), shape, material, z_m: None });
    let with_robot = well_formed(&draw_scene(&scene));
    assert_eq!(with_robot.matches("class=\"robot\"").count(), 2);
    assert!(texts(&with_robot).contains(&"robot b12".to_owned()));
}

#[test]
fn empty_scans_are_drawn() {
    let whole = scan_of_room(pose("fig9"), 4.5, 1);
    let bare = ScanView {
        scan: Uuid::nil(),
        session: None,
        start: None,
        pings: Vec::new(),
        events: Vec::new(),
        end: None,
    };
    let one = ScanView { pings: whole.pings[..1].to_vec(), ..whole.clone() };
    let mut no_echo = whole;
    for ping in &mut no_echo.pings {
        (ping.status, ping.range_m, ping.residual_m, ping.sim) =
            (PingStatus::NoEcho, None, None, None);
    }
    let mut nothing = room();
    nothing.walls.clear();
    nothing.poses.clear();
    well_formed(&draw_scene(&nothing));
    for scans in [vec![], vec![bare], vec![one], vec![no_echo]] {
        for scene in [None, Some(&room()), Some(&nothing)] {
            for picture in pictures(&scans, scene) {
                well_formed(&picture);
                assert!(picture.to_png(200).is_ok());
            }
        }
    }
}

/// Numbers, including ones that logs should not contain.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => 0.0..10.0_f64,
        1 => Just(1e9),
        1 => Just(0.0),
        2 => prop::num::f64::ANY,
    ]
}

fn any_status() -> impl Strategy<Value = PingStatus> {
    prop::sample::select(vec![
        PingStatus::Echo,
        PingStatus::NoEcho,
        PingStatus::MinRange,
        PingStatus::LinkLost,
        PingStatus::StepUncertain,
        PingStatus::ModuleFault,
    ])
}

prop_compose! {
    fn any_sim()(
        status in any_status(),
        range_m in prop::option::of(any_number()),
        margin_db in prop::option::of(any_number()),
        order in 0..5_u32,
        length_m in any_number(),
    ) -> SimRecord {
        let kind = if order == 4 { PathKind::Diffracted } else { PathKind::Specular };
        let path = PathRecord {
            kind,
            order,
            interactions: vec![reflection("south")],
            length_m,
        };
        SimRecord {
            status,
            range_m,
            amplitude: margin_db,
            margin_db,
            path: Some(path),
            crosstalk: None,
        }
    }
}

prop_compose! {
    fn any_ping()(
        index in any::<u32>(),
        azimuth_deg in prop_oneof![4 => 0.0..360.0_f64, 1 => prop::num::f64::ANY],
        status in any_status(),
        range_m in prop::option::of(any_number()),
        residual_m in prop::option::of(any_number()),
        margin_db in prop::option::of(any_number()),
        sim in prop::option::of(any_sim()),
    ) -> Ping {
        Ping {
            range_m, margin_db, sim, residual_m,
            ..Ping::new(Uuid::nil(), index, azimuth_deg, status)
        }
    }
}

prop_compose! {
    fn any_scan()(
        pings in prop::collection::vec(any_ping(), 0..40),
        place in prop::option::of([any_number(), any_number(), any_number()]),
        plan in [any_number(), any_number(), any_number()],
        blanking_us in any_number(),
        with_session in any::<bool>(),
    ) -> ScanView {
        let mut session = session();
        session.sensor.blanking_us = blanking_us;
        let [from_deg, to_deg, step_deg] = plan;
        let plan = ScanPlan { from_deg, to_deg, step_deg, pings_per_stop: 1 };
        let start = place.map(|[x_m, y_m, heading_deg]| {
            let pose = Pose { x_m, y_m, heading_deg };
            ScanStart::new(Uuid::nil(), jiff::Timestamp::UNIX_EPOCH, pose, plan)
        });
        let session = with_session.then(|| session.into());
        ScanView { scan: Uuid::nil(), session, start, pings, events: Vec::new(), end: None }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn any_scan_is_drawn(
        scans in prop::collection::vec(any_scan(), 1..4),
        with_scene in any::<bool>(),
    ) {
        let room = room();
        for picture in pictures(&scans, with_scene.then_some(&room)) {
            well_formed(&picture);
        }
    }

    #[test]
    fn any_scene_is_drawn(
        ends in prop::collection::vec([any_number(), any_number()], 4),
        name in any::<String>(),
    ) {
        let mut scene = room();
        scene.name = name.clone();
        for (wall, [x, y]) in scene.walls.iter_mut().zip(ends) {
            wall.a = DVec2::new(x, y);
            wall.id = name.as_str().into();
        }
        well_formed(&draw_scene(&scene));
    }
}
