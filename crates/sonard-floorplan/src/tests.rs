//! Floor plans from file to walls.

#[cfg(feature = "dxf")]
mod dxf;
mod sdf;
mod svg;

use sonard_model::scene::Scene;

use crate::{
    FloorPlan,
    sdf::{NoLibrary, SdfOptions},
    svg::SvgOptions,
};

/// Ends of the walls, to a millimetre.
fn walls(plan: &FloorPlan) -> Vec<[f64; 4]> {
    let scene: Scene = plan.surfaces.scene("plan", 0.97).build().expect("a scene");
    let round = |m: f64| (1e3 * m).round() / 1e3 + 0.0;
    scene.walls.iter().map(|wall| [wall.a.x, wall.a.y, wall.b.x, wall.b.y].map(round)).collect()
}

#[test]
fn large_files_are_rejected() {
    use std::io::Write as _;

    use flate2::{Compression, write::GzEncoder};

    let large = vec![b' '; crate::MAX_FILE_BYTES + 1];
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&large).expect("in memory");
    let compressed = encoder.finish().expect("in memory");
    let svg = |bytes: &[u8]| crate::svg::read(bytes, &SvgOptions { width_m: 10.0 });
    for plan in [
        svg(&large),
        svg(&compressed),
        crate::sdf::read(&large, &SdfOptions { cut_z_m: 0.3 }, &NoLibrary),
    ] {
        let error = plan.expect_err("too large");
        assert!(error.to_string().contains("larger than 16 MB"), "{error}");
    }
}
