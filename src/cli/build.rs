//! Version, commit and features of this program.

use crate::scan::Build;

/// Text of `sonard --version` after the name.
pub(super) const LONG_VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    "\ncommit ",
    env!("SONARD_COMMIT"),
    "\nfeatures ",
    env!("SONARD_FEATURES")
);

/// Declares commit and features for the sessions of logs.
pub(super) fn declare() {
    let features = env!("SONARD_FEATURES").split(", ").filter(|name| !name.is_empty());
    let features = features.map(str::to_owned).collect();
    Build { commit: env!("SONARD_COMMIT").to_owned(), features }.declare();
}
