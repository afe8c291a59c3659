//! Edges of a scene, and the echoes that bend at one of them.

use std::f64::consts::TAU;

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{Echo, SAME_RAD, Settings, Via, beam::Ray, drop_repeats, trace::Tree};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, Wedge},
    geometry::{Arrangement, DVec2, SNAP_M},
    model::Edge,
    scene::Wall,
};

/// Legs along a wall's face belong to the wall's near end, radians.
const GRAZING_RAD: f64 = 1e-9;

/// The edges of a scene, by point of its arrangement.
#[derive(Debug, Default)]
pub(super) struct Edges {
    points: Vec<Option<Corner>>,
}

/// A point where at least one wall ends and from which sound bends.
#[derive(Debug)]
struct Corner {
    place: DVec2,
    edge: Edge,
    /// Counter-clockwise around the point.
    sectors: SmallVec<[Sector; 2]>,
}

/// The air between two walls at a point.
#[derive(Debug, Clone, Copy)]
struct Sector {
    /// World direction of the wall it starts at, radians.
    from_rad: f64,
    wedge: Wedge,
    /// Whether it sends anything back.
    answers: bool,
}

/// How strong what bends is.
struct Bending<'a> {
    law: EdgeLaw,
    settings: &'a Settings,
}

/// A ray to an edge as the edge sees it.
#[derive(Clone, Copy)]
struct Arm<'a> {
    ray: &'a Ray,
    /// Its place in [`Tree::to_edges`].
    number: u32,
    length_m: f64,
    sector: usize,
    /// Direction from the edge towards the source, from the sector's first wall, radians.
    from_rad: f64,
}

impl Edges {
    /// Sorts the walls around each point. `gains` are the walls' reflectances.
    pub(super) fn new(plan: &Arrangement, walls: &[Wall], gains: &[f64], law: EdgeLaw) -> Self {
        let mut around: Vec<SmallVec<[(f64, u32); 4]>> = vec![SmallVec::new(); plan.points.len()];
        for piece in &plan.pieces {
            let [a, b] = piece.ends.map(|end| plan.points[end as usize]);
            // The wall's own direction: snapping and cutting may have bent the piece a little.
            let wall = &walls[piece.segment as usize];
            let along = (wall.b - wall.a) * (b - a).dot(wall.b - wall.a).signum();
            around[piece.ends[0] as usize].push((along.to_angle(), piece.segment));
            around[piece.ends[1] as usize].push(((-along).to_angle(), piece.segment));
        }
        let corner = |(place, mut faces): (DVec2, SmallVec<[(f64, u32); 4]>)| {
            faces.sort_by(|a, b| a.0.total_cmp(&b.0));
            let edge = faces.iter().filter_map(|&(_, wall)| end_at(walls, wall, place)).min()?;
            let sectors = sectors(&faces, gains, law);
            let answers = sectors.iter().any(|sector| sector.answers);
            answers.then_some(Corner { place, edge, sectors })
        };
        Self { points: plan.points.iter().copied().zip(around).map(corner).collect() }
    }

    pub(super) fn is_edge(&self, point: u32) -> bool {
        matches!(self.points.get(point as usize), Some(Some(_)))
    }

    /// What an edge is called.
    pub(super) fn edge(&self, point: u32) -> Option<Edge> {
        Some(self.points.get(point as usize)?.as_ref()?.edge)
    }

    pub(super) fn place(&self, point: u32) -> Option<DVec2> {
        Some(self.points.get(point as usize)?.as_ref()?.place)
    }

    /// All echoes that bend once: out on one ray to an edge, back on another or the same.
    pub(super) fn echoes(&self, tree: &mut Tree, law: EdgeLaw, settings: &Settings) -> Vec<Echo> {
        tree.to_edges.sort_by(|(p, r), (q, s)| {
            p.cmp(q).then(r.run.length_squared().total_cmp(&s.run.length_squared()))
        });
        let mut echoes = Vec::new();
        let mut first = 0;
        for rays in tree.to_edges.chunk_by(|a, b| a.0 == b.0) {
            let point = rays[0].0;
            if let Some(Some(corner)) = self.points.get(point as usize) {
                corner.echoes(point, first, rays, &Bending { law, settings }, &mut echoes);
            }
            first += rays.len() as u32;
        }
        echoes
    }
}

impl Corner {
    /// Of the rays to this point, the first of which is number `first` in the tree.
    fn echoes(
        &self,
        point: u32,
        first: u32,
        rays: &[(u32, Ray)],
        bending: &Bending,
        echoes: &mut Vec<Echo>,
    ) {
        let mut arms: Vec<Arm> =
            (first..).zip(rays).filter_map(|(number, (_, ray))| self.arm(ray, number)).collect();
        drop_repeats(&mut arms, |leg| leg.length_m, Arm::is_same);
        for (i, out) in arms.iter().enumerate() {
            for (j, back) in arms.iter().enumerate().skip(i) {
                let length_m = out.length_m + back.length_m;
                if length_m > bending.settings.max_path_m {
                    break;
                }
                let Some(field) = bending.field(self, out, back) else { continue };
                let echo = Echo {
                    length_m,
                    amplitude: field.norm(),
                    phase_rad: field.arg(),
                    departure: out.ray.departure,
                    arrival: back.ray.departure,
                    via: Via::Edge { point, out: out.number, back: back.number },
                };
                if i != j {
                    echoes.push(echo.reversed());
                }
                echoes.push(echo);
            }
        }
    }

    fn arm<'a>(&self, ray: &'a Ray, number: u32) -> Option<Arm<'a>> {
        let direction = (-ray.run).to_angle();
        let last = self.sectors.len() - 1;
        let sector = self.sectors.iter().rposition(|s| s.from_rad <= direction).unwrap_or(last);
        let from_rad = (direction - self.sectors[sector].from_rad).rem_euclid(TAU);
        let opening_rad = self.sectors[sector].wedge.opening_rad;
        let in_air = from_rad > GRAZING_RAD && from_rad < opening_rad - GRAZING_RAD;
        (in_air && self.sectors[sector].answers).then(|| Arm {
            ray,
            number,
            length_m: ray.run.length(),
            sector,
            from_rad,
        })
    }
}

impl Bending<'_> {
    /// Relative field of the echo out and back on two arms, `None` below the floor.
    fn field(&self, corner: &Corner, out: &Arm, back: &Arm) -> Option<Complex64> {
        let Self { law, settings } = self;
        if out.sector != back.sector || !settings.allows(out.ray.order + back.ray.order) {
            return None;
        }
        let length_m = out.length_m + back.length_m;
        let strength = out.ray.gain * back.ray.gain * settings.air_gain(length_m);
        // No law gives more than a wall's echo and the images that its edge replaces.
        if 2.0 * strength < settings.floor {
            return None;
        }
        let wedge = &corner.sectors[out.sector].wedge;
        let aspect = Aspect {
            in_rad: out.from_rad,
            out_rad: back.from_rad,
            distance_m: out.length_m * back.length_m / length_m,
        };
        let k = settings.wave_number_per_m;
        if strength * law.bound(wedge, &aspect, k) < settings.floor {
            return None;
        }
        let field = strength * law.echo(wedge, &aspect, k);
        (field.norm() >= settings.floor).then_some(field)
    }
}

impl Arm<'_> {
    /// Whether two arms are one that touches a corner on its way and was found on both sides.
    fn is_same(&self, other: &Self) -> bool {
        self.ray.departure.distance_squared(other.ray.departure) < SAME_RAD * SAME_RAD
    }
}

fn end_at(walls: &[Wall], index: u32, place: DVec2) -> Option<Edge> {
    let wall = &walls[index as usize];
    let is_at = |end: DVec2| end.distance(place) < 2.0 * SNAP_M;
    (is_at(wall.a) || is_at(wall.b)).then(|| Edge { wall: index, at_b: !is_at(wall.a) })
}

/// The air between each wall of a point and the next one; `faces` by direction.
fn sectors(faces: &[(f64, u32)], gains: &[f64], law: EdgeLaw) -> SmallVec<[Sector; 2]> {
    let next = faces.iter().cycle().skip(1);
    let sector = |(&(from_rad, wall), &(to_rad, next)): (&(f64, u32), &(f64, u32))| {
        let turn = (to_rad - from_rad).rem_euclid(TAU);
        let wedge = Wedge {
            // A wall alone has air all around its end.
            opening_rad: if turn == 0.0 { TAU } else { turn },
            reflectance: [gains[wall as usize], gains[next as usize]],
        };
        Sector { from_rad, wedge, answers: law.answers(&wedge) }
    };
    faces.iter().zip(next).map(sector).collect()
}
