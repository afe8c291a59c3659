//! Full-wave reference scans (tests/data/fullwave/README.md), and further ones of whole bodies by
//! boundary integrals (tests/peers/full_wave.py).

use std::collections::BTreeMap;

use serde::Deserialize;

#[derive(Deserialize)]
pub(in crate::model) struct Reference {
    pub(in crate::model) c: f64,
    pub(in crate::model) f0: f64,
    pub(in crate::model) piston_half_width_m: f64,
    pub(in crate::model) scenes: BTreeMap<String, ReferenceScene>,
}

#[derive(Deserialize)]
pub(in crate::model) struct ReferenceScene {
    pub(in crate::model) segments: Vec<[f64; 4]>,
    pub(in crate::model) sensor: [f64; 2],
    pub(in crate::model) scan: Vec<Beam>,
}

#[derive(Deserialize)]
pub(in crate::model) struct Beam {
    pub(in crate::model) azimuth: f64,
    /// Time and amplitude of the short pulse's arrivals.
    pub(in crate::model) arrivals: Vec<(f64, f64)>,
    /// Time and height of the burst's maxima.
    pub(in crate::model) peaks: Vec<(f64, f64)>,
    pub(in crate::model) threshold: BTreeMap<String, Option<Crossing>>,
}

#[derive(Deserialize)]
pub(in crate::model) struct Crossing {
    pub(in crate::model) range_unbiased: f64,
    pub(in crate::model) range_unbiased_09tau: Option<f64>,
    pub(in crate::model) range_unbiased_11tau: Option<f64>,
}

impl Reference {
    pub(in crate::model) fn given() -> Self {
        Self::load("fullwave/reference.json")
    }

    pub(in crate::model) fn bodies() -> Self {
        Self::load("peers/full_wave.json")
    }

    fn load(name: &str) -> Self {
        let path = format!("{}/../../tests/data/{name}", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(path).expect("the reference");
        serde_json::from_str(&text).expect("the reference")
    }
}
