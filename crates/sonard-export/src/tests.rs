//! Exports of one log that has something of everything.

mod cdr;
mod csv;
mod foxglove;
mod live;
mod live_map;
mod mcap;
mod parquet;
mod place;
mod scans;
