//! Inverse problems: estimates sensor, air, scene and pose from measured readings.
//!
//! [`fit`] maximizes the posterior of the readings of [`FitSweep`]s over the [`Parameter`]s of a
//! [`World`] and returns estimates with their uncertainties. [`locate`] finds the pose of a sweep
//! without an initial guess, with a [`CoarseGrid`] of predicted readings, and a [`Tracker`] tracks
//! a robot from sweep to sweep.
//!
//! The likelihood assumes a receiver whose threshold varies a little from firing to firing. From
//! the lowest threshold to the highest it would report one arrival after the other, and finally
//! none (`candidates`). So an echo may be any arrival near the threshold, a missing echo means that
//! none was strong enough, and the ends of arcs carry as much information as their ranges
//! (`likelihood`).

mod array_round;
mod bearing;
mod candidates;
mod coarse_grid;
mod course;
mod diagnosis;
mod fit;
mod hypothesis;
mod jacobian;
mod likelihood;
mod likelihood_terms;
mod linear;
mod locate;
mod motion;
mod outlier_hmm;
mod parameter;
mod parameter_groups;
mod progress;
mod report;
mod sweep;
#[cfg(test)]
mod tests;
mod time_walk;
mod walls;
mod world;

pub use array_round::{ArrayFiring, ArrayRound};
pub use coarse_grid::{CoarseGrid, CoarseGridError};
pub use course::{Odometry, Tracker};
pub use diagnosis::{Misfit, diagnose};
pub use fit::{
    FitError, FitOptions, FitResult, ParameterEstimate, Prior, Search, SearchResult,
    cramer_rao_bound, fit, fit_from, fit_observed,
};
pub use hypothesis::{Hypotheses, LogLikelihood};
pub use likelihood::ErrorModel;
pub use locate::{NuisanceEstimate, PoseMode, locate, locate_observed};
pub use motion::{SceneMotion, length_derivative};
pub use parameter::{EndOfWall, Parameter, PostPart};
pub use parameter_groups::{GroupError, ParameterGroup, name, priors};
pub use progress::{FitObserver, FitProgress, NoObserver};
pub use report::{ParameterReport, calibrated_sensor, strongly_correlated};
pub use sweep::{FiringOutcome, FitSweep, FitSweepError, SweepFiring};
pub use world::{World, WorldError};
