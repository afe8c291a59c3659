//! Writing of the tables of a shard.

use std::{
    collections::BTreeMap,
    io::{self, Write},
};

use serde::Serialize;
use smallvec::SmallVec;
use sonard_export::{ColumnType, ExportError, TypedTable, Value};
use sonard_interpret::interpret::grid::{GridShape, ideal};
use sonard_model::{
    geometry::DVec2,
    model::{Path, Simulator, raycast::Reflectors},
};
use sonard_records::PathRecord;

use super::rows::{PoseReadings, SimulatedFiring};
use crate::{
    labels,
    sample::SampledScene,
    shard::ShardError,
    spec::{KeepKeys, Spec},
    table::ShardTable,
};

type Row<'a> = SmallVec<[Option<Value<'a>>; 20]>;

/// Open tables with their numbers of rows.
pub(super) struct TableWriter {
    keep: KeepKeys,
    open: BTreeMap<ShardTable, (TypedTable<Box<dyn Write + Send>>, u64)>,
}

impl TableWriter {
    /// Opens all tables of a specification, with `identity` in the metadata of each.
    pub(super) fn create(
        spec: &Spec,
        identity: &str,
        create: &mut dyn FnMut(ShardTable) -> io::Result<Box<dyn Write + Send>>,
    ) -> Result<Self, ShardError> {
        let mut open = BTreeMap::new();
        for table in ShardTable::for_spec(spec) {
            let columns = table.columns(&spec.keep);
            let fields: Vec<ColumnType> = columns.iter().map(|column| column.field).collect();
            let mut typed = TypedTable::new(create(table)?, table.row(), &fields)?;
            typed.add_metadata("sonard.shard", identity.to_owned());
            open.insert(table, (typed, 0));
        }
        Ok(Self { keep: spec.keep.clone(), open })
    }

    /// Finishes all tables and returns their numbers of rows.
    pub(super) fn finish(self) -> Result<BTreeMap<ShardTable, u64>, ShardError> {
        let mut all = BTreeMap::new();
        for (table, (typed, rows)) in self.open {
            typed.finish()?;
            all.insert(table, rows);
        }
        Ok(all)
    }

    fn row(&mut self, table: ShardTable, row: Row<'_>) -> Result<(), ExportError> {
        let Some((typed, rows)) = self.open.get_mut(&table) else { return Ok(()) };
        *rows += 1;
        typed.row(row)
    }

    /// Writes the sampled values of a scene.
    pub(super) fn scene(
        &mut self,
        drawn: &SampledScene,
        simulator: &Simulator,
    ) -> Result<(), ExportError> {
        let (air, noise) = (&drawn.air, &drawn.noise);
        self.row(
            ShardTable::Scenes,
            Row::from_iter([
                integer(drawn.number),
                integer(drawn.kind as u64 + 1),
                text(&simulator.sensor().name),
                simulator.sensor_z_m().map(Value::Number),
                number(air.temperature_c()),
                number(air.humidity_percent()),
                number(air.pressure_kpa()),
                number(simulator.sound_speed_m_s()),
                number(noise.floor),
                number(noise.jitter_us),
                text(&drawn.scene.text),
            ]),
        )
    }

    /// Writes the readings at a pose, and their echoes.
    pub(super) fn pose(
        &mut self,
        simulator: &Simulator,
        at: &PoseReadings,
    ) -> Result<(), ShardError> {
        let reflectors = self.keep.ideal_range.then(|| {
            let scene = simulator.scene();
            Reflectors::new(scene, &scene.floor_plan())
        });
        for (firing, index) in at.firings.iter().zip(0..) {
            let ideal_m = reflectors.as_ref().map(|reflectors| {
                let direction = DVec2::from_angle(firing.direction_rad);
                reflectors.nearest(at.pose.position(), direction, None).map(|hit| hit.distance_m)
            });
            let path = self.keep.path.then(|| echo_path(simulator, firing)).flatten();
            let row = self.reading(simulator, at, (firing, index), path.as_deref(), ideal_m);
            self.row(ShardTable::Readings, row)?;
            for echo in &firing.echoes {
                let path = path_text(simulator, &echo.path, echo.length_m);
                let row = Row::from_iter([
                    integer(at.scene),
                    integer(at.number.into()),
                    integer(index),
                    enum_text(echo.path.kind()),
                    integer(echo.path.order() as u64),
                    number(echo.length_m),
                    number(echo.amplitude),
                    text(&path),
                ]);
                self.row(ShardTable::Echoes, row)?;
            }
        }
        Ok(())
    }

    fn reading<'a>(
        &self,
        simulator: &Simulator,
        at: &PoseReadings,
        (firing, index): (&'a SimulatedFiring, u64),
        path: Option<&'a str>,
        ideal_m: Option<Option<f64>>,
    ) -> Row<'a> {
        let (keep, reading) = (&self.keep, &firing.reading);
        let mut row = Row::from_iter([
            integer(at.scene),
            integer(at.number.into()),
            integer(index),
            number(at.pose.x_m),
            number(at.pose.y_m),
            number(at.pose.heading_deg),
            number(firing.azimuth_deg),
            enum_text(reading.status),
            reading.range_m.map(Value::Number),
        ]);
        // Without an echo, the arrival is only the candidate closest to detection.
        let echo = reading.arrival.as_ref().filter(|_| reading.status.has_range());
        if keep.strength {
            row.extend([
                reading.echoes_us.first().copied().map(Value::Number),
                reading.amplitude.map(Value::Number),
                reading.margin_db.map(Value::Number),
            ]);
        }
        if keep.path {
            row.extend([
                echo.and_then(|arrival| enum_text(arrival.path.kind())),
                echo.and_then(|arrival| integer(arrival.path.order() as u64)),
                echo.map(|arrival| Value::Number(arrival.length_m)),
                path.and_then(text),
            ]);
        }
        row.extend(ideal_m.map(|range_m| range_m.map(Value::Number)));
        if keep.features {
            let feature = |path: &Path| labels::feature_of(path, simulator.scene());
            row.push(echo.and_then(|arrival| text(feature(&arrival.path))));
        }
        if keep.envelope_range_m > 0.0 {
            row.push(Some(Value::Numbers(&firing.envelope)));
        }
        row
    }

    /// Writes the features and the true map of a scene, as seen from these positions.
    pub(super) fn truth(
        &mut self,
        drawn: &SampledScene,
        positions: &[DVec2],
    ) -> Result<(), ShardError> {
        if self.keep.features {
            for feature in labels::features(&drawn.scene) {
                let row = Row::from_iter([
                    integer(drawn.number),
                    text(feature.kind),
                    text(&feature.id),
                    number(feature.at.x),
                    number(feature.at.y),
                    feature.to.map(|to| Value::Number(to.x)),
                    feature.to.map(|to| Value::Number(to.y)),
                    feature.radius_m.map(Value::Number),
                    feature.opening_deg.map(Value::Number),
                ]);
                self.row(ShardTable::Features, row)?;
            }
        }
        if self.keep.occupancy_m > 0.0 {
            self.map(drawn, positions)?;
        }
        Ok(())
    }

    fn map(&mut self, drawn: &SampledScene, positions: &[DVec2]) -> Result<(), ShardError> {
        let (low, high) = extent(drawn, positions);
        let shape = GridShape::covering(low, high, self.keep.occupancy_m).map_err(|error| {
            let why = format!("{error} (keep.occupancy_m)");
            ShardError::DoesNotFit { scene: drawn.number, why }
        })?;
        let grid = ideal(&drawn.scene, shape, positions);
        let cells: Vec<u32> = grid.probabilities().map(cell).collect();
        let row = Row::from_iter([
            integer(drawn.number),
            number(shape.origin.x),
            number(shape.origin.y),
            number(shape.resolution_m),
            integer(shape.width as u64),
            integer(shape.height as u64),
            Some(Value::Integers(&cells)),
        ]);
        Ok(self.row(ShardTable::Occupancy, row)?)
    }
}

/// Returns the bounding box of all reflectors and positions, with a margin.
fn extent(drawn: &SampledScene, positions: &[DVec2]) -> (DVec2, DVec2) {
    const MARGIN_M: f64 = 0.2;
    let walls = drawn.scene.walls.iter().flat_map(|wall| [wall.a, wall.b]);
    let cylinders = drawn.scene.cylinders.iter().flat_map(|cylinder| {
        let reach = DVec2::splat(cylinder.radius_m);
        [cylinder.center - reach, cylinder.center + reach]
    });
    let all = walls.chain(cylinders).chain(positions.iter().copied());
    let (mut low, mut high) = (DVec2::splat(f64::INFINITY), DVec2::splat(f64::NEG_INFINITY));
    for point in all {
        (low, high) = (low.min(point), high.max(point));
    }
    (low - DVec2::splat(MARGIN_M), high + DVec2::splat(MARGIN_M))
}

/// Converts an occupancy probability: 0 free, 1 occupied, 2 not visible.
fn cell(probability: f64) -> u32 {
    match probability {
        p if p < 0.25 => 0,
        p if p > 0.75 => 1,
        _ => 2,
    }
}

fn echo_path(simulator: &Simulator, firing: &SimulatedFiring) -> Option<String> {
    let arrival = firing.reading.arrival.as_ref().filter(|_| firing.reading.status.has_range())?;
    Some(path_text(simulator, &arrival.path, arrival.length_m))
}

fn path_text(simulator: &Simulator, path: &Path, length_m: f64) -> String {
    PathRecord::from_path(simulator.scene(), path, length_m).describe()
}

fn integer<'a>(number: u64) -> Option<Value<'a>> {
    i64::try_from(number).ok().map(Value::Integer)
}

const fn number<'a>(number: f64) -> Option<Value<'a>> {
    Some(Value::Number(number))
}

fn text(text: &str) -> Option<Value<'_>> {
    Some(Value::Text(text.into()))
}

/// Serialized name of an enum value, as written in a log.
fn enum_text<'a>(value: impl Serialize) -> Option<Value<'a>> {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(enum_text)) => Some(Value::Text(enum_text.into())),
        _ => None,
    }
}
