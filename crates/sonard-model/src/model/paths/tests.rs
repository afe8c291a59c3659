mod bodies;
mod bounds;
mod closed_forms;
mod creeping;
mod cylinders;
mod fan;
mod full_wave;
mod half_plane;
mod laws;
mod level_edges;
mod low_walls;
mod pairs;
mod peers;
mod posts;
mod rough;
mod stacked;
mod strips;
mod two_edges;
mod vertical;

use std::{f64::consts::TAU, sync::Arc};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::{
    acoustics::edge::EdgeLaw,
    geometry::DVec2,
    model::{
        Diffractor, Edge,
        tests::{diffractors, reflectors},
    },
    reading::PathKind,
    scene::{DEFAULT_SNAP_M, Material, Scene, Wall},
};

pub(in crate::model) const LOSSLESS: PathSettings = PathSettings {
    max_path_m: 20.0,
    max_order: None,
    floor: 1e-4,
    repeated_contact_ratio: DEFAULT_REPEATED_CONTACT_RATIO,
    unrestricted_m: 0.0,
    edge_law: None,
    double_diffraction: false,
    absorption_np_per_m: 0.0,
    wave_number_per_m: TAU * 49_400.0 / 343.2,
    sensor_z_m: None,
    tilt_rad: 0.0,
    scatter_height_rad: 0.0,
    direct: false,
};

impl Paths {
    /// Follows all beams at any height.
    fn without_cuts(mut self) -> Self {
        let climbs = floor::Climbs { ends_beams: false, ..floor::Climbs::clone(&self.plan.climbs) };
        self.plan.climbs = climbs.into();
        Self { bound: effort::Bound { steps: u64::MAX, bytes: u64::MAX }, ..self }
    }

    /// Number of beams reflected by walls on the way out from a point.
    fn beams_from(&self, start: DVec2) -> usize {
        beams::Beams::grow(&self.plan, start, start).nodes.len()
    }
}

fn scene(walls: &[[f64; 4]]) -> Scene {
    let wall = |(i, &[ax, ay, bx, by]): (usize, &[f64; 4])| Wall {
        id: Arc::from(format!("w{i}")),
        a: DVec2::new(ax, ay),
        b: DVec2::new(bx, by),
        material: Material::RIGID,
        z_m: None,
    };
    Scene {
        name: "test".to_owned(),
        source: None,
        approximate: Vec::new(),
        materials: Default::default(),
        walls: walls.iter().enumerate().map(wall).collect(),
        cylinders: Vec::new(),
        floor_z_m: None,
        ceiling_z_m: None,
        floor_material: Material::RIGID,
        ceiling_material: Material::RIGID,
        snap_m: DEFAULT_SNAP_M,
        poses: Default::default(),
        robot: None,
        sha256: String::new(),
        text: "".into(),
    }
}

fn polygon(corners: &[DVec2]) -> Scene {
    let next = corners.iter().cycle().skip(1);
    let walls: Vec<_> = corners.iter().zip(next).map(|(a, b)| [a.x, a.y, b.x, b.y]).collect();
    scene(&walls)
}

/// Vector to each image of the source in a box's lattice (Allen and Berkley), in the box's own
/// frame.
fn lattice(size: DVec2, at: DVec2, max_path_m: f64) -> Vec<DVec2> {
    let bound = |side: f64| (max_path_m / (2.0 * side)).ceil() as i32 + 1;
    let images = |side: f64, at: f64| {
        (-bound(side)..=bound(side)).flat_map(move |m| {
            let shift = 2.0 * f64::from(m) * side;
            [shift, shift - 2.0 * at]
        })
    };
    let ys: Vec<f64> = images(size.y, at.y).collect();
    images(size.x, at.x)
        .flat_map(|x| ys.iter().map(move |&y| DVec2::new(x, y)))
        .filter(|image| image.length() <= max_path_m && image.length() > 1e-12)
        .collect()
}

#[test]
fn rectangle_is_the_image_lattice() {
    let mut random = Pcg64::seed_from_u64(3);
    for case in 0..1000 {
        let size = DVec2::new(random.random_range(0.5..6.0), random.random_range(0.5..6.0));
        let at =
            size * DVec2::new(random.random_range(0.01..0.99), random.random_range(0.01..0.99));
        let frame = DVec2::from_angle(random.random_range(0.0..TAU));
        let origin = DVec2::new(random.random_range(-9.0..9.0), random.random_range(-9.0..9.0));
        let world = |p: DVec2| origin + frame.rotate(p);
        let corners = [DVec2::ZERO, DVec2::new(size.x, 0.0), size, DVec2::new(0.0, size.y)];
        let room = polygon(&corners.map(world));
        let echoes = Paths::new(&room, LOSSLESS).enumerate(world(at)).expect("few paths");

        let mut expected = lattice(size, at, LOSSLESS.max_path_m);
        expected.sort_by(|a, b| a.length().total_cmp(&b.length()));
        assert_eq!(echoes.len(), expected.len(), "case {case}: {size} at {at}");
        // Each echo is one of the images, and no image occurs twice.
        for echo in &echoes {
            let seen = |image: &DVec2| {
                let arrival = frame.rotate(*image).to_angle();
                (image.length() - echo.length_m).abs() < 1e-9
                    && crate::geometry::wrap_pi(arrival - echo.arrival_rad).abs() < 1e-9
            };
            let place = expected.iter().position(seen);
            let place = place.unwrap_or_else(|| panic!("case {case}: no image for {echo:?}"));
            expected.swap_remove(place);
        }
    }
}
