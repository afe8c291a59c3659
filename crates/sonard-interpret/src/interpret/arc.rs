//! Arcs of one scan, and their classification from that scan alone.

use sonard_model::geometry::{DVec2, wrap_pi};

use super::{
    Extents, InterpretSettings, Reason, Region, RegionBorder, Sweep, UniformSum,
    posterior::{ExtentLikelihood, mean_density},
};

/// Arcs within this distance of the minimum range may be the remainder of an arc whose loud part
/// fell into the blanking interval: a faint echo is ranged too long by as much, metres.
const LATE_M: f64 = 0.05;

/// Planes farther than this from the direction of an arc do not cross it, degrees.
const CROSSING_DEG: f64 = 85.0;

/// Covered arcs narrower than this are not taken for walls, degrees.
const MIN_WALL_DEG: f64 = 8.0;

/// Minimum distance behind a plane at which an arc counts as hidden, metres.
const BEHIND_M: f64 = 0.05;

/// Arc of one scan, with its geometry and likelihoods.
#[derive(Debug, Clone)]
pub(super) struct Arc {
    /// Index of the scan.
    pub(super) scan: usize,
    /// World position of the ranger, metres.
    pub(super) from: DVec2,
    /// Heading of the robot, degrees.
    pub(super) heading_deg: f64,
    pub(super) region: Region,
    /// World direction of the middle of the arc, radians.
    pub(super) bearing_rad: f64,
    /// Standard deviation of each border, degrees.
    pub(super) border_sigma_deg: f64,
    /// Likelihoods of the extent by class.
    pub(super) extent_likelihood: ExtentLikelihood,
    /// Close to the end of blanking: possibly the remainder of an arc that began within it.
    is_remainder: bool,
}

impl Arc {
    pub(super) fn new(
        scan: usize,
        sweep: &Sweep,
        region: Region,
        extents: &Extents,
        settings: &InterpretSettings,
    ) -> Self {
        let noise = settings.noise;
        let border = extents.border_sigma_deg(region.extent_deg(), noise.amplitude);
        let border_sigma_deg = border.hypot(noise.azimuth_deg);
        let extent_likelihood = region.range_m.map_or(ExtentLikelihood::NONE, |range_m| {
            let error = UniformSum::for_extent(region.gaps_deg, border_sigma_deg);
            let (seen_deg, min_level) = (region.extent_deg(), extents.min_detected(range_m));
            let [min_edge, min_plane] = [min_level / extents.edge_level(range_m, 1.0), min_level];
            let plane_corner =
                mean_density(&error, seen_deg, settings.reflectance_range, min_plane, |strength| {
                    extents.plane_corner_deg(range_m, strength)
                });
            let edge =
                mean_density(&error, seen_deg, settings.sigma_e_range, min_edge, |strength| {
                    extents.edge_deg(range_m, strength)
                });
            let plane_deg = extents.plane_corner_deg(range_m, 1.0);
            ExtentLikelihood::new(plane_corner, edge, plane_deg).with_repeat(
                seen_deg,
                plane_deg,
                range_m,
                extents.min_range_m,
            )
        });
        let is_remainder = region.range_m.is_some_and(|m| m < extents.min_range_m + LATE_M);
        Self {
            scan,
            from: sweep.pose.position(),
            heading_deg: sweep.pose.heading_deg,
            bearing_rad: sweep.pose.direction_rad(region.bearing_deg()),
            region,
            border_sigma_deg,
            extent_likelihood,
            is_remainder,
        }
    }

    /// World position of the middle of the arc, metres.
    pub(super) fn point(&self) -> Option<DVec2> {
        let range_m = self.region.range_m?;
        Some(self.from + range_m * DVec2::from_angle(self.bearing_rad))
    }

    /// Returns `true` if the extent fits an edge better than a plane or corner (18).
    pub(super) fn is_edge(&self) -> bool {
        self.extent_likelihood.edge > self.extent_likelihood.plane_corner
    }

    /// Number of nearer arcs of the scan that would hide this one if they were extended walls. An
    /// arc whose plane crosses this direction at a shorter range counts once, and twice if it lies
    /// in that direction itself. Edges hide nothing; a partly covered arc counts by its visible
    /// part, and a possible repeat as the wall that it repeats.
    pub(super) fn hidden_by(&self, arcs: &[Self], min_range_m: f64) -> usize {
        let Some(range_m) = self.region.range_m else { return 0 };
        let hides = |other: &&Self| {
            let is_wall = if other.region.is_whole() {
                !other.is_edge() || other.may_be_repeat()
            } else {
                other.region.extent_deg() >= MIN_WALL_DEG
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

    /// Returns `true` if the arc may be the repeat of a wall within the blanking interval.
    pub(super) const fn may_be_repeat(&self) -> bool {
        self.extent_likelihood.may_be_repeat()
    }

    /// Reason why the arc can't be classified by itself, if any.
    pub(super) fn fault(&self) -> Option<Reason> {
        let sides = self.region.sides;
        if self.region.range_m.is_none() || self.is_remainder {
            Some(Reason::MinRange)
        } else if sides.contains(&RegionBorder::Covered) {
            Some(Reason::Interference)
        } else if sides.contains(&RegionBorder::Cut) {
            Some(Reason::CutOff)
        } else {
            None
        }
    }
}
