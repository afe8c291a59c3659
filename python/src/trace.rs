//! Conversion of the signal of a firing to the classes of `package/sonard/_results.py`.

use pyo3::{prelude::*, types::PyTuple};
use sonard_model::{
    acoustics::{EchoTrace, EnvelopePeak, TracePoint},
    model::{ObservationPoint, TooCostly},
    scene::Scene,
};

use crate::{
    arrays,
    path::{PathResult, result},
};

/// Trace with the path of each of its peaks.
pub(crate) struct TraceResult {
    trace: EchoTrace,
    paths: Vec<PathResult>,
}

impl TraceResult {
    pub(crate) fn compute(
        scene: &Scene,
        point: &ObservationPoint<'_>,
        direction_rad: f64,
        max_range_m: f64,
        step_us: f64,
    ) -> Result<Self, TooCostly> {
        let trace = point.trace(direction_rad, max_range_m, step_us)?;
        let path = |peak: &EnvelopePeak| {
            let arrival = point.arrival(direction_rad, &peak.arrival)?;
            Ok(PathResult::from_arrival(scene, &arrival))
        };
        let paths = trace.peaks.iter().map(path).collect::<Result<_, _>>()?;
        Ok(Self { trace, paths })
    }

    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let points = &self.trace.points;
        let column = |value: fn(&TracePoint) -> f64| {
            arrays::shaped(py, points.iter().map(value).collect(), &[points.len()])
        };
        let peak = |(peak, path): (&EnvelopePeak, PathResult)| {
            let (height, peak_us) = peak.peak;
            result(py, "Peak", (peak.tof_us, peak_us, height, path.into_python(py)?))
        };
        let peaks = self.trace.peaks.iter().zip(self.paths).map(peak);
        let echoes_us = self.trace.detection.echoes_us.to_vec();
        let echoes = echoes_us.len();
        let fields = (
            column(|point| point.t_us)?,
            column(|point| point.envelope)?,
            column(|point| point.threshold)?,
            column(|point| point.gain_db)?,
            arrays::shaped(py, echoes_us, &[echoes])?,
            PyTuple::new(py, peaks.collect::<PyResult<Vec<_>>>()?)?,
        );
        result(py, "Trace", fields)
    }
}
