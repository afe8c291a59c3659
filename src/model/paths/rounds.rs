//! Cylinders: what they hide, and the echoes that touch one of them.

use std::f64::consts::TAU;

use smallvec::SmallVec;

use super::{
    Echo, Settings, Via,
    beam::{Ray, TIE_M},
    mesh::Mesh,
    trace::{Bounce, Tree, View},
};
use crate::{geometry::DVec2, scene::Cylinder};

/// The cylinders of a scene and the triangles they reach into.
#[derive(Debug, Default)]
pub(super) struct Rounds {
    circles: Vec<Circle>,
    /// By triangle; empty without cylinders.
    by_triangle: Vec<SmallVec<[u32; 2]>>,
}

#[derive(Debug, Clone, Copy)]
struct Circle {
    center: DVec2,
    radius_m: f64,
    gain: f64,
}

impl Rounds {
    /// `gains` are the cylinders' reflectances.
    pub(super) fn new(cylinders: &[Cylinder], gains: &[f64], mesh: Option<&Mesh>) -> Self {
        let circle = |(cylinder, &gain): (&Cylinder, &f64)| Circle {
            center: cylinder.center,
            radius_m: cylinder.radius_m,
            gain,
        };
        let circles: Vec<_> = cylinders.iter().zip(gains).map(circle).collect();
        let mut by_triangle = Vec::new();
        if let Some(mesh) = mesh.filter(|_| !circles.is_empty()) {
            by_triangle.resize(mesh.triangles.len(), SmallVec::new());
            for (circle, index) in circles.iter().zip(0..) {
                for triangle in mesh.triangles_near(circle.center, circle.radius_m) {
                    by_triangle[triangle as usize].push(index);
                }
            }
        }
        Self { circles, by_triangle }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.circles.is_empty()
    }

    pub(super) fn in_triangle(&self, triangle: u32) -> &[u32] {
        self.by_triangle.get(triangle as usize).map_or(&[], |cylinders| cylinders)
    }

    /// Whether a cylinder stands across the straight way between two points.
    pub(super) fn hide(&self, from: DVec2, to: DVec2) -> bool {
        self.circles.iter().any(|circle| circle.meets(from, to))
    }

    /// All echoes with one reflection at a cylinder: there on one ray, back on another or the
    /// same. The place of the reflection is where the way from image to image is shortest.
    pub(super) fn echoes(&self, tree: &mut Tree, mesh: &Mesh, settings: &Settings) -> Vec<Echo> {
        let place = |view: &View| (view.cylinder, view.beam.triangle);
        tree.to_cylinders.sort_by_key(place);
        let mut echoes = Vec::new();
        for views in tree.to_cylinders.chunk_by(|a, b| place(a) == place(b)) {
            let circle = &self.circles[views[0].cylinder as usize];
            for_each_meeting(&mut lit_arcs(circle, views), |i, j| {
                let (out, back) = (&views[i as usize], &views[j as usize]);
                let Some((mut echo, bounce)) = self.echo(out, back, mesh, settings) else { return };
                let number = tree.bounces.len() as u32;
                tree.bounces.push(bounce);
                echo.via = Via::Cylinder { bounce: number, backwards: false };
                if i != j {
                    echoes.push(echo.reversed());
                }
                echoes.push(echo);
            });
        }
        echoes
    }

    fn echo(
        &self,
        out: &View,
        back: &View,
        mesh: &Mesh,
        settings: &Settings,
    ) -> Option<(Echo, Bounce)> {
        let circle = &self.circles[out.cylinder as usize];
        let gain = out.beam.gain * back.beam.gain * circle.gain;
        // Over the nearest points and head on, no way is shorter or spreads less.
        let (s, t) = (circle.distance_m(out.beam.image), circle.distance_m(back.beam.image));
        let least_spread = 1.0 + 2.0 * s * t / (circle.radius_m * (s + t));
        let most = gain * settings.air_gain(s + t) / least_spread.sqrt();
        let is_worth = s + t <= settings.max_path_m && most >= settings.floor;
        if !is_worth || !settings.allows(out.beam.order + back.beam.order + 1) {
            return None;
        }
        let hit = circle.reflection(out.beam.image, back.beam.image)?;
        let (there, here): (Ray, Ray) = (out.beam.ray_to(hit), back.beam.ray_to(hit));
        let (s, t) = (there.run.length(), here.run.length());
        let length_m = s + t;
        let seen = out.beam.holds(there.run) && back.beam.holds(here.run);
        if length_m > settings.max_path_m || !seen || !mesh.holds(out.beam.triangle, hit) {
            return None;
        }
        let cosine = -(hit - circle.center).dot(there.run) / (circle.radius_m * s);
        let spread = length_m + 2.0 * s * t / (circle.radius_m * cosine);
        let amplitude = gain * settings.air_gain(length_m) * (length_m / spread).sqrt();
        let echo = Echo {
            length_m,
            amplitude,
            phase_rad: 0.0,
            departure: there.departure,
            arrival: here.departure,
            via: Via::Cylinder { bounce: 0, backwards: false },
        };
        let (out_leg, back_leg) = ((&there).into(), (&here).into());
        let bounce = Bounce { cylinder: out.cylinder, hit, out: out_leg, back: back_leg };
        (amplitude >= settings.floor).then_some((echo, bounce))
    }
}

/// The part of a circle that a beam lights: counter-clockwise angles around the centre.
#[derive(Debug, Clone, Copy)]
struct Arc {
    from_rad: f64,
    to_rad: f64,
    view: u32,
}

/// Arcs this much longer than they are keep what rounding would lose, radians.
const SPARE_RAD: f64 = 1e-6;

/// The arc of each view that lights the circle, `from_rad` in [0, 2 pi).
fn lit_arcs(circle: &Circle, views: &[View]) -> Vec<Arc> {
    let arc = |(view, index): (&View, u32)| {
        let to_image = view.beam.image - circle.center;
        let sine = circle.radius_m / to_image.length();
        if sine >= 1.0 {
            return None;
        }
        let edge = sine.asin();
        let off_axis = |border: DVec2| (-to_image).angle_to(border);
        let (right, left) = if view.beam.right == DVec2::ZERO {
            (-edge, edge)
        } else {
            (off_axis(view.beam.right), off_axis(view.beam.left))
        };
        if right > edge || left < -edge {
            return None;
        }
        // A ray off the axis to the left meets the circle on the clockwise side of the image.
        let place = |off: f64| {
            let off = off.clamp(-edge, edge);
            off - (off.sin() / sine).clamp(-1.0, 1.0).asin()
        };
        let from = to_image.to_angle() + place(left) - SPARE_RAD;
        let width = place(right) - place(left) + 2.0 * SPARE_RAD;
        let from_rad = from.rem_euclid(TAU);
        Some(Arc { from_rad, to_rad: from_rad + width, view: index })
    };
    views.iter().zip(0..).filter_map(arc).collect()
}

/// Calls back for each pair of arcs that overlap, once, and for each arc with itself.
fn for_each_meeting(arcs: &mut [Arc], mut meet: impl FnMut(u32, u32)) {
    arcs.sort_unstable_by(|a, b| a.from_rad.total_cmp(&b.from_rad));
    for (i, arc) in arcs.iter().enumerate() {
        meet(arc.view, arc.view);
        let later = &arcs[i + 1..];
        later.iter().take_while(|other| other.from_rad <= arc.to_rad).for_each(|other| {
            meet(arc.view, other.view);
        });
        // Past a whole turn, the first ones again, but for those that have met it themselves.
        let first = arcs[..i].iter().take_while(|other| other.from_rad + TAU <= arc.to_rad);
        first.filter(|other| other.to_rad < arc.from_rad).for_each(|other| {
            meet(arc.view, other.view);
        });
    }
}

impl Circle {
    fn distance_m(&self, point: DVec2) -> f64 {
        (point.distance(self.center) - self.radius_m).max(0.0)
    }

    /// Where sound from `p` to `q` is reflected on the outside: the only stationary point of the
    /// way's length between the points of the circle that are nearest to `p` and to `q`.
    fn reflection(&self, p: DVec2, q: DVec2) -> Option<DVec2> {
        let (to_p, to_q) = (p - self.center, q - self.center);
        if to_p.length() <= self.radius_m || to_q.length() <= self.radius_m {
            return None;
        }
        let turn = to_p.angle_to(to_q);
        let first = to_p.normalize();
        let normal_at = |part: f64| first.rotate(DVec2::from_angle(part * turn));
        // Grows from p's side (negative) to q's (positive): the derivative of the length.
        let slope = |part: f64| {
            let normal = normal_at(part);
            let hit = self.center + self.radius_m * normal;
            let along = normal.perp() * turn.signum();
            along.dot((hit - p).normalize() + (hit - q).normalize())
        };
        let (mut low, mut high) = (0.0, 1.0);
        if turn != 0.0 {
            // False position, with the stale end's weight halved (the Illinois rule).
            let (mut at_low, mut at_high) = (slope(low), slope(high));
            let mut last_was_low = None;
            while high - low > 1e-14 {
                let middle = (low * at_high - high * at_low) / (at_high - at_low);
                let here = slope(middle);
                if here == 0.0 || middle <= low || middle >= high {
                    (low, high) = (middle, middle);
                } else if here < 0.0 {
                    (low, at_low) = (middle, here);
                    if last_was_low == Some(true) {
                        at_high *= 0.5;
                    }
                    last_was_low = Some(true);
                } else {
                    (high, at_high) = (middle, here);
                    if last_was_low == Some(false) {
                        at_low *= 0.5;
                    }
                    last_was_low = Some(false);
                }
                if here.abs() < 1e-13 {
                    (low, high) = (middle, middle);
                }
            }
        }
        let normal = normal_at(0.5 * (low + high));
        let hit = self.center + self.radius_m * normal;
        (normal.dot(p - hit) > 0.0 && normal.dot(q - hit) > 0.0).then_some(hit)
    }

    fn meets(&self, from: DVec2, to: DVec2) -> bool {
        let run = to - from;
        let nearest = ((self.center - from).dot(run) / run.length_squared()).clamp(0.0, 1.0);
        (from + nearest * run).distance(self.center) < self.radius_m - TIE_M
    }
}
