//! The board as its machine code makes it. One test binary: its tests run beside each other, and
//! all of it is linked once.

mod common;
mod conformance;
mod flight;
mod memory;
mod motion;
mod resume;
mod safety;
mod sweep;
mod world;
