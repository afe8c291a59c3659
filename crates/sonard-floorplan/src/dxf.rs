//! Drawings in DXF, ASCII or binary, with the feature `dxf`.

#[cfg(feature = "dxf")]
mod drawing;

#[cfg(feature = "dxf")]
pub use drawing::read;

#[cfg(not(feature = "dxf"))]
use crate::{FloorPlan, PlanError};

/// Options of reading a drawing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DxfOptions {
    /// Length of a drawing unit, metres; by default that of $INSUNITS, if the plan then has a
    /// plausible size.
    pub unit_m: Option<f64>,
    /// Layers with walls; by default all that are on and not frozen.
    pub layers: Vec<String>,
}

/// Rejects all drawings, because the feature `dxf` is off.
///
/// # Errors
/// Always.
#[cfg(not(feature = "dxf"))]
pub fn read(_bytes: &[u8], _options: &DxfOptions) -> Result<FloorPlan, PlanError> {
    Err(PlanError::new(
        "DXF drawing, but this program was built without the feature dxf",
        "build it with `cargo build --release --features dxf`, or save the drawing as SVG: \
         `sonard scene from-svg`",
    ))
}
