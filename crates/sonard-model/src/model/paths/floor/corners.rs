//! Upright edges by point of the floor plan: the wedges of air at the ends of walls, and objects
//! that diffract as a whole.

use std::f64::consts::TAU;

use num_complex::Complex64;
use smallvec::SmallVec;

use super::{posts::PlanPost, strips::PlanStrip};
use crate::{
    acoustics::edge::{Aspect, EdgeLaw, LitImages, Post, Strip, Wedge},
    geometry::{Arrangement, DVec2},
    model::{Diffractor, Edge, paths::tolerance::TIE_M},
};

/// Rays along a wall's face belong to the wall's near end, radians.
const GRAZING_RAD: f64 = 1e-9;

/// Tolerance within which a ray between edges counts as along a wall's face, radians: the edges'
/// points may have been moved slightly off the wall's line to where walls meet.
pub(crate) const ALONG_RAD: f64 = 1e-6;

/// Edges of a scene, by point of its arrangement.
#[derive(Debug, Default)]
pub(crate) struct Corners {
    points: Vec<Option<PlanCorner>>,
    /// Maximum of [`PlanCorner::lead_m`], metres.
    pub(crate) max_lead_m: f64,
}

/// A point where at least one wall ends and at which sound is diffracted.
#[derive(Debug)]
pub(crate) struct PlanCorner {
    point: DVec2,
    diffractor: Diffractor,
    /// Sectors counter-clockwise around the point.
    sectors: SmallVec<[AirSector; 2]>,
    /// Object with its middle here that scatters as a whole, instead of an edge.
    whole: Option<WholeScatterer>,
}

/// An object so narrow that it scatters as a whole.
#[derive(Debug)]
enum WholeScatterer {
    Strip(Box<Strip>),
    Post(Post),
}

/// Air between two walls at a point.
#[derive(Debug, Clone, Copy)]
struct AirSector {
    /// World direction of the wall at which the sector starts, radians.
    from_rad: f64,
    /// Directions of the walls.
    faces: [DVec2; 2],
    wedge: Wedge,
    /// `true` if the edge law diffracts anything back from this sector.
    diffracts: bool,
}

/// A direction from an edge.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facing {
    pub(crate) sector: usize,
    /// Angle from the sector's first wall, radians.
    pub(crate) from_rad: f64,
    pub(crate) flank: Flank,
    /// Reflectance of the wall along which the direction runs.
    pub(crate) face_reflectance: Option<f64>,
}

/// Position of the air relative to a direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flank {
    /// Air on both sides.
    Open,
    /// Along a wall's face, with the air on the left.
    Left,
    /// Along a wall's face, with the air on the right.
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
            // The wall's own direction: rounding may have bent the piece slightly.
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
            let diffracts = sectors.iter().any(|sector| sector.diffracts);
            diffracts.then_some(PlanCorner {
                point,
                diffractor: Diffractor::Upright(edge),
                sectors,
                whole: None,
            })
        };
        let mut points: Vec<_> = (0..).zip(around).map(corner).collect();
        for strip in strips {
            let at = strip.point as usize;
            points[at] = Some(PlanCorner::of_strip(plan.points[at], strip));
        }
        let leads_m = posts.iter().map(|post| 2.0 * post.post.radius_m());
        let max_lead_m = leads_m.fold(0.0, f64::max);
        for post in posts {
            let at = post.point as usize;
            points[at] = Some(PlanCorner::of_post(plan.points[at], post));
        }
        Self { points, max_lead_m }
    }

    /// Returns `true` if sound that reaches a point along `run` is diffracted back.
    pub(crate) fn diffracts(&self, point: u32, run: DVec2) -> bool {
        let corner = self.points.get(point as usize).and_then(Option::as_ref);
        corner.is_some_and(|corner| corner.sectors.iter().any(|sector| sector.sees(-run)))
    }

    /// Diffractor at a point, if there is one.
    pub(crate) fn diffractor(&self, point: u32) -> Option<Diffractor> {
        Some(self.points.get(point as usize)?.as_ref()?.diffractor)
    }

    /// Edge at a point, if there is one.
    pub(crate) fn corner(&self, point: u32) -> Option<&PlanCorner> {
        self.points.get(point as usize)?.as_ref()
    }

    /// Position of the edge at a point, metres.
    pub(crate) fn position(&self, point: u32) -> Option<DVec2> {
        Some(self.points.get(point as usize)?.as_ref()?.point)
    }
}

impl AirSector {
    /// Returns `true` if the sector diffracts sound from a direction back. Uses signs of cross
    /// products and no arc tangent, because every beam past a room's corner calls this.
    fn sees(&self, from: DVec2) -> bool {
        let [first, second] = self.faces;
        // Directions along a wall count as inside.
        let from_first = first.perp_dot(from) >= -TIE_M;
        let from_second = from.perp_dot(second) >= -TIE_M;
        // In more than half a turn, one wall's side is enough.
        let is_in = if self.wedge.is_convex() {
            from_first || from_second
        } else {
            from_first && from_second
        };
        self.diffracts && is_in
    }
}

impl PlanCorner {
    /// Sector of air that contains a direction from the edge, and the angle from its first wall,
    /// radians. `None` along a wall and in a sector that diffracts nothing back.
    pub(crate) fn sector(&self, direction: DVec2) -> Option<(usize, f64)> {
        let direction_rad = direction.to_angle();
        let last = self.sectors.len() - 1;
        let sector = self.sectors.iter().rposition(|s| s.from_rad <= direction_rad).unwrap_or(last);
        let from_rad = (direction_rad - self.sectors[sector].from_rad).rem_euclid(TAU);
        let opening_rad = self.sectors[sector].wedge.opening_rad;
        let in_air =
            self.is_round() || from_rad > GRAZING_RAD && from_rad < opening_rad - GRAZING_RAD;
        (in_air && self.sectors[sector].diffracts).then_some((sector, from_rad))
    }

    /// Creates a corner at the middle of a strip, with air all around.
    fn of_strip(point: DVec2, PlanStrip { wall, along, strip, .. }: PlanStrip) -> Self {
        let diffractor = Diffractor::Upright(Edge { wall, at_b: false });
        Self::of_whole(point, along.normalize(), diffractor, WholeScatterer::Strip(Box::new(strip)))
    }

    fn of_post(point: DVec2, PlanPost { cylinder, post, .. }: PlanPost) -> Self {
        Self::of_whole(point, DVec2::X, Diffractor::Post { cylinder }, WholeScatterer::Post(post))
    }

    fn of_whole(point: DVec2, along: DVec2, diffractor: Diffractor, whole: WholeScatterer) -> Self {
        let sector = AirSector {
            from_rad: along.to_angle(),
            faces: [along; 2],
            wedge: Wedge { opening_rad: TAU, reflectance: [1.0; 2] },
            diffracts: true,
        };
        let sectors = SmallVec::from_buf_and_len([sector; 2], 1);
        Self { point, diffractor, sectors, whole: Some(whole) }
    }

    /// Returns `true` if an object scatters as a whole here, instead of an edge.
    pub(crate) fn is_whole(&self) -> bool {
        self.whole.is_some()
    }

    /// Returns `true` if no direction from the corner runs along a wall.
    fn is_round(&self) -> bool {
        matches!(self.whole, Some(WholeScatterer::Post(_)))
    }

    /// Diffracted field relative to that of a head-on rigid wall; see [`EdgeLaw::echo`].
    pub(crate) fn echo(&self, law: EdgeLaw, sector: usize, aspect: &Aspect, k: f64) -> Complex64 {
        match &self.whole {
            Some(WholeScatterer::Strip(strip)) => strip.echo(aspect),
            Some(WholeScatterer::Post(post)) => post.echo(aspect),
            None => law.echo(&self.sectors[sector].wedge, aspect, k),
        }
    }

    /// Diffracted field beside the images `lit`; see [`EdgeLaw::echo_beside`].
    pub(crate) fn echo_beside(
        &self,
        law: EdgeLaw,
        sector: usize,
        aspect: &Aspect,
        lit: LitImages,
        k: f64,
    ) -> Complex64 {
        match self.whole {
            Some(_) => self.echo(law, sector, aspect, k),
            None => law.echo_beside(&self.sectors[sector].wedge, aspect, lit, k),
        }
    }

    /// Distance by which a pulse arrives earlier than by way of the point, metres.
    pub(crate) fn lead_m(&self, aspect: &Aspect) -> f64 {
        match &self.whole {
            Some(WholeScatterer::Post(post)) => post.lead_m(aspect),
            Some(WholeScatterer::Strip(_)) | None => 0.0,
        }
    }

    /// Upper bound of the magnitude of [`Self::echo`].
    pub(crate) fn bound(&self, law: EdgeLaw, sector: usize, aspect: &Aspect, k: f64) -> f64 {
        match &self.whole {
            Some(WholeScatterer::Strip(strip)) => strip.echo(aspect).norm(),
            Some(WholeScatterer::Post(post)) => post.bound(aspect.distance_m),
            None => law.bound(&self.sectors[sector].wedge, aspect, k),
        }
    }

    pub(crate) fn wedge(&self, sector: usize) -> &Wedge {
        &self.sectors[sector].wedge
    }

    /// Sectors into which a direction from the edge leads: one sector, or along a wall those on
    /// both of its sides.
    pub(crate) fn facings(&self, direction: DVec2) -> SmallVec<[Facing; 2]> {
        let direction_rad = direction.to_angle();
        let facing = |(sector, air): (usize, &AirSector)| {
            let Wedge { opening_rad, reflectance } = air.wedge;
            // From just below 0, so that rounding does not add a whole turn.
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
        let diffracting = self.sectors.iter().enumerate().filter(|(_, sector)| sector.diffracts);
        diffracting.flat_map(facing).collect()
    }
}

/// Returns the end of a wall at a point of the floor plan.
fn end_at(plan: &Arrangement, wall: u32, point: u32) -> Option<Edge> {
    let [a, b] = plan.ends[wall as usize];
    (a == point || b == point).then_some(Edge { wall, at_b: a != point })
}

/// Returns the wall end by which an edge within a wall is named.
fn nearer_end(walls: &[(DVec2, DVec2)], wall: u32, point: DVec2) -> Edge {
    let (a, b) = walls[wall as usize];
    Edge { wall, at_b: b.distance_squared(point) < a.distance_squared(point) }
}

/// Air between each wall of a point and the next one; `faces` are sorted by direction.
fn sectors(faces: &[(f64, u32)], gains: &[f64], law: EdgeLaw) -> SmallVec<[AirSector; 2]> {
    let next = faces.iter().cycle().skip(1);
    let sector = |(&(from_rad, wall), &(to_rad, next)): (&(f64, u32), &(f64, u32))| {
        let turn = (to_rad - from_rad).rem_euclid(TAU);
        let wedge = Wedge {
            // A single wall has air all around its end.
            opening_rad: if turn == 0.0 { TAU } else { turn },
            reflectance: [gains[wall as usize], gains[next as usize]],
        };
        let faces = [from_rad, to_rad].map(DVec2::from_angle);
        AirSector { from_rad, faces, wedge, diffracts: law.diffracts(&wedge) }
    };
    faces.iter().zip(next).map(sector).collect()
}
