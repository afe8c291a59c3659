//! The scenes that come with the program, so that an installed binary knows them by name.

/// A shipped scene: its name and the text of its file.
pub const SCENES: &[(&str, &str)] =
    &[("simple-room", include_str!("../../scenes/simple-room.json"))];

/// The text of a shipped scene.
#[must_use]
pub fn text(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Names of the shipped scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|(name, _)| *name)
}
