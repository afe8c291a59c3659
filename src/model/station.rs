//! A place from which firings are predicted.

use rand::Rng;

use super::{Arrival, Prediction, Simulator, Survey};
use crate::{
    acoustics::{Detection, EchoTrace, Image, Incidence, Incident, Latch, ReceiverNoise, Sound},
    geometry::wrap_pi,
    scan::PathKind,
};

/// A place from which firings are predicted; [`Simulator::station`] makes it.
pub struct Station<'a> {
    simulator: &'a Simulator,
    survey: Box<dyn Survey + 'a>,
}

impl<'a> Station<'a> {
    pub(super) fn new(simulator: &'a Simulator, survey: Box<dyn Survey + 'a>) -> Self {
        Self { simulator, survey }
    }

    /// The reading of a firing in a world direction, radians counter-clockwise from +x: the first
    /// echo, which latches ECHO.
    #[must_use]
    pub fn ping(&self, direction_rad: f64) -> Prediction {
        self.listen(direction_rad, Latch::First)
    }

    /// The same with the receiver made ready again after each echo, up to eight times.
    #[must_use]
    pub fn ping_rearmed(&self, direction_rad: f64) -> Prediction {
        self.listen(direction_rad, Latch::Rearmed)
    }

    fn listen(&self, direction_rad: f64, latch: Latch) -> Prediction {
        let (receiver, sounds) = (self.simulator.receiver(), self.sounds(direction_rad));
        let detection = if receiver.asks_incidents() {
            let incident = |sound: &Sound| Some(self.incident(direction_rad, sound));
            receiver.detect_at_face(&sounds, &incident, latch)
        } else {
            receiver.detect_at_face(&sounds, &|_| None, latch)
        };
        self.prediction(direction_rad, detection)
    }

    /// [`ping_rearmed`](Self::ping_rearmed) in noise: the same generator in the same state gives the same reading.
    #[must_use]
    pub fn ping_in_noise(
        &self,
        direction_rad: f64,
        noise: &ReceiverNoise,
        rng: &mut impl Rng,
    ) -> Prediction {
        let sounds = self.sounds(direction_rad);
        let incident = |sound: &Sound| Some(self.incident(direction_rad, sound));
        let detection = self.simulator.receiver().detect_in_noise(&sounds, &incident, noise, rng);
        self.prediction(direction_rad, detection)
    }

    /// What an oscilloscope would show of a firing, up to a range in metres, in steps of so many
    /// microseconds; each [`Hump`](crate::acoustics::Hump) can be named with
    /// [`arrival`](Self::arrival).
    #[must_use]
    pub fn trace(&self, direction_rad: f64, until_m: f64, step_us: f64) -> EchoTrace {
        let receiver = self.simulator.receiver();
        let until_us = 2e6 * until_m / receiver.sound_speed_m_s;
        let sounds = self.sounds(direction_rad);
        let incident = |sound: &Sound| Some(self.incident(direction_rad, sound));
        receiver.trace(&sounds, &incident, until_us, step_us)
    }

    /// Every echo of a firing in a world direction, detected or not, shortest path first.
    #[must_use]
    pub fn arrivals(&self, direction_rad: f64) -> Vec<Arrival> {
        self.survey.arrivals(direction_rad)
    }

    /// The full account of a sound of a firing in the same direction.
    #[must_use]
    pub fn arrival(&self, direction_rad: f64, sound: &Sound) -> Arrival {
        self.survey.arrival(direction_rad, sound)
    }

    fn sounds(&self, direction_rad: f64) -> Vec<Sound> {
        let mut sounds = Vec::new();
        self.survey.listen(direction_rad, &mut sounds);
        sounds
    }

    fn incident(&self, direction_rad: f64, sound: &Sound) -> Incident {
        let arrival = self.survey.arrival(direction_rad, sound);
        let image = match arrival.path.kind {
            PathKind::Diffracted => Image::Lost,
            PathKind::Specular if arrival.path.walls.len() % 2 == 1 => Image::Swapped,
            PathKind::Specular => Image::Upright,
        };
        Incident {
            strength: arrival.path_amplitude,
            incidence: Incidence {
                leaving_rad: wrap_pi(arrival.departure_rad - direction_rad),
                arriving_rad: wrap_pi(arrival.arrival_rad - direction_rad),
                length_m: arrival.length_m,
                image,
            },
        }
    }

    fn prediction(&self, direction_rad: f64, detection: Detection) -> Prediction {
        Prediction {
            status: detection.status,
            range_m: detection.range_m,
            arrival: detection.sound.map(|sound| self.survey.arrival(direction_rad, &sound)),
            amplitude: detection.amplitude,
            margin_db: detection.margin_db,
            echoes_us: detection.echoes_us,
        }
    }
}
