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
    made::{MadeArgs, file_failure, read},
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
    let help = "give an SDF file for Gazebo";
    let bytes = read(&args.world, help)?;
    let text = String::from_utf8(bytes).map_err(|error| file_failure(&args.world, &error, help))?;
    let document =
        Document::parse(&text).map_err(|error| file_failure(&args.world, &error, help))?;
    let root = document.root_element();
    if !root.has_tag_name("sdf") {
        let what = format!("the root element is {}, not sdf", root.tag_name().name());
        return Err(file_failure(&args.world, &what, help));
    }
    let mut world = World {
        args,
        found: Surfaces::default(),
        notes: Vec::new(),
        file: args.world.clone(),
        depth: 0,
    };
    world.add_worlds(root)?;
    let help = "give a world with boxes, cylinders or outlines at the height of --cut-z-m";
    args.made.write(&args.world, &world.found, &world.notes, help)
}

/// Surfaces and notes collected so far.
struct World<'a> {
    args: &'a FromSdfArgs,
    found: Surfaces,
    /// Notes on ignored objects.
    notes: Vec<String>,
    /// Current file: the world, or one that it includes.
    file: PathBuf,
    /// Nesting depth of included files.
    depth: usize,
}

/// Model with collision shapes: its name and scale.
#[derive(Clone, Copy)]
struct Body<'n> {
    name: &'n str,
    scale: DVec3,
}

impl World<'_> {
    /// Adds the worlds of a file, and the models outside them.
    fn add_worlds(&mut self, root: Node) -> Outcome {
        for child in root.children().filter(Node::is_element) {
            if child.has_tag_name("world") {
                let states = child.children().filter(|child| child.has_tag_name("state"));
                let state = State::new(states.collect());
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

    /// Adds the models and links in a world or a model.
    fn add_members(&mut self, scope: &Scope, state: &State) -> Outcome {
        for child in scope.element.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "model" => self.add_model(child, scope, state)?,
                "link" => self.add_link(child, scope, state)?,
                "include" => self.include(child, scope, state)?,
                "population" => {
                    let name = child.attribute("name").unwrap_or("without a name");
                    self.notes.push(format!("ignored: population `{name}`"));
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

    /// Returns the frame of a model: that of the state, or else its own pose.
    fn frame_of_model<'n>(
        &mut self,
        model: Node<'n, 'n>,
        name: &str,
        scope: &Scope<'_, 'n>,
        state: &State<'_, 'n>,
    ) -> Result<Option<DAffine3>, Failure> {
        if model.attribute("placement_frame").is_some_and(|frame| !frame.is_empty()) {
            self.notes.push(format!("ignored: model `{name}`, which uses placement_frame"));
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

    /// Returns the frame of an element by its pose; `None`, with a note, if the frame that it is
    /// relative to is missing.
    fn placed<'n>(
        &mut self,
        element: Node<'n, 'n>,
        scope: &Scope<'_, 'n>,
        name: &str,
    ) -> Result<Option<DAffine3>, Failure> {
        match self.frame(element, scope, 0)? {
            Ok(frame) => Ok(Some(frame)),
            Err(missing) => {
                self.found.count_ignored("poses relative to missing frames");
                self.notes.push(format!(
                    "ignored: {} of `{name}`, whose pose is relative to `{missing}`",
                    element.tag_name().name()
                ));
                Ok(None)
            }
        }
    }

    fn file_failure(&self, element: Node, what: &str) -> Failure {
        let at = element.document().text_pos_at(element.range().start);
        let place = format!("line {}, column {}: {what}", at.row, at.col);
        file_failure(&self.file, &place, "correct it; see http://sdformat.org")
    }
}

/// Returns the first child with a name.
fn child<'a, 'input>(element: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    element.children().find(|child| child.has_tag_name(name))
}
