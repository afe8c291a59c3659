//! What the receiver makes of what it hears: the first rise of ECHO and those after it, or silence and what came
//! closest to ending it.

use smallvec::SmallVec;

use super::{Latch, PulseArrival, Receiver, hearing::Hearing};
use crate::reading::PingStatus;

/// Most echoes a firing reports.
const MOST_ECHOES: usize = 8;

/// The receiver's detection of a firing.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// `Echo`, `NoEcho` or `MinRange`.
    pub status: PingStatus,
    /// Half the detected path; for `MinRange` the range of the end of blanking; metres.
    pub range_m: Option<f64>,
    /// The arrival that drove the detector, if it was sound; for `NoEcho` the one that came closest.
    pub arrival: Option<PulseArrival>,
    /// The most that the envelope reached with it, all arrivals together.
    pub amplitude: Option<f64>,
    /// The same above the threshold in force, decibels.
    pub margin_db: Option<f64>,
    /// Times at which ECHO rises, microseconds after firing.
    pub echoes_us: SmallVec<[f64; MOST_ECHOES]>,
}

impl Receiver {
    pub(super) fn detection(
        &self,
        hearing: &mut Hearing,
        latch: Latch,
        ready_us: f64,
    ) -> Detection {
        let mut echoes_us = SmallVec::new();
        let Some(first_us) = hearing.next_rise(self.listens_from_us(ready_us)) else {
            return self.silence(hearing);
        };
        let status = self.status_at(first_us);
        let already_there = status == PingStatus::MinRange;
        let told_us = first_us + if already_there { 0.0 } else { hearing.crest_after_us(first_us) };
        let cause = hearing.cause(first_us);
        let (peak, margin_db) = self.peak(hearing, first_us, cause.as_ref());
        let mut last_us = first_us;
        echoes_us.push(told_us);
        while latch == Latch::Rearmed
            && echoes_us.len() < MOST_ECHOES
            && let Some(next_us) = hearing.next_rise(last_us + self.rearm_us)
        {
            echoes_us.push(next_us + hearing.crest_after_us(next_us));
            last_us = next_us;
        }
        Detection {
            status,
            range_m: Some(self.range_m(told_us)),
            arrival: cause,
            amplitude: Some(peak),
            margin_db: Some(margin_db),
            echoes_us,
        }
    }

    /// The most that the envelope reaches with an echo that rose at a time, and how far that is above the threshold in
    /// force then, decibels. To be asked for before another rise.
    pub(super) fn peak(
        &self,
        hearing: &mut Hearing,
        first_us: f64,
        cause: Option<&PulseArrival>,
    ) -> (f64, f64) {
        let peak = match self.status_at(first_us) {
            PingStatus::MinRange => hearing.level(first_us),
            _ => hearing.peak(first_us, cause),
        };
        (peak, 20.0 * (peak / hearing.threshold_at(first_us)).log10())
    }

    /// From when on the envelope matters to a detector that can't be raised before `ready_us`: what has been above
    /// before, for less than it takes to rise, counts.
    pub(super) fn listens_from_us(&self, ready_us: f64) -> f64 {
        (ready_us - 2.0 * self.integration_us).max(self.blanking_us)
    }

    /// The status of a first rise.
    pub(super) fn status_at(&self, first_us: f64) -> PingStatus {
        let already_there = first_us <= self.blanking_us + 1e-6;
        if already_there { PingStatus::MinRange } else { PingStatus::Echo }
    }

    /// What a module tells that averages several firings, of which there is one at least: the mean of the first echoes, if
    /// more than half of the firings have one; one echo, then.
    pub(super) fn averaged(&self, mut firings: Vec<Detection>) -> Detection {
        if firings.len() == 1 {
            return firings.remove(0);
        }
        let is_echo = |firing: &&Detection| firing.status == PingStatus::Echo;
        let first_us: Vec<f64> =
            firings.iter().filter(is_echo).filter_map(|of| of.echoes_us.first().copied()).collect();
        let is_heard = 2 * first_us.len() > firings.len();
        let wanted = |firing: &Detection| (firing.status == PingStatus::Echo) == is_heard;
        let at = firings.iter().position(wanted).unwrap_or(0);
        let mut told = firings.swap_remove(at);
        if is_heard {
            let mean_us = first_us.iter().sum::<f64>() / first_us.len() as f64;
            told.range_m = Some(self.range_m(mean_us));
            told.echoes_us = SmallVec::from_slice(&[mean_us]);
        }
        told
    }

    /// As the module tells it: in whole steps of range. The end of the blanking is no range.
    pub(super) fn told(&self, mut detection: Detection) -> Detection {
        if self.range_step_m == 0.0 {
            return detection;
        }
        let us_per_m = 2e6 / self.sound_speed_m_s;
        let stepped_m = |range_m: f64| (range_m / self.range_step_m).round() * self.range_step_m;
        let blanked = usize::from(detection.status == PingStatus::MinRange);
        for echo_us in detection.echoes_us.iter_mut().skip(blanked) {
            *echo_us = us_per_m * stepped_m(self.range_m(*echo_us));
        }
        if detection.status == PingStatus::Echo {
            detection.range_m = detection.range_m.map(stepped_m);
        }
        detection
    }

    /// The arrival that came closest within the listening window.
    fn silence(&self, hearing: &mut Hearing) -> Detection {
        let (echoes_us, window_us) = (SmallVec::new(), self.window_us());
        // More has to be known before anything can be said.
        let known: &[PulseArrival] = if hearing.asked_beyond() { &[] } else { hearing.arrivals };
        let relative =
            |arrival: &PulseArrival| arrival.amplitude / self.threshold_at(self.tof_us(arrival));
        let arrival = known
            .iter()
            .filter(|arrival| (self.blanking_us..=window_us).contains(&self.tof_us(arrival)))
            .filter(|arrival| arrival.amplitude > 0.0)
            .max_by(|one, other| relative(one).total_cmp(&relative(other)))
            .copied();
        let peak = arrival.map(|arrival| {
            hearing.rewind();
            hearing.peak(self.tof_us(&arrival), Some(&arrival))
        });
        Detection {
            status: PingStatus::NoEcho,
            range_m: None,
            arrival,
            amplitude: peak,
            // It may have been strong enough, but not for long enough.
            margin_db: arrival.zip(peak).map(|(arrival, peak)| {
                let threshold = hearing.threshold_at(self.tof_us(&arrival));
                (20.0 * (peak / threshold).log10()).min(0.0)
            }),
            echoes_us,
        }
    }
}
