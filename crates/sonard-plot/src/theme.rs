//! Colours, line widths and text sizes of all pictures.
//!
//! The colours are those of Okabe and Ito, distinguishable by colour-blind readers, dark enough
//! for a white page. Each kind of reading has a shape of its own as well, so that no picture
//! depends on colour.

/// Colour of text and pose markers.
pub const INK: &str = "#1a1a1a";
/// Secondary text: axis labels, sources.
pub const QUIET: &str = "#404040";
/// Colour of the frames of panels.
pub const FRAME: &str = "#8c8c8c";
/// Colour of grid lines.
pub const GRID: &str = "#e8e8e8";
/// Colour of beams without echo.
pub const NO_ECHO: &str = "#8c8c8c";
/// Colour of walls.
pub const WALL: &str = "#262626";
/// Colour of the page.
pub const PAPER: &str = "#ffffff";

/// Blue of the palette.
pub const BLUE: &str = "#0072b2";
/// Light blue of the palette.
pub const SKY: &str = "#56b4e9";
/// Orange of the palette.
pub const ORANGE: &str = "#e69f00";
/// Red of the palette.
pub const VERMILLION: &str = "#d55e00";
/// Green of the palette.
pub const GREEN: &str = "#009e73";
/// Purple of the palette.
pub const PURPLE: &str = "#b8578f";

/// Font families in order of preference; PNG files use the first.
pub const FONT_FAMILY: &str =
    "Ubuntu, 'Ubuntu Light', 'Helvetica Neue', Helvetica, Arial, sans-serif";

/// Size of the title, pixels.
pub const TITLE_PX: f64 = 20.0;
/// Size of lines below the title, legend entries and axis titles, pixels.
pub const TEXT_PX: f64 = 14.0;
/// Size of tick labels and names of walls, pixels.
pub const SMALL_PX: f64 = 12.5;

/// Width of every picture before scaling, pixels.
pub const PAGE_PX: f64 = 1000.0;
/// Margin of the page, pixels.
pub const MARGIN_PX: f64 = 18.0;

/// Stroke width of walls, px.
pub const WALL_PX: f64 = 2.2;
/// Stroke width of grids, px.
pub const HAIRLINE_PX: f64 = 0.7;

/// Dash patterns for materials, most specular first.
pub const WALL_DASHES: [&str; 5] = ["none", "9 3", "3 2.5", "12 3 3 3", "1.5 3"];
