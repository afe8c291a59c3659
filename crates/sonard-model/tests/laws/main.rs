//! Laws of the exact engine on random scenes: properties of every listing of echo paths.
//!
//! Each law runs on 200 scenes, or on the number in `SONARD_LAWS`. Scene `n` of a law is always the
//! same, and a failure names it. A law that has an exception mentions it in its name.

mod compare;
mod energy;
mod heights;
mod listing;
mod nearly;
mod paths_are_real;
mod rough;
mod symmetry;
mod worlds;
