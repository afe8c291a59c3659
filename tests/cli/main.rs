//! The program as a user meets it. One test binary, because each would link all of it.
#![cfg(feature = "daemon")]

mod array;
mod collect;
mod common;
mod course;
mod daemon;
mod degenerate;
mod doctor;
mod export;
mod faults;
mod generate;
mod hangup;
mod import;
mod interpret;
mod inverse;
mod log;
mod long_logs;
mod map;
mod outputs;
mod paths;
mod plot;
mod readme;
mod scan;
mod scene;
mod scene_made;
mod small;
mod tamper;
mod trace;
mod whole_logs;
mod wrong_files;
mod wrong_input;
