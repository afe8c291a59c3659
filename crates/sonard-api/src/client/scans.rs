//! Requests scans from a daemon and returns their records as they arrive.

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

/// Time without data after which the client checks that the request is still pending.
const CHECK_INTERVAL: Duration = Duration::from_secs(2);
/// Maximum wait for the end of a cancelled scan.
const CANCEL_TIMEOUT: Duration = Duration::from_secs(4);
/// Prefix of the line that replaces readings dropped because this client was too slow.
const DROPPED_LINE: &[u8] = br#"{"type":"dropped""#;

/// Scans taken on request, with their own plan and pose. Records of other scans are skipped.
pub struct RequestedScans {
    client: Client,
    stream: LiveLines,
    /// Line that is being processed.
    line: Option<Vec<u8>>,
    request: Uuid,
    /// Records not returned yet.
    ready: VecDeque<Record>,
    /// Current scan of the request, and the indices of its beams received so far.
    current: Option<(Uuid, HashSet<u32>)>,
    /// `true` if readings of the current scan were dropped; the daemon still has them.
    dropped: bool,
    fetched_again: usize,
    session: Option<Session>,
    /// Number of consecutive status checks in which the request seemed unknown to the daemon.
    unknown_checks: u32,
    /// Reason given by the daemon for taking no scan.
    reason: Option<String>,
}

/// Premature end of the requested scans.
#[derive(Debug, Error)]
pub enum ScansError {
    /// Failed request to the daemon.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// End of the stream of records.
    #[error("the daemon ended the stream of records")]
    StreamEnded,
    /// Request cancelled by a stop, or scan that can't be taken, with the daemon's reason.
    #[error("{}", .0.as_deref().unwrap_or("the daemon was stopped"))]
    Cancelled(Option<String>),
    /// Dropped readings can't be fetched, because the daemon has begun another scan.
    #[error("readings were dropped, and the daemon has begun another scan")]
    Overtaken,
}

impl ScansError {
    /// Returns advice on how to resolve the error.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Client(error) => error.help(),
            Self::StreamEnded => {
                "check the log messages of the daemon (`journalctl -u sonard`); received records are kept".into()
            }
            Self::Cancelled(_) => "request the scans again".into(),
            Self::Overtaken => "the daemon's log contains them: GET /v1/logs".into(),
        }
    }
}

impl RequestedScans {
    /// Requests scans.
    ///
    /// # Errors
    /// No response, or a rejected request.
    pub async fn request(client: Client, request: &ScanRequest) -> Result<Self, ClientError> {
        // The subscription precedes the request, so no record is missed.
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
            unknown_checks: 0,
            reason: None,
        })
    }

    /// Returns the next record of these scans: their session when it changes, `scan_start`,
    /// readings and events, `scan_end`. Cancel-safe.
    ///
    /// # Errors
    /// Premature end of the scans.
    pub async fn next(&mut self) -> Result<Record, ScansError> {
        loop {
            if let Some(record) = self.ready.pop_front() {
                return Ok(record);
            }
            if self.line.is_some() {
                self.process_line().await?;
                continue;
            }
            match timeout(CHECK_INTERVAL, self.stream.next()).await.map(Result::transpose) {
                Ok(Some(line)) => self.line = Some(line?),
                Ok(None) => return Err(ScansError::StreamEnded),
                Err(_elapsed) if self.current.is_none() => self.check_pending().await?,
                Err(_elapsed) => {}
            }
        }
    }

    /// Cancels the request and returns the remaining records of the current scan.
    ///
    /// # Errors
    /// No response from the daemon.
    pub async fn cancel(&mut self) -> Result<Vec<Record>, ScansError> {
        let body = CancelRequest { request: self.request };
        match self.client.post::<Accepted>("/v1/cancel", &body).await {
            // A rejection means that the request has ended already.
            Ok(_) | Err(ClientError::Rejected { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        let mut records = Vec::new();
        let over = async {
            while self.current.is_some() || !self.ready.is_empty() {
                records.push(self.next().await?);
            }
            Ok::<(), ScansError>(())
        };
        // If the daemon has exited or is too slow, the rest remains in its log.
        drop(timeout(CANCEL_TIMEOUT, over).await);
        Ok(records)
    }

    /// Number of dropped readings that were fetched again.
    #[must_use]
    pub const fn fetched_again(&self) -> usize {
        self.fetched_again
    }

    /// Processes the pending line. All awaits precede the change of state: if the call is
    /// cancelled, the line is still pending.
    async fn process_line(&mut self) -> Result<(), ScansError> {
        let line = self.line.as_deref().unwrap_or_default().trim_ascii_end();
        self.dropped |= line.starts_with(DROPPED_LINE);
        let (mut session, mut lost) = (None, Vec::new());
        // Records of unknown kinds do not belong to the requested scans.
        let record = decode_line(line).ok();
        match &record {
            Some(Record::ScanStart(start)) if start.request == Some(self.request) => {
                session = Some(self.client.get_json::<Session>("/v1/session").await?);
            }
            Some(Record::ScanEnd(end)) if self.dropped && self.is_current(end.scan) => {
                lost = self.fetch_lost(end).await?;
            }
            _ => {}
        }
        self.line = None;
        self.unknown_checks = 0;
        if let Some(record) = record {
            self.handle_record(record, session, lost);
        }
        Ok(())
    }

    fn handle_record(&mut self, record: Record, session: Option<Session>, lost: Vec<Ping>) {
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

    /// Fetches the missing readings of the scan that has ended.
    async fn fetch_lost(&self, end: &ScanEnd) -> Result<Vec<Ping>, ScansError> {
        let latest: ScanReport = self.client.get_json("/v1/scan/latest").await?;
        if latest.start.scan != end.scan {
            return Err(ScansError::Overtaken);
        }
        let seen = self.current.as_ref().map(|(_, seen)| seen);
        let is_received = |index| seen.is_some_and(|seen| seen.contains(&index));
        Ok(latest.pings.into_iter().filter(|ping| !is_received(ping.index)).collect())
    }

    /// Checks, when no data arrive, that the daemon still scans or is about to. Between its
    /// beginning and its first record a scan is neither requested nor current; one check can fall
    /// into that gap, two consecutive ones can't.
    async fn check_pending(&mut self) -> Result<(), ScansError> {
        let status: Status = self.client.get_json("/v1/status").await?;
        let is_unknown = status.scanning.requested == 0 && status.scan.is_none();
        self.unknown_checks = if is_unknown { self.unknown_checks + 1 } else { 0 };
        if self.unknown_checks == 2 {
            Err(ScansError::Cancelled(self.reason.take()))
        } else {
            Ok(())
        }
    }
}
