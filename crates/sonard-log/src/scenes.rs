//! Where a log has the text of its scene: in the session's record, or, if it is too long for a
//! line, in a file beside the log that is named by its hash.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sonard_model::scene::Scene;
use sonard_records::{Record, SceneRef, Session};
use thiserror::Error;

use super::{StoreError, WholeFile};

/// Longest text of a scene that a session's record carries, bytes: escaped, it still fits a line.
pub const MAX_LOGGED_SCENE_BYTES: usize = 1 << 18;

/// Folder beside a log for longer ones, in files `SHA256.json`.
const FOLDER: &str = "scenes";

/// The reason why a log's scene can't be read from the log.
#[derive(Debug, Error)]
pub enum SceneLost {
    /// Absent from the record, and from the folder for scenes that are too long for a line.
    #[error("the log does not hold its scene `{}`", .0.name)]
    NotThere(SceneRef),
    /// The text is not the one that the model used.
    #[error("the log's text of its scene `{}` was changed: its SHA-256 differs", .0.name)]
    Changed(SceneRef),
}

/// The scene that a session's model was given, as the log at `log` has it; `None` if it was given
/// none.
///
/// # Errors
/// When the log does not have it, or not unchanged.
pub fn logged_scene(session: &Session, log: &Path) -> Result<Option<Scene>, SceneLost> {
    let Some(named) = &session.scene else { return Ok(None) };
    let beside = || fs::read_to_string(path_beside(log, &named.sha256)?).ok();
    let text = match &session.scene_text {
        Some(text) => text.to_string(),
        None => beside().ok_or_else(|| SceneLost::NotThere(named.clone()))?,
    };
    match Scene::from_json(&text) {
        Ok(scene) if scene.sha256 == named.sha256 => Ok(Some(scene)),
        _ => Err(SceneLost::Changed(named.clone())),
    }
}

/// Where the text of a scene with this hash would be; `None` for what is no hash.
fn path_beside(log: &Path, sha256: &str) -> Option<PathBuf> {
    let is_hash = sha256.len() == 64 && sha256.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_hash.then(|| log.with_file_name(FOLDER).join(format!("{sha256}.json")))
}

/// Sees to it that a log has the text of a scene once.
#[derive(Debug, Default)]
pub(super) struct SceneKeeper {
    /// The log, if texts may be kept beside it.
    log: Option<PathBuf>,
    /// Hash of the scene whose text was written last.
    last: Option<String>,
}

impl SceneKeeper {
    /// Keeps long texts beside `log`.
    pub(super) fn beside(log: &Path) -> Self {
        Self { log: Some(log.into()), last: None }
    }

    /// What is to be written in place of a session whose scene's text must not stand in it; the text
    /// is then in the log already, or beside it.
    pub(super) fn shortened(&self, record: &Record) -> Result<Option<Record>, StoreError> {
        let Some((session, scene, text)) = scene_in(record) else { return Ok(None) };
        let known = self.last.as_ref() == Some(&scene.sha256);
        if !known && text.len() <= MAX_LOGGED_SCENE_BYTES {
            return Ok(None);
        }
        if !known && let Some(log) = &self.log {
            keep(log, scene, text)?;
        }
        Ok(Some(Record::Session(Box::new(Session { scene_text: None, ..session.clone() }))))
    }

    /// The record is in the log.
    pub(super) fn written(&mut self, record: &Record) {
        if let Some((_, scene, _)) = scene_in(record) {
            self.last = Some(scene.sha256.clone());
        }
    }
}

fn scene_in(record: &Record) -> Option<(&Session, &SceneRef, &str)> {
    let Record::Session(session) = record else { return None };
    Some((session, session.scene.as_ref()?, session.scene_text.as_deref()?))
}

/// Keeps a text beside the log, unless it is there.
fn keep(log: &Path, scene: &SceneRef, text: &str) -> Result<(), StoreError> {
    let Some(path) = path_beside(log, &scene.sha256) else { return Ok(()) };
    if path.exists() {
        return Ok(());
    }
    let write = || {
        fs::create_dir_all(path.parent().unwrap_or(log))?;
        WholeFile::write(&path, text.as_bytes())
    };
    write().map_err(|source| StoreError::Write { path: path.clone(), source })
}
