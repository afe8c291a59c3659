//! Tables of a shard and their columns.

use serde::{Deserialize, Serialize};
use sonard_export::{ColumnKind, ColumnType};

use crate::spec::{KeepKeys, Spec};

/// Table of a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShardTable {
    /// Scenes, one per row, with sampled values and the scene file.
    Scenes,
    /// Readings, one firing per row.
    Readings,
    /// Echoes, one arrival of a firing per row.
    Echoes,
    /// Planes, corners, edges and cylinders of the scenes, one per row.
    Features,
    /// True occupancy maps, one scene per row.
    Occupancy,
}

/// Column with its description for the data card.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ColumnInfo {
    pub(crate) field: ColumnType,
    pub(crate) about: &'static str,
}

impl ShardTable {
    /// Returns the tables of a specification, in writing order.
    pub(crate) fn for_spec(spec: &Spec) -> Vec<Self> {
        let keep = &spec.keep;
        [
            (Self::Scenes, true),
            (Self::Readings, true),
            (Self::Echoes, keep.min_echo_amplitude > 0.0),
            (Self::Features, keep.features),
            (Self::Occupancy, keep.occupancy_m > 0.0),
        ]
        .into_iter()
        .filter_map(|(table, is_kept)| is_kept.then_some(table))
        .collect()
    }

    /// Returns the file name of the table.
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

    /// Returns the name of the row type.
    pub(crate) const fn row(self) -> &'static str {
        match self {
            Self::Scenes => "scene",
            Self::Readings => "reading",
            Self::Echoes => "echo",
            Self::Features => "feature",
            Self::Occupancy => "map",
        }
    }

    /// Returns the columns of the table, by the recorded columns of the specification.
    pub(crate) fn columns(self, keep: &KeepKeys) -> Vec<ColumnInfo> {
        match self {
            Self::Scenes => SCENES.to_vec(),
            Self::Readings => readings(keep),
            Self::Echoes => ECHOES.to_vec(),
            Self::Features => FEATURES.to_vec(),
            Self::Occupancy => OCCUPANCY.to_vec(),
        }
    }
}

const fn column(
    name: &'static str,
    kind: ColumnKind,
    is_single: bool,
    about: &'static str,
) -> ColumnInfo {
    ColumnInfo { field: ColumnType { name, kind, is_single }, about }
}

const fn text(name: &'static str, about: &'static str) -> ColumnInfo {
    column(name, ColumnKind::Text, false, about)
}

const fn integer(name: &'static str, about: &'static str) -> ColumnInfo {
    column(name, ColumnKind::Integer, false, about)
}

const fn number(name: &'static str, about: &'static str) -> ColumnInfo {
    column(name, ColumnKind::Number, false, about)
}

const fn single(name: &'static str, about: &'static str) -> ColumnInfo {
    column(name, ColumnKind::Number, true, about)
}

const SCENE: ColumnInfo = integer("scene", "number of the scene in the set, from 1");
const POSE: ColumnInfo = integer("pose", "number of the pose in its scene, from 1");
const INDEX: ColumnInfo = integer("index", "number of the firing in its scan, from 0");

const SCENES: &[ColumnInfo] = &[
    SCENE,
    integer("kind", "kind of scene: index of the [[scene]] in the specification, from 1"),
    text("sensor", "name of the sensor"),
    number("sensor_z_m", "height of the transducer, metres; null in a plan"),
    number("temperature_c", "temperature of the air, degrees Celsius"),
    number("humidity_percent", "relative humidity, percent"),
    number("pressure_kpa", "static pressure, kilopascals"),
    number("sound_speed_m_s", "speed of sound, metres per second"),
    number("noise_floor", "noise at the receiver's input, as the amplitude of an echo from 1 m"),
    number("jitter_us", "standard deviation of additional timing jitter, microseconds"),
    text("scene_text", "scene file, for `sonard simulate --scene` and other commands"),
];

const FIRING: [ColumnInfo; 7] = [
    SCENE,
    POSE,
    INDEX,
    number("x_m", "x of the rotation axis, metres"),
    number("y_m", "y of the rotation axis, metres"),
    number("heading_deg", "direction of azimuth 0, degrees counter-clockwise from +x"),
    number("azimuth_deg", "azimuth of the firing, degrees counter-clockwise from the heading"),
];
const RESULT: [ColumnInfo; 2] = [
    text("status", "echo, no_echo or min_range"),
    single("range_m", "range, metres; null without an echo"),
];
const STRENGTH: [ColumnInfo; 3] = [
    single("tof_us", "time of flight of the first echo, microseconds"),
    single("amplitude", "peak of the envelope; a perfect head-on wall gives 1"),
    single("margin_db", "peak above the threshold, decibels; negative for no_echo"),
];
const PATH: [ColumnInfo; 4] = [
    text("path_kind", "specular, diffracted or scattered"),
    integer("path_order", "number of mirror reflections"),
    single("path_length_m", "two-way length of the path, metres"),
    text("path", "surfaces along the path, in order"),
];
const IDEAL: ColumnInfo = single(
    "ideal_range_m",
    "distance along the beam axis to the nearest surface, metres; null if none",
);
const FEATURE: ColumnInfo = text(
    "feature",
    "feature of the echo: plane, corner, edge, cylinder, level (floor, ceiling), rough, or multiple reflections; null \
         without an echo",
);
const ENVELOPE: ColumnInfo = column(
    "envelope",
    ColumnKind::Numbers,
    false,
    "envelope of the firing from time 0, sampled every keep.envelope_step_us; without noise",
);

fn readings(keep: &KeepKeys) -> Vec<ColumnInfo> {
    let parts: [(&[ColumnInfo], bool); 7] = [
        (&FIRING, true),
        (&RESULT, true),
        (&STRENGTH, keep.strength),
        (&PATH, keep.path),
        (&[IDEAL], keep.ideal_range),
        (&[FEATURE], keep.features),
        (&[ENVELOPE], keep.envelope_range_m > 0.0),
    ];
    parts.into_iter().filter(|(_, is_kept)| *is_kept).flat_map(|(part, _)| part.to_vec()).collect()
}

const ECHOES: &[ColumnInfo] = &[
    SCENE,
    POSE,
    INDEX,
    text("path_kind", "specular, diffracted or scattered"),
    integer("path_order", "number of mirror reflections"),
    single("path_length_m", "two-way length of the path, metres"),
    single("amplitude", "amplitude after gain and beam pattern; a perfect head-on wall gives 1"),
    text("path", "surfaces along the path, in order"),
];

const FEATURES: &[ColumnInfo] = &[
    SCENE,
    text("kind", "plane, corner, edge or cylinder"),
    text("id", "names of the walls or of the cylinder"),
    number("x_m", "x of one end of a plane, or of the feature, metres"),
    number("y_m", "y of one end of a plane, or of the feature, metres"),
    number("to_x_m", "x of the other end of a plane, metres"),
    number("to_y_m", "y of the other end of a plane, metres"),
    number("radius_m", "radius of a cylinder, metres"),
    number("opening_deg", "angle between the walls of a corner or edge on the open side, degrees"),
];

const OCCUPANCY: &[ColumnInfo] = &[
    SCENE,
    number("origin_x_m", "x of the lower left corner of the map, metres"),
    number("origin_y_m", "y of the lower left corner of the map, metres"),
    number("resolution_m", "side of a cell, metres"),
    integer("width", "number of cells along x"),
    integer("height", "number of cells along y"),
    column(
        "cells",
        ColumnKind::Integers,
        false,
        "row by row from the lower left corner: 0 free, 1 occupied, 2 not visible from the poses",
    ),
];
