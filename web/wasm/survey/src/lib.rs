//! WebAssembly module of the page "Hidden room": random rooms, sweeps in them, and surveys.
//!
//! The page sends [`Request`]s through the interface of `sonard_wasm_module`. Every request contains
//! all that its response depends on, so that the page can discard a survey by ending its worker. The
//! module imports two functions of `page`: `report_progress`, by which a survey reports its progress,
//! and `is_survey_over`, by which the page ends a long one with the best plan so far.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

mod comparison;
mod dispatch;
mod progress;
mod request;
mod room;
mod sweep;

pub use dispatch::SurveyDispatcher;
pub use request::Request;

sonard_wasm_module::export_dispatcher!(SurveyDispatcher);
