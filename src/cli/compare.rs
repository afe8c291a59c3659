//! `sonard compare`.

use super::{Failure, Outcome};

/// Options of `sonard compare`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {}

pub(super) fn run(_args: Args) -> Outcome {
    Err(Failure::Found(None))
}
