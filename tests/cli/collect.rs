//! `sonard collect` as a researcher meets it: a plan, a folder, and whatever happens meanwhile.

mod by_daemon;
mod checks;
mod interrupted;
mod plans;
mod poses;

pub(crate) use sonard_test_support::collection::*;
