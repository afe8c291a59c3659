//! The messages of a recording, made of records as they come.

mod map;

use std::{convert::Infallible, sync::Arc};

use sonard_records::{Ping, Record, ScanStart, ScanView, Session};

use crate::{
    LeftOut, Settings, Topic,
    conversion::{Converter, Firings, MessageSink, in_order},
    live::map::LiveMap,
    recording::nanoseconds,
    ros::{
        cdr::{Cdr, Encode},
        interface::Interface,
        message::Stamp,
    },
};

/// Readings of the longest scan that is told as a whole; of a longer one the readings are. They wait in memory until
/// the scan ends, about a kilobyte each.
const MOST_READINGS: usize = 4096;

/// A message for live viewers.
#[derive(Debug, Clone, Copy)]
pub struct LiveMessage<'a> {
    /// Name of its topic, one of [`Live::topics`].
    pub topic: &'a str,
    /// When it was known, nanoseconds since 1970.
    pub at_ns: u64,
    /// It, in CDR.
    pub bytes: &'a [u8],
}

/// Makes messages of records in the order of a log, whose readings have times. What it holds does not grow with what it
/// is given: at most the readings of a scan of 4096 and, where it makes a map, that.
#[derive(Debug)]
pub struct Live {
    converter: Converter,
    topics: Vec<Topic>,
    map: Option<LiveMap>,
    session: Option<Arc<Session>>,
    /// The scan under way, with its readings as long as they are not too many.
    scan: Option<UnderWay>,
    /// The bytes of a message, kept for the next.
    buffer: Vec<u8>,
}

#[derive(Debug)]
struct UnderWay {
    view: ScanView,
    is_too_long: bool,
}

impl Live {
    /// One that has not seen any record.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let converter = Converter::new(settings);
        let topics = Vec::new();
        Self { converter, topics, map: None, session: None, scan: None, buffer: Vec::new() }
    }

    /// Whether it also tells a map after each scan ([`Topic::map`]): cell for cell the one that `sonard map` makes of
    /// all scans so far. Scans of more than 4096 readings are not on it. It has at most 500,000 cells, and takes at most 12
    /// megabytes; a place that is larger ends it.
    #[must_use]
    pub fn with_map(mut self, is_wanted: bool) -> Self {
        self.map = is_wanted.then(LiveMap::new);
        self.topics.retain(|topic| *topic != Topic::map());
        self.topics.extend(is_wanted.then(Topic::map));
        self
    }

    /// What there may be messages of in the session in force.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Takes the next record and hands what there is to be told of it to `tell`.
    ///
    /// # Errors
    /// Of a session that says too little for messages: nothing is told of its scans. Of a scan with which the map ends.
    pub fn take(
        &mut self,
        record: Record,
        tell: impl FnMut(LiveMessage<'_>),
    ) -> Result<(), LeftOut> {
        let mut teller = Teller { tell, buffer: std::mem::take(&mut self.buffer) };
        let taken = match record {
            Record::Session(session) => {
                let mapped = self.end_without_word(&mut teller);
                self.begin_session(session.into()).and(mapped)
            }
            Record::ScanStart(start) => {
                let mapped = self.end_without_word(&mut teller);
                self.scan = Some(UnderWay::of(start, self.session.clone()));
                mapped
            }
            Record::Ping(ping) => {
                self.take_reading(*ping, &mut teller);
                Ok(())
            }
            Record::ScanEnd(end) => {
                let scan = self.scan.take_if(|scan| scan.view.scan == end.scan);
                scan.map_or(Ok(()), |mut scan| {
                    scan.view.end = Some(end);
                    self.end_scan(&scan, &mut teller)
                })
            }
            Record::Event(_) => Ok(()),
        };
        self.buffer = teller.buffer;
        taken
    }

    fn begin_session(&mut self, session: Arc<Session>) -> Result<(), LeftOut> {
        let begun = self.converter.begin_session(&session);
        self.topics = self.converter.topics().to_vec();
        self.topics.extend(self.map.is_some().then(Topic::map));
        (self.session, self.scan) = (Some(session), None);
        begun
    }

    /// A scan whose end never came is on the map as well.
    fn end_without_word(
        &mut self,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), LeftOut> {
        let scan = self.scan.take();
        scan.map_or(Ok(()), |scan| self.map(&scan, out))
    }

    fn map(
        &mut self,
        scan: &UnderWay,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), LeftOut> {
        match &mut self.map {
            Some(map) if !scan.is_too_long => map.add(&scan.view, self.converter.end(), out),
            _ => Ok(()),
        }
    }

    fn take_reading(&mut self, ping: Ping, out: &mut impl MessageSink<Error = Infallible>) {
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
        scan: &UnderWay,
        out: &mut impl MessageSink<Error = Infallible>,
    ) -> Result<(), LeftOut> {
        if scan.is_too_long {
            return Ok(());
        }
        let pings = in_order(&scan.view);
        let fired = pings.iter().map(|ping| fired(ping)).collect();
        let firings = Firings { fired, window_ns: self.converter.window_ns() };
        let Ok(()) = self.converter.scan(&scan.view, (&pings, &firings), out);
        self.map(scan, out)
    }
}

impl UnderWay {
    fn of(start: ScanStart, session: Option<Arc<Session>>) -> Self {
        let (pings, events) = (Vec::new(), Vec::new());
        let scan = start.scan;
        let view = ScanView { scan, session, start: Some(start), pings, events, end: None };
        Self { view, is_too_long: false }
    }

    fn add(&mut self, ping: Ping) {
        if self.view.pings.len() >= MOST_READINGS {
            (self.view.pings, self.is_too_long) = (Vec::new(), true);
        }
        if !self.is_too_long {
            self.view.pings.push(ping);
        }
    }
}

/// When a reading was fired, by the log: where a device's time is not the world's, when it came.
fn fired(ping: &Ping) -> Option<Stamp> {
    ping.time.map(|time| Stamp(nanoseconds(time)))
}

/// Encodes messages and hands them on.
struct Teller<F> {
    tell: F,
    buffer: Vec<u8>,
}

impl<F: FnMut(LiveMessage<'_>)> MessageSink for Teller<F> {
    type Error = Infallible;

    fn message(
        &mut self,
        topic: &str,
        _interface: Interface,
        at: Stamp,
        message: &impl Encode,
    ) -> Result<(), Infallible> {
        let bytes = Cdr::of(message, &mut self.buffer);
        (self.tell)(LiveMessage { topic, at_ns: at.0, bytes });
        Ok(())
    }
}
