//! Surfaces imported from drawings, maps and simulated worlds, as input of a scene.

use std::collections::BTreeMap;

use super::{Scene, SceneBuilder};
use crate::geometry::DVec2;

/// Imported walls and round bodies by name, and counts of ignored elements.
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

/// Imported surface of a scene.
#[derive(Debug, Clone, PartialEq)]
enum Surface {
    /// Row of walls, metres.
    Walls { corners: Vec<DVec2>, is_closed: bool },
    /// Upright round body, metres.
    Round { center: DVec2, radius_m: f64 },
}

/// Tolerance for coincident points, metres: scenes are written to a tenth of a millimetre.
const SAME_M: f64 = 2e-4;
/// Name of the single material.
const MATERIAL: &str = "wall";

impl Surfaces {
    /// Adds a row of walls, unless it has no length. A row that returns to its first corner is
    /// closed.
    pub fn walls(&mut self, name: &str, mut corners: Vec<DVec2>, is_closed: bool) {
        corners.dedup_by(|a, b| a.distance(*b) < SAME_M);
        let is_ring = |corners: &[DVec2]| match corners {
            [first, .., last] => corners.len() > 2 && first.distance(*last) < SAME_M,
            _ => false,
        };
        let is_closed = (is_closed || is_ring(&corners)) && corners.len() > 2;
        if is_ring(&corners) {
            corners.pop();
        }
        if corners.len() > 1 && corners.iter().all(|corner| corner.is_finite()) {
            let is_closed = is_closed && corners.len() > 2;
            self.found.push((name.to_owned(), Surface::Walls { corners, is_closed }));
        }
    }

    /// Adds an upright round body, unless it has no width.
    pub fn round(&mut self, name: &str, center: DVec2, radius_m: f64) {
        if radius_m > SAME_M && radius_m.is_finite() && center.is_finite() {
            self.found.push((name.to_owned(), Surface::Round { center, radius_m }));
        }
    }

    /// Counts an element that is not converted to walls.
    pub fn count_ignored(&mut self, what: &'static str) {
        *self.left_out.entry(what).or_default() += 1;
    }

    /// Ignored kinds of elements, with their counts.
    pub fn ignored(&self) -> impl Iterator<Item = (&'static str, usize)> + '_ {
        self.left_out.iter().map(|(what, count)| (*what, *count))
    }

    /// Returns `true` if no surface was added.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Scene of all surfaces, of one material with an amplitude reflection coefficient of 0 to 1.
    /// Coordinates are rounded to a tenth of a millimetre, finer than any drawing.
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
    fn ignores_empty_and_closes_rings() {
        let mut found = Surfaces::default();
        let corner = |x: f64, y: f64| DVec2::new(x, y);
        found.walls("dot", vec![corner(1.0, 1.0), corner(1.0, 1.0 + 1e-5)], false);
        found.walls("far", vec![corner(0.0, 0.0), corner(f64::NAN, 1.0)], false);
        found.round("dot", corner(0.0, 0.0), 0.0);
        assert!(found.is_empty());
        let ring = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0)].map(|(x, y)| corner(x, y));
        found.walls("ring", ring.to_vec(), false);
        found.walls("retraced", vec![ring[0], ring[1], ring[0]], true);
        let [(_, ring), (_, retraced)] = &found.found[..] else { panic!("{found:?}") };
        assert!(matches!(ring, Surface::Walls { corners, is_closed: true } if corners.len() == 3));
        assert!(
            matches!(retraced, Surface::Walls { corners, is_closed: false } if corners.len() == 2)
        );
    }

    #[test]
    fn counts_ignored_elements() {
        let mut found = Surfaces::default();
        ["texts", "arcs", "texts"].into_iter().for_each(|what| found.count_ignored(what));
        assert_eq!(found.ignored().collect::<Vec<_>>(), [("arcs", 1), ("texts", 2)]);
    }

    #[test]
    fn surfaces_become_a_scene() {
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
