//! Naive model: the nearest hit of a few rays within an aperture.

use std::sync::Arc;

use super::{
    Arrival, Arrivals, Engine, Interaction, Mechanism, Path, TooCostly, raycast::Reflectors,
};
use crate::{
    acoustics::PulseArrival,
    geometry::{DVec2, wrap_pi},
    scene::Scene,
};

/// Angle between rays, degrees.
const SPACING_DEG: f64 = 1.0;

/// Cone model with one ray per degree within the aperture and the nearest hit of all: Arrabales'
/// simulated sonar array, and the usual model of robot simulators.
///
/// It has no mirror reflection, no beam pattern and no absorption: any hit returns an echo of
/// amplitude 1. Noise, if required, is added by the caller.
#[derive(Debug)]
pub struct Cone {
    reflectors: Reflectors,
    /// Rays, as angles from the axis, radians.
    offsets_rad: Arc<[f64]>,
}

impl Cone {
    /// Creates the model for a scene and a full aperture in degrees.
    #[must_use]
    pub fn new(scene: &Scene, aperture_deg: f64) -> Self {
        let gaps = (aperture_deg / SPACING_DEG + 1e-9).floor();
        let offsets_rad = (0..=gaps as u32)
            .map(|i| ((f64::from(i) - gaps / 2.0) * SPACING_DEG).to_radians())
            .collect();
        Self { reflectors: Reflectors::new(scene, &scene.ray_plan()), offsets_rad }
    }
}

impl Engine for Cone {
    fn arrivals_at<'a>(&'a self, position: DVec2) -> Result<Box<dyn Arrivals + 'a>, TooCostly> {
        Ok(Box::new(ConeArrivals { cone: self, position }))
    }
}

struct ConeArrivals<'a> {
    cone: &'a Cone,
    position: DVec2,
}

impl ConeArrivals<'_> {
    fn nearest(&self, direction_rad: f64) -> Option<Arrival> {
        let cast = |offset_rad: &f64| {
            let ray_rad = wrap_pi(direction_rad + offset_rad);
            let ray = DVec2::from_angle(ray_rad);
            let hit = self.cone.reflectors.nearest(self.position, ray, None)?;
            Some((hit, ray_rad))
        };
        let (hit, ray_rad) = self
            .cone
            .offsets_rad
            .iter()
            .filter_map(cast)
            .min_by(|a, b| a.0.distance_m.total_cmp(&b.0.distance_m))?;
        Some(Arrival {
            length_m: 2.0 * hit.distance_m,
            amplitude: 1.0,
            path_amplitude: 1.0,
            phase_rad: 0.0,
            departure_rad: ray_rad,
            arrival_rad: ray_rad,
            path: Path {
                interactions: [Interaction {
                    mechanism: Mechanism::Reflection(hit.reflector),
                    point: self.position + hit.distance_m * DVec2::from_angle(ray_rad),
                    z_m: None,
                }]
                .into(),
            },
        })
    }
}

impl Arrivals for ConeArrivals<'_> {
    fn collect_arrivals(&self, direction_rad: f64, arrivals: &mut Vec<PulseArrival>) {
        arrivals.clear();
        arrivals.extend(self.nearest(direction_rad).map(|arrival| PulseArrival {
            length_m: arrival.length_m,
            amplitude: arrival.amplitude,
            phase_rad: arrival.phase_rad,
            index: 0,
        }));
    }

    /// # Panics
    /// If `arrival` is not one of this direction.
    fn arrival(&self, direction_rad: f64, _sound: &PulseArrival) -> Arrival {
        self.nearest(direction_rad).expect("an arrival in this direction")
    }
}
