//! Interface of a WebAssembly module to the page: JSON requests and responses in its memory.
//!
//! A module defines its [`Dispatcher`] and exports it by [`export_dispatcher`]. The page reserves memory
//! for the JSON of a request by `request_buffer`, calls `handle_request`, which returns the length of
//! the response, and reads the response at the address that `response` returns, which is valid until
//! the next request (`web/playground/engine.js`).
//!
//! Errors are responses too: `{"error": {"message": ..., "help": ...}}`.

mod error;

use serde::{Serialize, de::DeserializeOwned};
use serde_json::json;
use sonard_model::model::Simulator;

pub use error::RequestError;

/// Request handler of a module, with its state.
pub trait Dispatcher: Default {
    /// Request of the page.
    type Request: DeserializeOwned;

    /// Handles a request; returns the response as JSON.
    ///
    /// # Errors
    /// A request that the module rejects.
    fn dispatch(&mut self, request: Self::Request) -> Result<String, RequestError>;

    /// Handles a request; both request and response are JSON.
    fn handle(&mut self, request: &[u8]) -> String {
        let response = serde_json::from_slice(request)
            .map_err(|error| RequestError::new(&format!("invalid request: {error}"), ""))
            .and_then(|request| self.dispatch(request));
        response.unwrap_or_else(|error| json!({ "error": error }).to_string())
    }
}

/// Two-way half-amplitude width of the beam, degrees from its axis.
pub fn half_beam_deg(simulator: &Simulator) -> f64 {
    // The one-way gain is the square root of one half.
    simulator.beam().angle_at(0.5_f64.sqrt()).to_degrees()
}

/// Encodes a response as JSON.
///
/// # Errors
/// Values without a representation in JSON.
pub fn encode(response: &impl Serialize) -> Result<String, RequestError> {
    serde_json::to_string(response).map_err(|error| RequestError::new(&error, ""))
}

/// Memory of a module that the page reads and writes.
#[derive(Default)]
pub struct Module<D> {
    dispatcher: D,
    request: Vec<u8>,
    response: String,
}

impl<D: Dispatcher> Module<D> {
    /// Reserves a request buffer of the given size in bytes, and returns its address.
    pub fn request_buffer(&mut self, bytes: usize) -> *mut u8 {
        self.request.clear();
        self.request.resize(bytes, 0);
        self.request.as_mut_ptr()
    }

    /// Processes the request in the buffer, and returns the length of the response in bytes.
    pub fn handle_request(&mut self) -> usize {
        self.response = self.dispatcher.handle(&self.request);
        self.response.len()
    }

    /// Address of the last response: JSON, UTF-8.
    pub fn response(&self) -> *const u8 {
        self.response.as_ptr()
    }
}

/// Exports a [`Dispatcher`] as the three functions that the page calls.
#[macro_export]
macro_rules! export_dispatcher {
    ($dispatcher:ty) => {
        ::std::thread_local! {
            static MODULE: ::std::cell::RefCell<$crate::Module<$dispatcher>> =
                ::std::cell::RefCell::default();
        }

        /// Reserves a request buffer of the given size in bytes, and returns its address.
        // SAFETY: no other item of the module exports this name.
        #[allow(unsafe_code)]
        #[unsafe(no_mangle)]
        pub extern "C" fn request_buffer(bytes: usize) -> *mut u8 {
            MODULE.with_borrow_mut(|module| module.request_buffer(bytes))
        }

        /// Processes the request in the buffer, and returns the length of the response in bytes.
        // SAFETY: no other item of the module exports this name.
        #[allow(unsafe_code)]
        #[unsafe(no_mangle)]
        pub extern "C" fn handle_request() -> usize {
            MODULE.with_borrow_mut($crate::Module::handle_request)
        }

        /// Address of the last response: JSON, UTF-8.
        // SAFETY: no other item of the module exports this name.
        #[allow(unsafe_code)]
        #[unsafe(no_mangle)]
        pub extern "C" fn response() -> *const u8 {
            MODULE.with_borrow($crate::Module::response)
        }
    };
}
