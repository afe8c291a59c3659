//! Echoes by way of cylinders.
//!
//! Cylinders take their shadow out of a beam and reflect what they take. Behind one a beam has no image any
//! more; it goes on as a tube of rays ([`grow`]), each known by where it touched the first cylinder. How much
//! a tube has spread says the mirror equation at each contact ([`front`]). Tubes end as half-paths at the next
//! cylinder; two of these, one from the transmitter and one from the receiver, are connected to an echo
//! ([`connect`]). A half-path is given up when no partner that is left for it would make an echo above the
//! floor ([`strength`]).

mod connect;
mod contact;
mod departures;
mod front;
mod groups;
mod grow;
mod half_path;
mod meet;
mod partners;
mod rays;
mod root;
mod stationary;
mod strength;
mod trace;
mod tracer;
mod tube;

pub(crate) use connect::Connection;
pub(crate) use rays::{CylinderRay, CylinderRays, OneWay, SpreadRay, surfaces_to};
pub(crate) use trace::trace;
pub(crate) use tracer::Tracer;
