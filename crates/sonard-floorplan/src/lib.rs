//! Walls from floor plans of other programs: worlds of Gazebo (SDF), drawings in DXF and SVG.
//!
//! [`sdf::read`], [`dxf::read`] and [`svg::read`] convert the bytes of a file to a [`FloorPlan`]:
//! surfaces in metres, and one note for each assumption and omission. Nothing here opens a file;
//! models that a world includes come from a [`sdf::Library`].
//!
//! ```
//! use sonard_floorplan::{svg, svg::SvgOptions};
//!
//! let drawing = b"<svg viewBox='0 0 10 8'><line x1='1' y1='1' x2='9' y2='1' stroke='black'/></svg>";
//! let plan = svg::read(drawing, &SvgOptions { width_m: 10.0 })?;
//! assert!(!plan.surfaces.is_empty());
//! # Ok::<(), sonard_floorplan::PlanError>(())
//! ```

mod curve;
pub mod dxf;
mod error;
pub mod sdf;
pub mod svg;
#[cfg(test)]
mod tests;
mod xml;

pub use error::PlanError;
use sonard_model::scene::Surfaces;

/// Maximum size of a file, decompressed, bytes. A drawing of lines alone takes up to 60 times its
/// size in memory.
pub const MAX_FILE_BYTES: usize = 16 << 20;

/// Rejects a file above [`MAX_FILE_BYTES`].
fn check_size(bytes: &[u8]) -> Result<(), PlanError> {
    if bytes.len() <= MAX_FILE_BYTES {
        return Ok(());
    }
    let what = format!("the file is larger than {} MB (decompressed)", MAX_FILE_BYTES >> 20);
    Err(PlanError::new(what, "save the walls alone: without furniture, meshes, texts and hatches"))
}

/// Surfaces found in a file, metres.
#[derive(Debug, Default)]
pub struct FloorPlan {
    /// Walls and cylinders.
    pub surfaces: Surfaces,
    /// Assumptions and omissions, one line each.
    pub notes: Vec<String>,
}
