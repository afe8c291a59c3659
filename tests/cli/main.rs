//! The program as a user meets it. One test binary, because each would link all of it.
#![cfg(feature = "daemon")]

mod collect;
mod common;
mod daemon;
mod doctor;
mod faults;
mod hangup;
mod interpret;
mod log;
mod map;
mod paths;
mod plot;
mod scan;
mod scene;
mod trace;
mod wrong_input;
