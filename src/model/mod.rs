//! The model: what a ranger at some place reads in some direction.
//!
//! An [`Engine`] finds the echoes that reach the transducer's face; the receiver decides which
//! of them is detected. [`Simulator`] joins the two.

mod cone;
mod fan;
pub mod paths;
mod raycast;
mod simulator;
#[cfg(test)]
mod tests;

pub use cone::Cone;
pub use fan::{Fan, FanSettings};
pub use simulator::{EdgeLawKind, EngineKind, ModelError, Options, Simulator, Station};

use smallvec::SmallVec;

use crate::{
    acoustics::Sound,
    geometry::DVec2,
    scan::{PathKind, PingStatus},
};

/// An echo at the transducer's face.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// Length of the path there and back, metres.
    pub length_m: f64,
    /// Strength after gain compensation and the beam pattern on both ways; a head-on, perfectly
    /// reflecting wall without absorption gives 1.
    pub amplitude: f64,
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
    /// The edge it bent at.
    pub edge: Option<Edge>,
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
    /// Half the detected path (for `MinRange`: the range of the end of blanking), metres.
    pub range_m: Option<f64>,
    /// The detected echo; for `NoEcho` the candidate that came closest, if there was any.
    pub arrival: Option<Arrival>,
    /// Amplitude of `arrival` above the threshold, decibels.
    pub margin_db: Option<f64>,
    /// Times after firing at which the module raises ECHO, microseconds, at most eight.
    pub echoes_us: SmallVec<[f64; 8]>,
}
