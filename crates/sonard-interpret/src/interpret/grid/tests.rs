//! Grids, their files and scores.

use super::{
    BeamModel, GaussianBeam, Grid, GridError, GridShape, ImageError, MapYaml, PathSettings,
    PhysicalBeam, Trust, from_pgm, ideal, score, to_pgm,
};
use crate::interpret::{BeamOutcome, Extents, Sweep, SweepBeam, prediction::Assessment};
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    scene::{Scene, shipped},
};

fn shape(side_m: f64, resolution_m: f64) -> GridShape {
    GridShape::covering(DVec2::ZERO, DVec2::splat(side_m), resolution_m).expect("a grid")
}

fn gaussian() -> BeamModel {
    BeamModel::Gaussian(GaussianBeam::new(20.0, 5.0))
}

/// One beam along +x from (1, 2).
fn beam(outcome: BeamOutcome) -> Sweep {
    let beams = vec![SweepBeam { azimuth_deg: 0.0, index: 0, outcome, mount: DVec2::ZERO }];
    let pose = Pose { x_m: 1.0, y_m: 2.0, heading_deg: 0.0 };
    Sweep { pose, step_deg: 25.0, beams, closed: false }
}

fn at(grid: &Grid, x: f64, y: f64) -> f64 {
    grid.probability(grid.shape().index_at(DVec2::new(x, y)).expect("inside"))
}

#[test]
fn echo_frees_before_and_fills_at_range() {
    let extents =
        Extents::new(&Sensor::preset("senscomp-6500").expect("a preset"), &Air::default(), false)
            .expect("figures");
    for model in [gaussian(), BeamModel::Physical(Box::new(PhysicalBeam::new(extents, 5.0)))] {
        let mut grid = Grid::new(shape(5.0, 0.05));
        grid.add(&beam(BeamOutcome::Echo(2.0)), None, &model, &Trust::default());
        assert!(at(&grid, 2.0, 2.0) < 0.5, "free before");
        assert!(at(&grid, 3.0, 2.0) > 0.5, "occupied there");
        assert_eq!(at(&grid, 4.0, 2.0), 0.5, "unknown behind");
        assert_eq!(at(&grid, 2.0, 3.0), 0.5, "unknown off the beam");
        assert_eq!(at(&grid, 0.5, 2.0), 0.5, "unknown at the back");
    }
}

#[test]
fn low_confidence_keeps_cleared_space() {
    let assessment = Assessment { confidence: 0.1, clear_m: Some(1.0) };
    let mut trusted = Grid::new(shape(5.0, 0.05));
    trusted.add(&beam(BeamOutcome::Echo(2.0)), None, &gaussian(), &Trust::default());
    let add = |trust: Trust| {
        let mut grid = Grid::new(shape(5.0, 0.05));
        let discarded =
            grid.add(&beam(BeamOutcome::Echo(2.0)), Some(&[assessment]), &gaussian(), &trust);
        (grid, discarded)
    };
    let (kept, _) = add(Trust { min_confidence: 0.0, keep_clear: true });
    assert_eq!(at(&kept, 1.5, 2.0), at(&trusted, 1.5, 2.0));
    assert!(at(&kept, 2.5, 2.0) > at(&trusted, 2.5, 2.0));
    let (dropped, discarded) = add(Trust { min_confidence: 0.3, keep_clear: true });
    assert_eq!((discarded, at(&dropped, 2.5, 2.0)), (1, 0.5));
    let (without, _) = add(Trust { min_confidence: 0.3, keep_clear: false });
    assert_eq!(without, Grid::new(shape(5.0, 0.05)));
}

#[test]
fn scans_from_outside_reach_in() {
    let mut grid = Grid::new(shape(5.0, 0.05));
    let mut outside = beam(BeamOutcome::Echo(2.0));
    outside.pose.x_m = -1.0;
    grid.add(&outside, None, &gaussian(), &Trust::default());
    assert!(at(&grid, 0.5, 2.0) < 0.5, "reached from outside");
    let before = grid.clone();
    outside.pose.x_m = 1e6;
    grid.add(&outside, None, &gaussian(), &Trust::default());
    assert_eq!(grid, before);
}

#[test]
fn invalid_grids_are_rejected() {
    let covering = |side_m: f64, resolution_m: f64| {
        GridShape::covering(DVec2::ZERO, DVec2::splat(side_m), resolution_m)
    };
    assert!(matches!(covering(1.0, 0.0), Err(GridError::Resolution(_))));
    assert!(matches!(covering(1.0, f64::NAN), Err(GridError::Resolution(_))));
    assert!(matches!(covering(-1.0, 0.1), Err(GridError::Empty { .. })));
    assert!(matches!(covering(f64::NAN, 0.1), Err(GridError::Empty { .. })));
    assert!(matches!(covering(1e6, 0.001), Err(GridError::TooLarge { .. })));
    for (side_m, resolution_m) in [(10.0, 1e-12), (1e300, 1e-300)] {
        let error = covering(side_m, resolution_m).expect_err("more than any memory").to_string();
        assert!(error.contains("more than 10^12 cells"), "{error}");
    }
    assert_eq!(covering(10.0, 0.02).map(|shape| shape.cells()), Ok(250_000));
}

#[test]
fn lower_and_left_border_belong_to_a_grid() {
    let shape = GridShape::covering(DVec2::new(-1.0, 2.0), DVec2::new(1.0, 3.0), 0.5);
    let shape = shape.expect("a grid");
    let index = |x: f64, y: f64| shape.index_at(DVec2::new(x, y));
    assert_eq!([index(-1.0, 2.0), index(0.9, 2.0), index(-1.0, 2.9)], [Some(0), Some(3), Some(4)]);
    assert_eq!([index(1.0, 2.5), index(0.0, 3.0), index(-1.1, 2.5), index(0.0, 1.9)], [None; 4]);
    for row in 0..2 {
        for column in 0..4 {
            assert_eq!(shape.index_at(shape.center(column, row)), Some(4 * row + column));
        }
    }
    assert_eq!(shape.center(3, 1), DVec2::new(0.75, 2.75));
}

/// At a metre in cells of 5 cm, a wall through a nearer cell is detected in twice the half extent
/// out of half a turn, if it reaches there. At the reading, one of the cells of the arc is the
/// wall.
#[test]
fn physical_profile_is_closed_form() {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let extents = Extents::new(&sensor, &Air::default(), false).expect("figures");
    let extent_deg = extents.plane_corner_deg(1.0, 1.0);
    let beam = PhysicalBeam::new(extents.clone(), 5.0);
    let model = BeamModel::Physical(Box::new(beam));
    let profile = model.profile(1.0, 0.05);
    assert!((profile.half_rad - (extent_deg / 2.0).to_radians()).abs() < 1e-12);
    assert!((profile.free.exp() - (1.0 - 0.8 * extent_deg / 180.0)).abs() < 1e-12, "{profile:?}");
    // The wall is shared by the cells of half the arc, in addition to the prior of a tenth.
    let cells = (extent_deg / 2.0).to_radians() / 0.05;
    let here = 0.1 + 0.9 / cells;
    let odds = here / (1.0 - here) / (0.1 / 0.9);
    assert!((profile.occupied.exp() - odds).abs() < 1e-9, "{profile:?} {odds}");
    // In cells of a centimetre the ring is four thick.
    let fine = 0.1 + 0.9 / (cells * 5.0 * 4.0);
    let odds = fine / (1.0 - fine) / (0.1 / 0.9);
    assert!((model.profile(1.0, 0.01).occupied.exp() - odds).abs() < 1e-9);
    let widest_deg = extents.plane_corner_deg(extents.min_range_m, 1.0);
    assert!((model.width_deg() - widest_deg).abs() < 1e-9);
    // Two standard deviations at the edge of the beam.
    let [free, occupied] = gaussian().off_axis(0.1, 0.1);
    assert_eq!((free, occupied), ((-2.0_f64).exp(), (-2.0_f64).exp()));
}

#[test]
fn pgm_and_yaml_round_trip() {
    let mut grid = Grid::new(shape(3.0, 0.05));
    grid.add(&beam(BeamOutcome::Echo(1.0)), None, &gaussian(), &Trust::default());
    let yaml = MapYaml::new(grid.shape(), "map.pgm");
    let read = MapYaml::from_text(&yaml.to_text()).expect("a description");
    assert_eq!(read, yaml);
    let back = from_pgm(&to_pgm(&grid), &read).expect("a map");
    for (a, b) in grid.probabilities().zip(back.probabilities()) {
        assert!((a - b).abs() < 1.0 / 255.0, "{a} {b}");
    }
    // A comment and another line break, as other programs write them.
    let pgm = to_pgm(&grid);
    let other = [b"P5\n# made by hand\n60 60 255\n".as_slice(), &pgm[13..]].concat();
    assert_eq!(from_pgm(&other, &read).map(|grid| *grid.shape()), Ok(*back.shape()));
}

#[test]
fn map_saver_unknown_is_recognized() {
    let yaml = MapYaml::new(&shape(0.3, 0.1), "map.pgm");
    let unknown = |pixels: &[u8; 9]| {
        let pgm = [b"P5\n3 3\n255\n", &pixels[..]].concat();
        from_pgm(&pgm, &yaml).expect("a map").probability(0)
    };
    assert_eq!(unknown(&[0, 254, 254, 254, 205, 205, 205, 0, 0]), 0.5);
    assert!((unknown(&[0, 230, 254, 254, 205, 205, 205, 0, 0]) - 0.196).abs() < 1e-3);
}

/// Description of three columns and one row.
fn described(more: &str) -> MapYaml {
    let text = format!("image: a.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n{more}");
    MapYaml::from_text(&text).expect("a description")
}

/// Probabilities of the cells of a row of shades.
fn row(yaml: &MapYaml, shades: &[u8]) -> Vec<f64> {
    let pgm = [format!("P5\n{} 1\n255\n", shades.len()).as_bytes(), shades].concat();
    from_pgm(&pgm, yaml).expect("a map").probabilities().map(|p| (1e3 * p).round() / 1e3).collect()
}

#[test]
fn thresholds_of_the_file_apply() {
    let near = |yaml: &str, shades: &[u8], expected: &[f64]| {
        let found = row(&described(yaml), shades);
        assert!(
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 5e-3),
            "{yaml}: {found:?}"
        );
    };
    // 205 is 0.19608, not below 0.196; a fourth shade does not affect other cells.
    near("", &[0, 205, 254, 150], &[1.0, 0.5, 0.0, 0.5]);
    near("free_thresh: 0.25", &[0, 205, 254], &[1.0, 0.5, 0.0]);
    near("free_thresh: 0.25", &[0, 205, 254, 150], &[1.0, 0.0, 0.0, 0.5]);
    near("occupied_thresh: 0.3\nfree_thresh: 0.1", &[150, 254, 205], &[1.0, 0.0, 0.5]);
    near("negate: 1", &[255, 50, 1], &[1.0, 0.5, 0.0]);
    near("negate: true", &[255, 50, 1], &[1.0, 0.5, 0.0]);
    near("negate: false", &[0, 205, 254], &[1.0, 0.5, 0.0]);
    near("mode: raw", &[0, 100, 40, 101, 255], &[0.0, 1.0, 0.4, 0.5, 0.5]);
    near("mode: scale\noccupied_thresh: 0.8\nfree_thresh: 0.2", &[0, 254, 127], &[1.0, 0.0, 0.5]);
}

#[test]
fn descriptions_are_any_yaml() {
    for text in [
        "image: a.pgm\nresolution: 0.05\norigin: [1.0, 2.0, 0.5]\n",
        "image: a.pgm\nmode: trinary\nresolution: 0.05\norigin:\n- 1.0\n- 2.0\n- 0.5\n",
        "{image: a.pgm, resolution: 0.05, origin: [1, 2, 0.5], negate: 0, occupied_thresh: 0.65}",
        "\u{feff}# by hand\r\nimage: \"a.pgm\"  # relative\r\nresolution: 5e-2\r\norigin: [ 1., 2., 0.5 ]\r\n",
    ] {
        let read = MapYaml::from_text(text).expect(text);
        assert_eq!(
            (read.image.as_str(), read.resolution, read.origin),
            ("a.pgm", 0.05, [1.0, 2.0, 0.5]),
            "{text}"
        );
        assert!(!read.is_graded);
    }
}

#[test]
fn plain_and_16_bit_images_decode() {
    let yaml = described("");
    let expected = row(&yaml, &[0, 205, 255]);
    for image in [
        &b"P2\n# plain\n3 1\n255\n0 205\n255\n"[..],
        b"P2 3 1 255 0 205 255",
        b"P5\n3 1\n65535\n\x00\x00\xcd\xcd\xff\xff",
        b"P5 3 1 255\n\x00\xcd\xff",
    ] {
        let found: Vec<f64> = from_pgm(image, &yaml).expect("a map").probabilities().collect();
        assert_eq!(found.len(), 3);
        assert!(
            found.iter().zip(&expected).all(|(found, expected)| (found - expected).abs() < 5e-3),
            "{found:?}"
        );
    }
    for (image, part) in [
        (&b"P6\n1 1\n255\n"[..], "convert"),
        (b"P2 3 1 255 0 1", "last pixel"),
        (b"P2 3 1 0 0 1 2", "maximum"),
    ] {
        let error = from_pgm(image, &yaml).expect_err(part).to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn damaged_files_are_rejected() {
    let grid = Grid::new(shape(1.0, 0.1));
    let (pgm, yaml) = (to_pgm(&grid), MapYaml::new(grid.shape(), "map.pgm"));
    for cut in 0..pgm.len() {
        assert!(matches!(from_pgm(&pgm[..cut], &yaml), Err(ImageError::Image { .. })), "{cut}");
    }
    for (text, part) in [
        ("image: a.pgm\nresolution: 0.1\n", "origin"),
        ("image: a.pgm\nresolution: x\norigin: [0, 0, 0]", "line 2"),
        ("image: a.pgm\nresolution: 1\norigin: [0, 0]", "line 3"),
        ("image: a.pgm\nresolution: 1\norigin: [0, 0, 0]\nmode: round", "mode"),
    ] {
        let error = MapYaml::from_text(text).expect_err(part).to_string();
        assert!(error.contains(part), "{error}");
    }
    let zero = MapYaml { resolution: 0.0, ..yaml };
    assert!(matches!(from_pgm(&pgm, &zero), Err(ImageError::Grid(_))));
}

fn room() -> (Scene, Grid) {
    let text = shipped::text("two-surface-room").expect("shipped");
    let scene = Scene::from_json(text).expect("a scene");
    let shape =
        GridShape::covering(DVec2::splat(-0.5), DVec2::new(4.1, 3.5), 0.05).expect("a grid");
    let ideal = ideal(&scene, shape, &[DVec2::new(1.2, 1.0)]);
    (scene, ideal)
}

#[test]
fn ideal_map_is_closed() {
    let (_, ideal) = room();
    assert_eq!(at(&ideal, -0.3, 1.0), 0.5, "outside is unknown");
    assert_eq!(at(&ideal, 3.0, 2.5), 0.5, "behind the ledge too");
    assert!(at(&ideal, 3.0, 0.5) < 0.01 && at(&ideal, 0.01, 1.0) > 0.99);
    let free_m2 = ideal.probabilities().filter(|p| *p < 0.5).count() as f64 * 0.05 * 0.05;
    // 3.6 x 1.6 + 2.2 x 1.4 m, less at most a cell along all 13.2 m of wall.
    assert!((8.84 - 13.2 * 0.05..8.84).contains(&free_m2), "{free_m2}");
}

#[test]
fn cylinders_are_rasterized() {
    let (center, radius_m) = (DVec2::new(1.02, 0.7), 0.4);
    let text = r#"{"name": "c", "materials": {"m": {"reflectance": 1}},
        "cylinders": [{"id": "c", "center": [1.02, 0.7], "radius_m": 0.4, "material": "m"},
                      {"id": "post", "center": [0.375, 1.725], "radius_m": 0.002, "material": "m"}]}"#;
    let scene = Scene::from_json(text).expect("a scene");
    let shape = GridShape::covering(DVec2::ZERO, DVec2::new(3.0, 2.0), 0.05).expect("a grid");
    let map = ideal(&scene, shape, &[DVec2::new(2.5, 1.5)]);
    let mut walls = 0;
    for row in 0..shape.height {
        for column in 0..shape.width {
            let middle = shape.center(column, row);
            let is_post = middle.distance(DVec2::new(0.375, 1.725)) < 1e-9;
            let is_wall = map.probability(row * shape.width + column) > 0.5;
            walls += usize::from(is_wall);
            assert_eq!(is_wall, is_post || middle.distance(center) <= radius_m, "{middle}");
        }
    }
    let disc_m2 = std::f64::consts::PI * radius_m * radius_m;
    assert!((walls as f64 * 0.0025 - disc_m2).abs() < 0.03 * disc_m2, "{walls}");
    // All free space is reachable.
    assert!(map.probabilities().all(|p| p != 0.5));
}

#[test]
fn ideal_and_unknown_maps_are_scored() {
    let (_, ideal) = room();
    let perfect = score(&ideal, &ideal, &PathSettings::default()).expect("one shape");
    assert!((perfect.correlation_percent.expect("it varies") - 100.0).abs() < 1e-9);
    assert_eq!(perfect.map_score_percent, 0.0);
    assert_eq!(perfect.false_positive_paths_percent, Some(0.0));
    assert!(perfect.paths > 100);

    let unknown = Grid::new(*ideal.shape());
    let blank = score(&unknown, &ideal, &PathSettings::default()).expect("one shape");
    assert_eq!((blank.correlation_percent, blank.false_positive_paths_percent), (None, None));
    let cells = ideal.shape().cells() as f64;
    let known = ideal.probabilities().filter(|p| *p != 0.5).count() as f64;
    let walls = ideal.probabilities().filter(|p| *p > 0.5).count() as f64;
    assert!((blank.map_score_percent - 25.0 * known / cells).abs() < 0.1);
    assert!((blank.map_score_occupied_percent - 25.0 * walls / cells).abs() < 0.01);
}

#[test]
fn paths_through_a_missing_wall_are_false() {
    // Two rooms of equal size; the map lacks the wall between them.
    let shape = shape(4.0, 0.1);
    let cells = |wall: bool| -> Vec<f64> {
        (0..shape.cells())
            .map(|at| if wall && at % shape.width == 20 { 1.0 } else { 0.0 })
            .collect()
    };
    let ideal = Grid::from_probabilities(shape, &cells(true));
    let map = Grid::from_probabilities(shape, &cells(false));
    let settings = PathSettings { spacing_m: 1.0, max_starts: 100, free_below: 0.45 };
    let found = score(&map, &ideal, &settings).expect("one shape");
    // 16 points, 8 on each side: 120 pairs, 64 of them across.
    assert_eq!(found.paths, 120);
    assert!(
        (found.false_positive_paths_percent.expect("paths") - 100.0 * 64.0 / 120.0).abs() < 1e-9
    );
}

#[test]
fn different_shapes_are_not_compared() {
    let small = Grid::new(shape(1.0, 0.1));
    let large = Grid::new(shape(2.0, 0.1));
    let error =
        score(&small, &large, &PathSettings::default()).expect_err("they differ").to_string();
    assert!(error.contains("10x10") && error.contains("20x20"), "{error}");
}
