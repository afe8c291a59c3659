//! Export of map, lines and features of a place.

mod geojson;

use std::io::Write;

use jiff::Timestamp;
use sonard_interpret::interpret::{
    Feature, FeatureKind,
    grid::Grid,
    lines::{LineKind, MapLine},
};
use sonard_records::Provenance;

use crate::{
    ExportError,
    columns::serialized_name,
    conversion::{MAP, MAP_TOPIC},
    recording::{RecordingWriter, nanoseconds},
    ros::{
        interface::{MARKERS, OCCUPANCY_GRID},
        message::{Header, Marker, MarkerShape, Markers, OccupancyGrid, Stamp},
    },
};
pub use geojson::{is_geojson, to_geojson};

/// Interpretation results of a place, in local metres.
#[derive(Debug, Clone, Copy)]
pub struct PlaceFindings<'a> {
    /// Start of the last interpreted scan.
    pub time: Option<Timestamp>,
    /// Origin of the readings.
    pub provenance: Option<Provenance>,
    /// Name of the scene, if known.
    pub scene: Option<&'a str>,
    /// Occupancy probabilities of the cells.
    pub grid: Option<&'a Grid>,
    /// Line segments with their confidence.
    pub lines: &'a [MapLine],
    /// Planes, corners and edges.
    pub features: &'a [Feature],
}

/// Writes a ROS 2 recording of a place: `/map` (`nav_msgs/OccupancyGrid`), `/sonar/lines` and
/// `/sonar/features` (`visualization_msgs/MarkerArray`), each only if there is content.
///
/// # Errors
/// Returns the write error of the output.
pub fn write_findings(out: impl Write, place: &PlaceFindings<'_>) -> Result<(), ExportError> {
    let mut messages = RecordingWriter::new(out)?;
    let stamp = Stamp(place.time.map_or(0, nanoseconds));
    let header = Header { stamp, frame: MAP };
    if let Some(grid) = place.grid {
        messages.write(MAP_TOPIC, OCCUPANCY_GRID, stamp, &OccupancyGrid { header, grid })?;
    }
    if !place.lines.is_empty() {
        let lines = Markers(LINES.map(|drawn| lines(place.lines, header, drawn)).into());
        messages.write("/sonar/lines", MARKERS, stamp, &lines)?;
    }
    if !place.features.is_empty() {
        let points = Markers(FEATURES.map(|drawn| points(place.features, header, drawn)).into());
        messages.write("/sonar/features", MARKERS, stamp, &points)?;
    }
    let provenance = place.provenance.and_then(serialized_name);
    let metadata = [("provenance", provenance), ("scene", place.scene.map(str::to_owned))];
    let metadata = metadata.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
    messages.finish(metadata.collect())
}

/// Namespace and colour (red, green, blue) of each kind of line.
const LINES: [(LineKind, &str, [f32; 3]); 3] = [
    (LineKind::Sonar, "sonar", [0.0, 0.45, 0.7]),
    (LineKind::Laser, "laser", [0.0, 0.62, 0.45]),
    (LineKind::Complex, "complex", [0.8, 0.47, 0.65]),
];

/// Namespace and colour (red, green, blue) of each kind of feature.
const FEATURES: [(FeatureKind, &str, [f32; 3]); 4] = [
    (FeatureKind::Plane, "plane", [0.0, 0.45, 0.7]),
    (FeatureKind::Corner, "corner", [0.84, 0.37, 0.0]),
    (FeatureKind::Edge, "edge", [0.0, 0.62, 0.45]),
    (FeatureKind::Unresolved, "unresolved", [0.5, 0.5, 0.5]),
];

const LINE_WIDTH_M: f64 = 0.02;
const POINT_WIDTH_M: f64 = 0.06;

fn lines<'a>(
    all: &[MapLine],
    header: Header<'a>,
    (kind, namespace, [red, green, blue]): (LineKind, &'a str, [f32; 3]),
) -> Marker<'a> {
    let of_kind = all.iter().filter(|line| line.kind == kind);
    Marker {
        header,
        namespace,
        shape: MarkerShape::Lines,
        width_m: LINE_WIDTH_M,
        colour: [red, green, blue, 1.0],
        points: of_kind.flat_map(|line| line.ends.map(|end| [end.x, end.y, 0.0])).collect(),
    }
}

/// Builds the marker of features with a known position.
fn points<'a>(
    all: &[Feature],
    header: Header<'a>,
    (kind, namespace, [red, green, blue]): (FeatureKind, &'a str, [f32; 3]),
) -> Marker<'a> {
    let of_kind = all.iter().filter(|feature| feature.kind == kind);
    Marker {
        header,
        namespace,
        shape: MarkerShape::Spheres,
        width_m: POINT_WIDTH_M,
        colour: [red, green, blue, 1.0],
        points: of_kind.filter_map(|feature| Some([feature.x_m?, feature.y_m?, 0.0])).collect(),
    }
}
