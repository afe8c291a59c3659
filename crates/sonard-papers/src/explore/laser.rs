//! A laser range finder with a narrow field of view.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use sonard_interpret::interpret::lines::{LaserReturn, LaserScan};
use sonard_model::{
    geometry::{DVec2, Pose},
    model::raycast::Reflectors,
};

/// A laser like the paper's BIRIS: a triangulating one, so that the error of its ranges grows with
/// their square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laser {
    /// Field of view, degrees.
    pub field_deg: f64,
    /// Readings across it.
    pub points: u32,
    /// Share of the field without the artifacts that the paper saw at its sides.
    pub usable: f64,
    /// Standard deviation of a range of one metre, metres.
    pub sigma_at_1_m: f64,
    /// Nothing is seen beyond this, metres.
    pub max_range_m: f64,
}

impl Default for Laser {
    /// 25 degrees, 512 points, useful to 3 to 4 m and accurate at 1.5 m as the paper says. It has no
    /// figure for the noise: 1.5 mm at one metre (so 3.4 mm at 1.5 m and 24 mm at 4 m) is ours, and
    /// so is the twelfth of the field that is lost.
    fn default() -> Self {
        Self {
            field_deg: 25.0,
            points: 512,
            usable: 11.0 / 12.0,
            sigma_at_1_m: 1.5e-3,
            max_range_m: 4.0,
        }
    }
}

impl Laser {
    /// How many shots a full turn takes.
    #[must_use]
    pub fn shots_per_turn(&self) -> u32 {
        (360.0 / (self.field_deg * self.usable)).ceil() as u32
    }

    /// A shot from a pose along its heading.
    pub(super) fn shoot(&self, room: &Reflectors, pose: Pose, rng: &mut impl Rng) -> LaserScan {
        let half_deg = self.field_deg * self.usable / 2.0;
        let count = (f64::from(self.points) * self.usable).max(2.0) as u32;
        let azimuth_deg =
            |point: u32| half_deg * (2.0 * f64::from(point) / f64::from(count - 1) - 1.0);
        let mut reading = |azimuth_deg: f64| {
            let ray = DVec2::from_angle(pose.direction_rad(azimuth_deg));
            let unit: f64 = StandardNormal.sample(rng);
            let hit = room.nearest(pose.position(), ray, None);
            let range_m = hit.map(|hit| hit.distance_m).filter(|m| *m <= self.max_range_m);
            let noisy = range_m.map(|m| (m + unit * self.sigma_at_1_m * m * m).max(1e-3));
            LaserReturn { azimuth_deg, range_m: noisy }
        };
        let returns = (0..count).map(|point| reading(azimuth_deg(point))).collect();
        LaserScan { pose, returns }
    }
}

/// Shots of one place side by side as one scan: where two overlap, the later one counts. Each is
/// given with the direction it looked into, degrees from the heading, in rising order.
pub(super) fn side_by_side(pose: Pose, shots: &[(f64, LaserScan)]) -> LaserScan {
    let mut returns: Vec<LaserReturn> = Vec::new();
    for (direction_deg, shot) in shots {
        let moved = shot
            .returns
            .iter()
            .map(|one| LaserReturn { azimuth_deg: one.azimuth_deg + direction_deg, ..*one });
        let from_deg = moved.clone().next().map_or(f64::MAX, |one| one.azimuth_deg);
        returns.retain(|one| one.azimuth_deg < from_deg);
        returns.extend(moved);
    }
    // The last shot of a full turn may reach into the first.
    let start_deg = returns.first().map_or(0.0, |one| one.azimuth_deg);
    returns.retain(|one| one.azimuth_deg < start_deg + 360.0);
    LaserScan { pose, returns }
}
