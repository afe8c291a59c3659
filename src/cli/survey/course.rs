//! Readings of a survey in the order of its course.

use crate::{
    geometry::{DVec2, Pose, wrap_180, wrap_360},
    inverse::{ArrayFiring, ArrayRound, FitSweep, FitSweepError, SweepFiring},
    scan::{ScanView, text::format_count},
    survey::SurveyInput,
};

/// Readings in the order of the course.
#[derive(Debug)]
pub(super) enum Course {
    Sweeps(Vec<FitSweep>),
    Rounds(Vec<ArrayRound>),
}

impl Course {
    /// Readings of a scan: a sweep of a ranger on a stepper, or the rounds of an array.
    pub(super) fn from_scan(scan: &ScanView) -> Result<Self, FitSweepError> {
        match FitSweep::from_scan(scan) {
            Err(FitSweepError::OfArray(_)) => ArrayRound::from_scan(scan).map(Self::Rounds),
            sweep => sweep.map(|sweep| Self::Sweeps(vec![sweep])),
        }
    }

    /// Appends readings of the same kind; `None` for those of the other.
    pub(super) fn extend(&mut self, more: Self) -> Option<()> {
        match (self, more) {
            (Self::Sweeps(sweeps), Self::Sweeps(more)) => sweeps.extend(more),
            (Self::Rounds(rounds), Self::Rounds(more)) => rounds.extend(more),
            _ => return None,
        }
        Some(())
    }

    /// Drops rounds that begin nearer than `spacing_m` and at less than 5 degrees from the last one
    /// kept.
    pub(super) fn thin(&mut self, spacing_m: f64) {
        const TURN_DEG: f64 = 5.0;
        let Self::Rounds(rounds) = self else { return };
        let mut last: Option<Pose> = None;
        rounds.retain(|round| {
            let is_kept = last.is_none_or(|last| {
                last.position().distance(round.pose.position()) >= spacing_m
                    || wrap_180(last.heading_deg - round.pose.heading_deg).abs() >= TURN_DEG
            });
            last = if is_kept { Some(round.pose) } else { last };
            is_kept
        });
    }

    pub(super) fn count(&self) -> String {
        match self {
            Self::Sweeps(sweeps) => format_count(sweeps.len(), "sweep"),
            Self::Rounds(rounds) => format_count(rounds.len(), "round"),
        }
    }

    pub(super) fn input(&self) -> SurveyInput<'_> {
        match self {
            Self::Sweeps(sweeps) => sweeps.into(),
            Self::Rounds(rounds) => rounds.into(),
        }
    }

    /// Echoes of each sweep or round, in the order of the azimuths: position of the transducer in
    /// the frame of the pose, azimuth in degrees, and range in metres unless there was no echo.
    pub(super) fn beams(&self, sound_speed_m_s: f64) -> Vec<Vec<(DVec2, f64, Option<f64>)>> {
        let of_sweep = |sweep: &FitSweep| {
            let beam =
                |beam: &SweepFiring| (DVec2::ZERO, beam.azimuth_deg, beam.range_m(sound_speed_m_s));
            sweep.beams.iter().map(beam).collect()
        };
        let of_round = |round: &ArrayRound| {
            let beam = |firing: &ArrayFiring| {
                let range_m = firing.outcome.range_m(sound_speed_m_s);
                (firing.position, firing.azimuth_deg, range_m)
            };
            round.firings.iter().map(beam).collect()
        };
        let mut all: Vec<Vec<_>> = match self {
            Self::Sweeps(sweeps) => sweeps.iter().map(of_sweep).collect(),
            Self::Rounds(rounds) => rounds.iter().map(of_round).collect(),
        };
        for beams in &mut all {
            beams.sort_by(|a: &(_, f64, _), b| wrap_360(a.1).total_cmp(&wrap_360(b.1)));
        }
        all
    }
}
