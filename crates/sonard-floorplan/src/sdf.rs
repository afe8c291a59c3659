//! Worlds and models of Gazebo (SDF).

mod frames;
mod include;
mod shapes;
mod state;

use std::path::PathBuf;

use glam::{DAffine3, DVec3};
pub use include::{Library, NoLibrary};
use roxmltree::Node;
use sonard_model::scene::Surfaces;

use crate::{FloorPlan, PlanError, xml};
use frames::Scope;
use state::State;

/// Options of reading a world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SdfOptions {
    /// Height of the horizontal slice, that of the ranger, metres.
    pub cut_z_m: f64,
}

/// Advice for a file that is not a world.
const HELP: &str = "give an SDF file for Gazebo";
/// Maximum nesting depth of models.
const MAX_NESTING: usize = 64;

/// Result of adding elements.
type Added = Result<(), PlanError>;

/// Reads the walls of a world at the height of the ranger.
///
/// # Errors
/// Returns an error for a file that is not SDF, with the position of an invalid value.
pub fn read(
    bytes: &[u8],
    options: &SdfOptions,
    library: &dyn Library,
) -> Result<FloorPlan, PlanError> {
    let text = xml::text(bytes, HELP)?;
    let document = xml::parse(&text, HELP)?;
    let root = document.root_element();
    if !root.has_tag_name("sdf") {
        let what = format!("the root element is {}, not sdf", root.tag_name().name());
        return Err(PlanError::new(what, HELP));
    }
    let mut world = World {
        options: *options,
        library,
        found: Surfaces::default(),
        notes: Vec::new(),
        further_notes: 0,
        file: None,
        depth: 0,
        includes: 0,
        included_bytes: 0,
        nesting: 0,
        at_other_heights: 0,
    };
    world.add_worlds(root)?;
    if world.at_other_heights > 0 {
        let (count, cut_z_m) = (world.at_other_heights, options.cut_z_m);
        world.notes.push(format!("{count} shapes are above or below the slice at {cut_z_m} m"));
    }
    if world.further_notes > 0 {
        world.notes.push(format!("{} further notes", world.further_notes));
    }
    Ok(FloorPlan { surfaces: world.found, notes: world.notes })
}

/// Surfaces and notes collected so far.
struct World<'a> {
    options: SdfOptions,
    library: &'a dyn Library,
    found: Surfaces,
    /// Notes on ignored objects.
    notes: Vec<String>,
    /// Number of notes beyond [`MAX_NOTES`].
    further_notes: u64,
    /// File that is included; `None` for the world itself.
    file: Option<PathBuf>,
    /// Nesting depth and number of included files.
    depth: usize,
    includes: usize,
    /// Total size of the included files, with repetitions.
    included_bytes: usize,
    /// Nesting depth of models.
    nesting: usize,
    /// Number of shapes above or below the slice.
    at_other_heights: usize,
}

/// Model with collision shapes: its name and scale.
#[derive(Clone, Copy)]
struct Body<'n> {
    name: &'n str,
    scale: DVec3,
}

/// Maximum number of notes.
const MAX_NOTES: usize = 100;

impl World<'_> {
    /// Adds a note, once; beyond [`MAX_NOTES`] notes are counted.
    fn note(&mut self, note: String) {
        if self.notes.len() == MAX_NOTES {
            self.further_notes += 1;
        } else if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Adds the worlds of a file, and the models outside them.
    fn add_worlds(&mut self, root: Node) -> Added {
        let mut worlds = 0;
        for child in root.children().filter(Node::is_element) {
            if child.has_tag_name("world") {
                worlds += 1;
                if worlds > 1 {
                    let name = child.attribute("name").unwrap_or("without a name");
                    self.note(format!("ignored: world `{name}`, which is not the first"));
                    continue;
                }
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
    fn add_members(&mut self, scope: &Scope, state: &State) -> Added {
        for child in scope.element.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "model" => self.add_model(child, scope, state)?,
                "link" => self.add_link(child, scope, state)?,
                "include" => self.include(child, scope, state)?,
                kind @ ("population" | "actor") => {
                    let name = child.attribute("name").unwrap_or("without a name");
                    self.note(format!("ignored: {kind} `{name}`"));
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
    ) -> Added {
        let name = model.attribute("name").unwrap_or("body");
        if state.is_deleted(name) {
            return Ok(());
        }
        let Some(frame) = self.frame_of_model(model, name, scope, state)? else { return Ok(()) };
        let state = state.of_model(name);
        let scale = scope.scale * state.scale(self)?;
        if self.nesting == MAX_NESTING {
            self.note(format!("ignored: model `{name}`, which is nested too deeply"));
            return Ok(());
        }
        let inner = Scope { element: model, frame, scale, name, outer: Some(scope) };
        self.nesting += 1;
        let added = self.add_members(&inner, &state);
        self.nesting -= 1;
        added
    }

    /// Returns the frame of a model: that of the state, or else its own pose.
    fn frame_of_model<'n>(
        &mut self,
        model: Node<'n, 'n>,
        name: &str,
        scope: &Scope<'_, 'n>,
        state: &State<'_, 'n>,
    ) -> Result<Option<DAffine3>, PlanError> {
        if model.attribute("placement_frame").is_some_and(|frame| !frame.is_empty()) {
            self.note(format!("ignored: model `{name}`, which uses placement_frame"));
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
    ) -> Added {
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
    ) -> Result<Option<DAffine3>, PlanError> {
        match self.frame(element, scope, 0)? {
            Ok(frame) => Ok(Some(frame)),
            Err(missing) => {
                self.found.count_ignored("poses relative to missing frames");
                self.note(format!(
                    "ignored: {} of `{name}`, whose pose is relative to `{missing}`",
                    element.tag_name().name()
                ));
                Ok(None)
            }
        }
    }

    fn invalid(&self, element: Node, what: &str) -> PlanError {
        let at = element.document().text_pos_at(element.range().start);
        let what = format!("line {}, column {}: {what}", at.row, at.col);
        let mut error = PlanError::new(what, "correct it; see http://sdformat.org");
        error.file.clone_from(&self.file);
        error
    }
}

/// Returns the first child with a name.
fn child<'a, 'input>(element: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    element.children().find(|child| child.has_tag_name(name))
}
