//! `sonard scene from-svg`.

use std::path::PathBuf;

use usvg::{
    Group, Node, Options, Tree,
    tiny_skia_path::{Path as Outline, PathSegment, Point},
};

use super::{
    super::{Outcome, numbers::positive},
    made::{MadeArgs, read, refuse},
};
use crate::{geometry::DVec2, scene::Surfaces};

/// Options of `sonard scene from-svg`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromSvgArgs {
    /// Drawing of the plan, an SVG file
    #[arg(value_name = "DRAWING")]
    drawing: PathBuf,
    /// Width of the whole drawing (its `width`, else its `viewBox`) in the world, metres
    #[arg(long, value_name = "M", value_parser = positive)]
    width_m: f64,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene of a drawing: every line of an SVG file is a wall.

Lines, polylines, polygons, rectangles, circles and paths count, in whatever groups they are and however they are \
turned; fills, colours, widths and texts do not. Curves become short walls, a hundredth of the drawing's width at most. The lower left \
corner of the drawing is the origin, y points up. All is of one material: give walls their own in the file that comes out.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-svg plan.svg --width-m 12.5 -o plan.json
  sonard scene draw plan.json -o check.svg";

/// Of the drawing's width; a wall of a curve is at most so long.
const LONGEST_OF_CURVE: f64 = 0.01;
/// Walls of a curve, at least and at most.
const LEAST_OF_CURVE: usize = 4;
const MOST_OF_CURVE: usize = 64;

pub(super) fn run(args: &FromSvgArgs) -> Outcome {
    let help = "give an SVG file, as a drawing program writes it";
    let text = read(&args.drawing, help)?;
    let tree = Tree::from_data(&text, &Options::default())
        .map_err(|error| refuse(&args.drawing, &error, help))?;
    let (width, height) = (f64::from(tree.size().width()), f64::from(tree.size().height()));
    let scale = args.width_m / width;
    let mut drawing = Drawing { scale, width, height, found: Surfaces::default() };
    drawing.group(tree.root());
    args.made.write(&args.drawing, &drawing.found, "draw walls as lines; texts and images are none")
}

/// What was found so far.
struct Drawing {
    /// Metres a unit.
    scale: f64,
    /// Of the drawing, in its units.
    width: f64,
    height: f64,
    found: Surfaces,
}

impl Drawing {
    fn group(&mut self, group: &Group) {
        for node in group.children() {
            match node {
                Node::Group(group) => self.group(group),
                Node::Path(path) if path.is_visible() => {
                    if let Some(outline) = path.data().clone().transform(path.abs_transform()) {
                        self.outline(&outline);
                    }
                }
                Node::Path(_) | Node::Image(_) | Node::Text(_) => {}
            }
        }
    }

    fn outline(&mut self, outline: &Outline) {
        let mut corners: Vec<DVec2> = Vec::new();
        let mut last = Point::zero();
        for segment in outline.segments() {
            match segment {
                PathSegment::MoveTo(to) => {
                    self.line(&mut corners, false);
                    corners.push(self.place(to));
                    last = to;
                }
                PathSegment::LineTo(to) => {
                    corners.push(self.place(to));
                    last = to;
                }
                PathSegment::QuadTo(by, to) => {
                    // The same curve as one of the third degree.
                    let third = |end: Point| mixed([end, by], [1.0 / 3.0, 2.0 / 3.0]);
                    self.curve(&mut corners, [last, third(last), third(to), to]);
                    last = to;
                }
                PathSegment::CubicTo(by, and, to) => {
                    self.curve(&mut corners, [last, by, and, to]);
                    last = to;
                }
                PathSegment::Close => self.line(&mut corners, true),
            }
        }
        self.line(&mut corners, false);
    }

    /// A Bezier curve as short lines; it is no longer than the way by its control points.
    fn curve(&self, corners: &mut Vec<DVec2>, points: [Point; 4]) {
        let longest: f32 = points.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
        let parts = (f64::from(longest) / (LONGEST_OF_CURVE * self.width)).ceil();
        let parts = (parts as usize).clamp(LEAST_OF_CURVE, MOST_OF_CURVE);
        corners.extend((1..=parts).map(|part| {
            let t = part as f32 / parts as f32;
            let s = 1.0 - t;
            self.place(mixed(points, [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]))
        }));
    }

    /// In the world: y up.
    fn place(&self, point: Point) -> DVec2 {
        self.scale * DVec2::new(f64::from(point.x), self.height - f64::from(point.y))
    }

    /// Keeps a line, and begins another.
    fn line(&mut self, corners: &mut Vec<DVec2>, is_closed: bool) {
        self.found.walls("wall", std::mem::take(corners), is_closed);
    }
}

fn mixed<const N: usize>(points: [Point; N], shares: [f32; N]) -> Point {
    let sum = |of: fn(&Point) -> f32| {
        points.iter().zip(shares).map(|(point, share)| share * of(point)).sum()
    };
    Point::from_xy(sum(|point| point.x), sum(|point| point.y))
}
