//! `sonard scene`.

mod from_dxf;
mod from_grid;
mod from_sdf;
mod from_svg;
mod made;

use std::{
    fmt::Write as _,
    io::{self, Write as _},
    path::PathBuf,
};

use super::{
    Failure, Outcome,
    output::{OutPath, Overwrite},
    picture::Target,
    preset, scene_file,
};
use crate::{
    geometry::DVec2,
    plot::draw_scene,
    scene::{Scene, json_schema, shipped},
};

/// Maximum number of listed changes of the plan.
const MAX_LISTED_CHANGES: usize = 100;

/// Verbs of `sonard scene`.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Verb {
    /// Check a scene file and summarize it in one line
    #[command(long_about = CHECK_ABOUT, after_help = CHECK_EXAMPLES)]
    Check(CheckArgs),
    /// Draw a scene's floor plan as SVG or PNG
    #[command(long_about = DRAW_ABOUT, after_help = DRAW_EXAMPLES)]
    Draw(DrawArgs),
    /// Make a scene from a CAD drawing, from the lines of a DXF file
    #[command(long_about = from_dxf::ABOUT, after_help = from_dxf::EXAMPLES)]
    FromDxf(from_dxf::FromDxfArgs),
    /// Make a scene from a map_server map, from its traced walls
    #[command(long_about = from_grid::ABOUT, after_help = from_grid::EXAMPLES)]
    FromGrid(from_grid::FromGridArgs),
    /// Make a scene from a Gazebo world, from the boxes and cylinders of an SDF file
    #[command(long_about = from_sdf::ABOUT, after_help = from_sdf::EXAMPLES)]
    FromSdf(from_sdf::FromSdfArgs),
    /// Make a scene from a drawing, from the lines of an SVG file
    #[command(long_about = from_svg::ABOUT, after_help = from_svg::EXAMPLES)]
    FromSvg(from_svg::FromSvgArgs),
    /// List the shipped scenes, with their poses
    List,
    /// Print the file of a shipped scene, as a template
    Show(preset::Name),
    /// Print the JSON Schema of scene files
    #[command(long_about = SCHEMA_ABOUT, after_help = SCHEMA_EXAMPLES)]
    Schema,
}

/// Options of `sonard scene check`.
#[derive(Debug, clap::Args)]
pub(super) struct CheckArgs {
    /// Scene file, or the name of a shipped scene (`sonard scene list`)
    #[arg(value_name = "FILE")]
    scene: PathBuf,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene; checks
    /// that it is free
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
}

/// Options of `sonard scene draw`.
#[derive(Debug, clap::Args)]
pub(super) struct DrawArgs {
    /// Scene file, or the name of a shipped scene (`sonard scene list`)
    #[arg(value_name = "FILE")]
    scene: PathBuf,
    /// Pose of the ranger: X,Y,DEG (metres, degrees) or the name of a pose in the scene; the only
    /// one drawn, instead of all named poses
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<String>,
    /// File to write; a picture, .svg or .png by its name, instead of SVG to standard output
    #[arg(short, long, value_name = "FILE")]
    output: Option<OutPath>,
    /// Width of a PNG, pixels
    #[arg(long, value_name = "PX", default_value_t = 1000)]
    width: u32,
    #[command(flatten)]
    overwrite: Overwrite,
}

const CHECK_ABOUT: &str = "\
Check a scene file and summarize it in one line.

A scene is a floor plan in JSON: materials with their reflectance, walls (from one point to \
another, or a polyline), cylinders, and named poses of the ranger. With floor_z_m and ceiling_z_m \
it has a height: floor and ceiling reflect, too, with floor_material and ceiling_material (rigid \
by default), and walls and cylinders may have limits in height (z_m). Lengths are metres, angles \
degrees counter-clockwise from +x. Errors are reported with line and column, and with advice; the \
exit code is then 2.

Changes of the plan as drawn are listed below the summary: ends of walls closer to each other, or \
to a wall, than the scene's snap_m (default 2 mm) are joined, shorter overhangs are cut, and of \
coincident walls one is kept. snap_m 0 keeps the plan as drawn.";

const CHECK_EXAMPLES: &str = r#"Examples:
  sonard scene check my-room.json
  sonard scene check simple-room        a shipped scene, by name
  sonard scene check simple-room --pose 0.4,0.3,90

A minimal scene:
  {"name": "my-room",
   "materials": {"plaster": {"reflectance": 0.95}},
   "walls": [{"id": "room", "polyline": [[0,0],[4,0],[4,3],[0,3]], "closed": true,
              "material": "plaster"}],
   "poses": {"middle": {"x_m": 2, "y_m": 1.5, "heading_deg": 0}}}"#;

const DRAW_ABOUT: &str = "\
Draw a scene's floor plan as SVG or PNG.

Shows the walls by material with their ids, after the changes listed by `sonard scene check`, \
cylinders, the poses with an arrow along azimuth 0, the robot's body if the scene has one, a scale \
in metres, and the scene's source and approximations. Heights, and the materials of floor and \
ceiling, are not drawn.";

const DRAW_EXAMPLES: &str = "\
Examples:
  sonard scene draw simple-room -o simple-room.png
  sonard scene draw my-room.json --pose 1.2,0.8,90 -o my-room.svg
  sonard scene draw my-room.json > my-room.svg";

const SCHEMA_ABOUT: &str = "\
Print the JSON Schema of scene files.

Editors with JSON Schema support complete fields and mark errors while you type. The schema \
describes every field with its unit; rules beyond the format (existing materials, walls with a \
length) are checked by `sonard scene check`.";

const SCHEMA_EXAMPLES: &str = r#"Examples:
  sonard scene schema > scene.schema.json
  and in a scene file:  "$schema": "./scene.schema.json""#;

pub(super) fn run(verb: Verb) -> Outcome {
    match verb {
        Verb::Check(args) => check(&args),
        Verb::Draw(args) => draw(&args),
        Verb::FromDxf(args) => from_dxf::run(&args),
        Verb::FromGrid(args) => from_grid::run(&args),
        Verb::FromSdf(args) => from_sdf::run(&args),
        Verb::FromSvg(args) => from_svg::run(&args),
        Verb::List => list(),
        Verb::Show(name) => preset::scene(&name),
        Verb::Schema => schema(),
    }
}

fn check(args: &CheckArgs) -> Outcome {
    let scene = scene_file::load(&args.scene)?;
    if let Some(pose) = &args.pose {
        scene_file::pose(&scene, pose)?;
    }
    let plan = scene.floor_plan();
    let mut text = summary(&scene);
    for change in plan.changes.iter().take(MAX_LISTED_CHANGES) {
        let _ = write!(text, "\n  {}", change.describe(&scene));
    }
    if let Some(more) = plan.changes.len().checked_sub(MAX_LISTED_CHANGES).filter(|more| *more > 0)
    {
        let _ = write!(text, "\n  and {more} more changes");
    }
    print(&text)
}

fn draw(args: &DrawArgs) -> Outcome {
    let target = args.output.as_ref().map(|path| Target::new(path, args.overwrite)).transpose()?;
    let scene = scene_file::load(&args.scene)?;
    let picture = draw_scene(&with_drawn_poses(scene, args.pose.as_deref())?);
    match target {
        None => print(picture.to_svg().trim_end()),
        Some(target) => target.write(&picture, args.width),
    }
}

/// Returns the scene with the poses to draw, and the robot's body at each of them.
fn with_drawn_poses(mut scene: Scene, pose: Option<&str>) -> Result<Scene, Failure> {
    if let Some(spec) = pose {
        let pose = scene_file::pose(&scene, spec)?;
        scene.poses = [(spec.to_owned(), pose)].into();
    }
    let robot = scene.robot.clone();
    for pose in scene.poses.clone().values() {
        scene.robot.clone_from(&robot);
        scene = scene.with_robot_at(pose);
    }
    Ok(scene.floor_plan().planned_scene(&scene))
}

fn list() -> Outcome {
    let mut rows = Vec::new();
    for name in shipped::names() {
        let scene = scene_file::shipped(name)?;
        let poses = scene.poses.keys().cloned().collect::<Vec<_>>().join(", ");
        rows.push([name.to_owned(), format!("poses: {poses}")]);
    }
    preset::list(rows)
}

fn schema() -> Outcome {
    print(&format!("{:#}", json_schema()))
}

fn print(text: &str) -> Outcome {
    writeln!(io::stdout(), "{text}")
        .or_else(|error| Failure::from_write("to standard output", &error))
}

/// Summarizes contents and size of a scene in one line.
fn summary(scene: &Scene) -> String {
    let mut parts =
        vec![count(scene.walls.len(), "wall"), count(scene.cylinders.len(), "cylinder")];
    let poses: Vec<&str> = scene.poses.keys().map(String::as_str).collect();
    parts.push(match poses.len() {
        0 => "no poses".to_owned(),
        number => format!("{} ({})", count(number, "pose"), poses.join(", ")),
    });
    if let Some(robot) = &scene.robot {
        parts.push(format!("robot {}", robot.id));
    }
    if let Some((low, high)) = extent(scene) {
        let size = high - low;
        parts.push(format!("{:.3} x {:.3} m", size.x, size.y));
    }
    format!("{}: {}", scene.name, parts.join(", "))
}

fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// Lower left and upper right corner of all reflectors, metres.
fn extent(scene: &Scene) -> Option<(DVec2, DVec2)> {
    let walls = scene.walls.iter().map(|wall| (wall.a.min(wall.b), wall.a.max(wall.b)));
    let cylinders = scene.cylinders.iter().map(|cylinder| {
        let reach = DVec2::splat(cylinder.radius_m);
        (cylinder.center - reach, cylinder.center + reach)
    });
    walls.chain(cylinders).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}
