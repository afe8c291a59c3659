//! Storage of scene texts: in the session record, or, if too long for a line, in a separate file
//! named by its hash in the log's folder.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sonard_model::scene::Scene;
use sonard_records::{Record, SceneRef, Session};
use thiserror::Error;

use super::{AtomicFile, StoreError};

/// Maximum length of a scene's text in a session record, bytes: its escaped form fits in a line.
pub const MAX_LOGGED_SCENE_BYTES: usize = 1 << 18;

/// Subfolder for longer texts, in files `SHA256.json`.
const FOLDER: &str = "scenes";

/// Reason why the scene of a log is unavailable.
#[derive(Debug, Error)]
pub enum SceneUnavailable {
    /// Scene missing from the record and from the folder for long texts.
    #[error("the log does not contain its scene `{}`", .0.name)]
    Missing(SceneRef),
    /// Scene whose text differs from the one that the model used.
    #[error("the log's text of its scene `{}` was changed: its SHA-256 differs", .0.name)]
    Changed(SceneRef),
}

/// Reads the scene of a session's predictions from the log at `log`; `None` for a session without
/// scene.
///
/// # Errors
/// Returns an error if the scene's text is missing or was changed.
pub fn logged_scene(session: &Session, log: &Path) -> Result<Option<Scene>, SceneUnavailable> {
    let Some(named) = &session.scene else { return Ok(None) };
    let from_file = || fs::read_to_string(scene_path(log, &named.sha256)?).ok();
    let text = match &session.scene_text {
        Some(text) => text.to_string(),
        None => from_file().ok_or_else(|| SceneUnavailable::Missing(named.clone()))?,
    };
    match Scene::from_json(&text) {
        Ok(scene) if scene.sha256 == named.sha256 => Ok(Some(scene)),
        _ => Err(SceneUnavailable::Changed(named.clone())),
    }
}

/// Path of the file for a scene with this hash; `None` if the text is not a SHA-256.
fn scene_path(log: &Path, sha256: &str) -> Option<PathBuf> {
    let is_hash = sha256.len() == 64 && sha256.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_hash.then(|| log.with_file_name(FOLDER).join(format!("{sha256}.json")))
}

/// Writer of scene texts that stores each text once per log.
#[derive(Debug, Default)]
pub(super) struct SceneStore {
    /// Path of the log, if long texts may be stored in its folder.
    log: Option<PathBuf>,
    /// Hash of the last written scene.
    last: Option<String>,
}

impl SceneStore {
    /// Creates a store that writes long texts into the folder of `log`.
    pub(super) fn in_folder_of(log: &Path) -> Self {
        Self { log: Some(log.into()), last: None }
    }

    /// Returns the session without its scene text if the text is already stored or too long for the
    /// record; a long text is written to its file.
    pub(super) fn without_text(&self, record: &Record) -> Result<Option<Record>, StoreError> {
        let Some((session, scene, text)) = scene_in(record) else { return Ok(None) };
        let known = self.last.as_ref() == Some(&scene.sha256);
        if !known && text.len() <= MAX_LOGGED_SCENE_BYTES {
            return Ok(None);
        }
        if !known && let Some(log) = &self.log {
            write_text(log, scene, text)?;
        }
        Ok(Some(Record::Session(Box::new(Session { scene_text: None, ..session.clone() }))))
    }

    /// Notes that the log contains the record.
    pub(super) fn record_written(&mut self, record: &Record) {
        if let Some((_, scene, _)) = scene_in(record) {
            self.last = Some(scene.sha256.clone());
        }
    }
}

fn scene_in(record: &Record) -> Option<(&Session, &SceneRef, &str)> {
    let Record::Session(session) = record else { return None };
    Some((session, session.scene.as_ref()?, session.scene_text.as_deref()?))
}

/// Writes a scene's text into the log's folder, unless the file exists.
fn write_text(log: &Path, scene: &SceneRef, text: &str) -> Result<(), StoreError> {
    let Some(path) = scene_path(log, &scene.sha256) else { return Ok(()) };
    if path.exists() {
        return Ok(());
    }
    let write = || {
        fs::create_dir_all(path.parent().unwrap_or(log))?;
        AtomicFile::write(&path, text.as_bytes())
    };
    write().map_err(|source| StoreError::Write { path: path.clone(), source })
}
