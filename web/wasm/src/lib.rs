//! WebAssembly bindings of the acoustic model for the playground.
//!
//! Requests and responses are JSON: a scene, a sensor, air and a pose go in; readings, propagation
//! paths and echo traces come out.
//!
//! Built for `wasm32-unknown-unknown`, the module imports nothing, so it can only compute. It
//! exports three functions, called by `web/playground/engine.js`: [`request_buffer`] reserves
//! memory for the JSON of a [`Request`], [`handle_request`] processes it and returns the length of
//! the response, and [`response`] returns the response's address, valid until the next request.
//!
//! Errors are responses too: `{"error": {"message": ..., "help": ...}}`.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

mod beam;
mod dispatch;
mod error;
mod log;
mod observation_cache;
mod request;
mod setup;
mod sweep;

use std::cell::RefCell;

pub use dispatch::Dispatcher;
pub use error::RequestError;
pub use request::Request;

/// State shared by the exported functions.
#[derive(Default)]
struct Module {
    dispatcher: Dispatcher,
    request: Vec<u8>,
    response: String,
}

thread_local! {
    static MODULE: RefCell<Module> = RefCell::default();
}

/// Reserves a request buffer of the given size in bytes, and returns its address.
// SAFETY: no other item of the module exports this name.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn request_buffer(bytes: usize) -> *mut u8 {
    MODULE.with_borrow_mut(|module| {
        module.request.clear();
        module.request.resize(bytes, 0);
        module.request.as_mut_ptr()
    })
}

/// Processes the request in the buffer, and returns the length of the response in bytes.
// SAFETY: no other item of the module exports this name.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn handle_request() -> usize {
    MODULE.with_borrow_mut(|Module { dispatcher, request, response }| {
        *response = dispatcher.handle(request);
        response.len()
    })
}

/// Address of the last response: JSON, UTF-8.
// SAFETY: no other item of the module exports this name.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn response() -> *const u8 {
    MODULE.with_borrow(|module| module.response.as_ptr())
}
