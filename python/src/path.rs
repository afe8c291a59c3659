//! Conversion of propagation paths and single readings to the classes of
//! `package/sonard/_results.py`.

use pyo3::{prelude::*, types::PyTuple};
use sonard_model::{
    geometry::wrap_360,
    model::{self, Arrival, Mechanism, Prediction, paths::EchoPath},
    reading::PathKind,
    scene::Scene,
};

use crate::{arrays, status};

/// Creates an instance of a class in `_results`, with its fields in order.
pub(crate) fn result<'py>(
    py: Python<'py>,
    class: &str,
    fields: impl pyo3::call::PyCallArgs<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    py.import("sonard._results")?.getattr(class)?.call1(fields)
}

/// Propagation path, ready for conversion to Python.
pub(crate) struct PathResult {
    kind: PathKind,
    order: usize,
    length_m: f64,
    amplitude: f64,
    phase_rad: f64,
    departure_rad: f64,
    arrival_rad: f64,
    interactions: Vec<(&'static str, String)>,
    points: Vec<f64>,
    columns: usize,
}

impl PathResult {
    pub(crate) fn from_arrival(scene: &Scene, arrival: &Arrival) -> Self {
        Self {
            length_m: arrival.length_m,
            amplitude: arrival.path_amplitude,
            phase_rad: arrival.phase_rad,
            departure_rad: arrival.departure_rad,
            arrival_rad: arrival.arrival_rad,
            ..Self::from_path(scene, &arrival.path)
        }
    }

    pub(crate) fn from_echo(scene: &Scene, echo: &EchoPath) -> Self {
        Self {
            length_m: echo.length_m,
            amplitude: echo.amplitude,
            phase_rad: echo.phase_rad,
            departure_rad: echo.departure_rad,
            arrival_rad: echo.arrival_rad,
            ..Self::from_path(scene, &echo.path)
        }
    }

    /// Converts the interactions of a path; the caller sets the numerical fields.
    fn from_path(scene: &Scene, path: &model::Path) -> Self {
        let interactions = &path.interactions;
        let has_heights = interactions.iter().any(|interaction| interaction.z_m.is_some());
        let columns = if has_heights { 3 } else { 2 };
        let point = |interaction: &model::Interaction| {
            let at =
                [interaction.point.x, interaction.point.y, interaction.z_m.unwrap_or(f64::NAN)];
            at.into_iter().take(columns)
        };
        let name = |interaction: &model::Interaction| {
            (mechanism_name(interaction.mechanism), interaction.mechanism.name(scene))
        };
        Self {
            kind: path.kind(),
            order: path.order(),
            length_m: f64::NAN,
            amplitude: f64::NAN,
            phase_rad: f64::NAN,
            departure_rad: f64::NAN,
            arrival_rad: f64::NAN,
            interactions: interactions.iter().map(name).collect(),
            points: interactions.iter().flat_map(point).collect(),
            columns,
        }
    }

    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let kind = match self.kind {
            PathKind::Specular => "specular",
            PathKind::Diffracted => "diffracted",
            PathKind::Scattered => "scattered",
        };
        let count = self.interactions.len();
        let fields = (
            kind,
            self.order,
            self.length_m,
            self.amplitude,
            self.phase_rad.to_degrees(),
            degrees(self.departure_rad),
            degrees(self.arrival_rad),
            PyTuple::new(py, self.interactions)?,
            arrays::shaped(py, self.points, &[count, self.columns])?,
        );
        result(py, "Path", fields)
    }
}

const fn mechanism_name(mechanism: Mechanism) -> &'static str {
    match mechanism {
        Mechanism::Reflection(_) => "reflection",
        Mechanism::Diffraction(_) => "diffraction",
        Mechanism::Scattering { .. } => "scattering",
        Mechanism::Transducer => "transducer",
    }
}

/// Converts to degrees from 0 to 360, never a negative zero.
fn degrees(angle_rad: f64) -> f64 {
    wrap_360(angle_rad.to_degrees()) + 0.0
}

/// Converts a prediction to a `Reading`; `crosstalk` is the id of another ranger that transmitted
/// the sound.
pub(crate) fn reading<'py>(
    py: Python<'py>,
    scene: &Scene,
    predicted: &Prediction,
    crosstalk: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let arrival = predicted.arrival.as_ref();
    let path = arrival.map(|arrival| PathResult::from_arrival(scene, arrival).into_python(py));
    let fields = (
        status::member(py, predicted.status)?,
        predicted.range_m,
        predicted.amplitude,
        predicted.margin_db,
        predicted.echoes_us.first().copied(),
        path.transpose()?,
        crosstalk,
    );
    result(py, "Reading", fields)
}
