//! `sonard scene from-svg`.

mod clip;
mod file;

use std::path::PathBuf;

use usvg::{
    Group, Node, Options, Tree,
    tiny_skia_path::{Path as Outline, PathSegment, Point},
};

use super::{
    super::{Outcome, numbers::positive},
    made::{MadeArgs, file_failure, read},
};
use crate::{geometry::DVec2, scene::Surfaces};
use clip::Window;

/// Options of `sonard scene from-svg`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromSvgArgs {
    /// Drawing of the plan, an SVG file
    #[arg(value_name = "DRAWING")]
    drawing: PathBuf,
    /// Width of the whole drawing (its `width`, else its `viewBox`, else the extent of its
    /// contents) in the world, metres
    #[arg(long, value_name = "M", value_parser = positive)]
    width_m: f64,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene from a drawing: every line of an SVG file is a wall.

Lines, polylines, polygons, rectangles, circles and paths are used, with all groups and \
transformations; fills, colours, widths, markers (arrow heads) and texts are ignored. Lines hidden \
by a rectangular clip path or the edge of an inner page are ignored; other clip paths and masks \
are not applied, with a warning. Curves become short walls, at most a hundredth of the drawing's \
width. The lower left corner of the drawing is the origin, y points up. Compressed files (.svgz) \
are accepted. All walls have the same material, which can be changed in the resulting file.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-svg plan.svg --width-m 12.5 -o plan.json
  sonard scene draw plan.json -o check.svg";

/// Maximum length of a wall of a curve, as a share of the drawing's width.
const MAX_CURVE_STEP: f64 = 0.01;
/// Minimum number of walls of a curve.
const MIN_CURVE_WALLS: usize = 4;
const MAX_CURVE_WALLS: usize = 64;

pub(super) fn run(args: &FromSvgArgs) -> Outcome {
    let help = "give an SVG file, from a drawing program";
    let bytes = read(&args.drawing, help)?;
    let file::Drawing { text, notes } =
        file::text(bytes).map_err(|what| file_failure(&args.drawing, &what, help))?;
    let tree = Tree::from_str(&text, &Options::default())
        .map_err(|error| file_failure(&args.drawing, &error, help))?;
    let (width, height) = (f64::from(tree.size().width()), f64::from(tree.size().height()));
    let scale = args.width_m / width;
    let mut drawing = Drawing { scale, width, height, found: Surfaces::default(), notes };
    drawing.group(tree.root(), Window::default());
    let help = "draw walls as lines; texts and images are ignored";
    args.made.write(&args.drawing, &drawing.found, &drawing.notes, help)
}

/// Surfaces and notes collected so far.
struct Drawing {
    /// Metres per unit.
    scale: f64,
    /// Width of the drawing, units.
    width: f64,
    height: f64,
    found: Surfaces,
    /// Notes on assumptions and ignored elements.
    notes: Vec<String>,
}

impl Drawing {
    /// Adds the visible part of a group within a window of the drawing.
    fn group(&mut self, group: &Group, window: Window) {
        let window = match group.clip_path() {
            Some(clip) => match clip::rectangle(group, clip) {
                Some(rectangle) => window.within(rectangle),
                None => {
                    self.note("a clip path other than an axis-parallel rectangle is not applied");
                    window
                }
            },
            None => window,
        };
        if group.mask().is_some() {
            self.note("a mask is not applied");
        }
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group, window),
                Node::Path(path) if path.is_visible() => {
                    if let Some(outline) = path.data().clone().transform(path.abs_transform()) {
                        self.outline(&outline, window);
                    }
                }
                Node::Image(_) => self.note("an image is ignored"),
                Node::Path(_) | Node::Text(_) => {}
            }
        }
    }

    fn note(&mut self, what: &str) {
        if !self.notes.iter().any(|known| known == what) {
            self.notes.push(what.to_owned());
        }
    }

    fn outline(&mut self, outline: &Outline, window: Window) {
        let mut corners: Vec<DVec2> = Vec::new();
        let mut last = Point::zero();
        for segment in outline.segments() {
            match segment {
                PathSegment::MoveTo(to) => {
                    self.line(&mut corners, false, window);
                    corners.push(self.place(to));
                    last = to;
                }
                PathSegment::LineTo(to) => {
                    corners.push(self.place(to));
                    last = to;
                }
                PathSegment::QuadTo(by, to) => {
                    // Exact conversion to a cubic curve.
                    let third = |end: Point| mixed([end, by], [1.0 / 3.0, 2.0 / 3.0]);
                    self.curve(&mut corners, [last, third(last), third(to), to]);
                    last = to;
                }
                PathSegment::CubicTo(by, and, to) => {
                    self.curve(&mut corners, [last, by, and, to]);
                    last = to;
                }
                PathSegment::Close => self.line(&mut corners, true, window),
            }
        }
        self.line(&mut corners, false, window);
    }

    /// Approximates a Bezier curve by short lines; its length is at most that of its control
    /// polygon.
    fn curve(&self, corners: &mut Vec<DVec2>, points: [Point; 4]) {
        let longest: f32 = points.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
        let parts = (f64::from(longest) / (MAX_CURVE_STEP * self.width)).ceil();
        let parts = (parts as usize).clamp(MIN_CURVE_WALLS, MAX_CURVE_WALLS);
        corners.extend((1..=parts).map(|part| {
            let t = part as f32 / parts as f32;
            let s = 1.0 - t;
            self.place(mixed(points, [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]))
        }));
    }

    /// Converts to the world, with y up.
    fn place(&self, point: Point) -> DVec2 {
        self.scale * DVec2::new(f64::from(point.x), self.height - f64::from(point.y))
    }

    /// Adds the visible parts of a line, and starts a new one.
    fn line(&mut self, corners: &mut Vec<DVec2>, is_closed: bool, window: Window) {
        let corners = std::mem::take(corners);
        let seen = window.transformed(|[x, y]| self.place(Point::from_xy(x as f32, y as f32)));
        for (corners, is_closed) in seen.cut(corners, is_closed) {
            self.found.walls("wall", corners, is_closed);
        }
    }
}

fn mixed<const N: usize>(points: [Point; N], shares: [f32; N]) -> Point {
    let sum = |of: fn(&Point) -> f32| {
        points.iter().zip(shares).map(|(point, share)| share * of(point)).sum()
    };
    Point::from_xy(sum(|point| point.x), sum(|point| point.y))
}
