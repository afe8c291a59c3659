//! `sonard scene from-sdf`.

use std::path::{Path, PathBuf};

use super::{
    super::{Outcome, numbers::within, output::register_input},
    made::{MadeArgs, plan_failure, read, read_limited},
};
use crate::floorplan::sdf::{self, Library, SdfOptions};

/// Options of `sonard scene from-sdf`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromSdfArgs {
    /// World or model of Gazebo, an SDF file
    #[arg(value_name = "WORLD")]
    world: PathBuf,
    /// Height of the horizontal slice, that of the ranger, metres
    #[arg(long, value_name = "M", default_value_t = 0.2, value_parser = within(-1e4..=1e4), allow_negative_numbers = true)]
    cut_z_m: f64,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene from a Gazebo world: boxes and outlines of an SDF file are walls, cylinders are cylinders.

Collision geometry is sliced at the ranger's height (--cut-z-m); the ground is ignored, and a \
table's top counts only for a ranger at its height. Upright boxes, cylinders and outlines \
(polyline) are used, each named after its model. Poses and scales of a saved <state> override \
those of the models; poses relative to other frames, nested models, and models from files next to \
the world (include) are followed. Meshes, spheres, other shapes, vertical planes, populations, \
models from elsewhere and tilted objects are ignored with a warning. All walls have the same \
material, which can be changed in the resulting file.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-sdf arena.sdf -o arena.json
  sonard scene from-sdf arena.sdf --cut-z-m 0.45 -o arena.json
  sonard scene draw arena.json -o check.svg";

pub(super) fn run(args: &FromSdfArgs) -> Outcome {
    let bytes = read(&args.world, "give an SDF file for Gazebo")?;
    let options = SdfOptions { cut_z_m: args.cut_z_m };
    let plan = sdf::read(&bytes, &options, &LocalModels { world: &args.world })
        .map_err(|error| plan_failure(&args.world, &error))?;
    let help = "give a world with boxes, cylinders or outlines at the height of --cut-z-m";
    args.made.write_plan(&args.world, &plan, help)
}

/// Models in the folder of a world, or of the model that includes them, or below it.
struct LocalModels<'a> {
    world: &'a Path,
}

impl Library for LocalModels<'_> {
    fn model(&self, uri: &str, from: Option<&Path>) -> Option<(PathBuf, Vec<u8>)> {
        let path = from.and_then(|from| local(uri, from)).or_else(|| local(uri, self.world))?;
        register_input(&path);
        let bytes = read_limited(&path).ok()?;
        Some((path, bytes))
    }
}

/// Returns the file of a model in the folder of the file that includes it, or below it.
fn local(uri: &str, from: &Path) -> Option<PathBuf> {
    let folder = from.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let name = ["model://", "file://"].iter().find_map(|scheme| uri.strip_prefix(scheme));
    let name = name.unwrap_or(uri);
    if name.is_empty() || name.contains("://") {
        return None;
    }
    let within = |path: &Path| {
        let (path, folder) = (path.canonicalize().ok()?, folder.canonicalize().ok()?);
        (path.starts_with(folder) && path.is_file()).then_some(path)
    };
    let places = [folder.join(name), folder.join("models").join(name)];
    places.iter().find_map(|place| within(place).or_else(|| within(&place.join("model.sdf"))))
}
