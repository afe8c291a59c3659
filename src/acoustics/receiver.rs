//! The receiver: which of the sounds at the transducer's face raise ECHO, and when.

use smallvec::SmallVec;

use crate::scan::PingStatus;

/// Most echoes a firing reports.
const MOST_ECHOES: usize = 8;

/// ECHO this soon after the end of blanking counts as raised by sound already there,
/// microseconds: about one cycle at 50 kHz, 3.4 mm of range.
const BLANKING_TOLERANCE_US: f64 = 20.0;

/// A sound at the transducer's face, reduced to what the receiver notices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sound {
    /// Length of its path there and back, metres.
    pub length_m: f64,
    /// Strength after gain compensation and the beam pattern on both ways; a head-on, perfectly
    /// reflecting wall without absorption gives 1.
    pub amplitude: f64,
    /// Phase of the carrier beside that of the way, for `exp(+i omega t)`, radians.
    pub phase_rad: f64,
    /// Which of the sender's paths it took; meaningless to the receiver.
    pub index: u32,
}

/// A detector with a threshold that opens after the blanking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// From firing until it listens, microseconds.
    pub blanking_us: f64,
    /// How long each echo sounds, microseconds.
    pub pulse_us: f64,
    /// How long it is held after an echo, microseconds.
    pub rearm_us: f64,
    /// Least amplitude it notices.
    pub threshold: f64,
    /// Speed of sound, metres a second.
    pub sound_speed_m_s: f64,
    /// Half the longest path it waits for, metres.
    pub max_range_m: f64,
}

/// What the receiver makes of a firing.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// `Echo`, `NoEcho` or `MinRange`.
    pub status: PingStatus,
    /// Half the detected path; for `MinRange` the range of the end of blanking; metres.
    pub range_m: Option<f64>,
    /// What was detected; for `NoEcho` the strongest sound in the listening window.
    pub sound: Option<Sound>,
    /// Times at which ECHO rises, microseconds after firing.
    pub echoes_us: SmallVec<[f64; MOST_ECHOES]>,
}

impl Receiver {
    /// Listens to the sounds of one firing, which come in order of their length.
    ///
    /// A sound that begins before the detector is ready and still lasts then raises ECHO at that
    /// moment: at the end of blanking that is the minimum range, whatever is really there. A
    /// sound that is over by then is lost. Sounds are taken one at a time: neither interference
    /// nor the sum of several weak ones is modelled.
    #[must_use]
    pub fn detect(&self, sounds: &[Sound]) -> Detection {
        let mut echoes_us = SmallVec::new();
        let Some((first_us, sound)) = self.next_echo(sounds, self.blanking_us) else {
            let sound = self.strongest_heard(sounds);
            return Detection { status: PingStatus::NoEcho, range_m: None, sound, echoes_us };
        };
        let already_there = self.tof_us(&sound) < self.blanking_us;
        echoes_us.push(first_us);
        while echoes_us.len() < MOST_ECHOES
            && let Some(last_us) = echoes_us.last()
            && let Some((next_us, _)) = self.next_echo(sounds, last_us + self.rearm_us)
        {
            echoes_us.push(next_us);
        }
        let (status, range_m) = if already_there {
            (PingStatus::MinRange, self.min_range_m())
        } else {
            (PingStatus::Echo, sound.length_m / 2.0)
        };
        Detection { status, range_m: Some(range_m), sound: Some(sound), echoes_us }
    }

    /// The range that belongs to the end of blanking, metres.
    #[must_use]
    pub fn min_range_m(&self) -> f64 {
        self.sound_speed_m_s * self.blanking_us * 1e-6 / 2.0
    }

    /// When ECHO next rises if the detector is ready from `ready_us` on, and by which sound.
    fn next_echo(&self, sounds: &[Sound], ready_us: f64) -> Option<(f64, Sound)> {
        let loud = || sounds.iter().filter(|sound| self.hears(sound));
        let sounding = loud()
            .take_while(|sound| self.tof_us(sound) < ready_us)
            .filter(|sound| self.tof_us(sound) + self.pulse_us >= ready_us)
            .max_by(|one, other| one.amplitude.total_cmp(&other.amplitude));
        if let Some(sound) = sounding {
            return Some((ready_us, *sound));
        }
        loud()
            .find(|sound| self.tof_us(sound) >= ready_us)
            .map(|sound| (self.tof_us(sound), *sound))
    }

    fn hears(&self, sound: &Sound) -> bool {
        sound.amplitude >= self.threshold && sound.length_m <= 2.0 * self.max_range_m
    }

    fn strongest_heard(&self, sounds: &[Sound]) -> Option<Sound> {
        sounds
            .iter()
            .filter(|sound| self.tof_us(sound) >= self.blanking_us)
            .filter(|sound| sound.length_m <= 2.0 * self.max_range_m && sound.amplitude > 0.0)
            .max_by(|one, other| one.amplitude.total_cmp(&other.amplitude))
            .copied()
    }

    fn tof_us(&self, sound: &Sound) -> f64 {
        sound.length_m / self.sound_speed_m_s * 1e6
    }
}

/// The status of a measured reading from its first time of flight, microseconds, if any.
///
/// ECHO within one carrier cycle (20 us) of the end of blanking was raised by sound already
/// there: a real echo that begins in that span can't be told from it.
#[must_use]
pub fn classify_tof(tof_us: Option<f64>, blanking_us: f64) -> PingStatus {
    match tof_us {
        None => PingStatus::NoEcho,
        Some(tof_us) if tof_us <= blanking_us + BLANKING_TOLERANCE_US => PingStatus::MinRange,
        Some(_) => PingStatus::Echo,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At 340 m/s a path of 0.34 m takes 1000 us.
    const RECEIVER: Receiver = Receiver {
        blanking_us: 2380.0,
        pulse_us: 324.0,
        rearm_us: 440.0,
        threshold: 0.02,
        sound_speed_m_s: 340.0,
        max_range_m: 3.4,
    };

    /// Sounds at times (microseconds) and amplitudes; expected status and times of ECHO.
    fn check(sounds: &[(f64, f64)], status: PingStatus, echoes_us: &[f64]) -> Detection {
        let sounds: Vec<Sound> = sounds
            .iter()
            .zip(0..)
            .map(|(&(tof_us, amplitude), index)| Sound {
                phase_rad: 0.0,
                length_m: tof_us * 340e-6,
                amplitude,
                index,
            })
            .collect();
        let detection = RECEIVER.detect(&sounds);
        assert_eq!(detection.status, status, "{sounds:?}");
        assert_eq!(detection.echoes_us.len(), echoes_us.len(), "{detection:?}");
        for (found, expected) in detection.echoes_us.iter().zip(echoes_us) {
            assert!((found - expected).abs() < 1e-6, "{detection:?}");
        }
        detection
    }

    #[test]
    fn blanking_loses_what_ended_and_catches_what_still_sounds() {
        check(&[(2000.0, 1.0)], PingStatus::NoEcho, &[]);
        let caught = check(&[(2100.0, 1.0)], PingStatus::MinRange, &[2380.0]);
        assert!((caught.range_m.expect("a range") - 0.4046).abs() < 1e-12);
        check(&[(2100.0, 0.01)], PingStatus::NoEcho, &[]);
        let echo = check(&[(2380.5, 1.0)], PingStatus::Echo, &[2380.5]);
        assert!((echo.range_m.expect("a range") - 340.0 * 2380.5e-6 / 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_first_loud_sound_wins_over_louder_later_ones() {
        let echo = check(
            &[(3000.0, 0.019), (4000.0, 0.02), (5000.0, 0.9)],
            PingStatus::Echo,
            &[4000.0, 5000.0],
        );
        assert_eq!(echo.sound.map(|sound| sound.index), Some(1));
    }

    #[test]
    fn silence_names_its_best_candidate_in_the_window() {
        let silence = check(
            &[(1000.0, 1.0), (3000.0, 0.01), (4000.0, 0.015), (25_000.0, 1.0)],
            PingStatus::NoEcho,
            &[],
        );
        assert_eq!(silence.sound.map(|sound| sound.index), Some(2));
        assert_eq!(check(&[], PingStatus::NoEcho, &[]).sound, None);
    }

    #[test]
    fn held_detector_skips_sounds_that_end_and_catches_those_that_last() {
        check(&[(3000.0, 1.0), (3100.0, 1.0)], PingStatus::Echo, &[3000.0]);
        check(&[(3000.0, 1.0), (3200.0, 1.0)], PingStatus::Echo, &[3000.0, 3440.0]);
        let many: Vec<(f64, f64)> = (0..20).map(|i| (3000.0 + 500.0 * f64::from(i), 1.0)).collect();
        let first_eight: Vec<f64> = many.iter().take(8).map(|&(tof_us, _)| tof_us).collect();
        check(&many, PingStatus::Echo, &first_eight);
    }

    #[test]
    fn measured_times_at_the_end_of_blanking_are_minimum_range() {
        for (tof_us, status) in [
            (None, PingStatus::NoEcho),
            (Some(2380.0), PingStatus::MinRange),
            (Some(2395.0), PingStatus::MinRange),
            (Some(2401.0), PingStatus::Echo),
        ] {
            assert_eq!(classify_tof(tof_us, 2380.0), status, "{tof_us:?}");
        }
    }
}
