//! The tree of beams from one place.

use super::{Paths, Settings, mesh::{Mesh, Side}};
use crate::geometry::DVec2;

/// Rays this close to a corner pass through it, metres: on either side of it and over it. Above
/// rounding (1e-14 over tens of metres), below anything that sound could tell.
pub(super) const TIE_M: f64 = 1e-9;

/// No scene keeps a beam this long; it stops one that rounding has caught.
const MOST_REFLECTIONS: u16 = 4096;

/// Marks a node without a parent.
pub(super) const ROOT: u32 = u32::MAX;

/// What the beams from one place have met.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// One for each reflection of a beam.
    nodes: Vec<Node>,
    /// Rays that come back to where they started.
    pub(super) returns: Vec<Ray>,
    /// Rays that end at an edge, with the index of its point.
    pub(super) to_edges: Vec<(u32, Ray)>,
    /// Beams that meet a cylinder.
    pub(super) to_cylinders: Vec<View>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    before: u32,
    wall: u32,
}

/// One way by mirror reflections, unfolded: a straight ray from an image of the start.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    /// From the image to the end, metres.
    pub(super) run: DVec2,
    /// Unit vector in which it leaves.
    pub(super) departure: DVec2,
    /// Product of the reflectances.
    pub(super) gain: f64,
    /// Last reflection, [`ROOT`] if none.
    pub(super) node: u32,
    /// Number of reflections.
    pub(super) order: u16,
}

/// A beam where it passes a triangle that a cylinder reaches into.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    pub(super) cylinder: u32,
    pub(super) beam: Beam,
}

/// All rays from an image of the start between two directions, in one triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    /// Mirror image of the start.
    pub(super) image: DVec2,
    /// Its clockwise border, any length.
    right: DVec2,
    /// Its counter-clockwise border, any length.
    left: DVec2,
    /// With `mirrored`, the way back to the start's own frame: see [`Beam::departure`].
    turn: DVec2,
    pub(super) gain: f64,
    pub(super) node: u32,
    pub(super) triangle: u32,
    /// The side it came in by.
    side: u8,
    mirrored: bool,
    pub(super) order: u16,
}

impl Beam {
    /// The direction in which a ray left that now runs along `direction`.
    pub(super) fn departure(&self, direction: DVec2) -> DVec2 {
        self.turn.rotate(if self.mirrored { conjugate(direction) } else { direction })
    }

    /// The ray of this beam to a point.
    pub(super) fn ray_to(&self, point: DVec2) -> Ray {
        let run = point - self.image;
        Ray {
            run,
            departure: self.departure(run.normalize_or_zero()),
            gain: self.gain,
            node: self.node,
            order: self.order,
        }
    }

    /// Whether the ray towards `run` is in the beam, borders included. A beam without borders is
    /// the one that starts in all directions.
    pub(super) fn holds(&self, run: DVec2) -> bool {
        if self.right == DVec2::ZERO {
            return true;
        }
        reaches(self.right, run) && reaches(run, self.left) && run.dot(self.right + self.left) > 0.0
    }
}

/// Whether `v` is counter-clockwise of the ray along `border`, or its end within [`TIE_M`] of it.
fn reaches(border: DVec2, v: DVec2) -> bool {
    let cross = border.perp_dot(v);
    // |cross| / |border| is the distance; with the shorter of the two it needs no third case.
    cross >= 0.0 || cross * cross <= TIE_M * TIE_M * border.length_squared().min(v.length_squared())
}

fn conjugate(v: DVec2) -> DVec2 {
    DVec2::new(v.x, -v.y)
}

impl Tree {
    /// All beams from `start` that can still give an echo.
    pub(super) fn grow(paths: &Paths, start: DVec2) -> Self {
        let tree = Self::default();
        let Some(mesh) = &paths.mesh else { return tree };
        let Some(home) = mesh.locate(start) else { return tree };
        let mut grower = Grower { paths, mesh, start, home, stack: Vec::new(), tree };
        grower.grow();
        grower.tree
    }

    /// The walls that lead to a node, last one first.
    pub(super) fn walls_back(&self, node: u32) -> impl Iterator<Item = u32> {
        let mut at = node;
        std::iter::from_fn(move || {
            let node = self.nodes.get(at as usize)?;
            at = node.before;
            Some(node.wall)
        })
    }
}

struct Grower<'a> {
    paths: &'a Paths,
    mesh: &'a Mesh,
    start: DVec2,
    /// Triangle of the start.
    home: u32,
    stack: Vec<Beam>,
    tree: Tree,
}

impl Grower<'_> {
    fn grow(&mut self) {
        let first = Beam {
            image: self.start,
            right: DVec2::ZERO,
            left: DVec2::ZERO,
            turn: DVec2::X,
            gain: 1.0,
            node: ROOT,
            triangle: self.home,
            side: 0,
            mirrored: false,
            order: 0,
        };
        self.look_around(first, None);
        while let Some(beam) = self.stack.pop() {
            self.follow(beam);
        }
    }

    /// Beams through the sides of the start's triangle, and its corners. A start on a side looks
    /// around in the triangle behind it too.
    fn look_around(&mut self, first: Beam, entered_by: Option<usize>) {
        let triangle = self.mesh.triangles[first.triangle as usize];
        let (mesh, start) = (self.mesh, self.start);
        let to_corner = |corner: usize| mesh.corner(first.triangle, corner) - start;
        if entered_by.is_none() {
            for corner in triangle.corners {
                self.meet_edge(&first, corner);
            }
        } else if let Some(side) = entered_by {
            self.meet_edge(&first, triangle.corners[(side + 2) % 3]);
        }
        for side in (0..3).filter(|&side| Some(side) != entered_by) {
            let (right, left) = (to_corner(side), to_corner((side + 1) % 3));
            let on_side = right.perp_dot(left) <= TIE_M * (left - right).length();
            match triangle.sides[side] {
                Side::Open { triangle, side } if on_side && entered_by.is_none() => {
                    self.look_around(Beam { triangle, ..first }, Some(side as usize));
                }
                _ if on_side => {}
                _ => {
                    let beam = Beam { right, left, ..first };
                    if let Some(beam) = self.leave(beam, side) {
                        self.stack.push(beam);
                    }
                }
            }
        }
        self.meet_cylinders(&first);
    }

    /// Follows a beam until it is gone; parts that split off go on the stack.
    fn follow(&mut self, mut beam: Beam) {
        loop {
            if beam.triangle == self.home && beam.node != ROOT {
                self.meet_start(&beam);
            }
            self.meet_cylinders(&beam);
            let side = beam.side as usize;
            let (right_side, left_side) = ((side + 1) % 3, (side + 2) % 3);
            let corner = self.mesh.triangles[beam.triangle as usize].corners[left_side];
            let run = self.mesh.points[corner as usize] - beam.image;
            let past_right = reaches(beam.right, run);
            let past_left = reaches(run, beam.left);
            if past_right && past_left {
                self.meet_edge(&beam, corner);
            }
            // A corner on a border sends the whole beam past it, on the other side.
            let next = if !past_right || !reaches_well(beam.right, run) {
                self.leave(beam, left_side)
            } else if !past_left || !reaches_well(run, beam.left) {
                self.leave(beam, right_side)
            } else {
                let left_part = self.leave(Beam { right: run, ..beam }, left_side);
                let right_part = self.leave(Beam { left: run, ..beam }, right_side);
                match (left_part, right_part) {
                    (Some(left), Some(right)) => {
                        self.stack.push(left);
                        Some(right)
                    }
                    (left, right) => left.or(right),
                }
            };
            match next {
                Some(next) => beam = next,
                None => return,
            }
        }
    }

    /// The beam after it has left its triangle by a side: in the next one, or reflected; `None`
    /// if no echo can come of it.
    fn leave(&mut self, beam: Beam, side: usize) -> Option<Beam> {
        match self.mesh.triangles[beam.triangle as usize].sides[side] {
            Side::Open { triangle, side } => {
                let next = Beam { triangle, side, ..beam };
                self.may_return(&next).then_some(next)
            }
            Side::Wall(wall) => self.reflect(&beam, wall, side),
            Side::Outside => None,
        }
    }

    /// Cheap test on the way: whether a beam can be back within the longest path through the
    /// side it came in by.
    fn may_return(&self, beam: &Beam) -> bool {
        let side = beam.side as usize;
        let [a, b] = [side, (side + 1) % 3].map(|corner| self.mesh.corner(beam.triangle, corner));
        let middle = 0.5 * (a + b);
        let least = middle.distance(beam.image) + middle.distance(self.start) - a.distance(b);
        least <= self.paths.settings.max_path_m
    }

    fn reflect(&mut self, beam: &Beam, wall: u32, side: usize) -> Option<Beam> {
        let settings = &self.paths.settings;
        if beam.order >= settings.max_order.unwrap_or(MOST_REFLECTIONS).min(MOST_REFLECTIONS) {
            return None;
        }
        let face = &self.paths.faces[wall as usize];
        let gain = beam.gain * face.gain;
        let next = Beam {
            image: face.mirror.image(beam.image),
            right: face.mirror.turn(beam.left),
            left: face.mirror.turn(beam.right),
            turn: beam.departure(face.mirror.rotor()),
            gain,
            mirrored: !beam.mirrored,
            order: beam.order + 1,
            side: side as u8,
            ..*beam
        };
        if !self.is_worth(beam, &next, wall, side) {
            return None;
        }
        let node = self.tree.nodes.len() as u32;
        self.tree.nodes.push(Node { before: beam.node, wall });
        Some(Beam { node, ..next })
    }

    /// Whether an echo by this reflection can be short and strong enough.
    fn is_worth(&self, beam: &Beam, next: &Beam, wall: u32, side: usize) -> bool {
        let Settings { max_path_m, floor, absorption_np_per_m, .. } = self.paths.settings;
        let least_m = self.least_path_m(beam, next, wall, side);
        least_m <= max_path_m && next.gain * (-absorption_np_per_m * least_m).exp() >= floor
    }

    /// Length of the shortest way from the beam's image to its part of a wall and straight back
    /// to the start. The length is a convex function of the place on the wall: least at one end
    /// of the part, or where an image and the start see each other through it.
    fn least_path_m(&self, beam: &Beam, next: &Beam, wall: u32, side: usize) -> f64 {
        let mirror = &self.paths.faces[wall as usize].mirror;
        let behind = mirror.height_m(self.start) * mirror.height_m(beam.image) < 0.0;
        let (image, seen) = if behind {
            (beam.image, beam.holds(self.start - beam.image))
        } else {
            (next.image, next.holds(self.start - next.image))
        };
        if seen {
            return image.distance(self.start);
        }
        let along = mirror.normal.perp();
        let ends = [self.mesh.corner(beam.triangle, side), self.mesh.corner(beam.triangle, (side + 1) % 3)]
            .map(|end| along.dot(end));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let height = mirror.height_m(beam.image);
        let by = |border: DVec2| {
            let hit = beam.image - height / mirror.normal.dot(border) * border;
            // Clamped, for borders that graze the wall; min and max drop a NaN.
            let place = along.dot(hit).max(low).min(high);
            let hit = mirror.offset_m * mirror.normal + place * along;
            hit.distance(beam.image) + hit.distance(self.start)
        };
        by(beam.right).min(by(beam.left))
    }

    fn meet_start(&mut self, beam: &Beam) {
        let run = self.start - beam.image;
        if beam.holds(run) && run.length_squared() <= self.paths.settings.max_path_m.powi(2) {
            self.tree.returns.push(beam.ray_to(self.start));
        }
    }

    fn meet_edge(&mut self, beam: &Beam, point: u32) {
        if self.paths.edges.is_edge(point) {
                self.tree.to_edges.push((point, beam.ray_to(self.mesh.points[point as usize])));
        }
    }

    fn meet_cylinders(&mut self, beam: &Beam) {
        for &cylinder in self.paths.rounds.in_triangle(beam.triangle) {
            self.tree.to_cylinders.push(View { cylinder, beam: *beam });
        }
    }
}

/// Whether `v` is counter-clockwise of the ray along `border` by more than [`TIE_M`].
fn reaches_well(border: DVec2, v: DVec2) -> bool {
    !reaches(v, border)
}
