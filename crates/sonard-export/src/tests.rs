//! Exports of one log that has something of everything.

mod csv;
mod scans;
