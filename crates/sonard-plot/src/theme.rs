//! Colours, lines and text of every picture.
//!
//! Colours are those of Okabe and Ito, which stay apart for colour-blind readers, chosen dark
//! enough for a white page. Each kind of reading has a shape of its own as well, so that no
//! picture depends on colour.

/// Text and pose markers.
pub const INK: &str = "#1a1a1a";
/// Secondary text: axis labels, sources.
pub const QUIET: &str = "#404040";
/// Frames of the panels.
pub const FRAME: &str = "#8c8c8c";
/// Grid lines.
pub const GRID: &str = "#e8e8e8";
/// Silent beams.
pub const SILENT: &str = "#8c8c8c";
/// Walls.
pub const WALL: &str = "#262626";
/// The page.
pub const PAPER: &str = "#ffffff";

/// Blue.
pub const BLUE: &str = "#0072b2";
/// Light blue.
pub const SKY: &str = "#56b4e9";
/// Orange.
pub const ORANGE: &str = "#e69f00";
/// Red.
pub const VERMILLION: &str = "#d55e00";
/// Green.
pub const GREEN: &str = "#009e73";
/// Purple.
pub const PURPLE: &str = "#b8578f";

/// Names tried in this order; the first is the font that PNG files are made with.
pub const FONT_FAMILY: &str =
    "Ubuntu, 'Ubuntu Light', 'Helvetica Neue', Helvetica, Arial, sans-serif";

/// The picture's title, pixels.
pub const TITLE_PX: f64 = 20.0;
/// Lines under the title, legend entries, axis titles, pixels.
pub const TEXT_PX: f64 = 14.0;
/// Tick labels and names of walls, pixels.
pub const SMALL_PX: f64 = 12.5;

/// Width of every picture before scaling, pixels.
pub const PAGE_PX: f64 = 1000.0;
/// White space around everything, pixels.
pub const MARGIN_PX: f64 = 18.0;

/// Stroke width of walls, px.
pub const WALL_PX: f64 = 2.2;
/// Stroke width of grids, px.
pub const HAIRLINE_PX: f64 = 0.7;

/// Dash patterns for materials, most mirror-like first.
pub const WALL_DASHES: [&str; 5] = ["none", "9 3", "3 2.5", "12 3 3 3", "1.5 3"];
