//! The model: what a ranger at some place reads in some direction.
//!
//! An [`Engine`] finds the echoes that reach the transducer's face; the receiver decides which
//! of them is detected. [`Simulator`] joins the two.

mod array;
mod batch;
mod cone;
mod fan;
mod names;
pub mod paths;
mod place;
pub mod raycast;
mod simulator;
mod station;
#[cfg(test)]
mod tests;
mod way;

pub use array::{ArrayModel, ArrayStand};
pub use cone::Cone;
pub use fan::{Fan, FanSettings};
pub use simulator::{EngineKind, ModelError, Options, Simulator};
pub use station::Station;

pub use crate::acoustics::EdgeLawKind;

use smallvec::SmallVec;

use crate::{
    acoustics::{Sound, edge::EdgeView},
    geometry::DVec2,
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
    /// The way it took.
    pub path: Path,
}

/// The way an echo took, by indices into the scene.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Path {
    /// How the sound got back.
    pub kind: PathKind,
    /// Reflectors met, in order.
    pub walls: SmallVec<[Reflector; 4]>,
    /// The edges it bent at, in order.
    pub bends: SmallVec<[Bend; 2]>,
}

/// A reflector of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Reflector {
    /// `scene.walls[i]`.
    Wall(u32),
    /// `scene.cylinders[i]`.
    Cylinder(u32),
    /// The transducer's own face.
    Face,
    /// The floor of a scene with heights.
    Floor,
    /// Its ceiling.
    Ceiling,
}

/// An edge of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Bend {
    /// An upright one: where walls end or meet.
    Upright(Edge),
    /// A level one of a wall that ends below the ceiling or above the floor.
    Level {
        /// Index into `scene.walls`.
        wall: u32,
        /// Whether it is the wall's upper one (else the lower).
        is_upper: bool,
    },
}

/// An end of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Edge {
    /// Index into `scene.walls`.
    pub wall: u32,
    /// Whether it is end `b` (else `a`).
    pub at_b: bool,
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

    /// How the edge of a sound looks from the face; `None` of others, and from engines and laws that do
    /// not say.
    fn edge(&self, _sound: &Sound) -> Option<EdgeView> {
        None
    }

    /// Every arrival of a firing, shortest path first.
    fn arrivals(&self, direction_rad: f64) -> Vec<Arrival> {
        let mut sounds = Vec::new();
        self.listen(direction_rad, &mut sounds);
        sounds.iter().map(|sound| self.arrival(direction_rad, sound)).collect()
    }
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
