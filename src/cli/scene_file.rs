//! Scenes and poses named on the command line.

use std::{fs, io, path::Path};

use miette::{LabeledSpan, MietteDiagnostic, NamedSource, Report};

use super::{Failure, output::note_input};
use crate::{
    geometry::Pose,
    scan::Session,
    scene::{PoseError, Scene, SceneError, shipped, shown, suggest},
    store::{SceneLost, logged_scene},
};

/// Reads and checks a scene: a file, or a shipped scene by its name. A file of that name wins.
///
/// # Errors
/// No such file or name, a file that can't be read, or a fault in it, shown at its line.
pub(super) fn load(path_or_name: impl AsRef<Path>) -> Result<Scene, Failure> {
    let path_or_name = path_or_name.as_ref();
    let text = read(path_or_name)?;
    let name = path_or_name.display().to_string();
    Scene::from_json(&text).map_err(|error| Failure::Input(report(&name, text, &error)))
}

/// Reads and checks a shipped scene, whatever files there are.
///
/// # Errors
/// No shipped scene of that name.
pub(super) fn shipped(name: &str) -> Result<Scene, Failure> {
    let text = shipped::text(name).ok_or_else(|| no_such_scene(name))?;
    Scene::from_json(text).map_err(|error| Failure::Input(report(name, text.to_owned(), &error)))
}

/// The scene that a session of a log was predicted in: the one that the log holds, else a shipped one
/// of its name; without either a note says so.
///
/// # Errors
/// A shipped scene with a fault, which there is none of.
pub(super) fn of_session(log: &Path, session: &Session) -> Result<Option<Scene>, Failure> {
    let lost = match logged_scene(session, log) {
        Ok(scene) => return Ok(scene),
        Err(lost) => lost,
    };
    let named = session.scene.as_ref().map(|scene| &*scene.name).unwrap_or_default();
    if matches!(lost, SceneLost::Changed(_)) {
        notice!("warning: {}: {lost}", log.display());
    }
    if shipped::text(named).is_some() {
        return shipped(named).map(Some);
    }
    notice!(
        "note: {}: {lost}, and it does not come with sonard: give its file with --scene; until then \
         it is taken as unknown",
        log.display()
    );
    Ok(None)
}

/// The pose meant by `X,Y,DEG` or a name, if a ranger can stand there.
///
/// # Errors
/// No such pose, or one outside the room, in a body or on a wall.
pub(super) fn pose(scene: &Scene, spec: &str) -> Result<Pose, Failure> {
    let refuse = |error: PoseError| Failure::input(&error, error.help());
    let pose = scene.pose(spec).map_err(refuse)?;
    scene.check_pose(&pose).map_err(refuse)?;
    Ok(pose)
}

/// The text of a scene, by its file or name.
pub(super) fn read(path_or_name: impl AsRef<Path>) -> Result<String, Failure> {
    let path = path_or_name.as_ref();
    note_input(path);
    // No shipped scene has a name that is no text.
    let name = path.to_string_lossy();
    let bytes = match fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return shipped::text(&name).map(str::to_owned).ok_or_else(|| no_such_scene(&name));
        }
        Err(error) => {
            return Err(Failure::input(
                format!("cannot read the scene {name}: {error}"),
                "give a scene file that you may read, or the name of a shipped scene",
            ));
        }
    };
    String::from_utf8(bytes).map_err(|error| {
        Failure::input(
            format!(
                "the scene {name} is not UTF-8 text: byte {} is wrong",
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
        format!("there is no scene file `{path_or_name}` and no shipped scene of that name"),
        suggest(&stem, &names, "shipped scenes"),
    )
}

/// Lines up to this length are shown whole, bytes.
const LONGEST_LINE: usize = 400;

/// So are parts of the file up to this length.
const LONGEST_PART: usize = 10_000;

/// Shows the line of the file that is wrong. The headline alone says `file:line:column` too,
/// for whoever greps.
fn report(name: &str, text: String, error: &SceneError) -> Report {
    let label = if error.path.is_empty() { "here".to_owned() } else { shown(&error.path) };
    let diagnostic = MietteDiagnostic::new(format!("{name}:{error}")).with_help(error.help());
    let (before, after) = text.split_at(error.span.start);
    let near = before.rsplit('\n').take(3).chain(after.split('\n').take(3));
    let longest = near.map(str::len).max().unwrap_or_default();
    if longest > LONGEST_LINE || error.span.len() > LONGEST_PART {
        // The place says line and column; a line of a hundred megabytes would say nothing more.
        let excerpt: String = after.chars().take(LONGEST_LINE).collect();
        return Report::new(diagnostic.with_help(format!(
            "{}\nthere: {}",
            error.help(),
            shown(&excerpt)
        )));
    }
    let diagnostic = diagnostic.with_label(LabeledSpan::at(error.span.clone(), label));
    Report::new(diagnostic).with_source_code(NamedSource::new(name, text).with_language("json"))
}
