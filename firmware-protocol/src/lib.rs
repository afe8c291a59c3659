//! Wire protocol of the sonard ranger, and the state machines of both of its ends.
//!
//! [`frame::FrameDecoder`] extracts frames with a valid CRC from the byte stream of the line. A
//! frame body is a [`messages::Request`] or a [`messages::Reply`]. Two state machines act on them:
//!
//! - [`device::Device`] makes every decision of the device. The firmware, the emulator and the mock
//!   differ only in how they carry out its actions and where they take the time from.
//! - [`host::Host`] turns one command at a time into requests, repeats them, repairs sweeps and
//!   reports results. Only the host waits and retries.
//!
//! Neither machine reads a clock, touches a line, allocates or uses floating point. A test can
//! therefore join the two in virtual time, where an hour on a bad line takes milliseconds.
//!
//! `PROTOCOL.md`, next to this crate's `Cargo.toml`, specifies the bytes for authors of other
//! clients.
#![no_std]

#[cfg(feature = "conformance")]
pub mod conformance;
pub mod device;
pub mod frame;
pub mod host;
pub mod messages;
