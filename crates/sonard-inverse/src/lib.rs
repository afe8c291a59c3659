//! From readings back to the world: what a sensor, the air, a scene and a pose must be for the model to explain
//! what was measured.
//!
//! [`fit`] improves the [`Parameter`]s of a [`World`] until the readings of some [`Sweep`]s are as likely as they
//! can be, and says how sure that is. [`locate`] finds with an [`Atlas`] where a sweep was taken without any guess,
//! and a [`Course`] follows a robot from sweep to sweep.
//!
//! A reading is taken for what a receiver says whose threshold differs a little from firing to firing: from the
//! lowest to the highest it would have reported one arrival after the other and in the end nothing
//! (`candidates`). So an echo may be of any arrival near the threshold, a silence says that none was strong
//! enough, and where arcs begin and end counts as much as their ranges (`likelihood`).

mod atlas;
mod candidates;
mod course;
mod doubt;
mod fit;
mod groups;
mod hypothesis;
mod judged;
mod likelihood;
mod linear;
mod locate;
mod motion;
mod parameter;
mod rates;
mod sweep;
#[cfg(test)]
mod tests;
mod told;
mod walls;
mod watch;
mod world;

pub use atlas::{Atlas, AtlasError};
pub use course::{Course, Odometry};
pub use doubt::{Doubt, doubts};
pub use fit::{
    Estimate, Fit, FitError, Fitted, Found, Prior, bound, fit, fit_from, fit_thoroughly,
    fit_watched,
};
pub use groups::{Group, GroupError, name, priors};
pub use hypothesis::{Hypotheses, LogLikelihood};
pub use likelihood::ErrorModel;
pub use locate::{Mode, locate, locate_watched};
pub use motion::{Motion, length_rate};
pub use parameter::Parameter;
pub use sweep::{Beam, Heard, Sweep, SweepError};
pub use told::Told;
pub use watch::{Progress, Unwatched, Watch};
pub use world::{World, WorldError};
