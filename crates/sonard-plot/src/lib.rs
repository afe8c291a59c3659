//! Pictures of scenes and scans, as SVG and PNG.
//!
//! Everything here is a pure function from data to a [`Picture`]; the caller writes it to a file.

// Modules are `foo.rs` next to `foo/`.
#![warn(clippy::mod_module_files)]

mod animation;
mod before_after;
pub mod canvas;
pub mod caption;
mod confidence;
mod convergence;
mod fans;
mod features;
mod floor;
mod font;
mod labels;
pub mod legend;
mod legend_entries;
pub mod lines;
mod map;
mod materials;
mod overlay;
mod path;
mod picture;
pub mod plan;
mod polar;
mod readings;
mod region;
mod residuals;
mod scan;
mod scan_caption;
mod scan_strips;
mod scene;
mod series;
mod side_by_side;
mod strip;
mod survey;
pub mod theme;
pub mod ticks;
mod trace;

#[cfg(test)]
mod fixtures;
#[cfg(test)]
mod legibility;
#[cfg(test)]
mod tests;

pub use animation::animate;
pub use before_after::{ComparedReading, draw_before_after};
pub use confidence::draw_confidence;
pub use convergence::{Convergence, draw_convergence};
pub use features::draw_features;
pub use lines::draw_lines;
pub use map::{MapView, draw_map};
pub use path::{PathView, draw_path};
pub use picture::{MAX_WIDTH_PX, Picture, PlotError};
pub use polar::draw_polar;
pub use residuals::draw_residuals;
pub use scan::{draw_scan, draw_scans};
pub use scan_caption::{badge_among, badge_for};
pub use scene::draw_scene;
pub use series::{Series, SeriesPoint, draw_series};
pub use side_by_side::draw_side_by_side;
pub use survey::{EchoCause, SurveyView, WallCertainty, draw_survey};
pub use trace::{TraceView, draw_trace};
