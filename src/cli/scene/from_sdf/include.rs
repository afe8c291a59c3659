//! Models included by a world, read from files next to it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use roxmltree::{Document, Node};

use super::{
    super::super::{Outcome, output::register_input},
    Scope, World, child,
    state::State,
};

/// Maximum nesting depth of included files.
const MAX_DEPTH: usize = 8;
/// Maximum size of an included file, bytes.
const MAX_BYTES: u64 = 64 << 20;

impl World<'_> {
    /// Adds the model of an `include`, or notes that it is not available.
    pub(super) fn include<'n>(
        &mut self,
        include: Node<'n, 'n>,
        scope: &Scope<'_, 'n>,
        state: &State<'_, 'n>,
    ) -> Outcome {
        let text = |name: &str| child(include, name).and_then(|node| node.text()).map(str::trim);
        let uri = text("uri").unwrap_or_default();
        let Some(path) = self.local(uri).filter(|_| self.depth < MAX_DEPTH) else {
            return self.ignore(uri);
        };
        register_input(&path);
        let Ok(file) = fs::read_to_string(&path) else { return self.ignore(uri) };
        let Ok(document) = Document::parse(&file) else { return self.ignore(uri) };
        let Some(model) = document.descendants().find(|node| node.has_tag_name("model")) else {
            return self.ignore(uri);
        };
        let own = text("name").or_else(|| model.attribute("name"));
        let name = own.unwrap_or("body").to_owned();
        if state.is_deleted(&name) {
            return Ok(());
        }
        // The pose of the include replaces that of the model.
        let frame = match state.of_model(&name).pose(self)? {
            Some(frame) => Some(frame),
            None if child(include, "pose").is_some() => self.placed(include, scope, &name)?,
            None => match child(model, "pose") {
                Some(pose) => Some(scope.frame * self.pose(pose)?),
                None => Some(scope.frame),
            },
        };
        let Some(frame) = frame else { return Ok(()) };
        let scale = scope.scale * state.of_model(&name).scale(self)?;
        let outer = std::mem::replace(&mut self.file, path);
        self.depth += 1;
        let inner = Scope { element: model, frame, scale, name: &name, outer: None };
        let added = self.add_members(&inner, &State::default());
        self.depth -= 1;
        self.file = outer;
        added
    }

    fn ignore(&mut self, uri: &str) -> Outcome {
        self.found.count_ignored("models from elsewhere (include)");
        self.notes.push(format!(
            "ignored: the model `{uri}`; put its folder next to the world to include it"
        ));
        Ok(())
    }

    /// Returns the file of a model in the world's folder or below it.
    fn local(&self, uri: &str) -> Option<PathBuf> {
        let folder = self.file.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        let name = ["model://", "file://"].iter().find_map(|scheme| uri.strip_prefix(scheme));
        let name = name.unwrap_or(uri);
        if name.is_empty() || name.contains("://") {
            return None;
        }
        let within = |path: &Path| {
            let (path, folder) = (path.canonicalize().ok()?, folder.canonicalize().ok()?);
            let is_short =
                fs::metadata(&path).is_ok_and(|file| file.is_file() && file.len() <= MAX_BYTES);
            (path.starts_with(folder) && is_short).then_some(path)
        };
        let places = [folder.join(name), folder.join("models").join(name)];
        places.iter().find_map(|place| within(place).or_else(|| within(&place.join("model.sdf"))))
    }
}
