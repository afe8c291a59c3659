//! Exports of a log that contains every kind of record.

mod cdr;
mod csv;
mod findings;
mod foxglove;
mod live;
mod live_map;
mod mcap;
mod parquet;
mod scans;
