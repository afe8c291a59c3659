//! An arc of one scan, and what it says by itself.

use sonard_model::geometry::{DVec2, wrap_pi};

use super::{
    Extents, Reason, Region, Settings, Side, Sweep, UniformSum,
    belief::{ExtentLikelihood, mean_density},
};

/// An arc within this of the least range may be the rest of one of which the receiver, still shut,
/// missed the loud part: a faint echo is read by as much too far, metres.
const LATE_M: f64 = 0.05;

/// Planes farther from an arc's direction than this do not cross it, degrees.
const CROSSING_DEG: f64 = 85.0;

/// A covered arc narrower than this may be anything, degrees.
const LEAST_WALL_DEG: f64 = 8.0;

/// An arc must be this far behind a plane to be hidden by it, metres.
const BEHIND_M: f64 = 0.05;

/// An arc of one scan.
#[derive(Debug, Clone)]
pub(super) struct Arc {
    /// Which scan.
    pub(super) scan: usize,
    /// Where it was seen from, world, metres.
    pub(super) from: DVec2,
    /// Heading there, degrees.
    pub(super) heading_deg: f64,
    pub(super) region: Region,
    /// World direction of its middle, radians.
    pub(super) bearing_rad: f64,
    /// Standard deviation of each border, degrees.
    pub(super) border_sigma_deg: f64,
    /// What its extent says.
    pub(super) extent_likelihood: ExtentLikelihood,
    /// So near the end of the blanking that it may be the rest of an arc that began within it.
    is_rest: bool,
}

impl Arc {
    pub(super) fn new(
        scan: usize,
        sweep: &Sweep,
        region: Region,
        extents: &Extents,
        settings: &Settings,
    ) -> Self {
        let noise = settings.noise;
        let border = extents.border_sigma_deg(region.extent_deg(), noise.amplitude);
        let border_sigma_deg = border.hypot(noise.azimuth_deg);
        let extent_likelihood = region.range_m.map_or(ExtentLikelihood::NONE, |range_m| {
            let error = UniformSum::of_extent(region.gaps_deg, border_sigma_deg);
            let (seen_deg, least) = (region.extent_deg(), extents.least_heard(range_m));
            let [edge_least, plane_least] = [least / extents.edge_level(range_m, 1.0), least];
            let plane_corner = mean_density(
                &error,
                seen_deg,
                settings.reflectance_range,
                plane_least,
                |strength| extents.plane_corner_deg(range_m, strength),
            );
            let edge =
                mean_density(&error, seen_deg, settings.sigma_e_range, edge_least, |strength| {
                    extents.edge_deg(range_m, strength)
                });
            ExtentLikelihood::new(plane_corner, edge, extents.plane_corner_deg(range_m, 1.0))
        });
        let is_rest = region.range_m.is_some_and(|m| m < extents.min_range_m + LATE_M);
        Self {
            scan,
            from: sweep.pose.position(),
            heading_deg: sweep.pose.heading_deg,
            bearing_rad: sweep.pose.direction_rad(region.bearing_deg()),
            region,
            border_sigma_deg,
            extent_likelihood,
            is_rest,
        }
    }

    /// The middle of the arc, world, metres.
    pub(super) fn point(&self) -> Option<DVec2> {
        let range_m = self.region.range_m?;
        Some(self.from + range_m * DVec2::from_angle(self.bearing_rad))
    }

    /// Whether its extent is rather an edge's than a plane's or corner's (18).
    pub(super) fn is_edge(&self) -> bool {
        self.extent_likelihood.edge > self.extent_likelihood.plane_corner
    }

    /// How many nearer arcs of its scan would hide it if they were of walls that go on so far: one
    /// whose plane crosses its direction nearer counts once, and twice if it lies in that direction
    /// itself. Edges hide nothing; of an arc that something covers only as much as is seen counts.
    pub(super) fn hidden_by(&self, arcs: &[Self], min_range_m: f64) -> usize {
        let Some(range_m) = self.region.range_m else { return 0 };
        let hides = |other: &&Self| {
            let is_wall = if other.region.is_whole() {
                !other.is_edge()
            } else {
                other.region.extent_deg() >= LEAST_WALL_DEG
            };
            other.scan == self.scan && other.region.beams != self.region.beams && is_wall
        };
        arcs.iter()
            .filter(hides)
            .map(|other| {
                let off_deg = wrap_pi(other.bearing_rad - self.bearing_rad).to_degrees().abs();
                let other_m = other.region.range_m.unwrap_or(min_range_m);
                let crosses = off_deg < CROSSING_DEG
                    && other_m / off_deg.to_radians().cos() < range_m - BEHIND_M;
                let ahead = off_deg < other.region.extent_deg() / 2.0;
                usize::from(crosses) * (1 + usize::from(ahead))
            })
            .sum()
    }

    /// Why the arc by itself can't be told, if so.
    pub(super) fn fault(&self) -> Option<Reason> {
        let sides = self.region.sides;
        if self.region.range_m.is_none() || self.is_rest {
            Some(Reason::MinRange)
        } else if sides.contains(&Side::Covered) {
            Some(Reason::Interference)
        } else if sides.contains(&Side::Cut) {
            Some(Reason::CutOff)
        } else {
            None
        }
    }
}
