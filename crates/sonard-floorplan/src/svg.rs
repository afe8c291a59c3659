//! Drawings in SVG.

mod clip;
mod file;
mod limits;
mod outline;

use sonard_model::scene::Surfaces;
use usvg::{Group, Node, Options, Tree};

use crate::{FloorPlan, PlanError};
use clip::Visible;
use outline::{Page, Polyline};

/// Options of reading a drawing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SvgOptions {
    /// Width of the whole drawing (its `width`, else its `viewBox`, else the extent of its
    /// contents), metres.
    pub width_m: f64,
}

/// Advice for a file that is not a drawing.
const HELP: &str = "give an SVG file, from a drawing program";
/// Maximum nesting depth of groups.
const MAX_DEPTH: usize = 256;

/// Reads the walls of a drawing: every visible line.
///
/// # Errors
/// Returns an error for a file that is not SVG, and for coordinates beyond 1e7 units.
pub fn read(bytes: &[u8], options: &SvgOptions) -> Result<FloorPlan, PlanError> {
    let file::Drawing { text, notes, has_size } = file::prepare(bytes, HELP)?;
    let tree = Tree::from_str(&text, &Options::default())
        .map_err(|error| PlanError::new(error.to_string(), HELP))?;
    let (width, height) = (f64::from(tree.size().width()), f64::from(tree.size().height()));
    let page = Page { scale: options.width_m / width, width, height };
    let mut drawing = Drawing { page, found: Surfaces::default(), notes, beyond_page: 0, depth: 0 };
    drawing.group(tree.root(), &Visible::default());
    if drawing.beyond_page > 0 && has_size {
        drawing
            .notes
            .push(format!("{} lines reach beyond the page and are kept", drawing.beyond_page));
    }
    Ok(FloorPlan { surfaces: drawing.found, notes: drawing.notes })
}

/// Surfaces and notes collected so far.
struct Drawing {
    page: Page,
    found: Surfaces,
    /// Notes on assumptions and ignored elements.
    notes: Vec<String>,
    /// Number of lines that leave the page.
    beyond_page: usize,
    depth: usize,
}

impl Drawing {
    /// Adds the visible part of a group.
    fn group(&mut self, group: &Group, visible: &Visible) {
        if self.depth == MAX_DEPTH {
            return self.note("groups that are nested too deeply are ignored");
        }
        let mut visible = visible.clone();
        if let Some(clip) = group.clip_path()
            && !visible.clip(group, clip, &self.page)
        {
            self.note("a clip path whose shapes are clipped themselves is not applied");
        }
        if group.mask().is_some() {
            self.note("a mask is not applied");
        }
        self.depth += 1;
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, &visible),
                Node::Path(path) if path.is_visible() => {
                    if let Some(outline) = path.data().clone().transform(path.abs_transform()) {
                        for line in self.page.polylines(&outline) {
                            self.line(line, &visible);
                        }
                    }
                }
                Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
            }
        }
        self.depth -= 1;
    }

    fn note(&mut self, what: &str) {
        if !self.notes.iter().any(|known| known == what) {
            self.notes.push(what.to_owned());
        }
    }

    /// Adds the visible parts of a line.
    fn line(&mut self, line: Polyline, visible: &Visible) {
        for (corners, is_closed) in visible.cut(line) {
            let is_beyond = corners.iter().any(|corner| !self.page.contains(*corner));
            self.beyond_page += usize::from(is_beyond);
            self.found.walls("wall", corners, is_closed);
        }
    }
}
