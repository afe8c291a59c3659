//! Surfaces that were found in drawings, maps and worlds of others, on the way to a scene.

use std::collections::BTreeMap;

use super::{Scene, SceneBuilder};
use crate::geometry::DVec2;

/// Walls and round bodies by the names of what they were found in, and a count of what makes none.
///
/// ```
/// use sonard_model::{geometry::DVec2, scene::Surfaces};
///
/// let mut found = Surfaces::default();
/// found.walls("wall", [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]].map(DVec2::from).to_vec(), true);
/// found.round("column", DVec2::new(3.0, 1.0), 0.2);
/// let scene = found.scene("hall", 0.97).build()?;
/// assert_eq!((scene.walls.len(), scene.cylinders.len()), (3, 1));
/// # Ok::<(), sonard_model::scene::SceneError>(())
/// ```
#[derive(Debug, Default)]
pub struct Surfaces {
    found: Vec<(String, Surface)>,
    left_out: BTreeMap<&'static str, usize>,
}

/// A surface that was found.
#[derive(Debug, Clone, PartialEq)]
enum Surface {
    /// A row of walls, metres.
    Walls { corners: Vec<DVec2>, is_closed: bool },
    /// An upright round body, metres.
    Round { center: DVec2, radius_m: f64 },
}

/// Points this near are one, metres: scenes are written to a tenth of a millimetre.
const SAME_M: f64 = 2e-4;
/// The material of everything.
const MATERIAL: &str = "wall";

impl Surfaces {
    /// Keeps a row of walls, unless it has no length; one that comes back to its first corner is closed.
    pub fn walls(&mut self, name: &str, mut corners: Vec<DVec2>, is_closed: bool) {
        corners.dedup_by(|a, b| a.distance(*b) < SAME_M);
        let meets = |corners: &[DVec2]| match corners {
            [first, .., last] => corners.len() > 2 && first.distance(*last) < SAME_M,
            _ => false,
        };
        let is_closed = (is_closed || meets(&corners)) && corners.len() > 2;
        if meets(&corners) {
            corners.pop();
        }
        if corners.len() > 1 && corners.iter().all(|corner| corner.is_finite()) {
            let is_closed = is_closed && corners.len() > 2;
            self.found.push((name.to_owned(), Surface::Walls { corners, is_closed }));
        }
    }

    /// Keeps an upright round body, unless it has no width.
    pub fn round(&mut self, name: &str, center: DVec2, radius_m: f64) {
        if radius_m > SAME_M && radius_m.is_finite() && center.is_finite() {
            self.found.push((name.to_owned(), Surface::Round { center, radius_m }));
        }
    }

    /// Counts what makes no wall.
    pub fn leave_out(&mut self, what: &'static str) {
        *self.left_out.entry(what).or_default() += 1;
    }

    /// What makes no wall, with how often it was met.
    pub fn left_out(&self) -> impl Iterator<Item = (&'static str, usize)> + '_ {
        self.left_out.iter().map(|(what, count)| (*what, *count))
    }

    /// Whether nothing was found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// The scene of what was found, of one material that mirrors such a share of the amplitude, 0 to 1. Rounded to a
    /// tenth of a millimetre: nobody draws finer.
    #[must_use]
    pub fn scene(&self, name: &str, reflectance: f64) -> SceneBuilder {
        let empty = Scene::builder(name).material(MATERIAL, reflectance);
        self.found.iter().zip(1_usize..).fold(empty, with_surface)
    }
}

fn with_surface(
    scene: SceneBuilder,
    ((name, surface), number): (&(String, Surface), usize),
) -> SceneBuilder {
    let round = |metres: f64| (1e4 * metres).round() / 1e4 + 0.0;
    let place = |point: &DVec2| [round(point.x), round(point.y)];
    let id = format!("{name}-{number}");
    match surface {
        Surface::Walls { corners, is_closed } => {
            let corners: Vec<[f64; 2]> = corners.iter().map(place).collect();
            match is_closed {
                true => scene.room(&id, &corners, MATERIAL),
                false => scene.walls(&id, &corners, MATERIAL),
            }
        }
        Surface::Round { center, radius_m } => {
            scene.cylinder(&id, place(center), round(*radius_m), MATERIAL)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_without_length_are_none_and_a_ring_that_comes_back_is_closed() {
        let mut found = Surfaces::default();
        let corner = |x: f64, y: f64| DVec2::new(x, y);
        found.walls("dot", vec![corner(1.0, 1.0), corner(1.0, 1.0 + 1e-5)], false);
        found.walls("far", vec![corner(0.0, 0.0), corner(f64::NAN, 1.0)], false);
        found.round("dot", corner(0.0, 0.0), 0.0);
        assert!(found.is_empty());
        let ring = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0)].map(|(x, y)| corner(x, y));
        found.walls("ring", ring.to_vec(), false);
        found.walls("there and back", vec![ring[0], ring[1], ring[0]], true);
        let [(_, one), (_, other)] = &found.found[..] else { panic!("{found:?}") };
        assert!(matches!(one, Surface::Walls { corners, is_closed: true } if corners.len() == 3));
        assert!(
            matches!(other, Surface::Walls { corners, is_closed: false } if corners.len() == 2)
        );
    }

    #[test]
    fn what_makes_no_wall_is_counted() {
        let mut found = Surfaces::default();
        ["texts", "arcs", "texts"].into_iter().for_each(|what| found.leave_out(what));
        assert_eq!(found.left_out().collect::<Vec<_>>(), [("arcs", 1), ("texts", 2)]);
    }

    #[test]
    fn what_was_found_is_a_scene() {
        let mut found = Surfaces::default();
        found.round("column", DVec2::new(3.000_04, 1.0), 0.2);
        let ring = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]].map(DVec2::from);
        found.walls("wall", ring.to_vec(), true);
        found.walls("screen", ring[..2].to_vec(), false);
        let scene = found.scene("hall", 0.97).build().expect("a scene");
        let ids: Vec<&str> = scene.walls.iter().map(|wall| &*wall.id).collect();
        assert_eq!(ids, ["wall-2.0", "wall-2.1", "wall-2.2", "screen-3"]);
        let [column] = &scene.cylinders[..] else { panic!("{:?}", scene.cylinders) };
        assert_eq!(
            (&*column.id, column.center, column.radius_m),
            ("column-1", DVec2::new(3.0, 1.0), 0.2)
        );
        assert_eq!(scene.walls[0].material.reflectance, 0.97);
    }
}
