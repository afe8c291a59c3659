//! `sonard scene from-sdf`.

mod frames;
mod include;
mod shapes;
mod state;

use std::path::PathBuf;

use glam::{DAffine3, DVec3};
use roxmltree::{Document, Node};

use super::{
    super::{Failure, Outcome, numbers::within},
    made::{MadeArgs, read, refuse},
};
use crate::scene::Surfaces;
use frames::Scope;
use state::State;

/// Options of `sonard scene from-sdf`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FromSdfArgs {
    /// World or model of Gazebo, an SDF file
    #[arg(value_name = "WORLD")]
    world: PathBuf,
    /// Height at which the world is cut, that of the ranger, metres
    #[arg(long, value_name = "M", default_value_t = 0.2, value_parser = within(-1e4..=1e4), allow_negative_numbers = true)]
    cut_z_m: f64,
    #[command(flatten)]
    made: MadeArgs,
}

pub(super) const ABOUT: &str = "\
Make a scene of a world of Gazebo: boxes and outlines of an SDF file are walls, cylinders are cylinders.

What has to do with collisions is cut at the height of the ranger (--cut-z-m), so the ground is none, and a table's top is \
only for a ranger at its height; boxes, cylinders and outlines (polyline) that stand upright count, \
each named by its model. Poses and scales of a saved <state> override those of the models; poses relative to other frames, \
nested models, and models from files beside the world (include) are followed. Meshes, spheres, other shapes, upright planes, populations, \
models from elsewhere and what leans are left out with a warning that names them. All is of one material: give walls their own in \
the file that comes out.";

pub(super) const EXAMPLES: &str = "\
Examples:
  sonard scene from-sdf arena.sdf -o arena.json
  sonard scene from-sdf arena.sdf --cut-z-m 0.45 -o arena.json
  sonard scene draw arena.json -o check.svg";

pub(super) fn run(args: &FromSdfArgs) -> Outcome {
    let help = "give an SDF file, as Gazebo reads it";
    let bytes = read(&args.world, help)?;
    let text = String::from_utf8(bytes).map_err(|error| refuse(&args.world, &error, help))?;
    let document = Document::parse(&text).map_err(|error| refuse(&args.world, &error, help))?;
    let root = document.root_element();
    if !root.has_tag_name("sdf") {
        let what = format!("the outermost element is {}, not sdf", root.tag_name().name());
        return Err(refuse(&args.world, &what, help));
    }
    let mut world = World {
        args,
        found: Surfaces::default(),
        notes: Vec::new(),
        file: args.world.clone(),
        depth: 0,
    };
    world.add_worlds(root)?;
    let help = "give a world with boxes, cylinders or outlines that the height of --cut-z-m meets";
    args.made.write(&args.world, &world.found, &world.notes, help)
}

/// What was found so far.
struct World<'a> {
    args: &'a FromSdfArgs,
    found: Surfaces,
    /// Names of the things left out.
    notes: Vec<String>,
    /// The file that is read: the world, or one that it includes.
    file: PathBuf,
    /// Files included within each other.
    depth: usize,
}

/// A body that shapes belong to: its name and the scale of its model.
#[derive(Clone, Copy)]
struct Body<'n> {
    name: &'n str,
    scale: DVec3,
}

impl World<'_> {
    /// The worlds of a file, and the models beside them.
    fn add_worlds(&mut self, root: Node) -> Outcome {
        for child in root.children().filter(Node::is_element) {
            if child.has_tag_name("world") {
                let states = child.children().filter(|child| child.has_tag_name("state"));
                let state = State::of(states.collect());
                self.add_members(&Scope::world(child), &state)?;
                for inserted in state.insertions() {
                    self.add_model(inserted, &Scope::world(child), &state)?;
                }
            } else if child.has_tag_name("model") {
                self.add_model(child, &Scope::world(root), &State::default())?;
            }
        }
        Ok(())
    }

    /// The models and links in a world or a model.
    fn add_members(&mut self, scope: &Scope, state: &State) -> Outcome {
        for child in scope.element.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "model" => self.add_model(child, scope, state)?,
                "link" => self.add_link(child, scope, state)?,
                "include" => self.include(child, scope, state)?,
                "population" => {
                    let name = child.attribute("name").unwrap_or("without a name");
                    self.notes.push(format!("left out: population `{name}`"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn add_model<'n>(
        &mut self,
        model: Node<'n, 'n>,
        scope: &Scope<'_, 'n>,
        state: &State<'_, 'n>,
    ) -> Outcome {
        let name = model.attribute("name").unwrap_or("body");
        if state.is_deleted(name) {
            return Ok(());
        }
        let Some(frame) = self.frame_of_model(model, name, scope, state)? else { return Ok(()) };
        let state = state.of_model(name);
        let scale = scope.scale * state.scale(self)?;
        let inner = Scope { element: model, frame, scale, name, outer: Some(scope) };
        self.add_members(&inner, &state)
    }

    /// The frame of a model: that of the state, else its own pose.
    fn frame_of_model<'n>(
        &mut self,
        model: Node<'n, 'n>,
        name: &str,
        scope: &Scope<'_, 'n>,
        state: &State<'_, 'n>,
    ) -> Result<Option<DAffine3>, Failure> {
        if model.attribute("placement_frame").is_some_and(|frame| !frame.is_empty()) {
            self.notes.push(format!(
                "left out: model `{name}`, which is placed by one of its frames (placement_frame)"
            ));
            return Ok(None);
        }
        match state.of_model(name).pose(self)? {
            Some(frame) => Ok(Some(frame)),
            None => self.placed(model, scope, name),
        }
    }

    fn add_link<'n>(
        &mut self,
        link: Node<'n, 'n>,
        scope: &Scope<'_, 'n>,
        state: &State<'_, 'n>,
    ) -> Outcome {
        let own = link.attribute("name").unwrap_or_default();
        let frame = match state.of_link(own, self)? {
            Some(frame) => Some(frame),
            None => self.placed(link, scope, scope.name)?,
        };
        let Some(frame) = frame else { return Ok(()) };
        let of_link =
            Scope { element: link, frame, scale: scope.scale, name: own, outer: Some(scope) };
        for collision in link.children().filter(|child| child.has_tag_name("collision")) {
            let Some(frame) = self.placed(collision, &of_link, scope.name)? else { continue };
            let body = Body { name: scope.name, scale: scope.scale };
            for geometry in collision.children().filter(|child| child.has_tag_name("geometry")) {
                self.geometry(geometry, body, &frame)?;
            }
        }
        Ok(())
    }

    /// The frame of an element by its pose; none, with a note, where that is relative to what is not there.
    fn placed<'n>(
        &mut self,
        element: Node<'n, 'n>,
        scope: &Scope<'_, 'n>,
        name: &str,
    ) -> Result<Option<DAffine3>, Failure> {
        match self.frame(element, scope, 0)? {
            Ok(frame) => Ok(Some(frame)),
            Err(missing) => {
                self.found.leave_out("poses relative to something else");
                self.notes.push(format!(
                    "left out: {} of `{name}`, whose pose is relative to `{missing}`",
                    element.tag_name().name()
                ));
                Ok(None)
            }
        }
    }

    fn refuse(&self, element: Node, what: &str) -> Failure {
        let at = element.document().text_pos_at(element.range().start);
        let place = format!("line {}, column {}: {what}", at.row, at.col);
        refuse(&self.file, &place, "mend it, as http://sdformat.org describes the format")
    }
}

/// The first child of a name.
fn child<'a, 'input>(element: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    element.children().find(|child| child.has_tag_name(name))
}
