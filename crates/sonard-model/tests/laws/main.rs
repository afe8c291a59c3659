//! Laws of the exact engine, held on random scenes: what every listing of echo paths obeys, whatever the scene.
//!
//! Each law runs on 200 scenes, or on as many as `SONARD_LAWS` says; scene `n` of a law is always the same, and
//! a failure names it. A law that has an exception says so in its name.

mod compare;
mod energy;
mod heights;
mod listing;
mod paths_are_real;
mod rough;
mod symmetry;
mod worlds;
