//! Legibility of pictures: provenance badges, axis titles, and names clear of walls.

use resvg::{tiny_skia::Pixmap, usvg::roxmltree};
use sonard_interpret::interpret::grid::{Grid, GridShape};
use sonard_model::geometry::DVec2;
use sonard_records::Provenance;

use super::{
    fixtures::{room, scan_of_room},
    *,
};

fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).expect("well-formed");
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.filter_map(|node| node.text().map(str::to_owned)).collect()
}

#[test]
fn path_of_a_beam_has_a_badge() {
    let scene = room();
    let pose = scene.poses["fig9"];
    let draw = |provenance| {
        let view = PathView {
            title: "a path".into(),
            lines: Vec::new(),
            badge: badge_for(Some(provenance)),
            scene: &scene,
            pose,
            transducer: pose,
            azimuth_deg: 0.0,
            range_m: Some(0.5),
            points: vec![pose.position(), pose.position() + DVec2::X, pose.position()],
        };
        draw_path(&view).to_svg()
    };
    assert!(draw(Provenance::Mock).contains("MOCK, not hardware"));
    assert!(draw(Provenance::Emulator).contains("EMULATOR, not hardware"));
    assert!(!draw(Provenance::Hardware).contains("class=\"provenance\""));
}

#[test]
fn mixed_scans_have_a_badge() {
    let scan = |provenance: Provenance| {
        let mut scan = scan_of_room(room().poses["fig9"], 9.0, 1);
        let mut session = scan.session.as_deref().expect("a session").clone();
        session.provenance = provenance;
        scan.session = Some(std::sync::Arc::new(session));
        scan
    };
    let scans = [scan(Provenance::Hardware), scan(Provenance::Mock)];
    assert!(draw_scans(&scans, None).to_svg().contains("MOCK, not hardware"));
    assert!(!draw_scans(&scans[..1], None).to_svg().contains("class=\"provenance\""));
}

#[test]
fn series_and_convergence_have_a_badge() {
    let some = [Provenance::Hardware, Provenance::Mock, Provenance::Hardware];
    let series = |sources: &[Provenance]| {
        let badge = badge_among(sources.iter().copied());
        draw_series("drift", badge, &[], "hours", &[]).to_svg()
    };
    assert!(series(&some).contains("MOCK, not hardware"));
    assert!(series(&[]).contains("PROVENANCE UNKNOWN"));
    assert!(!series(&some[..1]).contains("class=\"provenance\""));
    let badge = badge_for(Some(Provenance::Simulated));
    let converged = draw_convergence("fan", badge, &[], ["spacing", "share"], &[]).to_svg();
    assert!(converged.contains("SIMULATED"));
}

#[test]
fn side_by_side_legend_is_complete() {
    let scene = room();
    let scan = scan_of_room(scene.poses["fig9"], 9.0, 1);
    let svg = draw_side_by_side(&[scan.clone(), scan], Some(&scene)).to_svg();
    let shown = texts(&svg);
    for label in ["minimum range (blanking)", "wall, reflectance"] {
        assert!(shown.iter().any(|text| text.starts_with(label)), "{label}: {shown:?}");
    }
}

#[test]
fn map_has_frame_and_badge() {
    let shape = GridShape::covering(DVec2::ZERO, DVec2::new(2.0, 1.0), 0.05).expect("a shape");
    let grid = Grid::new(shape);
    let draw = |badge| {
        let (title, lines) = ("a map".to_owned(), Vec::new());
        let view =
            MapView { title, lines, badge, grid: &grid, scene: Some(&room()), trajectory: &[] };
        Pixmap::decode_png(&draw_map(&view).expect("drawn")).expect("a PNG")
    };
    let red = |image: &Pixmap| {
        let is_red = |p: &&resvg::tiny_skia::PremultipliedColorU8| p.red() > 180 && p.blue() < 60;
        image.pixels().iter().filter(is_red).count()
    };
    let [plain, marked] = [draw(None), draw(badge_for(Some(Provenance::Simulated)))];
    assert_eq!(red(&plain), 0);
    assert!(red(&marked) > 200, "a badge");
    let is_grey = |p: &&resvg::tiny_skia::PremultipliedColorU8| p.red() == 127;
    let unknown = plain.pixels().iter().filter(is_grey).count();
    let all = plain.pixels().len();
    assert!(unknown > all / 3 && unknown < all * 9 / 10, "{unknown} of {all}: cells, and paper");
}

#[test]
fn residual_axis_states_logarithmic_scale() {
    let scan = scan_of_room(room().poses["fig9"], 0.9, 1);
    let mut close = scan.clone();
    close.pings.retain(|ping| {
        let model_m = ping.sim.as_ref().and_then(|sim| sim.range_m);
        ping.range_m.zip(model_m).is_none_or(|(range_m, model_m)| (range_m - model_m).abs() < 0.01)
    });
    let svg = draw_residuals(&[scan], None).to_svg();
    assert!(texts(&svg).iter().any(|text| text.contains("logarithmic beyond")), "{svg}");
    assert!(svg.contains("class=\"band\""));
    let svg = draw_residuals(&[close], None).to_svg();
    assert!(texts(&svg).contains(&"measured \u{2212} predicted, mm".to_owned()));
    assert!(!svg.contains("class=\"band\""), "a band over everything carries no information");
}

#[test]
fn text_fits_without_its_font() {
    let svg = draw_scan(&scan_of_room(room().poses["fig9"], 0.9, 1), Some(&room())).to_svg();
    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    let mut checked = 0;
    for node in texts.filter(|node| node.text().is_some_and(|text| text.trim().len() > 1)) {
        let width_px: f64 = node.attribute("textLength").expect("a width").parse().expect("px");
        let size_px =
            node.attribute("font-size").map_or(theme::TEXT_PX, |px| px.parse().expect("px"));
        // Widths of the letters, as the rasterizer lays them out.
        let drawn_px = drawn_width_px(node.text().unwrap_or_default().trim(), size_px);
        assert!(
            (width_px - drawn_px).abs() < 0.04 * drawn_px + 1.5,
            "{width_px} {drawn_px}: {node:?}"
        );
        checked += 1;
    }
    assert!(checked > 30, "{checked}");
}

/// Width of a text laid out in the bundled font by the rasterizer.
fn drawn_width_px(text: &str, size_px: f64) -> f64 {
    use resvg::usvg::{Node, Options, Tree};
    let escaped = text.replace('&', "&amp;").replace('<', "&lt;");
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"2000\" height=\"50\"><text y=\"30\" \
         font-size=\"{size_px}\">{escaped}</text></svg>"
    );
    let options = Options { fontdb: picture::fonts(), ..Options::default() };
    let tree = Tree::from_str(&svg, &options).expect("a drawing");
    let widths = tree.root().children().iter().filter_map(|node| match node {
        Node::Text(text) => Some(f64::from(text.bounding_box().width())),
        _ => None,
    });
    widths.sum()
}

#[test]
fn titles_of_several_poses() {
    let scene = room();
    let scans = ["fig7", "fig9"].map(|name| scan_of_room(scene.poses[name], 9.0, 1));
    let shown =
        |scans: &[sonard_records::ScanView], scene| texts(&draw_scans(scans, scene).to_svg());
    let named = shown(&scans, Some(&scene)).join("\n");
    assert!(named.contains(", poses fig7, fig9"), "{named}");
    assert!(!named.contains("heading 0"), "the line below is not that of the first pose: {named}");
    let counted = shown(&scans, None).join("\n");
    assert!(counted.contains(", 2 poses"), "{counted}");
    let one = shown(&scans[..1], Some(&scene)).join("\n");
    assert!(one.contains(", pose fig7") && one.contains("heading"), "{one}");
}

#[test]
fn differing_sensors_are_counted() {
    let mut scans = [1, 2].map(|seed| scan_of_room(room().poses["fig9"], 9.0, seed));
    let mut session = scans[1].session.as_deref().expect("a session").clone();
    session.sensor.name = "another".into();
    session.air.temperature_c += 3.0;
    scans[1].session = Some(session.into());
    let shown = texts(&draw_scans(&scans, Some(&room())).to_svg()).join("\n");
    assert!(shown.contains("2 sensors \u{b7} 2 air conditions"), "{shown}");
}

#[test]
fn legends_list_what_is_drawn() {
    let legend = |svg: &str| texts(svg).join("\n");
    let scan = scan_of_room(room().poses["fig9"], 9.0, 1);
    assert!(legend(&draw_scan(&scan, None).to_svg()).contains("prediction"));
    let mut alone = scan.clone();
    alone.pings.iter_mut().for_each(|ping| (ping.sim, ping.residual_m) = (None, None));
    for picture in [draw_scan(&alone, None), draw_residuals(&[alone.clone()], None)] {
        assert!(!legend(&picture.to_svg()).contains("prediction"));
    }
    assert!(legend(&draw_scan(&alone, None).to_svg()).contains("direction of a beam"));
    alone.pings.iter_mut().for_each(|ping| ping.range_m = None);
    let silent = legend(&draw_features(&[alone.clone()], None, &[]).to_svg());
    assert!(!silent.lines().any(|line| line == "reading"), "{silent}");
    let unrated = legend(&draw_confidence(&[scan], None).to_svg());
    assert!(
        unrated.contains("without a confidence (") && !unrated.contains("trusted"),
        "{unrated}"
    );
}
