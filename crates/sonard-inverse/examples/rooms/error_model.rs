//! Error model of the readings of `rooms`, as input of fits and bounds.

use sonard_inverse::ErrorModel;

use crate::rooms::NOISE_MM;

pub(crate) const ERRORS: ErrorModel = ErrorModel {
    sigma_m: NOISE_MM * 1e-3,
    tail_weight: 0.1,
    tail_ratio: 2.0,
    sigma_db: 0.5,
    sigma_db_per_reflection: 0.0,
    outlier_share: 0.002,
    outlier_arc_share: 0.002,
    outlier_arc_beams: 8.0,
    outlier_no_echo_share: 0.3,
    outlier_max_range_m: 4.0,
};
