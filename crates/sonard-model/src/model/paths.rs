//! Exact engine: all echo paths of an observation point, by beam tracing through the floor plan.
//!
//! # Mirror reflections
//!
//! Sound that walls have reflected runs straight on from a mirror image of its source (Allen and
//! Berkley, JASA 65, 1979, for boxes; Borish, JASA 75, 1984, for any polyhedron). The number of
//! images grows without bounds, but few are visible from the receiver. Beam tracing finds only
//! those (Heckbert and Hanrahan 1984; Funkhouser et al., JASA 115, 2004). A beam is the set of all
//! rays from one image that were reflected by the same walls. The floor plan is triangulated once,
//! with the walls as sides of triangles (`floor`). A beam walks from triangle to triangle. At the
//! far corner of a triangle it splits in two; at a wall it continues from the next image.
//! Visibility therefore needs no search: a beam crosses exactly what its rays see, and a step costs
//! the same in a plan of ten walls and of ten thousand. Each ray from the source is in exactly one
//! beam at each order. An echo is a beam that contains the source. Beams that a corner has split,
//! and that later lie side by side before the same image and wall, are merged again (`beams`).
//!
//! A beam ends when none of its echoes can be both short and strong enough. The shortest path from
//! the image through the beam's part of the wall back to the source bounds the length from below.
//! With that length, absorption and the reflectances so far bound the amplitude from above.
//!
//! # Ties
//!
//! The echo of a right-angled corner runs exactly through the corner, on the border of two beams
//! (wall a first, or wall b first). Beams are therefore closed: a ray within a nanometre of a
//! border counts as inside, and such an echo is found on both sides with the same length, departure
//! and arrival. Only one ray leaves in a given direction, so two echoes that agree in all three are
//! one, and one is kept. The same rule covers joints of collinear walls and all corners of
//! `pi / m`. An echo at the very end of a wall counts as visible; the echo of the edge, which is
//! minus half of it there, takes that into account. Corners that are right-angled except for
//! rounded coordinates are made exact beforehand, with all other repairs of a drawn floor plan
//! ([`FloorPlan`](crate::scene::FloorPlan)).
//!
//! # Pairs
//!
//! An echo path can be traversed in both directions. If its walls read the same backwards, the path
//! returns on itself and is one echo. Otherwise both directions arrive at the same time and in
//! phase, with departure and arrival swapped; they are listed as two echoes, as two images of the
//! source. (A right-angled corner is both in one: one image, one echo.)
//!
//! # Edges
//!
//! Free ends and corners other than `pi / m` diffract sound (`diffraction`): all echoes with one
//! diffraction and any reflections before and after, and on request
//! ([`PathSettings::double_diffraction`]) with two. The strength is that of
//! [`crate::acoustics::edge`].
//!
//! # Cylinders
//!
//! Cylinders cut their shadow out of a beam and reflect the part that they cut (`cylinders`). Rays
//! reflected by convex surfaces spread and never cross. At most one ray of a tube therefore reaches
//! an edge, and it is found as the zero of a monotone function. The tube's width, by the mirror
//! equation at each cylinder, measures how much the sound has spread. The number of contacts of a
//! path follows from what can be detected, including the beam pattern on departure and arrival
//! where an engine supplies it. Between a round body and a wall next to it that is a dozen. The
//! amplitude floor of echoes that touch cylinders more than once is ten times that of the others.
//!
//! Thin free-standing cylinders are posts (`floor`). Like an edge they diffract from a point, their
//! axis, by the exact series of cylindrical waves, and beams pass them. For thicker cylinders the
//! creeping wave and the field in the shadow are omitted. Head-on at a cylinder of 5 cm and 49.4
//! kHz (`ka = 23`) the creeping wave is 48 dB below the mirror's echo (from the series, in the
//! tests).
//!
//! # Rough walls
//!
//! Rough walls scatter what they do not mirror, and so return echoes at aspects where a mirror does
//! not (`scattering`).
//!
//! # Heights
//!
//! Walls are upright. The paths that floor and ceiling add to those in the plan, and those that low
//! walls remove, are worked out afterwards (`height`). The level edges of such walls diffract as
//! upright edges do: every path out is combined with every path back, by walls, floor and ceiling.
//!
//! # The transducer's face
//!
//! The face also reflects, and turns with the azimuth, so echoes are sent out once more
//! (`transducer`).
//!
//! # Crosstalk
//!
//! Sound from one transducer to another also runs between two places, each with an axis of its own
//! (`crosstalk`).
//!
//! # Scans
//!
//! Paths depend on the observation point alone. [`PathEngine`] finds them, and each azimuth weights
//! them with the beam pattern on departure and arrival (`engine`). A transducer off the rotation
//! axis is at a separate point for each azimuth. A separate transmitter and receiver are two points
//! ([`Paths::enumerate_between`]). A robot body is part of the scene
//! ([`Scene::with_robot_at`](crate::scene::Scene::with_robot_at)).
//!
//! # Layers
//!
//! Each mechanism has a folder and data of its own; ARCHITECTURE.md lists their order, lowest
//! first. `echo` and `settings` are at the bottom, then the `floor` of the scene, `beams` in it and
//! the mechanisms built on beams. On top `enumerate` runs every mechanism in turn, and
//! `interactions` reconstructs the surfaces along a path.

mod beams;
mod crosstalk;
mod cylinders;
mod diffraction;
mod direction_index;
mod echo;
mod echo_set;
mod effort;
mod engine;
mod enumerate;
mod floor;
mod found;
mod height;
mod interactions;
mod mirror_paths;
mod pattern;
mod prepare;
mod rays;
mod scattering;
mod settings;
#[cfg(test)]
pub(super) mod tests;
mod tolerance;
mod traced;
mod transducer;

pub(super) use crosstalk::{CrosstalkPaths, TransducerPose};
pub use echo_set::{EchoChange, EchoSet};
pub use engine::PathEngine;
pub use interactions::EchoPath;
pub(super) use mirror_paths::MirrorPath;
pub(super) use pattern::BoundedPattern;
pub use prepare::Paths;
pub use settings::{
    DEFAULT_MIN_AMPLITUDE, DEFAULT_REPEATED_CONTACT_RATIO, PathSettings, default_sensor_z_m,
};
