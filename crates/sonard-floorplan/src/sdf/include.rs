//! Models included by a world.

use std::{
    fmt::Display,
    path::{Path, PathBuf},
};

use roxmltree::Node;

use super::{Added, Scope, World, child, state::State};
use crate::{MAX_FILE_BYTES, xml};

/// Source of the models that a world includes.
pub trait Library {
    /// Returns path and content of a model's file by its URI (`model://table`), or `None` if it is
    /// not available; `from` is the file that includes it, `None` for the world.
    fn model(&self, uri: &str, from: Option<&Path>) -> Option<(PathBuf, Vec<u8>)>;
}

/// Library without models.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoLibrary;

impl Library for NoLibrary {
    fn model(&self, _: &str, _: Option<&Path>) -> Option<(PathBuf, Vec<u8>)> {
        None
    }
}

/// Maximum nesting depth, number and total size of included files, with repetitions: a few files
/// that include each other would take hours otherwise.
const MAX_DEPTH: usize = 8;
const MAX_INCLUDES: usize = 10_000;
const MAX_INCLUDED_BYTES: usize = 4 * MAX_FILE_BYTES;

impl World<'_> {
    /// Adds the model of an `include`, or notes that it is not available.
    pub(super) fn include<'n>(
        &mut self,
        include: Node<'n, 'n>,
        scope: &Scope<'_, 'n>,
        state: &State<'_, 'n>,
    ) -> Added {
        let text = |name: &str| child(include, name).and_then(|node| node.text()).map(str::trim);
        let uri = text("uri").unwrap_or_default();
        let limit = if self.depth == MAX_DEPTH {
            Some(format!("{MAX_DEPTH} nested files"))
        } else if self.includes == MAX_INCLUDES {
            Some(format!("{MAX_INCLUDES} included files"))
        } else if self.included_bytes > MAX_INCLUDED_BYTES {
            Some(format!("{} MB of included files", MAX_INCLUDED_BYTES >> 20))
        } else {
            None
        };
        if let Some(limit) = limit {
            return self.ignore(format!("ignored: the model `{uri}`: more than {limit}"));
        }
        self.includes += 1;
        let Some((path, bytes)) = self.library.model(uri, self.file.as_deref()) else {
            return self.ignore(format!(
                "ignored: the model `{uri}`; put its folder next to the world to include it"
            ));
        };
        self.included_bytes += bytes.len();
        let ignored =
            |why: &dyn Display| format!("ignored: the model `{uri}`: {}: {why}", path.display());
        let file = match xml::text(&bytes, "") {
            Ok(file) => file,
            Err(error) => return self.ignore(ignored(&error)),
        };
        let document = match xml::parse(&file, "") {
            Ok(document) => document,
            Err(error) => return self.ignore(ignored(&error)),
        };
        let Some(model) = document.descendants().find(|node| node.has_tag_name("model")) else {
            return self.ignore(ignored(&"no model"));
        };
        let own = text("name").or_else(|| model.attribute("name"));
        let name = own.unwrap_or("body").to_owned();
        if state.is_deleted(&name) {
            return Ok(());
        }
        // The pose of the include replaces that of the model.
        let state = state.of_model(&name);
        let frame = match state.pose(self)? {
            Some(frame) => Some(frame),
            None if child(include, "pose").is_some() => self.placed(include, scope, &name)?,
            None => match child(model, "pose") {
                Some(pose) => Some(scope.frame * self.pose(pose)?),
                None => Some(scope.frame),
            },
        };
        let Some(frame) = frame else { return Ok(()) };
        let scale = scope.scale * state.scale(self)?;
        let outer = self.file.replace(path);
        self.depth += 1;
        let inner = Scope { element: model, frame, scale, name: &name, outer: None };
        let added = self.add_members(&inner, &state);
        self.depth -= 1;
        self.file = outer;
        added
    }

    fn ignore(&mut self, note: String) -> Added {
        self.found.count_ignored("models from elsewhere (include)");
        self.note(note);
        Ok(())
    }
}
