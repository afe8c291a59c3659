//! Inverse problems: estimates sensor, air, scene and pose from measured readings.
//!
//! [`fit`] maximises the likelihood of the readings of [`Sweep`]s over the [`Parameter`]s of a [`World`] and returns
//! estimates with their uncertainty. [`locate`] finds the pose of a sweep without an initial guess, with an [`Atlas`] of
//! predicted readings, and a [`Course`] tracks a robot from sweep to sweep.
//!
//! The likelihood assumes a receiver whose threshold varies a little from firing to firing: from the lowest threshold to
//! the highest it would report one arrival after the other, and finally none (`candidates`). So an echo may be any
//! arrival near the threshold, a missing echo means that none was strong enough, and the ends of arcs carry as much
//! information as their ranges (`likelihood`).

mod arcs;
mod atlas;
mod bearing;
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
mod walk;
mod walls;
mod watch;
mod world;

pub use atlas::{Atlas, AtlasError};
pub use course::{Course, Odometry};
pub use doubt::{Doubt, doubts};
pub use fit::{
    Estimate, Fit, FitError, Fitted, Found, Prior, Search, bound, fit, fit_from, fit_watched,
};
pub use groups::{Group, GroupError, name, priors};
pub use hypothesis::{Hypotheses, LogLikelihood};
pub use likelihood::ErrorModel;
pub use locate::{Besides, Mode, locate, locate_watched};
pub use motion::{Motion, length_rate};
pub use parameter::Parameter;
pub use sweep::{Beam, Heard, Sweep, SweepError};
pub use told::Told;
pub use watch::{Progress, Unwatched, Watch};
pub use world::{World, WorldError};
