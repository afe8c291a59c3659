//! Wire protocol.
#![no_std]
