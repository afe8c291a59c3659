//! Cylinders: what they hide, and the echoes that touch one of them.

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
            for (i, out) in views.iter().enumerate() {
                for (j, back) in views.iter().enumerate().skip(i) {
                    let Some((mut echo, bounce)) = self.echo(out, back, mesh, settings) else {
                        continue;
                    };
                    let number = tree.bounces.len() as u32;
                    tree.bounces.push(bounce);
                    echo.via = Via::Cylinder { bounce: number, backwards: false };
                    if i != j {
                        echoes.push(echo.reversed());
                    }
                    echoes.push(echo);
                }
            }
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
        if gain < settings.floor || !settings.allows(out.beam.order + back.beam.order + 1) {
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

impl Circle {
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
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if slope(middle) < 0.0 { low = middle } else { high = middle }
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
