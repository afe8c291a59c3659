//! Recordings of ROS 2: MCAP with messages in CDR.

mod messages;
mod times;

use std::{
    collections::{BTreeMap, BTreeSet},
    io::{self, Read, Write},
};

use mcap::records::AttachmentHeader;

use sonard_records::{Ping, ScanView};

use crate::{
    Export, ExportError, LeftOut, LogFile,
    columns::logged_word,
    conversion::{Converter, Profile, Settings, in_order},
    ros::message::Stamp,
    sessions::Sessions,
};
pub(crate) use messages::Messages;
use messages::refused;
use times::Times;
pub(crate) use times::nanoseconds;

/// A recording as ROS 2, Foxglove and others read it: each reading a `Range`, each scan a `LaserScan` where it has
/// the form of one, a `PointCloud2` and the paths of its sound, with the frames of robot and rangers.
pub struct McapExport<W: Write> {
    messages: Messages<W>,
    profile: Profile,
    converter: Converter,
    sessions: Sessions,
    times: Times,
    provenances: BTreeSet<String>,
}

impl<W: Write> McapExport<W> {
    /// A recording that is written to `out`, from its beginning to its end.
    ///
    /// # Errors
    /// When `out` refuses the beginning.
    pub fn new(out: W, settings: Settings) -> Result<Self, ExportError> {
        Ok(Self {
            messages: Messages::new(out)?,
            profile: settings.profile,
            converter: Converter::new(settings),
            sessions: Sessions::default(),
            times: Times::default(),
            provenances: BTreeSet::new(),
        })
    }

    /// Whether a file that begins so is such a recording.
    #[must_use]
    pub fn begins(head: &[u8]) -> bool {
        messages::begins(head)
    }

    /// Its readings in the order of their firing, then what is told of all of them.
    fn write_scan(&mut self, scan: &ScanView) -> Result<(), ExportError> {
        let pings = in_order(scan);
        let firings = self.times.of(scan, &pings, self.converter.window_ns());
        let fired = pings.iter().zip(&firings.fired);
        let mut fired: Vec<(Stamp, &Ping)> =
            fired.filter_map(|(ping, fired)| Some((fired.as_ref().copied()?, *ping))).collect();
        fired.sort_by_key(|(fired, _)| *fired);
        for (at, ping) in fired {
            let Some(robot) = ping.pose.or_else(|| scan.pose()) else { continue };
            self.converter.reading(robot, ping, at, &mut self.messages)?;
        }
        self.converter.scan(scan, (&pings, &firings), &mut self.messages)
    }

    /// What a reader of the recording must know and no message says.
    fn remarks(&self) -> BTreeMap<String, String> {
        let bases: Vec<_> = self.times.bases.iter().map(|base| base.in_words()).collect();
        let provenances: Vec<_> = self.provenances.iter().cloned().collect();
        BTreeMap::from([
            ("time_base".to_owned(), bases.join(", ")),
            ("provenance".to_owned(), provenances.join(", ")),
            ("profile".to_owned(), self.profile.in_words().to_owned()),
            ("stamp".to_owned(), "firing".to_owned()),
        ])
    }
}

impl<W: Write> Export for McapExport<W> {
    fn scan(&mut self, _log: &str, scan: &ScanView) -> Result<Option<LeftOut>, ExportError> {
        let (Some(session), Some((_, is_new))) =
            (scan.session.as_deref(), self.sessions.number(scan.session.as_ref()))
        else {
            return Ok(Some(LeftOut::NoSession));
        };
        if (is_new || !self.converter.is_in_session())
            && let Err(why) = self.converter.begin_session(session)
        {
            return Ok(Some(why));
        }
        if scan.pose().is_none() {
            return Ok(Some(LeftOut::NoPose));
        }
        self.provenances.extend(logged_word(session.provenance));
        self.write_scan(scan).map(|()| None)
    }

    fn attach(&mut self, log: &LogFile<'_>, bytes: &mut dyn Read) -> Result<(), ExportError> {
        let cannot = |source| ExportError::Attach { name: log.name.to_owned(), source };
        let header = AttachmentHeader {
            log_time: self.converter.end().0,
            create_time: nanoseconds(log.written),
            name: log.name.to_owned(),
            media_type: "application/x-ndjson".to_owned(),
        };
        self.messages.out.start_attachment(log.bytes, header).map_err(refused)?;
        let mut piece = vec![0; 1 << 16];
        let mut left = log.bytes;
        while left > 0 {
            let most = piece.len().min(usize::try_from(left).unwrap_or(usize::MAX));
            let read = bytes.read(&mut piece[..most]).map_err(cannot)?;
            if read == 0 {
                return Err(cannot(io::ErrorKind::UnexpectedEof.into()));
            }
            self.messages.out.put_attachment_bytes(&piece[..read]).map_err(refused)?;
            left -= read as u64;
        }
        self.messages.out.finish_attachment().map_err(refused)
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let remarks = self.remarks();
        self.messages.finish(remarks)
    }
}
