//! `sonard benchmark`: how well maps, interpretations and explorations do, for developers and for
//! readers of the papers behind them.

mod explore;
mod interpret;
mod map;
mod score;

use super::Outcome;

/// Verbs of `sonard benchmark`.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Verb {
    /// Map simulated courses without and with Feature Prediction, and score the maps
    #[command(long_about = map::ABOUT)]
    Map(map::Args),
    /// Compare a map with the ideal one
    #[command(long_about = score::ABOUT)]
    Score(score::Args),
    /// Explore random rooms with sonar, laser, and laser just in time, and compare the maps
    #[command(long_about = explore::ABOUT)]
    Explore(explore::Args),
    /// Measure on random rooms how often the claims of `interpret` are true
    #[command(long_about = interpret::ABOUT)]
    Interpret(interpret::Args),
}

pub(super) fn run(verb: Verb) -> Outcome {
    match verb {
        Verb::Map(args) => map::run(&args),
        Verb::Score(args) => score::run(&args),
        Verb::Explore(args) => explore::run(&args),
        Verb::Interpret(args) => interpret::run(&args),
    }
}
