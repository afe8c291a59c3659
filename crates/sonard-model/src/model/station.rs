//! A place from which firings are predicted.

use rand::Rng;

use super::{Arrival, Prediction, Simulator, Survey, place::Place};
use crate::{
    acoustics::{Detection, EchoTrace, Incident, Latch, ReceiverNoise, Sound},
    geometry::DVec2,
};

/// A place from which firings are predicted; [`Simulator::station`] makes it.
pub struct Station<'a> {
    simulator: &'a Simulator,
    position: DVec2,
    /// Of a transducer on the axis, which stays where it is when it turns; one beside the axis is
    /// somewhere else at each azimuth.
    axis: Option<Place<'a>>,
}

/// A firing that hears more has to make room for them.
const USUAL_SOUNDS: usize = 64;

impl<'a> Station<'a> {
    pub(super) fn new(simulator: &'a Simulator, position: DVec2) -> Self {
        let on_axis = simulator.sensor().mounting.is_on_axis();
        let axis = on_axis.then(|| simulator.place([position; 2]));
        Self { simulator, position, axis }
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
        let receiver = self.simulator.receiver();
        let mut sounds = Vec::with_capacity(USUAL_SOUNDS);
        self.at(direction_rad, |place| {
            let (detection, survey) = place.nearest(|survey, reach_m| {
                survey.listen(direction_rad, &mut sounds);
                let firing = Firing { survey, direction_rad };
                let incident = |sound: &Sound| Some(firing.incident(sound));
                let incident: &dyn Fn(&Sound) -> Option<Incident> =
                    if receiver.asks_incidents() { &incident } else { &|_| None };
                receiver.detect_within(reach_m, &sounds, incident, latch)
            });
            Firing { survey, direction_rad }.prediction(detection)
        })
    }

    /// The same by all echoes at once, however far they come from.
    #[cfg(test)]
    pub(super) fn ping_by_all(&self, direction_rad: f64, latch: Latch) -> Prediction {
        self.firing(direction_rad, |firing| {
            let incident = |sound: &Sound| Some(firing.incident(sound));
            let receiver = self.simulator.receiver();
            firing.prediction(receiver.detect_at_face(&firing.sounds(), &incident, latch))
        })
    }

    /// [`ping_rearmed`](Self::ping_rearmed) in noise: the same generator in the same state gives
    /// the same reading.
    #[must_use]
    pub fn ping_in_noise(
        &self,
        direction_rad: f64,
        noise: &ReceiverNoise,
        rng: &mut impl Rng,
    ) -> Prediction {
        self.firing(direction_rad, |firing| {
            let incident = |sound: &Sound| Some(firing.incident(sound));
            let receiver = self.simulator.receiver();
            firing.prediction(receiver.detect_in_noise(&firing.sounds(), &incident, noise, rng))
        })
    }

    /// What an oscilloscope would show of a firing, up to a range in metres, in steps of so many
    /// microseconds; each [`Hump`](crate::acoustics::Hump) can be named with
    /// [`arrival`](Self::arrival).
    #[must_use]
    pub fn trace(&self, direction_rad: f64, until_m: f64, step_us: f64) -> EchoTrace {
        self.firing(direction_rad, |firing| {
            let receiver = self.simulator.receiver();
            let until_us = 2e6 * until_m / receiver.sound_speed_m_s;
            let incident = |sound: &Sound| Some(firing.incident(sound));
            receiver.trace(&firing.sounds(), &incident, until_us, step_us)
        })
    }

    /// Every echo of a firing in a world direction, detected or not, shortest path first.
    #[must_use]
    pub fn arrivals(&self, direction_rad: f64) -> Vec<Arrival> {
        self.firing(direction_rad, |firing| firing.survey.arrivals(direction_rad))
    }

    /// The full account of a sound of a firing in the same direction.
    #[must_use]
    pub fn arrival(&self, direction_rad: f64, sound: &Sound) -> Arrival {
        self.firing(direction_rad, |firing| firing.survey.arrival(direction_rad, sound))
    }

    /// Fires with all echoes from where the transducer is when it looks into a direction.
    fn firing<T>(&self, direction_rad: f64, tell: impl FnOnce(&Firing) -> T) -> T {
        self.at(direction_rad, |place| tell(&Firing { survey: place.whole(), direction_rad }))
    }

    /// Goes where the transducer is when it looks into a direction.
    fn at<T>(&self, direction_rad: f64, tell: impl FnOnce(&Place) -> T) -> T {
        if let Some(place) = &self.axis {
            return tell(place);
        }
        let mounting = &self.simulator.sensor().mounting;
        tell(&self.simulator.place(mounting.places(self.position, direction_rad)))
    }
}

/// The echoes of a place in a direction.
struct Firing<'a> {
    survey: &'a dyn Survey,
    direction_rad: f64,
}

impl Firing<'_> {
    fn sounds(&self) -> Vec<Sound> {
        let mut sounds = Vec::new();
        self.survey.listen(self.direction_rad, &mut sounds);
        sounds
    }

    fn incident(&self, sound: &Sound) -> Incident {
        self.survey.incident(self.direction_rad, sound)
    }

    fn prediction(&self, detection: Detection) -> Prediction {
        let arrival = |sound| self.survey.arrival(self.direction_rad, &sound);
        Prediction {
            status: detection.status,
            range_m: detection.range_m,
            arrival: detection.sound.map(arrival),
            amplitude: detection.amplitude,
            margin_db: detection.margin_db,
            echoes_us: detection.echoes_us,
        }
    }
}
