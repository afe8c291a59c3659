//! Python package `sonard`: the simulation crates with NumPy arrays as input and output.
//!
//! The interface is described in `package/sonard/__init__.pyi`; `stubtest` compares the two.

mod air;
mod array;
mod arrays;
mod calibrate;
mod error;
mod firing;
mod generate;
mod images;
mod json;
mod locate;
mod log;
mod map;
mod model;
mod options;
mod path;
mod pool;
mod readings;
mod scene;
mod sense;
mod sensor;
mod status;
mod survey;
mod trace;

/// The compiled part of `sonard`.
#[pyo3::pymodule]
mod _sonard {
    #[pymodule_export]
    use crate::{
        air::Air,
        array::{ArrayModel, Course, RangerArray},
        calibrate::calibrate,
        error::{
            AirError, ArrayError, LogError, OptionError, PoseError, SceneError, SensorError,
            SonardError, TooManyPathsError,
        },
        generate::generate,
        images::image_sources,
        locate::Locator,
        log::{Log, Scan, read_log},
        map::make_map,
        model::{Model, predict::seconds_of_predict_many},
        scene::Scene,
        sense::{compare, find_features},
        sensor::Sensor,
        survey::survey,
    };

    #[pymodule_init]
    fn init(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        use pyo3::types::PyModuleMethods as _;
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("__commit__", env!("SONARD_COMMIT"))?;
        module.add("READING", crate::arrays::reading_dtype(module.py())?)?;
        let array_reading = crate::arrays::array_reading_dtype(module.py())?;
        module.add("ARRAY_READING", array_reading)?;
        module.add("LOGGED", crate::log::logged_dtype(module.py())?)
    }
}
