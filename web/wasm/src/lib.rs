//! WebAssembly bindings of the acoustic model for the playground.
//!
//! Requests and responses are JSON: a scene, a sensor, air and a pose go in; readings, propagation
//! paths and echo traces come out.
//!
//! Built for `wasm32-unknown-unknown`, the module imports nothing, so it can only compute. The page
//! sends it [`Request`]s through the interface of `sonard_wasm_module`.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

mod beam;
mod dispatch;
mod log;
mod observation_cache;
mod request;
mod setup;
mod sweep;

pub use dispatch::ModelDispatcher;
pub use request::Request;
pub(crate) use sonard_wasm_module::RequestError;

sonard_wasm_module::export_dispatcher!(ModelDispatcher);
