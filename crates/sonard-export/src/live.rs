//! The messages of a recording, made of records as they come.

use std::{convert::Infallible, sync::Arc};

use sonard_records::{Ping, Record, ScanStart, ScanView, Session};

use crate::{
    LeftOut, Settings, Topic,
    conversion::{Converter, Firings, Outlet, in_order},
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
/// is given: at most the readings of a scan of 4096.
#[derive(Debug)]
pub struct Live {
    converter: Converter,
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
        Self { converter, session: None, scan: None, buffer: Vec::new() }
    }

    /// What there may be messages of in the session in force.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        self.converter.topics()
    }

    /// Takes the next record and hands what there is to be told of it to `tell`.
    ///
    /// # Errors
    /// Of a session that says too little for messages: nothing is told of its scans.
    pub fn take(
        &mut self,
        record: Record,
        tell: impl FnMut(LiveMessage<'_>),
    ) -> Result<(), LeftOut> {
        let mut teller = Teller { tell, buffer: std::mem::take(&mut self.buffer) };
        let taken = match record {
            Record::Session(session) => self.begin_session(session.into()),
            Record::ScanStart(start) => {
                self.scan = Some(UnderWay::of(start, self.session.clone()));
                Ok(())
            }
            Record::Ping(ping) => {
                self.take_reading(*ping, &mut teller);
                Ok(())
            }
            Record::ScanEnd(end) => {
                if let Some(mut scan) = self.scan.take_if(|scan| scan.view.scan == end.scan) {
                    scan.view.end = Some(end);
                    self.end_scan(&scan, &mut teller);
                }
                Ok(())
            }
            Record::Event(_) => Ok(()),
        };
        self.buffer = teller.buffer;
        taken
    }

    fn begin_session(&mut self, session: Arc<Session>) -> Result<(), LeftOut> {
        let begun = self.converter.begin_session(&session);
        (self.session, self.scan) = (Some(session), None);
        begun
    }

    fn take_reading(&mut self, ping: Ping, out: &mut impl Outlet<Error = Infallible>) {
        let Some(scan) = self.scan.as_mut().filter(|scan| scan.view.scan == ping.scan) else {
            return;
        };
        let robot = ping.pose.or_else(|| scan.view.pose());
        if let Some((robot, fired)) = robot.zip(fired(&ping)) {
            let Ok(()) = self.converter.reading(robot, &ping, fired, out);
        }
        scan.add(ping);
    }

    fn end_scan(&mut self, scan: &UnderWay, out: &mut impl Outlet<Error = Infallible>) {
        if scan.is_too_long {
            return;
        }
        let pings = in_order(&scan.view);
        let fired = pings.iter().map(|ping| fired(ping)).collect();
        let firings = Firings { fired, window_ns: self.converter.window_ns() };
        let Ok(()) = self.converter.scan(&scan.view, (&pings, &firings), out);
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

impl<F: FnMut(LiveMessage<'_>)> Outlet for Teller<F> {
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
