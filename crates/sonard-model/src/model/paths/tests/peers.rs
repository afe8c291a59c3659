//! Agreement with other programs, by vectors that `tests/peers/` writes.

use serde::Deserialize;

use super::*;

#[derive(Deserialize)]
struct Vectors {
    order: u16,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    corners: Vec<[f64; 2]>,
    at: [f64; 2],
    /// Order and place of each visible image.
    images: Vec<(usize, f64, f64)>,
}

/// pyroomacoustics computes in single precision and its places are written to 10 um.
const CLOSE_M: f64 = 1e-4;

#[test]
fn images_match_pyroomacoustics() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/peers/image_sources.json");
    let text = std::fs::read_to_string(path).expect("vectors");
    let vectors: Vectors = serde_json::from_str(&text).expect("vectors");
    assert_eq!(vectors.cases.len(), 200);
    let settings =
        PathSettings { max_path_m: 100.0, max_order: Some(vectors.order), floor: 1e-9, ..LOSSLESS };
    for (number, case) in vectors.cases.iter().enumerate() {
        let corners: Vec<_> = case.corners.iter().copied().map(DVec2::from_array).collect();
        let at = DVec2::from_array(case.at);
        let echoes =
            Paths::new(&polygon(&corners), settings.clone()).enumerate(at).expect("few paths");
        let mut images = case.images.clone();
        for echo in &echoes {
            let image = at + echo.length_m * DVec2::from_angle(echo.arrival_rad);
            let place = images.iter().position(|&(order, x, y)| {
                order == reflectors(&echo.path).len() && image.distance(DVec2::new(x, y)) < CLOSE_M
            });
            let place = place.unwrap_or_else(|| panic!("case {number}: only here: {echo:?}"));
            images.swap_remove(place);
        }
        assert!(images.is_empty(), "case {number}: only there: {images:?}");
    }
}
