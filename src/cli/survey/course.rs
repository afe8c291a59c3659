//! Readings of a survey for people.

use crate::{
    geometry::{DVec2, wrap_360},
    inverse::{ArrayFiring, ArrayRound, FitSweep, SweepFiring},
    scan::text::format_count,
    survey::SurveyCourse,
};

/// Beam of a sweep or of a round.
pub(super) struct BeamEcho {
    /// Position of the transducer in the frame of the pose, metres.
    pub(super) position: DVec2,
    pub(super) azimuth_deg: f64,
    /// Range unless there was no echo, metres.
    pub(super) range_m: Option<f64>,
}

/// Number of sweeps or rounds with its noun.
pub(super) fn count(course: &SurveyCourse) -> String {
    match course {
        SurveyCourse::Sweeps(sweeps) => format_count(sweeps.len(), "sweep"),
        SurveyCourse::Rounds(rounds) => format_count(rounds.len(), "round"),
    }
}

/// Echoes of each sweep or round, in the order of the azimuths.
pub(super) fn echoes(course: &SurveyCourse, sound_speed_m_s: f64) -> Vec<Vec<BeamEcho>> {
    let of_sweep = |sweep: &FitSweep| {
        let echo = |beam: &SweepFiring| BeamEcho {
            position: DVec2::ZERO,
            azimuth_deg: beam.azimuth_deg,
            range_m: beam.range_m(sound_speed_m_s),
        };
        sweep.beams.iter().map(echo).collect()
    };
    let of_round = |round: &ArrayRound| {
        let echo = |firing: &ArrayFiring| BeamEcho {
            position: firing.position,
            azimuth_deg: firing.azimuth_deg,
            range_m: firing.outcome.range_m(sound_speed_m_s),
        };
        round.firings.iter().map(echo).collect()
    };
    let mut all: Vec<Vec<BeamEcho>> = match course {
        SurveyCourse::Sweeps(sweeps) => sweeps.iter().map(of_sweep).collect(),
        SurveyCourse::Rounds(rounds) => rounds.iter().map(of_round).collect(),
    };
    for beams in &mut all {
        beams.sort_by(|a, b| wrap_360(a.azimuth_deg).total_cmp(&wrap_360(b.azimuth_deg)));
    }
    all
}
