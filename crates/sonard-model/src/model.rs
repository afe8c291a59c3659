//! The model: what a ranger at some place reads in some direction.
//!
//! An [`Engine`] finds the echoes that reach the transducer's face; the receiver decides which
//! of them is detected. [`Simulator`] joins the two.

mod array;
mod batch;
mod cone;
mod fan;
mod names;
mod path;
pub mod paths;
mod place;
pub mod raycast;
mod simulator;
mod station;
#[cfg(test)]
mod tests;

pub use array::{ArrayModel, ArrayStand};
pub use cone::Cone;
pub use fan::{Fan, FanSettings};
pub use names::FACE_NAME;
pub use path::{Bend, Edge, Interaction, Mechanism, Path, Reflector};
pub use simulator::{EngineKind, ModelError, Options, Simulator};
pub use station::Station;

pub use crate::acoustics::EdgeLawKind;

use smallvec::SmallVec;

use crate::{
    acoustics::{Image, Incidence, Incident, Sound},
    geometry::{DVec2, wrap_pi},
    reading::{PathKind, PingStatus},
};

/// An echo at the transducer's face.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// Length of the path there and back, metres.
    pub length_m: f64,
    /// Strength after gain compensation and the beam pattern on both ways; a head-on, perfectly
    /// reflecting wall without absorption gives 1.
    pub amplitude: f64,
    /// The same before the beam pattern.
    pub path_amplitude: f64,
    /// Phase of the carrier beside that of the way, for `exp(+i omega t)`, radians: what an edge
    /// adds. Mirror reflections add none.
    pub phase_rad: f64,
    /// World direction in which the sound leaves, radians counter-clockwise from +x.
    pub departure_rad: f64,
    /// World direction from the ranger towards where the sound comes from, radians.
    pub arrival_rad: f64,
    /// What it met on its way, and where.
    pub path: Path,
}

/// Finds echo paths in a scene.
pub trait Engine: Send + Sync {
    /// Prepares for firing from `position` (world, metres).
    fn survey<'a>(&'a self, position: DVec2) -> Box<dyn Survey + 'a>;

    /// The same for a transmitter and a receiver apart; engines that know one place only take
    /// the middle.
    fn survey_pair<'a>(&'a self, transmitter: DVec2, receiver: DVec2) -> Box<dyn Survey + 'a> {
        self.survey(0.5 * (transmitter + receiver))
    }

    /// The same of paths up to a length there and back alone, in metres, between transmitter and
    /// receiver; `None` from engines that would gain nothing by it.
    fn survey_within<'a>(
        &'a self,
        _places: [DVec2; 2],
        _max_path_m: f64,
    ) -> Option<Box<dyn Survey + 'a>> {
        None
    }
}

/// The echoes of one place.
///
/// The paths depend on the place only, so one survey serves all directions.
pub trait Survey: Send + Sync {
    /// Replaces `sounds` with what a firing in world direction `direction_rad` brings back,
    /// shortest path first, weighted with the beam pattern; also sounds too weak to be detected,
    /// as far as the engine knows them.
    fn listen(&self, direction_rad: f64, sounds: &mut Vec<Sound>);

    /// The full account of a sound that [`listen`](Self::listen) gave for the same direction.
    fn arrival(&self, direction_rad: f64, sound: &Sound) -> Arrival;

    /// How a sound that [`listen`](Self::listen) gave for the same direction meets the face: what the
    /// full response of the face asks of each sound of a firing.
    fn incident(&self, direction_rad: f64, sound: &Sound) -> Incident {
        let arrival = self.arrival(direction_rad, sound);
        let image = match arrival.path.kind() {
            PathKind::Specular => mirrored(arrival.path.interactions.len()),
            PathKind::Diffracted | PathKind::Scattered => Image::Lost,
        };
        let off_rad = |end_rad: f64| wrap_pi(end_rad - direction_rad);
        Incident {
            strength: arrival.path_amplitude,
            incidence: Incidence {
                leaving_rad: off_rad(arrival.departure_rad),
                arriving_rad: off_rad(arrival.arrival_rad),
                length_m: arrival.length_m,
                image,
            },
        }
    }

    /// Every arrival of a firing, shortest path first.
    fn arrivals(&self, direction_rad: f64) -> Vec<Arrival> {
        let mut sounds = Vec::new();
        self.listen(direction_rad, &mut sounds);
        sounds.iter().map(|sound| self.arrival(direction_rad, sound)).collect()
    }
}

/// How the face looks over a number of mirrors.
const fn mirrored(count: usize) -> Image {
    if count.is_multiple_of(2) { Image::Upright } else { Image::Swapped }
}

/// What the model says a firing gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// `Echo`, `NoEcho` or `MinRange`.
    pub status: PingStatus,
    /// Range of the moment at which ECHO rose (for `MinRange`, of the end of blanking), metres. For a
    /// strong echo that is half its path; see [`Receiver`](crate::acoustics::Receiver) for what a
    /// weak one adds.
    pub range_m: Option<f64>,
    /// The echo that raised ECHO; for `NoEcho` the candidate that came closest, if there was any.
    pub arrival: Option<Arrival>,
    /// The most that the envelope reached with that echo, all sounds together.
    pub amplitude: Option<f64>,
    /// The same above the threshold in force, decibels; negative for `NoEcho`: what it lacked.
    pub margin_db: Option<f64>,
    /// Times after firing at which the module raises ECHO, microseconds: the first, or up to eight
    /// where the receiver was made ready again.
    pub echoes_us: SmallVec<[f64; 8]>,
}
