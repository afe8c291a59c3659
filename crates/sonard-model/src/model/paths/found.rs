//! The echo paths that were found between a transmitter and a receiver, and what is told of each.

use super::{
    diffraction::single, echo::Echo, pattern::TwoWayBound, prepare::Paths, traced::Traced,
};
use crate::{
    acoustics::{Image, Incidence, Incident},
    geometry::{DVec2, wrap_pi},
    model::{Arrival, TooCostly, engine::mirrored},
    reading::PathKind,
};

/// Echo paths, shortest first, with what their interactions are told from.
pub(super) struct Found {
    /// What they were searched in, up to the length in its settings.
    pub(super) paths: Paths,
    pub(super) traced: Traced,
    pub(super) echoes: Vec<Echo>,
}

impl Found {
    /// Searches between transmitter and receiver; with `bound`, for echoes by cylinders only that can be heard.
    pub(super) fn between(
        paths: Paths,
        [transmitter, receiver]: [DVec2; 2],
        bound: Option<&TwoWayBound>,
    ) -> Result<Self, TooCostly> {
        let (traced, echoes) = paths.trace(transmitter, receiver, bound)?;
        Ok(Self { paths, traced, echoes })
    }

    /// The full account of an echo that arrives with an amplitude.
    pub(super) fn arrival(&self, echo: &Echo, amplitude: f64) -> Arrival {
        let path = self.paths.path(&self.traced, echo);
        Arrival {
            length_m: path.length_m,
            amplitude,
            path_amplitude: path.amplitude,
            phase_rad: path.phase_rad,
            departure_rad: path.departure_rad,
            arrival_rad: path.arrival_rad,
            path: path.path,
        }
    }

    /// The incidence of an echo, for a transmitter and a receiver that point in world directions, radians.
    pub(super) fn incident(&self, echo: &Echo, axes_rad: [f64; 2]) -> Incident {
        let (paths, traced) = (&self.paths, &self.traced);
        let image = match echo.via.kind() {
            PathKind::Specular => mirrored(paths.mirrors_met(traced, echo)),
            PathKind::Diffracted => {
                let view = single::view(&paths.plan, &traced.out, traced.back(), echo);
                view.map_or(Image::Lost, Image::Bent)
            }
            PathKind::Scattered => Image::Lost,
        };
        let [leaving_rad, arriving_rad] = [
            wrap_pi(echo.departure.to_angle() - axes_rad[0]),
            wrap_pi(echo.arrival.to_angle() - axes_rad[1]),
        ];
        let length_m = echo.length_m;
        Incident {
            strength: echo.amplitude,
            incidence: Incidence { leaving_rad, arriving_rad, length_m, image },
        }
    }
}
