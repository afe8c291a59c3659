//! Edges of a scene, and the echoes that bend at one of them.

use std::f64::consts::TAU;

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{
    Echo, Settings, Trees, Via,
    beam::{Ray, TIE_M},
    echo::{SAME_RAD, drop_repeats},
    trace::Tree,
};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, EdgeView, Wedge},
    geometry::{Arrangement, DVec2, SNAP_M},
    model::Edge,
};

/// Legs along a wall's face belong to the wall's near end, radians.
const GRAZING_RAD: f64 = 1e-9;

/// Between edges a leg counts as along a wall's face to within this, radians: their places may have
/// been moved a little off the wall's line to where walls meet.
pub(super) const ALONG_RAD: f64 = 1e-6;

/// The edges of a scene, by point of its arrangement.
#[derive(Debug, Default)]
pub(super) struct Edges {
    points: Vec<Option<Corner>>,
}

/// A point where at least one wall ends and from which sound bends.
#[derive(Debug)]
pub(super) struct Corner {
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
    /// Directions of its walls.
    faces: [DVec2; 2],
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
pub(super) struct Arm<'a> {
    pub(super) ray: &'a Ray,
    /// See [`Tree::part`].
    pub(super) number: u32,
    pub(super) length_m: f64,
    /// Width of the ray tube at the edge, metres: without cylinders its length.
    pub(super) width_m: f64,
    /// Radius of curvature of the wave front at the edge, metres: without cylinders its length.
    pub(super) radius_m: f64,
    pub(super) sector: usize,
    /// Direction from the edge towards the source, from the sector's first wall, radians.
    pub(super) from_rad: f64,
}

/// A direction from an edge.
#[derive(Debug, Clone, Copy)]
pub(super) struct Facing {
    pub(super) sector: usize,
    /// From the sector's first wall, radians.
    pub(super) from_rad: f64,
    pub(super) flank: Flank,
    /// Of the wall along which it runs.
    pub(super) face_reflectance: Option<f64>,
}

/// On which side of a direction its air lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flank {
    /// On both.
    Open,
    /// Along a wall's face, on the left.
    Left,
    /// The same, on the right.
    Right,
}

impl Edges {
    /// Sorts the walls around each point. `walls` are their ends, `gains` their reflectances.
    pub(super) fn new(
        plan: &Arrangement,
        walls: &[(DVec2, DVec2)],
        gains: &[f64],
        law: EdgeLaw,
    ) -> Self {
        let mut around: Vec<SmallVec<[(f64, u32); 4]>> = vec![SmallVec::new(); plan.points.len()];
        for piece in &plan.pieces {
            let [a, b] = piece.ends.map(|end| plan.points[end as usize]);
            // The wall's own direction: snapping and cutting may have bent the piece a little.
            let (from, to) = walls[piece.segment as usize];
            let along = (to - from) * (b - a).dot(to - from).signum();
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

    /// Whether sound that comes to a point along `run` finds an edge there.
    pub(super) fn answers(&self, point: u32, run: DVec2) -> bool {
        let corner = self.points.get(point as usize).and_then(Option::as_ref);
        corner.is_some_and(|corner| corner.sectors.iter().any(|sector| sector.sees(-run)))
    }

    /// What an edge is called.
    pub(super) fn edge(&self, point: u32) -> Option<Edge> {
        Some(self.points.get(point as usize)?.as_ref()?.edge)
    }

    /// The edge at a point, if there is one.
    pub(super) fn corner(&self, point: u32) -> Option<&Corner> {
        self.points.get(point as usize)?.as_ref()
    }

    pub(super) fn place(&self, point: u32) -> Option<DVec2> {
        Some(self.points.get(point as usize)?.as_ref()?.place)
    }

    /// How the edge of an echo that bends at no other looks from where it begins and ends; `None` of
    /// other echoes, by way of a cylinder, and by laws that know no aspect.
    pub(super) fn view(&self, trees: &Trees, echo: &Echo, settings: &Settings) -> Option<EdgeView> {
        let Via::Edge { point, out, back } = echo.via else { return None };
        let corner = self.corner(point).filter(|_| settings.edge_law == Some(EdgeLaw::Utd))?;
        let rays = [trees.out.flat_ray(out)?, trees.back().flat_ray(back)?];
        let [out, back] = rays.map(|ray| {
            let length_m = ray.run.length();
            corner.arm(ray, 0, length_m, length_m)
        });
        let (out, back) = (out?, back?);
        Some(EdgeView {
            wedge: *corner.wedge(out.sector),
            aspect: out.aspect(&back),
            wave_number_per_m: settings.wave_number_per_m,
            legs_m: [out.length_m, back.length_m],
            swapped: rays.map(|ray| ray.order % 2 == 1),
        })
    }

    /// All echoes that bend once: out on one ray to an edge, back on another or the same.
    pub(super) fn echoes(&self, trees: &mut Trees, law: EdgeLaw, settings: &Settings) -> Vec<Echo> {
        trees.out.sort_by_edge();
        trees.back.iter_mut().for_each(Tree::sort_by_edge);
        let bending = Bending { law, settings };
        let mut echoes = Vec::new();
        for point in trees.out.edges() {
            let Some(Some(corner)) = self.points.get(point as usize) else { continue };
            let outs = corner.arms(&trees.out, point);
            match &trees.back {
                None => corner.echoes(point, &outs, &bending, &mut echoes),
                Some(back) => {
                    let backs = corner.arms(back, point);
                    corner.echoes_between(point, &outs, &backs, &bending, &mut echoes);
                }
            }
        }
        echoes
    }
}

impl Sector {
    /// Whether it sends sound back that comes from a direction. Without an arc tangent, for all
    /// the beams that pass a room's corner.
    fn sees(&self, from: DVec2) -> bool {
        let [first, second] = self.faces;
        // Along a wall counts as seen.
        let from_first = first.perp_dot(from) >= -TIE_M;
        let from_second = from.perp_dot(second) >= -TIE_M;
        // In more than half a turn, to be on either wall's side is enough.
        let is_in = if self.wedge.is_convex() {
            from_first || from_second
        } else {
            from_first && from_second
        };
        self.answers && is_in
    }
}

impl Corner {
    /// The rays of a tree to this point, by length, each once.
    pub(super) fn arms<'a>(&self, tree: &'a Tree, point: u32) -> Vec<Arm<'a>> {
        let (first, flat) = tree.flat_to(point);
        let (first_bent, bent) = tree.bent_to(point);
        let flat = (first..).zip(flat).filter_map(|(number, (_, ray))| {
            let length_m = ray.run.length();
            self.arm(ray, number, length_m, length_m)
        });
        let bent = (first_bent..)
            .zip(bent)
            .filter_map(|(number, bent)| self.arm(&bent.ray, number, bent.width_m, bent.radius_m));
        let mut arms: Vec<Arm> = flat.chain(bent).collect();
        arms.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
        drop_repeats(&mut arms, |leg| leg.length_m, Arm::is_same);
        arms
    }

    pub(super) fn wedge(&self, sector: usize) -> &Wedge {
        &self.sectors[sector].wedge
    }

    /// Where a direction from the edge leads: into one sector, or along a wall into those on both
    /// sides of it.
    pub(super) fn facings(&self, direction: DVec2) -> SmallVec<[Facing; 2]> {
        let direction_rad = direction.to_angle();
        let facing = |(sector, air): (usize, &Sector)| {
            let Wedge { opening_rad, reflectance } = air.wedge;
            // From just below 0, so that rounding does not take it a turn round.
            let from_rad = (direction_rad - air.from_rad + ALONG_RAD).rem_euclid(TAU) - ALONG_RAD;
            let at = |from_rad, flank, face_reflectance| Facing {
                sector,
                from_rad,
                flank,
                face_reflectance,
            };
            let [first, second] = reflectance.map(Some);
            let mut found: SmallVec<[Facing; 2]> = SmallVec::new();
            if from_rad < ALONG_RAD {
                found.push(at(0.0, Flank::Left, first));
            } else if from_rad < opening_rad - ALONG_RAD {
                found.push(at(from_rad, Flank::Open, None));
            }
            // All around a free end both faces are the same direction.
            let is_last = (from_rad - opening_rad).abs() <= ALONG_RAD
                || opening_rad == TAU && from_rad < ALONG_RAD;
            if is_last {
                found.push(at(opening_rad, Flank::Right, second));
            }
            found
        };
        let answering = self.sectors.iter().enumerate().filter(|(_, sector)| sector.answers);
        answering.flat_map(facing).collect()
    }

    /// Out on one ray and back on another or the same: each pair in both directions.
    fn echoes(&self, point: u32, arms: &[Arm], bending: &Bending, echoes: &mut Vec<Echo>) {
        for (i, out) in arms.iter().enumerate() {
            for (j, back) in arms.iter().enumerate().skip(i) {
                if out.length_m + back.length_m > bending.settings.max_path_m {
                    break;
                }
                let Some(echo) = bending.echo(self, point, out, back) else { continue };
                if i != j {
                    echoes.push(Echo {
                        departure: echo.arrival,
                        arrival: echo.departure,
                        via: Via::Edge { point, out: back.number, back: out.number },
                        ..echo
                    });
                }
                echoes.push(echo);
            }
        }
    }

    /// Out on a ray from the transmitter and back on one from the receiver.
    fn echoes_between(
        &self,
        point: u32,
        outs: &[Arm],
        backs: &[Arm],
        bending: &Bending,
        echoes: &mut Vec<Echo>,
    ) {
        for out in outs {
            for back in backs {
                if out.length_m + back.length_m > bending.settings.max_path_m {
                    break;
                }
                echoes.extend(bending.echo(self, point, out, back));
            }
        }
    }

    fn arm<'a>(&self, ray: &'a Ray, number: u32, width_m: f64, radius_m: f64) -> Option<Arm<'a>> {
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
            width_m,
            radius_m,
            sector,
            from_rad,
        })
    }
}

impl Bending<'_> {
    fn echo(&self, corner: &Corner, point: u32, out: &Arm, back: &Arm) -> Option<Echo> {
        let field = self.field(corner, out, back)?;
        Some(Echo {
            length_m: out.length_m + back.length_m,
            amplitude: field.norm(),
            phase_rad: field.arg(),
            departure: out.ray.departure,
            arrival: back.ray.departure,
            rise_rad: [0.0; 2],
            image: 0,
            via: Via::Edge { point, out: out.number, back: back.number },
        })
    }

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
        let aspect = out.aspect(back);
        let strength = strength * out.spreading(back, &aspect);
        let k = settings.wave_number_per_m;
        if strength * law.bound(wedge, &aspect, k) < settings.floor {
            return None;
        }
        let field = strength * law.echo(wedge, &aspect, k);
        (field.norm() >= settings.floor).then_some(field)
    }
}

impl Arm<'_> {
    /// In on this one, out on another.
    fn aspect(&self, back: &Self) -> Aspect {
        Aspect {
            in_rad: self.from_rad,
            out_rad: back.from_rad,
            distance_m: distance_parameter_m(self.radius_m, back.radius_m),
        }
    }

    /// What cylinders on the way leave of the field at an edge, beside fronts that flat walls
    /// turned: these fall by `sqrt((s + s') / (s s'))`, and the distance parameter of the
    /// transition is that of the fronts' radii of curvature in the plane (Kouyoumjian and Pathak
    /// 1974, equations (24) and (33), whose other radius, along the edge, no cylinder changes).
    fn spreading(&self, back: &Self, aspect: &Aspect) -> f64 {
        let length_m = self.length_m + back.length_m;
        (aspect.distance_m * length_m / (self.width_m * back.width_m)).sqrt()
    }

    /// Whether two arms are one that touches a corner on its way and was found on both sides.
    fn is_same(&self, other: &Self) -> bool {
        is_same_departure(self.ray, other.ray)
    }
}

/// Kouyoumjian and Pathak's distance parameter of a front of one radius that goes on from an edge for
/// the other, metres.
pub(super) fn distance_parameter_m(one_m: f64, other_m: f64) -> f64 {
    one_m * other_m / (one_m + other_m)
}

/// Whether two rays from one place, of one length, leave it in one direction.
pub(super) fn is_same_departure(one: &Ray, other: &Ray) -> bool {
    one.departure.distance_squared(other.departure) < SAME_RAD * SAME_RAD
}

fn end_at(walls: &[(DVec2, DVec2)], index: u32, place: DVec2) -> Option<Edge> {
    let (a, b) = walls[index as usize];
    let is_at = |end: DVec2| end.distance(place) < 2.0 * SNAP_M;
    (is_at(a) || is_at(b)).then(|| Edge { wall: index, at_b: !is_at(a) })
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
        let faces = [from_rad, to_rad].map(DVec2::from_angle);
        Sector { from_rad, faces, wedge, answers: law.answers(&wedge) }
    };
    faces.iter().zip(next).map(sector).collect()
}
