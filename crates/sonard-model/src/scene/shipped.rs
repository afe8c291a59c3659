//! Scenes included in the program, available by name from an installed binary.

/// Shipped scenes: names and texts of their files.
pub const SCENES: &[(&str, &str)] = &[
    ("simple-room", include_str!("../../../../scenes/simple-room.json")),
    ("simple-room-robot", include_str!("../../../../scenes/simple-room-robot.json")),
    ("echo-traces", include_str!("../../../../scenes/echo-traces.json")),
    ("mcgill-lab", include_str!("../../../../scenes/mcgill-lab.json")),
    ("oblique-corner", include_str!("../../../../scenes/oblique-corner.json")),
    ("right-angle-corner", include_str!("../../../../scenes/right-angle-corner.json")),
    ("two-surface-room", include_str!("../../../../scenes/two-surface-room.json")),
    ("corridor", include_str!("../../../../scenes/corridor.json")),
    ("plane-corner-edge", include_str!("../../../../scenes/plane-corner-edge.json")),
];

/// Text of a shipped scene, if there is one of that name.
#[must_use]
pub fn text(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Names of the shipped scenes, in order.
pub fn names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|(name, _)| *name)
}
