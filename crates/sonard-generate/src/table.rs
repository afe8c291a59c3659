//! The tables of a shard and their columns.

use serde::{Deserialize, Serialize};
use sonard_export::{Field, Kind};

use crate::spec::{KeepKeys, Spec};

/// A table of a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Table {
    /// A scene a row: what was drawn for it, and its file.
    Scenes,
    /// A firing a row.
    Readings,
    /// An echo of a firing a row.
    Echoes,
    /// A plane, corner, edge or cylinder of a scene a row.
    Features,
    /// The map of a scene as it should be, a scene a row.
    Occupancy,
}

/// A column with what it means.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Described {
    pub(crate) field: Field,
    pub(crate) about: &'static str,
}

impl Table {
    /// Those of a specification, in the order in which they are written.
    pub(crate) fn of(spec: &Spec) -> Vec<Self> {
        let keep = &spec.keep;
        [
            (Self::Scenes, true),
            (Self::Readings, true),
            (Self::Echoes, keep.echoes_down_to > 0.0),
            (Self::Features, keep.features),
            (Self::Occupancy, keep.occupancy_m > 0.0),
        ]
        .into_iter()
        .filter_map(|(table, is_kept)| is_kept.then_some(table))
        .collect()
    }

    /// Its file's name.
    #[must_use]
    pub const fn file(self) -> &'static str {
        match self {
            Self::Scenes => "scenes.parquet",
            Self::Readings => "readings.parquet",
            Self::Echoes => "echoes.parquet",
            Self::Features => "features.parquet",
            Self::Occupancy => "occupancy.parquet",
        }
    }

    /// What one of its rows is.
    pub(crate) const fn row(self) -> &'static str {
        match self {
            Self::Scenes => "scene",
            Self::Readings => "reading",
            Self::Echoes => "echo",
            Self::Features => "feature",
            Self::Occupancy => "map",
        }
    }

    /// What it has columns for, with what is kept of readings.
    pub(crate) fn columns(self, keep: &KeepKeys) -> Vec<Described> {
        match self {
            Self::Scenes => SCENES.to_vec(),
            Self::Readings => readings(keep),
            Self::Echoes => ECHOES.to_vec(),
            Self::Features => FEATURES.to_vec(),
            Self::Occupancy => OCCUPANCY.to_vec(),
        }
    }
}

const fn column(name: &'static str, kind: Kind, is_single: bool, about: &'static str) -> Described {
    Described { field: Field { name, kind, is_single }, about }
}

const fn text(name: &'static str, about: &'static str) -> Described {
    column(name, Kind::Text, false, about)
}

const fn integer(name: &'static str, about: &'static str) -> Described {
    column(name, Kind::Integer, false, about)
}

const fn number(name: &'static str, about: &'static str) -> Described {
    column(name, Kind::Number, false, about)
}

const fn single(name: &'static str, about: &'static str) -> Described {
    column(name, Kind::Number, true, about)
}

const SCENE: Described = integer("scene", "number of the scene in the set, from 1");
const POSE: Described = integer("pose", "number of the pose in its scene, from 1");
const INDEX: Described = integer("index", "number of the firing in its scan, from 0");

const SCENES: &[Described] = &[
    SCENE,
    integer("kind", "kind of scene: which [[scene]] of the specification, from 1"),
    text("sensor", "name of the sensor"),
    number("sensor_z_m", "height of the transducer, metres; null in a plan"),
    number("temperature_c", "temperature of the air, degrees Celsius"),
    number("humidity_percent", "relative humidity, percent"),
    number("pressure_kpa", "static pressure, kilopascals"),
    number("sound_speed_m_s", "speed of sound, metres a second"),
    number("noise_floor", "noise at the receiver's input, as the amplitude of an echo from 1 m"),
    number("jitter_us", "standard deviation of the time of flight beside it, microseconds"),
    text("scene_text", "the scene's file, for `sonard simulate --scene` and others"),
];

const FIRING: [Described; 7] = [
    SCENE,
    POSE,
    INDEX,
    number("x_m", "where the rotation axis stands, metres"),
    number("y_m", "the same"),
    number("heading_deg", "where azimuth 0 points, degrees counter-clockwise from +x"),
    number("azimuth_deg", "of the firing, degrees counter-clockwise from the heading"),
];
const HEARD: [Described; 2] = [
    text("status", "echo, no_echo or min_range"),
    single("range_m", "range, metres; null where nothing was heard"),
];
const STRENGTH: [Described; 3] = [
    single("tof_us", "time of flight of the first echo, microseconds"),
    single("amplitude", "most of the envelope; a head-on, perfect wall gives 1"),
    single("margin_db", "the same above the threshold, decibels; of no_echo what it lacked"),
];
const PATH: [Described; 4] = [
    text("path_kind", "specular, diffracted or scattered"),
    integer("path_order", "mirror reflections on the way"),
    single("path_length_m", "length of the path there and back, metres"),
    text("path", "what the sound met, in order"),
];
const IDEAL: Described =
    single("ideal_range_m", "distance straight ahead to the nearest surface, metres; null if none");
const FEATURE: Described = text(
    "feature",
    "what was heard: plane, corner, edge, cylinder, level (floor, ceiling), rough, or multiple reflections; null if \
     nothing",
);
const ENVELOPE: Described = column(
    "envelope",
    Kind::Numbers,
    false,
    "envelope of the firing from time 0 on, a sample every keep.trace_step_us; without noise",
);

fn readings(keep: &KeepKeys) -> Vec<Described> {
    let parts: [(&[Described], bool); 7] = [
        (&FIRING, true),
        (&HEARD, true),
        (&STRENGTH, keep.strength),
        (&PATH, keep.path),
        (&[IDEAL], keep.ideal_range),
        (&[FEATURE], keep.features),
        (&[ENVELOPE], keep.trace_to_m > 0.0),
    ];
    parts.into_iter().filter(|(_, is_kept)| *is_kept).flat_map(|(part, _)| part.to_vec()).collect()
}

const ECHOES: &[Described] = &[
    SCENE,
    POSE,
    INDEX,
    text("path_kind", "specular, diffracted or scattered"),
    integer("path_order", "mirror reflections on the way"),
    single("path_length_m", "length of the path there and back, metres"),
    single("amplitude", "strength after gain and beam pattern; a head-on, perfect wall gives 1"),
    text("path", "what the sound met, in order"),
];

const FEATURES: &[Described] = &[
    SCENE,
    text("kind", "plane, corner, edge or cylinder"),
    text("id", "names of the walls or of the cylinder"),
    number("x_m", "one end of a plane, the place of others, metres"),
    number("y_m", "the same"),
    number("to_x_m", "the other end of a plane, metres"),
    number("to_y_m", "the same"),
    number("radius_m", "of a cylinder, metres"),
    number("opening_deg", "of corner and edge: angle between the walls on the open side, degrees"),
];

const OCCUPANCY: &[Described] = &[
    SCENE,
    number("origin_x_m", "lower left corner of the map, metres"),
    number("origin_y_m", "the same"),
    number("resolution_m", "side of a cell, metres"),
    integer("width", "cells in x"),
    integer("height", "cells in y"),
    column(
        "cells",
        Kind::Integers,
        false,
        "row by row from the lower left corner: 0 free, 1 occupied, 2 out of reach of the poses",
    ),
];
