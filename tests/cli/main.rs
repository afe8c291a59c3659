//! Tests of the program through its command line. One test binary, because each would link all of it.
#![cfg(feature = "daemon")]

mod arguments;
mod array;
mod collect;
mod common;
mod compare;
mod course;
mod daemon;
mod doctor;
mod export;
mod faults;
mod file_kinds;
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
mod ports;
mod presets;
mod readme;
mod receive_window;
mod scan;
mod scan_input;
mod scene;
mod scene_made;
mod sparse_logs;
mod tamper;
mod trace;
mod whole_logs;
