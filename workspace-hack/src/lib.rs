//! Nothing. What counts is in `Cargo.toml`.
