//! ROS 2 messages: types and serialization.

pub(crate) mod cdr;
pub(crate) mod interface;
pub(crate) mod message;
