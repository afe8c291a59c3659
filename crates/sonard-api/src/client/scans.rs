//! Scans that a daemon is asked for, as their records come in.

use std::{
    collections::{HashSet, VecDeque},
    time::Duration,
};

use sonard_records::{EventKind, Ping, Record, ScanEnd, Session, decode_line};
use thiserror::Error;
use tokio::time::timeout;
use uuid::Uuid;

use super::{Client, ClientError, LiveLines};
use crate::api::{Accepted, CancelRequest, ScanReport, ScanRequest, Started, Status};

/// How long nothing may come before it is asked whether the request is still known.
const QUIET: Duration = Duration::from_secs(2);
/// How long the end of a cancelled scan is waited for.
const CLOSING: Duration = Duration::from_secs(4);
/// What stands in a stream for readings that this client was too slow for.
const DROPPED: &[u8] = br#"{"type":"dropped""#;

/// Scans that a daemon takes on request, with their own plan and pose. What else it measures
/// meanwhile is left out.
pub struct RequestedScans {
    client: Client,
    stream: LiveLines,
    /// The line that is being taken in.
    line: Option<Vec<u8>>,
    request: Uuid,
    /// Records that nobody has taken yet.
    ready: VecDeque<Record>,
    /// The scan under way that belongs to the request, and its beams that are in.
    current: Option<(Uuid, HashSet<u32>)>,
    /// Readings were lost on the way here: the daemon has them.
    dropped: bool,
    fetched_again: usize,
    session: Option<Session>,
    /// How often in a row the daemon did not seem to know of the request.
    doubts: u32,
    /// What the daemon said about taking no scan.
    reason: Option<String>,
}

/// The reason why no more scans arrive.
#[derive(Debug, Error)]
pub enum ScansError {
    /// The daemon does not answer as it should.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// It ended the stream of records.
    #[error("the daemon ended the stream of records")]
    Ended,
    /// It was told to stop, or can't take the scan.
    #[error("{}", .0.as_deref().unwrap_or("the daemon was told to stop"))]
    Forgotten(Option<String>),
    /// Readings were lost on the way, and the daemon has begun another scan meanwhile.
    #[error("readings were dropped, and the daemon has begun another scan")]
    Overtaken,
}

impl ScansError {
    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Client(error) => error.help(),
            Self::Ended => {
                "look at its messages (`journalctl -u sonard`); what came is kept".into()
            }
            Self::Forgotten(_) => "ask again".into(),
            Self::Overtaken => "they are in the daemon's log: GET /v1/logs".into(),
        }
    }
}

impl RequestedScans {
    /// Asks for scans.
    ///
    /// # Errors
    /// When nobody answers, or the daemon refuses.
    pub async fn ask(client: Client, request: &ScanRequest) -> Result<Self, ClientError> {
        // Listening before asking: nothing is missed.
        let stream = client.live("/v1/live/records").await?;
        let Started { request, .. } = client.post("/v1/start", request).await?;
        Ok(Self {
            client,
            stream,
            line: None,
            request,
            ready: VecDeque::new(),
            current: None,
            dropped: false,
            fetched_again: 0,
            session: None,
            doubts: 0,
            reason: None,
        })
    }

    /// The next record of these scans: their session when it is new, `scan_start`, readings and
    /// events, `scan_end`. Cancel-safe.
    ///
    /// # Errors
    /// When no more will come.
    pub async fn next(&mut self) -> Result<Record, ScansError> {
        loop {
            if let Some(record) = self.ready.pop_front() {
                return Ok(record);
            }
            if self.line.is_some() {
                self.take_in().await?;
                continue;
            }
            match timeout(QUIET, self.stream.next()).await.map(Result::transpose) {
                Ok(Some(line)) => self.line = Some(line?),
                Ok(None) => return Err(ScansError::Ended),
                Err(_quiet) if self.current.is_none() => self.doubt().await?,
                Err(_quiet) => {}
            }
        }
    }

    /// Wants no more of them, and returns what still came of the scan under way.
    ///
    /// # Errors
    /// When nobody answers.
    pub async fn cancel(&mut self) -> Result<Vec<Record>, ScansError> {
        let body = CancelRequest { request: self.request };
        match self.client.post::<Accepted>("/v1/cancel", &body).await {
            // It is over already.
            Ok(_) | Err(ClientError::Refused { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        let mut records = Vec::new();
        let over = async {
            while self.current.is_some() || !self.ready.is_empty() {
                records.push(self.next().await?);
            }
            Ok::<(), ScansError>(())
        };
        // A daemon that has gone meanwhile, or is too slow, keeps the rest in its log.
        drop(timeout(CLOSING, over).await);
        Ok(records)
    }

    /// Readings that this client was too slow for and fetched again.
    #[must_use]
    pub const fn fetched_again(&self) -> usize {
        self.fetched_again
    }

    /// Takes the line at hand in. Whatever has to be waited for comes first: dropped meanwhile, the
    /// line is still to be taken in.
    async fn take_in(&mut self) -> Result<(), ScansError> {
        let line = self.line.as_deref().unwrap_or_default().trim_ascii_end();
        self.dropped |= line.starts_with(DROPPED);
        let (mut session, mut lost) = (None, Vec::new());
        // A kind of record that this version does not know is none of its scans'.
        let record = decode_line(line).ok();
        match &record {
            Some(Record::ScanStart(start)) if start.request == Some(self.request) => {
                session = Some(self.client.get_json::<Session>("/v1/session").await?);
            }
            Some(Record::ScanEnd(end)) if self.dropped && self.is_current(end.scan) => {
                lost = self.lost(end).await?;
            }
            _ => {}
        }
        self.line = None;
        self.doubts = 0;
        if let Some(record) = record {
            self.learn(record, session, lost);
        }
        Ok(())
    }

    fn learn(&mut self, record: Record, session: Option<Session>, lost: Vec<Ping>) {
        match &record {
            Record::ScanStart(start) if start.request == Some(self.request) => {
                if let Some(session) = session.filter(|now| self.session.as_ref() != Some(now)) {
                    self.ready.push_back(Record::Session(Box::new(session.clone())));
                    self.session = Some(session);
                }
                (self.current, self.dropped) = (Some((start.scan, HashSet::new())), false);
            }
            Record::Ping(ping) => match &mut self.current {
                Some((scan, seen)) if *scan == ping.scan => drop(seen.insert(ping.index)),
                _ => return,
            },
            Record::Event(event) => {
                if event.kind == EventKind::Stopped {
                    self.reason = Some(event.detail.clone());
                }
                if self.current.is_none() {
                    return;
                }
            }
            Record::ScanEnd(end) if self.is_current(end.scan) => {
                self.fetched_again += lost.len();
                self.ready.extend(lost.into_iter().map(|ping| Record::Ping(Box::new(ping))));
                self.current = None;
            }
            _ => return,
        }
        self.ready.push_back(record);
    }

    fn is_current(&self, scan: Uuid) -> bool {
        self.current.as_ref().is_some_and(|(current, _)| *current == scan)
    }

    /// Readings of the scan that ends here that did not come.
    async fn lost(&self, end: &ScanEnd) -> Result<Vec<Ping>, ScansError> {
        let latest: ScanReport = self.client.get_json("/v1/scan/latest").await?;
        if latest.start.scan != end.scan {
            return Err(ScansError::Overtaken);
        }
        let seen = self.current.as_ref().map(|(_, seen)| seen);
        let came = |index| seen.is_some_and(|seen| seen.contains(&index));
        Ok(latest.pings.into_iter().filter(|ping| !came(ping.index)).collect())
    }

    /// Nothing comes: asks whether the daemon neither scans nor means to. Between its beginning and
    /// its first record a scan is neither asked for nor under way: one look may fall there, two
    /// don't.
    async fn doubt(&mut self) -> Result<(), ScansError> {
        let status: Status = self.client.get_json("/v1/status").await?;
        let forgotten = status.scanning.requested == 0 && status.scan.is_none();
        self.doubts = if forgotten { self.doubts + 1 } else { 0 };
        if self.doubts == 2 { Err(ScansError::Forgotten(self.reason.take())) } else { Ok(()) }
    }
}
