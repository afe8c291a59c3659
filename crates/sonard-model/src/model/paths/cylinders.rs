//! Echoes by way of cylinders.
//!
//! Cylinders cut their shadow out of a beam and reflect the part that they cut. Behind a cylinder a
//! beam has no image; it continues as a tube of rays ([`grow`]), each identified by its contact
//! with the first cylinder. The mirror equation at each contact determines how much a tube has
//! spread ([`front`]). Tubes end as half-paths at the next cylinder. Two half-paths, one from the
//! transmitter and one from the receiver, are connected to an echo ([`connect`]). A half-path is
//! dropped when no remaining partner would make an echo above the floor ([`strength`]).

mod connect;
mod contact;
mod departures;
mod front;
mod groups;
mod grow;
mod half_path;
mod hits;
mod partners;
mod rays;
mod root;
mod stationary;
mod strength;
mod trace;
mod tracer;
mod tube;

pub(crate) use connect::MiddleContact;
pub(crate) use rays::{CylinderRay, CylinderRays, OneWay, SpreadRay, surfaces_to};
pub(crate) use trace::trace;
pub(crate) use tracer::Tracer;
