//! Pictures of scenes and scans, as SVG and PNG.
//!
//! Everything here is a pure function from data to a [`Picture`]; writing it to a file is the
//! caller's business.

mod canvas;
mod caption;
mod labels;
mod legend;
mod materials;
mod picture;
mod plan;
mod scene;
mod theme;
mod ticks;

pub use picture::{MAX_WIDTH_PX, Picture, PlotError};
pub use scene::draw_scene;
