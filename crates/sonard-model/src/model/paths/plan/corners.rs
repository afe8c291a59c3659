//! Upright edges by point of the plan: the wedges of air at the ends of walls, and what diffracts as a whole.

use std::f64::consts::TAU;

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{posts::PlanPost, strips::PlanStrip};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, Post, Strip, Wedge},
    geometry::{Arrangement, DVec2},
    model::{Diffractor, Edge, paths::tolerance::TIE_M},
};

/// Rays along a wall's face belong to the wall's near end, radians.
const GRAZING_RAD: f64 = 1e-9;

/// Between edges a ray counts as along a wall's face to within this, radians: their points may have
/// been moved a little off the wall's line to where walls meet.
pub(crate) const ALONG_RAD: f64 = 1e-6;

/// The edges of a scene, by point of its arrangement.
#[derive(Debug, Default)]
pub(crate) struct Corners {
    points: Vec<Option<Corner>>,
    /// The most of [`Corner::lead_m`], metres.
    pub(crate) most_lead_m: f64,
}

/// A point where at least one wall ends and at which sound is diffracted.
#[derive(Debug)]
pub(crate) struct Corner {
    point: DVec2,
    diffractor: Diffractor,
    /// Counter-clockwise around the point.
    sectors: SmallVec<[Sector; 2]>,
    /// What scatters as a whole and has its middle here, in place of an edge.
    whole: Option<Whole>,
}

/// What is so narrow that it scatters as a whole.
#[derive(Debug)]
enum Whole {
    Strip(Box<Strip>),
    Post(Post),
}

/// The air between two walls at a point.
#[derive(Debug, Clone, Copy)]
struct Sector {
    /// World direction of the wall it starts at, radians.
    from_rad: f64,
    /// Directions of its walls.
    faces: [DVec2; 2],
    wedge: Wedge,
    /// Whether the edge law has it send anything back.
    answers: bool,
}

/// A direction from an edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facing {
    pub(crate) sector: usize,
    /// From the sector's first wall, radians.
    pub(crate) from_rad: f64,
    pub(crate) flank: Flank,
    /// Of the wall along which it runs.
    pub(crate) face_reflectance: Option<f64>,
}

/// On which side of a direction its air lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flank {
    /// On both.
    Open,
    /// Along a wall's face, on the left.
    Left,
    /// The same, on the right.
    Right,
}

impl Corners {
    /// Sorts the walls around each point. `walls` are their ends, `gains` their reflectances.
    pub(crate) fn new(
        plan: &Arrangement,
        walls: &[(DVec2, DVec2)],
        gains: &[f64],
        law: EdgeLaw,
        strips: Vec<PlanStrip>,
        posts: Vec<PlanPost>,
    ) -> Self {
        let mut around: Vec<SmallVec<[(f64, u32); 4]>> = vec![SmallVec::new(); plan.points.len()];
        for piece in &plan.pieces {
            let [a, b] = piece.ends.map(|end| plan.points[end as usize]);
            // The wall's own direction: rounding may have bent the piece a little.
            let (from, to) = walls[piece.segment as usize];
            let along = (to - from) * (b - a).dot(to - from).signum();
            around[piece.ends[0] as usize].push((along.to_angle(), piece.segment));
            around[piece.ends[1] as usize].push(((-along).to_angle(), piece.segment));
        }
        let corner = |(index, mut faces): (u32, SmallVec<[(f64, u32); 4]>)| {
            faces.sort_by(|a, b| a.0.total_cmp(&b.0));
            let point = plan.points[index as usize];
            let ending = faces.iter().filter_map(|&(_, wall)| end_at(plan, wall, index)).min();
            // Where walls cross none of them ends.
            let crossing = || faces.iter().map(|&(_, wall)| nearer_end(walls, wall, point)).min();
            let edge = ending.or_else(crossing)?;
            let sectors = sectors(&faces, gains, law);
            let answers = sectors.iter().any(|sector| sector.answers);
            answers.then_some(Corner {
                point,
                diffractor: Diffractor::Upright(edge),
                sectors,
                whole: None,
            })
        };
        let mut points: Vec<_> = (0..).zip(around).map(corner).collect();
        for strip in strips {
            let at = strip.point as usize;
            points[at] = Some(Corner::of_strip(plan.points[at], strip));
        }
        let leads_m = posts.iter().map(|post| 2.0 * post.post.radius_m());
        let most_lead_m = leads_m.fold(0.0, f64::max);
        for post in posts {
            let at = post.point as usize;
            points[at] = Some(Corner::of_post(plan.points[at], post));
        }
        Self { points, most_lead_m }
    }

    /// Whether sound that comes to a point along `run` finds an edge there.
    pub(crate) fn answers(&self, point: u32, run: DVec2) -> bool {
        let corner = self.points.get(point as usize).and_then(Option::as_ref);
        corner.is_some_and(|corner| corner.sectors.iter().any(|sector| sector.sees(-run)))
    }

    /// What diffracts at a point.
    pub(crate) fn diffractor(&self, point: u32) -> Option<Diffractor> {
        Some(self.points.get(point as usize)?.as_ref()?.diffractor)
    }

    /// The edge at a point, if there is one.
    pub(crate) fn corner(&self, point: u32) -> Option<&Corner> {
        self.points.get(point as usize)?.as_ref()
    }

    /// Its position, metres.
    pub(crate) fn position(&self, point: u32) -> Option<DVec2> {
        Some(self.points.get(point as usize)?.as_ref()?.point)
    }
}

impl Sector {
    /// Whether it sends sound back that comes from a direction. By signs of cross products and without
    /// an arc tangent, because every beam that passes a room's corner asks.
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
    /// The sector in whose air a direction from the edge lies, and how far from its first wall, radians;
    /// `None` along a wall and in a sector that answers nothing.
    pub(crate) fn sector(&self, direction: DVec2) -> Option<(usize, f64)> {
        let direction_rad = direction.to_angle();
        let last = self.sectors.len() - 1;
        let sector = self.sectors.iter().rposition(|s| s.from_rad <= direction_rad).unwrap_or(last);
        let from_rad = (direction_rad - self.sectors[sector].from_rad).rem_euclid(TAU);
        let opening_rad = self.sectors[sector].wedge.opening_rad;
        let in_air =
            self.is_round() || from_rad > GRAZING_RAD && from_rad < opening_rad - GRAZING_RAD;
        (in_air && self.sectors[sector].answers).then_some((sector, from_rad))
    }

    /// A strip's middle: air all around it.
    fn of_strip(point: DVec2, PlanStrip { wall, along, strip, .. }: PlanStrip) -> Self {
        let diffractor = Diffractor::Upright(Edge { wall, at_b: false });
        Self::of_whole(point, along.normalize(), diffractor, Whole::Strip(Box::new(strip)))
    }

    fn of_post(point: DVec2, PlanPost { cylinder, post, .. }: PlanPost) -> Self {
        Self::of_whole(point, DVec2::X, Diffractor::Post { cylinder }, Whole::Post(post))
    }

    fn of_whole(point: DVec2, along: DVec2, diffractor: Diffractor, whole: Whole) -> Self {
        let sector = Sector {
            from_rad: along.to_angle(),
            faces: [along; 2],
            wedge: Wedge { opening_rad: TAU, reflectance: [1.0; 2] },
            answers: true,
        };
        let sectors = SmallVec::from_buf_and_len([sector; 2], 1);
        Self { point, diffractor, sectors, whole: Some(whole) }
    }

    /// Whether something scatters as a whole and no edge does.
    pub(crate) fn is_whole(&self) -> bool {
        self.whole.is_some()
    }

    /// Whether no direction from it runs along a wall.
    fn is_round(&self) -> bool {
        matches!(self.whole, Some(Whole::Post(_)))
    }

    /// Field of what is here relative to that of a head-on rigid wall: see [`EdgeLaw::echo`].
    pub(crate) fn echo(&self, law: EdgeLaw, sector: usize, aspect: &Aspect, k: f64) -> Complex64 {
        match &self.whole {
            Some(Whole::Strip(strip)) => strip.echo(aspect),
            Some(Whole::Post(post)) => post.echo(aspect),
            None => law.echo(&self.sectors[sector].wedge, aspect, k),
        }
    }

    /// By how much a pulse comes earlier than by the point here, metres.
    pub(crate) fn lead_m(&self, aspect: &Aspect) -> f64 {
        match &self.whole {
            Some(Whole::Post(post)) => post.lead_m(aspect),
            Some(Whole::Strip(_)) | None => 0.0,
        }
    }

    /// An upper bound of its magnitude.
    pub(crate) fn bound(&self, law: EdgeLaw, sector: usize, aspect: &Aspect, k: f64) -> f64 {
        match &self.whole {
            Some(Whole::Strip(strip)) => strip.echo(aspect).norm(),
            Some(Whole::Post(post)) => post.bound(aspect.distance_m),
            None => law.bound(&self.sectors[sector].wedge, aspect, k),
        }
    }

    pub(crate) fn wedge(&self, sector: usize) -> &Wedge {
        &self.sectors[sector].wedge
    }

    /// The sectors that a direction from the edge leads to: into one sector, or along a wall into those on both
    /// sides of it.
    pub(crate) fn facings(&self, direction: DVec2) -> SmallVec<[Facing; 2]> {
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
            if self.is_round() {
                found.push(at(from_rad, Flank::Open, None));
                return found;
            }
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
}

/// The end of a wall that is at a point of the plan.
fn end_at(plan: &Arrangement, wall: u32, point: u32) -> Option<Edge> {
    let [a, b] = plan.ends[wall as usize];
    (a == point || b == point).then_some(Edge { wall, at_b: a != point })
}

/// The end by which an edge within a wall is called.
fn nearer_end(walls: &[(DVec2, DVec2)], wall: u32, point: DVec2) -> Edge {
    let (a, b) = walls[wall as usize];
    Edge { wall, at_b: b.distance_squared(point) < a.distance_squared(point) }
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
