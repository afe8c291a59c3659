//! Command `sonard-papers benchmark` with its verbs.

use super::{Outcome, interpret, map, rooms, score, views};

/// Verbs of `sonard-papers benchmark`.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Verb {
    /// Map simulated courses without and with Feature Prediction, and score the maps
    #[command(long_about = map::ABOUT)]
    Map(map::Args),
    /// Compare a map with the ideal one
    #[command(long_about = score::ABOUT)]
    Score(score::Args),
    /// Explore random rooms with sonar, laser and just-in-time sensing, and compare the maps
    #[command(long_about = rooms::ABOUT)]
    Explore(rooms::Args),
    /// Explore random rooms by the next views of surveys and by lines, and compare the maps
    #[command(long_about = views::ABOUT)]
    Views(views::Args),
    /// Measure the calibration of the probabilities of `interpret` in random rooms
    #[command(long_about = interpret::ABOUT)]
    Interpret(interpret::Args),
}

pub(crate) fn run(verb: Verb) -> Outcome {
    match verb {
        Verb::Map(args) => map::run(&args),
        Verb::Score(args) => score::run(&args),
        Verb::Explore(args) => rooms::run(&args),
        Verb::Views(args) => views::run(&args),
        Verb::Interpret(args) => interpret::run(&args),
    }
}
