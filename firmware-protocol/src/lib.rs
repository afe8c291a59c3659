//! The wire protocol of the sonard ranger, and the state machines of both its ends.
//!
//! Bytes from the line go through a [`frame::FrameDecoder`], which finds frames whose CRC is
//! right; a body is a [`messages::Request`] or a [`messages::Reply`]; the machines act on them:
//!
//! - [`device::Device`] decides everything that a device does. The firmware, the emulator and
//!   the mock differ only in who carries out its actions and who tells it the time.
//! - [`host::Host`] turns one command at a time into requests, repeats them, repairs sweeps and
//!   reports what came of it. It alone waits and retries.
//!
//! Neither reads a clock, touches a line, allocates or uses floating point, so two of them can
//! be joined in virtual time, where an hour of bad line takes milliseconds.
//!
//! `PROTOCOL.md` beside this crate describes the bytes for writers of other clients.
#![no_std]

#[cfg(feature = "conformance")]
pub mod conformance;
pub mod device;
pub mod frame;
pub mod host;
pub mod messages;
