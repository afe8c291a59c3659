//! A laser range finder with a narrow field of view.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use sonard_interpret::interpret::lines::{LaserReturn, LaserScan};
use sonard_model::{
    geometry::{DVec2, Pose},
    model::raycast::Reflectors,
};

/// Triangulating laser range finder like the paper's BIRIS. Its range error grows with the square
/// of the range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Laser {
    /// Field of view, degrees.
    pub field_deg: f64,
    /// Number of readings across the field.
    pub points: u32,
    /// Fraction of the field without the artifacts that the paper reports at its sides.
    pub usable: f64,
    /// Standard deviation of the range at reading metre, metres.
    pub sigma_at_1_m: f64,
    /// Maximum range of the laser, metres.
    pub max_range_m: f64,
}

impl Default for Laser {
    /// Laser of the paper: 25 degrees, 512 points, useful to 3 to 4 m and accurate at 1.5 m. The
    /// paper gives no noise; 1.5 mm at reading metre (3.4 mm at 1.5 m, 24 mm at 4 m) and the
    /// unusable twelfth of the field are assumptions.
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
    /// Number of shots for a full turn.
    #[must_use]
    pub fn shots_per_turn(&self) -> u32 {
        (360.0 / (self.field_deg * self.usable)).ceil() as u32
    }

    /// Simulates a shot from a pose along its heading.
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

/// Joins shots from reading pose into reading scan. In overlaps the later shot takes precedence.
/// Each shot has its direction, degrees from the heading, in ascending order.
pub(super) fn join_shots(pose: Pose, shots: &[(f64, LaserScan)]) -> LaserScan {
    let mut returns: Vec<LaserReturn> = Vec::new();
    for (direction_deg, shot) in shots {
        let rotated = shot.returns.iter().map(|reading| LaserReturn {
            azimuth_deg: reading.azimuth_deg + direction_deg,
            ..*reading
        });
        let from_deg = rotated.clone().next().map_or(f64::MAX, |reading| reading.azimuth_deg);
        returns.retain(|reading| reading.azimuth_deg < from_deg);
        returns.extend(rotated);
    }
    // The last shot of a full turn may overlap the first.
    let start_deg = returns.first().map_or(0.0, |reading| reading.azimuth_deg);
    returns.retain(|reading| reading.azimuth_deg < start_deg + 360.0);
    LaserScan { pose, returns }
}
