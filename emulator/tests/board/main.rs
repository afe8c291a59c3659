//! Tests of the board's machine code. A single test binary: its tests run in parallel, and
//! everything is linked once.

mod common;
mod conformance;
mod flight;
mod memory;
mod motion;
mod resume;
mod safety;
mod sweep;
mod world;
