//! Live conversion of records to the messages of a recording.

mod map;

use std::{convert::Infallible, sync::Arc};

use sonard_records::{Ping, Record, ScanStart, ScanView, Session};

use crate::{
    ExportSettings, SkippedScan, Topic,
    conversion::{Converter, FiringTimes, MessageSink, plan_order},
    live::map::LiveMap,
    recording::nanoseconds,
    ros::{
        cdr::{CdrWriter, Encode},
        interface::Interface,
        message::Stamp,
    },
};

/// Maximum number of readings of a scan that is converted as a whole; of longer scans only the
/// readings are converted. Readings are held in memory until the scan ends, about a kilobyte each.
const MAX_READINGS: usize = 4096;

/// Message for live viewers.
#[derive(Debug, Clone, Copy)]
pub struct LiveMessage<'a> {
    /// Topic name, one of [`LiveConverter::topics`].
    pub topic: &'a str,
    /// Time at which the message was complete, nanoseconds since 1970.
    pub at_ns: u64,
    /// Message encoded in CDR.
    pub bytes: &'a [u8],
}

/// Converter of records, in log order and with times, to messages. Memory is bounded: at most the
/// readings of a scan of 4096 and an optional map.
#[derive(Debug)]
pub struct LiveConverter {
    converter: Converter,
    topics: Vec<Topic>,
    map: Option<LiveMap>,
    session: Option<Arc<Session>>,
    /// Current scan, with its readings unless they are too many.
    scan: Option<PartialScan>,
    /// Buffer of an encoded message, reused.
    buffer: Vec<u8>,
}

#[derive(Debug)]
struct PartialScan {
    view: ScanView,
    is_too_long: bool,
}

impl LiveConverter {
    /// Creates a converter without a session.
    #[must_use]
    pub fn new(settings: ExportSettings) -> Self {
        let converter = Converter::new(settings);
        let topics = Vec::new();
        Self { converter, topics, map: None, session: None, scan: None, buffer: Vec::new() }
    }

    /// Enables a map after each scan ([`Topic::map`]), identical to that of `sonard map` for all
    /// scans so far. Scans of more than 4096 readings are excluded. The map has at most 500,000
    /// cells and takes at most 12 MB; it stops at a larger place.
    #[must_use]
    pub fn with_map(mut self, is_enabled: bool) -> Self {
        self.map = is_enabled.then(LiveMap::new);
        self.topics.retain(|topic| *topic != Topic::map());
        self.topics.extend(is_enabled.then(Topic::map));
        self
    }

    /// Returns the topics of the current session.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Converts the next record and passes its messages to `callback`.
    ///
    /// # Errors
    /// Returns the reason if a session cannot be converted, so that its scans are skipped, or if a
    /// scan ends the map.
    pub fn convert(
        &mut self,
        record: Record,
        callback: impl FnMut(LiveMessage<'_>),
    ) -> Result<(), SkippedScan> {
        let mut sink = CallbackSink { callback, buffer: std::mem::take(&mut self.buffer) };
        let result = match record {
            Record::Session(session) => {
                let mapped = self.map_unfinished_scan(&mut sink);
                self.begin_session(session.into()).and(mapped)
            }
            Record::ScanStart(start) => {
                let mapped = self.map_unfinished_scan(&mut sink);
                self.scan = Some(PartialScan::new(start, self.session.clone()));
                mapped
            }
            Record::Ping(ping) => {
                self.convert_reading(*ping, &mut sink);
                Ok(())
            }
            Record::ScanEnd(end) => {
                let scan = self.scan.take_if(|scan| scan.view.scan == end.scan);
                scan.map_or(Ok(()), |mut scan| {
                    scan.view.end = Some(end);
                    self.end_scan(&scan, &mut sink)
                })
            }
            Record::Event(_) => Ok(()),
        };
        self.buffer = sink.buffer;
        result
    }

    fn begin_session(&mut self, session: Arc<Session>) -> Result<(), SkippedScan> {
        let begun = self.converter.begin_session(&session);
        self.topics = self.converter.topics().to_vec();
        self.topics.extend(self.map.is_some().then(Topic::map));
        (self.session, self.scan) = (Some(session), None);
        begun
    }

    /// Adds a scan without an end record to the map.
    fn map_unfinished_scan(
        &mut self,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), SkippedScan> {
        let scan = self.scan.take();
        scan.map_or(Ok(()), |scan| self.map(&scan, out))
    }

    fn map(
        &mut self,
        scan: &PartialScan,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), SkippedScan> {
        match &mut self.map {
            Some(map) if !scan.is_too_long => map.add(&scan.view, self.converter.end(), out),
            _ => Ok(()),
        }
    }

    fn convert_reading(&mut self, ping: Ping, out: &mut impl MessageSink<Error = Infallible>) {
        let Some(scan) = self.scan.as_mut().filter(|scan| scan.view.scan == ping.scan) else {
            return;
        };
        let robot = ping.pose.or_else(|| scan.view.pose());
        if let Some((robot, fired)) = robot.zip(fired(&ping)) {
            let Ok(()) = self.converter.reading(robot, &ping, fired, out);
        }
        scan.add(ping);
    }

    fn end_scan(
        &mut self,
        scan: &PartialScan,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), SkippedScan> {
        if scan.is_too_long {
            return Ok(());
        }
        let pings = plan_order(&scan.view);
        let fired = pings.iter().map(|ping| fired(ping)).collect();
        let firings = FiringTimes { fired, window_ns: self.converter.window_ns() };
        let Ok(()) = self.converter.scan(&scan.view, (&pings, &firings), out);
        self.map(scan, out)
    }
}

impl PartialScan {
    fn new(start: ScanStart, session: Option<Arc<Session>>) -> Self {
        let (pings, events) = (Vec::new(), Vec::new());
        let scan = start.scan;
        let view = ScanView { scan, session, start: Some(start), pings, events, end: None };
        Self { view, is_too_long: false }
    }

    fn add(&mut self, ping: Ping) {
        if self.view.pings.len() >= MAX_READINGS {
            (self.view.pings, self.is_too_long) = (Vec::new(), true);
        }
        if !self.is_too_long {
            self.view.pings.push(ping);
        }
    }
}

/// Returns the firing time in the log; without clock synchronization, the time of reception.
fn fired(ping: &Ping) -> Option<Stamp> {
    ping.time.map(|time| Stamp(nanoseconds(time)))
}

/// Message sink that encodes messages and passes them to a callback.
struct CallbackSink<F> {
    callback: F,
    buffer: Vec<u8>,
}

impl<F: FnMut(LiveMessage<'_>)> MessageSink for CallbackSink<F> {
    type Error = Infallible;

    fn message(
        &mut self,
        topic: &str,
        _interface: Interface,
        at: Stamp,
        message: &impl Encode,
    ) -> Result<(), Infallible> {
        let bytes = CdrWriter::encode(message, &mut self.buffer);
        (self.callback)(LiveMessage { topic, at_ns: at.0, bytes });
        Ok(())
    }
}
