//! Error model of the readings of `rooms`, as input of fits and bounds.

use sonard_inverse::ErrorModel;

use crate::rooms::NOISE_MM;

pub(crate) const ERRORS: ErrorModel = ErrorModel {
    sigma_m: NOISE_MM * 1e-3,
    tail_share: 0.1,
    tail_ratio: 2.0,
    sigma_db: 0.5,
    sigma_db_per_reflection: 0.0,
    clutter: 0.002,
    arcs: 0.002,
    arc_beams: 8.0,
    clutter_silent: 0.3,
    clutter_m: 4.0,
};
