//! From records to messages of ROS 2, one record at a time: what recordings hold and what live viewers are told.
//!
//! Pure: it is told when each reading was fired, and hands messages to an [`MessageSink`].

mod frames;
mod readings;
mod scene;
mod settings;
mod topics;

use sonard_model::geometry::Pose;
use sonard_records::{Ping, ScanView, Session};

use crate::{
    LeftOut,
    ros::{
        cdr::Encode,
        interface::{Interface, LASER_SCAN, MARKERS, POINT_CLOUD, TRANSFORMS},
        message::{Float, Header, Markers, Range, Stamp, Transforms},
    },
};
pub(crate) use frames::MAP;
use frames::Stance;
use readings::{Figures, Heard, laser_scan, paths, points};
pub(crate) use readings::{Firings, in_order};
use scene::outlines;
pub use settings::{Distribution, Profile, Settings};
use topics::OfReading;
pub use topics::Topic;
use topics::{FIXED_TRANSFORMS, SCENE};
pub(crate) use topics::{MAP_TOPIC, stands_still};

/// Where messages go.
pub(crate) trait MessageSink {
    type Error;

    /// Takes a message, told at a time.
    fn message(
        &mut self,
        topic: &str,
        interface: Interface,
        at: Stamp,
        message: &impl Encode,
    ) -> Result<(), Self::Error>;
}

/// Makes messages of readings and scans.
#[derive(Debug)]
pub(crate) struct Converter {
    settings: Settings,
    /// Of the session in force.
    figures: Option<Figures>,
    topics: Vec<Topic>,
    /// What stands still in that session and was not told yet.
    untold: Option<Untold>,
    /// The last reading, until the transducer's place at its end is told.
    listening: Option<Listening>,
    /// When the last reading ended.
    end: Stamp,
}

/// What is told once in a session, when it has a first time.
#[derive(Debug)]
struct Untold {
    scene: Vec<(&'static str, Vec<[f64; 3]>)>,
}

/// A reading whose end is not told yet.
#[derive(Debug, Clone, Copy)]
struct Listening {
    fired: Stamp,
    stance: Stance,
}

impl Converter {
    pub(crate) fn new(settings: Settings) -> Self {
        let end = Stamp(0);
        Self { settings, figures: None, topics: Vec::new(), untold: None, listening: None, end }
    }

    /// Takes what holds for the scans that follow; says so if there is nothing to be told of them.
    pub(crate) fn begin_session(&mut self, session: &Session) -> Result<(), LeftOut> {
        (self.figures, self.topics, self.untold) = (None, Vec::new(), None);
        let figures = Figures::of(session, &self.settings)?;
        let scene = outlines(session);
        let distribution = self.settings.distribution;
        self.topics = topics::of_session(session, &figures.frames, !scene.is_empty(), distribution);
        self.untold = Some(Untold { scene });
        self.figures = Some(figures);
        Ok(())
    }

    /// Whether there is something to be told of the scans of the session in force.
    pub(crate) const fn is_in_session(&self) -> bool {
        self.figures.is_some()
    }

    /// The topics of the session in force.
    pub(crate) fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// When the last reading ended that was told.
    pub(crate) const fn end(&self) -> Stamp {
        self.end
    }

    /// How long a reading listens, nanoseconds.
    pub(crate) fn window_ns(&self) -> u64 {
        self.figures.as_ref().map_or(0, |figures| figures.window_ns)
    }

    /// Tells a reading, with the robot at a pose, and where the transducer was.
    pub(crate) fn reading<O: MessageSink>(
        &mut self,
        robot: Pose,
        ping: &Ping,
        fired: Stamp,
        out: &mut O,
    ) -> Result<(), O::Error> {
        // Before the motor steps on, and before the next reading begins: no frame is at two places at one time.
        self.close(Stamp(fired.0.saturating_sub(1)), out)?;
        let Some(figures) = &self.figures else { return Ok(()) };
        if let Some(untold) = self.untold.take() {
            untold.tell(figures, fired, out)?;
        }
        let stance = Stance::of(robot, ping);
        self.settings.place(figures, fired, stance, out)?;
        self.listening = Some(Listening { fired, stance });
        figures.tell(&self.settings, ping, fired, out)
    }

    /// Tells a scan whose readings are told, in the order of its plan.
    pub(crate) fn scan<O: MessageSink>(
        &mut self,
        scan: &ScanView,
        (pings, firings): (&[&Ping], &Firings),
        out: &mut O,
    ) -> Result<(), O::Error> {
        self.close(Stamp(u64::MAX), out)?;
        let (end, both) = (self.end, (pings, firings));
        let first = firings.fired.iter().flatten().min();
        let Some((first, figures)) = first.copied().zip(self.figures.as_ref()) else {
            return Ok(());
        };
        if let Some(laser) = laser_scan(scan, both, figures, first) {
            out.message(topics::SCAN, LASER_SCAN, end, &laser)?;
        }
        let header = Header { stamp: first, frame: MAP };
        let cloud = points(scan, both, header, |ping| Some(Heard::measured(ping)));
        out.message(topics::POINTS, POINT_CLOUD, end, &cloud)?;
        if pings.iter().any(|ping| ping.sim.is_some()) {
            let cloud = points(scan, both, header, Heard::predicted);
            out.message(topics::PREDICTED_POINTS, POINT_CLOUD, end, &cloud)?;
        }
        if pings.iter().any(|ping| ping.sound_path().is_some()) {
            out.message(topics::PATHS, MARKERS, end, &Markers(paths(scan, pings, header)))?;
        }
        Ok(())
    }

    /// Tells where the transducer was when the last reading's window ended, or at `latest`.
    fn close<O: MessageSink>(&mut self, latest: Stamp, out: &mut O) -> Result<(), O::Error> {
        let Some((last, figures)) = self.listening.take().zip(self.figures.as_ref()) else {
            return Ok(());
        };
        let end = figures.ended(last.fired).min(latest).max(last.fired);
        self.end = self.end.max(end);
        // Told already, where there is no time between.
        if end == last.fired {
            return Ok(());
        }
        self.settings.place(figures, end, last.stance, out)
    }
}

impl Settings {
    /// Tells where what moves is at a time.
    fn place<O: MessageSink>(
        &self,
        figures: &Figures,
        at: Stamp,
        stance: Stance,
        out: &mut O,
    ) -> Result<(), O::Error> {
        let mut placed = figures.frames.moving(at, stance);
        if !self.places_robot {
            placed.retain(|transform| transform.header.frame != MAP);
        }
        match placed.is_empty() {
            true => Ok(()),
            false => out.message(topics::TRANSFORMS_TOPIC, TRANSFORMS, at, &Transforms(placed)),
        }
    }
}

impl Untold {
    fn tell<O: MessageSink>(
        self,
        figures: &Figures,
        at: Stamp,
        out: &mut O,
    ) -> Result<(), O::Error> {
        let fixed = Transforms(figures.frames.fixed(at));
        out.message(FIXED_TRANSFORMS, TRANSFORMS, at, &fixed)?;
        if self.scene.is_empty() {
            return Ok(());
        }
        let header = Header { stamp: at, frame: MAP };
        out.message(SCENE, MARKERS, at, &Markers(scene::markers(self.scene, header)))
    }
}

impl Figures {
    /// When a reading that was fired at a time stops to listen: before the motor steps on.
    fn ended(&self, fired: Stamp) -> Stamp {
        Stamp(fired.0.saturating_add(self.window_ns.saturating_sub(1)))
    }

    /// Tells what was heard, what was predicted, and by how much they differ, when both are known.
    fn tell<O: MessageSink>(
        &self,
        settings: &Settings,
        ping: &Ping,
        fired: Stamp,
        out: &mut O,
    ) -> Result<(), O::Error> {
        let Some((frame, ranger)) = self.frames.of_reading(ping) else { return Ok(()) };
        let heard_at = self.ended(fired);
        let readings = [
            (OfReading::Range, Some(Heard::measured(ping))),
            (OfReading::Predicted, Heard::predicted(ping)),
        ];
        for (told, heard) in readings {
            let range = heard.and_then(|heard| self.range(settings.profile, heard));
            let Some(range) = range else { continue };
            let message = Range {
                header: Header { stamp: fired, frame },
                field_of_view: self.field_of_view_rad as f32,
                min_range: self.min_range_m as f32,
                max_range: self.max_range_m as f32,
                range,
                has_variance: settings.distribution != Distribution::Humble,
            };
            let interface = told.interface(settings.distribution);
            out.message(&told.topic(ranger), interface, heard_at, &message)?;
        }
        match ping.residual_m {
            Some(residual_m) => {
                let told = OfReading::Residual;
                let interface = told.interface(settings.distribution);
                out.message(&told.topic(ranger), interface, heard_at, &Float(residual_m))
            }
            None => Ok(()),
        }
    }
}
