//! Scenes and poses named on the command line.

use std::{fs, io, path::Path};

use super::{Diagnostic, Failure, output::register_input};
use crate::{
    geometry::Pose,
    scan::Session,
    scene::{PoseError, Scene, SceneError, sanitize, shipped, suggest},
    store::{SceneUnavailable, logged_scene},
};

/// Reads and checks a scene from a file, or else the shipped scene of that name.
///
/// # Errors
///
/// No such file or name, an unreadable file, or an error in it, reported with its line.
pub(super) fn load(path_or_name: impl AsRef<Path>) -> Result<Scene, Failure> {
    let path_or_name = path_or_name.as_ref();
    let text = read(path_or_name)?;
    let name = path_or_name.display().to_string();
    Scene::from_json(&text).map_err(|error| Failure::Input(describe(&name, text, &error)))
}

/// Reads and checks a shipped scene, ignoring files of that name.
///
/// # Errors
///
/// No shipped scene of that name.
pub(super) fn shipped(name: &str) -> Result<Scene, Failure> {
    let text = shipped::text(name).ok_or_else(|| no_such_scene(name))?;
    Scene::from_json(text).map_err(|error| Failure::Input(describe(name, text.to_owned(), &error)))
}

/// Returns the scene of a session's predictions: the one in the log, or else the shipped scene of
/// that name; otherwise `None`, with a notice.
///
/// # Errors
///
/// An invalid shipped scene.
pub(super) fn of_session(log: &Path, session: &Session) -> Result<Option<Scene>, Failure> {
    let lost = match logged_scene(session, log) {
        Ok(scene) => return Ok(scene),
        Err(lost) => lost,
    };
    let named = session.scene.as_ref().map(|scene| &*scene.name).unwrap_or_default();
    if matches!(lost, SceneUnavailable::Changed(_)) {
        notice!("warning: {}: {lost}", log.display());
    }
    if shipped::text(named).is_some() {
        return shipped(named).map(Some);
    }
    notice!(
        "note: {}: {lost}, and it is not shipped with sonard: give its file with --scene; the scene \
         is unknown",
        log.display()
    );
    Ok(None)
}

/// Parses a pose, `X,Y,DEG` or a name, and checks that it is free.
///
/// # Errors
///
/// No such pose, or a pose outside the room, in a body or on a wall.
pub(super) fn pose(scene: &Scene, spec: &str) -> Result<Pose, Failure> {
    let refuse = |error: PoseError| Failure::input(&error, error.help());
    let pose = scene.pose(spec).map_err(refuse)?;
    scene.check_pose(&pose).map_err(refuse)?;
    Ok(pose)
}

/// Reads the text of a scene, by its file or name.
pub(super) fn read(path_or_name: impl AsRef<Path>) -> Result<String, Failure> {
    let path = path_or_name.as_ref();
    register_input(path);
    // All names of shipped scenes are UTF-8.
    let name = path.to_string_lossy();
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return shipped::text(&name).map(str::to_owned).ok_or_else(|| no_such_scene(&name));
        }
        Err(error) => {
            return Err(Failure::input(
                format!("cannot read the scene {name}: {error}"),
                "give a readable scene file, or the name of a shipped scene",
            ));
        }
    };
    String::from_utf8(bytes).map_err(|error| {
        Failure::input(
            format!(
                "the scene {name} is not UTF-8 text: invalid byte {}",
                error.utf8_error().valid_up_to()
            ),
            "a scene is a JSON text file; `sonard scene schema` describes it",
        )
    })
}

fn no_such_scene(path_or_name: &str) -> Failure {
    let names: Vec<String> = shipped::names().map(str::to_owned).collect();
    let stem = Path::new(path_or_name).file_stem().unwrap_or_default().to_string_lossy();
    Failure::input(
        format!("no scene file `{path_or_name}` and no shipped scene of that name"),
        suggest(&stem, &names, "shipped scenes"),
    )
}

/// Maximum length of a line shown in full, bytes.
const MAX_LINE_BYTES: usize = 400;

/// Maximum length of a file region shown in full, bytes.
const MAX_REGION_BYTES: usize = 10_000;

/// Describes an error with the affected lines of the file. The message begins with
/// `file:line:column`.
fn describe(name: &str, text: String, error: &SceneError) -> Diagnostic {
    let message = format!("{name}:{error}");
    let (before, after) = text.split_at(error.span.start);
    let near = before.rsplit('\n').take(3).chain(after.split('\n').take(3));
    let longest = near.map(str::len).max().unwrap_or_default();
    if longest > MAX_LINE_BYTES || error.span.len() > MAX_REGION_BYTES {
        // Line and column suffice for a very long line, of which an excerpt is shown.
        let excerpt: String = after.chars().take(MAX_LINE_BYTES).collect();
        let help = format!("{}\nthere: {}", error.help(), sanitize(&excerpt));
        return Diagnostic::new(message, help);
    }
    let label = if error.path.is_empty() { "here".to_owned() } else { sanitize(&error.path) };
    Diagnostic::new(message, error.help()).with_excerpt(text, error.span.clone(), label)
}
