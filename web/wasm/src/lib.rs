//! The model for the playground: a scene, a sensor, some air and a pose go in as JSON, readings, paths and
//! echo traces come out as JSON.
//!
//! Built for `wasm32-unknown-unknown` it is a module that imports nothing: it can compute and
//! nothing else. It exports three functions. [`request`] gives room for the text of a [`Request`],
//! [`answer`] answers it and says how long the answer is, and [`answered`] says where the answer stands until the
//! next one. In place of bindings made by a tool these are few enough to be written by hand, in
//! `web/playground/engine.js`.
//!
//! A refusal is an answer, too: `{"refused": {"message": ..., "help": ...}}`.

// Modules are `foo.rs` beside `foo/`.
#![warn(clippy::mod_module_files)]

mod beam;
mod desk;
mod log;
mod refusal;
mod request;
mod setup;
mod standing;
mod sweep;

use std::cell::RefCell;

pub use desk::Desk;
pub use refusal::Refusal;
pub use request::Request;

/// What the page and the model hand each other.
#[derive(Default)]
struct Counter {
    desk: Desk,
    request: Vec<u8>,
    answer: String,
}

thread_local! {
    static COUNTER: RefCell<Counter> = RefCell::default();
}

/// Makes room for a request of so many bytes, and says where.
// SAFETY: the name is exported by nothing else in the module.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn request(bytes: usize) -> *mut u8 {
    COUNTER.with_borrow_mut(|counter| {
        counter.request.clear();
        counter.request.resize(bytes, 0);
        counter.request.as_mut_ptr()
    })
}

/// Answers the request that was written there; the length of the answer, bytes.
// SAFETY: as above.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> usize {
    COUNTER.with_borrow_mut(|Counter { desk, request, answer }| {
        *answer = desk.answer(request);
        answer.len()
    })
}

/// Where the last answer is: UTF-8, JSON.
// SAFETY: as above.
#[allow(unsafe_code)]
#[unsafe(no_mangle)]
pub extern "C" fn answered() -> *const u8 {
    COUNTER.with_borrow(|counter| counter.answer.as_ptr())
}
