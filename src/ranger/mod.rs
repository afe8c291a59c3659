//! ranger.
