//! Messages of ROS 2: their types, their bytes, and what they say of a scan.

pub(crate) mod cdr;
pub(crate) mod interface;
pub(crate) mod message;
