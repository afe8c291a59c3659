//! Conversion of records to ROS 2 messages, one record at a time, for recordings and live viewers.
//!
//! Free of I/O and clocks: the caller provides the time of each firing and a [`MessageSink`] for
//! the messages.

mod frames;
mod readings;
mod scene;
mod settings;
mod topics;

use sonard_model::geometry::Pose;
use sonard_records::{Ping, ScanView, Session};

use crate::{
    SkippedScan,
    ros::{
        cdr::Encode,
        interface::{Interface, LASER_SCAN, MARKERS, POINT_CLOUD, TRANSFORMS},
        message::{Float, Header, Markers, Range, Stamp, Transforms},
    },
};
pub(crate) use frames::MAP;
use frames::RangerPose;
pub(crate) use readings::{FiringTimes, plan_order};
use readings::{RangeReading, SessionParameters, laser_scan, paths, points};
use scene::outlines;
pub use settings::{Distribution, ExportSettings, Profile};
use topics::ReadingTopic;
pub use topics::Topic;
use topics::{FIXED_TRANSFORMS, SCENE};
pub(crate) use topics::{MAP_TOPIC, is_static_topic};

/// Receiver of converted messages.
pub(crate) trait MessageSink {
    type Error;

    /// Writes a message at a time.
    fn message(
        &mut self,
        topic: &str,
        interface: Interface,
        at: Stamp,
        message: &impl Encode,
    ) -> Result<(), Self::Error>;
}

/// Converter of readings and scans to messages.
#[derive(Debug)]
pub(crate) struct Converter {
    settings: ExportSettings,
    /// Parameters of the current session.
    parameters: Option<SessionParameters>,
    topics: Vec<Topic>,
    /// Static messages of the session, until the first reading gives their time.
    static_messages: Option<StaticMessages>,
    /// Last reading, until the transducer's position at its end is written.
    open_reading: Option<OpenReading>,
    /// End of the last written reading.
    end: Stamp,
}

/// Messages that are written once per session, with the time of its first reading.
#[derive(Debug)]
struct StaticMessages {
    scene: Vec<(&'static str, Vec<[f64; 3]>)>,
}

/// Reading whose end is not written yet.
#[derive(Debug, Clone, Copy)]
struct OpenReading {
    fired: Stamp,
    ranger_pose: RangerPose,
}

impl Converter {
    pub(crate) fn new(settings: ExportSettings) -> Self {
        let end = Stamp(0);
        Self {
            settings,
            parameters: None,
            topics: Vec::new(),
            static_messages: None,
            open_reading: None,
            end,
        }
    }

    /// Starts a session; returns the reason if its scans cannot be converted.
    pub(crate) fn begin_session(&mut self, session: &Session) -> Result<(), SkippedScan> {
        (self.parameters, self.topics, self.static_messages) = (None, Vec::new(), None);
        let parameters = SessionParameters::new(session, &self.settings)?;
        let scene = outlines(session);
        let distribution = self.settings.distribution;
        self.topics =
            topics::session_topics(session, &parameters.frames, !scene.is_empty(), distribution);
        self.static_messages = Some(StaticMessages { scene });
        self.parameters = Some(parameters);
        Ok(())
    }

    /// Returns `true` if scans of the current session can be converted.
    pub(crate) const fn is_in_session(&self) -> bool {
        self.parameters.is_some()
    }

    /// Returns the topics of the current session.
    pub(crate) fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Returns the end of the last written reading.
    pub(crate) const fn end(&self) -> Stamp {
        self.end
    }

    /// Returns the duration of the receive window, nanoseconds.
    pub(crate) fn window_ns(&self) -> u64 {
        self.parameters.as_ref().map_or(0, |parameters| parameters.window_ns)
    }

    /// Writes the messages of a reading, and the transforms at its firing with the robot at a pose.
    pub(crate) fn reading<O: MessageSink>(
        &mut self,
        robot: Pose,
        ping: &Ping,
        fired: Stamp,
        out: &mut O,
    ) -> Result<(), O::Error> {
        // Ends before the motor steps and the next reading starts: a frame has one placement at a
        // time.
        self.close(Stamp(fired.0.saturating_sub(1)), out)?;
        let Some(parameters) = &self.parameters else { return Ok(()) };
        if let Some(static_messages) = self.static_messages.take() {
            static_messages.write(parameters, fired, out)?;
        }
        let ranger_pose = RangerPose::at_reading(robot, ping);
        self.settings.write_transforms(parameters, fired, ranger_pose, out)?;
        self.open_reading = Some(OpenReading { fired, ranger_pose });
        parameters.write(&self.settings, ping, fired, out)
    }

    /// Writes the messages of a complete scan, whose readings were written, in plan order.
    pub(crate) fn scan<O: MessageSink>(
        &mut self,
        scan: &ScanView,
        (pings, firings): (&[&Ping], &FiringTimes),
        out: &mut O,
    ) -> Result<(), O::Error> {
        self.close(Stamp(u64::MAX), out)?;
        let (end, both) = (self.end, (pings, firings));
        let first = firings.fired.iter().flatten().min();
        let Some((first, parameters)) = first.copied().zip(self.parameters.as_ref()) else {
            return Ok(());
        };
        if let Some(laser) = laser_scan(scan, both, parameters, first) {
            out.message(topics::SCAN, LASER_SCAN, end, &laser)?;
        }
        let header = Header { stamp: first, frame: MAP };
        let cloud = points(scan, both, header, |ping| Some(RangeReading::measured(ping)));
        out.message(topics::POINTS, POINT_CLOUD, end, &cloud)?;
        if pings.iter().any(|ping| ping.sim.is_some()) {
            let cloud = points(scan, both, header, RangeReading::predicted);
            out.message(topics::PREDICTED_POINTS, POINT_CLOUD, end, &cloud)?;
        }
        if pings.iter().any(|ping| ping.sound_path().is_some()) {
            out.message(topics::PATHS, MARKERS, end, &Markers(paths(scan, pings, header)))?;
        }
        Ok(())
    }

    /// Writes the transforms at the end of the last reading's window, or at `latest`.
    fn close<O: MessageSink>(&mut self, latest: Stamp, out: &mut O) -> Result<(), O::Error> {
        let Some((last, parameters)) = self.open_reading.take().zip(self.parameters.as_ref())
        else {
            return Ok(());
        };
        let end = parameters.window_end(last.fired).min(latest).max(last.fired);
        self.end = self.end.max(end);
        // Already written if no time has passed.
        if end == last.fired {
            return Ok(());
        }
        self.settings.write_transforms(parameters, end, last.ranger_pose, out)
    }
}

impl ExportSettings {
    /// Writes the transforms of moving frames at a time.
    fn write_transforms<O: MessageSink>(
        &self,
        parameters: &SessionParameters,
        at: Stamp,
        ranger_pose: RangerPose,
        out: &mut O,
    ) -> Result<(), O::Error> {
        let mut transforms = parameters.frames.moving(at, ranger_pose);
        if !self.places_robot {
            transforms.retain(|transform| transform.header.frame != MAP);
        }
        match transforms.is_empty() {
            true => Ok(()),
            false => out.message(topics::TRANSFORMS_TOPIC, TRANSFORMS, at, &Transforms(transforms)),
        }
    }
}

impl StaticMessages {
    fn write<O: MessageSink>(
        self,
        parameters: &SessionParameters,
        at: Stamp,
        out: &mut O,
    ) -> Result<(), O::Error> {
        let fixed = Transforms(parameters.frames.fixed(at));
        out.message(FIXED_TRANSFORMS, TRANSFORMS, at, &fixed)?;
        if self.scene.is_empty() {
            return Ok(());
        }
        let header = Header { stamp: at, frame: MAP };
        out.message(SCENE, MARKERS, at, &Markers(scene::markers(self.scene, header)))
    }
}

impl SessionParameters {
    /// Returns the end of the receive window of a reading, before the motor steps.
    fn window_end(&self, fired: Stamp) -> Stamp {
        Stamp(fired.0.saturating_add(self.window_ns.saturating_sub(1)))
    }

    /// Writes measured range, predicted range and residual, as far as they are known.
    fn write<O: MessageSink>(
        &self,
        settings: &ExportSettings,
        ping: &Ping,
        fired: Stamp,
        out: &mut O,
    ) -> Result<(), O::Error> {
        let Some((frame, ranger)) = self.frames.frame_of_reading(ping) else { return Ok(()) };
        let received_at = self.window_end(fired);
        let readings = [
            (ReadingTopic::Range, Some(RangeReading::measured(ping))),
            (ReadingTopic::Predicted, RangeReading::predicted(ping)),
        ];
        for (topic, reading) in readings {
            let range = reading.and_then(|reading| self.range(settings.profile, reading));
            let Some(range) = range else { continue };
            let message = Range {
                header: Header { stamp: fired, frame },
                field_of_view: self.field_of_view_rad as f32,
                min_range: self.min_range_m as f32,
                max_range: self.max_range_m as f32,
                range,
                has_variance: settings.distribution != Distribution::Humble,
            };
            let interface = topic.interface(settings.distribution);
            out.message(&topic.topic(ranger), interface, received_at, &message)?;
        }
        match ping.residual_m {
            Some(residual_m) => {
                let topic = ReadingTopic::Residual;
                let interface = topic.interface(settings.distribution);
                out.message(&topic.topic(ranger), interface, received_at, &Float(residual_m))
            }
            None => Ok(()),
        }
    }
}
