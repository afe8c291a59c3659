//! The exact engine: all echo paths of an observation point, by tracing beams through the floor plan.
//!
//! # Mirror reflections
//!
//! Sound that mirrors have turned back and forth runs straight on from an image of its source
//! (Allen and Berkley, JASA 65, 1979, for boxes; Borish, JASA 75, 1984, for any polyhedron). How
//! many images there are grows without bounds, but few are seen from where one listens. Beams
//! find those alone (Heckbert and Hanrahan 1984; Funkhouser et al., JASA 115, 2004): a beam is
//! all rays from an image that met the same walls. The plan is triangulated once, with the walls
//! as sides of triangles (`plan`). A beam walks from triangle to triangle; at the
//! triangle's far corner it splits in two, at a wall it turns into a beam from the next image.
//! So visibility needs no search: what a beam walks through is what its rays see, a step costs
//! the same in a plan of ten walls and of ten thousand, and each ray from the source is in exactly
//! one beam at each order. An echo is a beam that holds the source itself. Beams that a corner
//! split but that stand side by side before the same image and wall later are merged again
//! (`beams`).
//!
//! A beam ends when no echo of it can be both short and strong enough: the shortest path from the
//! image through the beam's part of the wall back to the source bounds the length from below, and
//! with it absorption and the reflectances so far bound the amplitude from above.
//!
//! # Ties
//!
//! The echo of a right-angled corner runs exactly through the corner, on the border of two beams
//! (wall a first, or wall b first). Beams therefore are closed: a ray within a nanometre
//! of a border counts as inside, and such an echo is found on both sides. Both have the same
//! length, departure and arrival. But only one ray leaves in a given direction, so two echoes
//! that agree in all three are one, and one is kept. The same rule covers joints of collinear
//! walls and all corners of `pi / m`. An echo on the very end of a wall counts as seen, and the
//! edge's echo, which is minus half of it there, knows that. Corners that are right-angled but for
//! the rounding of their coordinates are made so before, with all else that a drawn plan needs
//! ([`FloorPlan`](crate::scene::FloorPlan)).
//!
//! # Pairs
//!
//! An echo path can be run through in both directions. If the walls read the same backwards the
//! path comes back on itself and is one echo. Otherwise both directions arrive, at the same time
//! and in phase, with departure and arrival swapped: they are listed as two echoes, as two images
//! of the source. (A right-angled corner is both in one: one image, one echo.)
//!
//! # Edges
//!
//! Free ends and corners that are not `pi / m` diffract sound (`diffraction`): all echoes with one diffraction
//! and any reflections before and after, and on request ([`Settings::double_diffraction`]) with two. How much
//! comes back says [`crate::acoustics::edge`].
//!
//! # Cylinders
//!
//! Cylinders take their shadow out of a beam and reflect what they take (`cylinders`). Rays off
//! convex surfaces spread and never cross, so in each tube of rays one at most comes to an edge, and is
//! found as the zero of a monotone function. The tube's width, by the mirror equation at each
//! cylinder, says how much the sound has spread. How many contacts a path has follows
//! from what can be heard, the beam pattern on departure and arrival included where
//! an engine asks. Between a round body and a wall beside it that is a dozen. The floor of echoes that
//! touch cylinders more than once is ten times that of the others.
//!
//! Thin cylinders that stand free are posts (`plan`): like an edge they diffract from a point, their axis, by the exact
//! series of cylindrical waves, and beams pass them. Of thicker ones the sound that creeps round them is left out, and
//! so is what reaches their shadow. Head-on on one of 5 cm at 49.4 kHz (`ka = 23`) it is 48 dB below the mirror's echo
//! (from the series, in the tests).
//!
//! # Rough walls
//!
//! They scatter what they do not mirror, and so are seen at aspects from which a mirror is not
//! (`scattering`).
//!
//! # Heights
//!
//! Walls are upright: what floor and ceiling add to the paths of the plan, and what low walls take
//! away, is worked out after them (`height`). The level edges of such walls diffract
//! as upright ones do: every path out with every path back, by walls, floor and ceiling.
//!
//! # The transducer's face
//!
//! It reflects too, and turns with the azimuth: echoes come back from it once more (`transducer`).
//!
//! # Crosstalk
//!
//! What one transducer sends and another one receives runs between two places, too, each with an axis of its own
//! (`crosstalk`).
//!
//! # Scans
//!
//! Paths depend on the observation point alone. [`PathEngine`] finds them,
//! and each azimuth weighs them with the beam pattern on departure and arrival (`engine`).
//! A transducer off the rotation axis is at a point of its own at each azimuth.
//! Transmitter and receiver apart are two points ([`Paths::enumerate_between`]). A robot
//! body is part of the scene ([`Scene::with_robot_at`](crate::scene::Scene::with_robot_at)).
//!
//! # Layers
//!
//! Each mechanism has a folder and data of its own; ARCHITECTURE.md has their order, lowest first. `echo` and
//! `settings` are at the bottom, then the `plan` of the scene, `beams` in it and what is built on beams; on top
//! `enumerate` asks every mechanism in its turn, and `interactions` tells what a path met.

mod beams;
mod crosstalk;
mod cylinders;
mod diffraction;
mod direction_index;
mod echo;
mod effort;
mod engine;
mod enumerate;
mod found;
mod height;
mod interactions;
mod pattern;
mod plan;
mod prepare;
mod rays;
mod scattering;
mod settings;
#[cfg(test)]
pub(super) mod tests;
mod tolerance;
mod traced;
mod transducer;

pub(super) use crosstalk::{Aimed, AimedPaths};
pub use engine::PathEngine;
pub use interactions::EchoPath;
pub use prepare::Paths;
pub use settings::{REPEATED_CONTACTS_ABOVE, Settings, usual_z_m};
