//! ROS 2 recordings: MCAP with messages in CDR.

mod messages;
mod times;

use std::{
    collections::{BTreeMap, BTreeSet},
    io::{self, Read, Write},
};

use mcap::records::AttachmentHeader;

use sonard_records::{Ping, ScanView};

use crate::{
    AttachedLog, Export, ExportError, SkippedScan,
    columns::serialized_name,
    conversion::{Converter, ExportSettings, Profile, plan_order},
    ros::message::Stamp,
    session_numbers::SessionNumbers,
};
pub(crate) use messages::RecordingWriter;
use messages::write_error;
use times::ScanTimes;
pub(crate) use times::nanoseconds;

/// Export to a recording for ROS 2 and Foxglove. Each reading is a `Range`; each scan is a
/// `PointCloud2`, markers of its propagation paths and, if it has the form, a `LaserScan`. Frames
/// place robot and rangers.
pub struct McapExport<W: Write> {
    messages: RecordingWriter<W>,
    profile: Profile,
    converter: Converter,
    sessions: SessionNumbers,
    times: ScanTimes,
    provenances: BTreeSet<String>,
}

impl<W: Write> McapExport<W> {
    /// Writes the beginning of a recording to `out`.
    ///
    /// # Errors
    /// Returns the write error of the output.
    pub fn new(out: W, settings: ExportSettings) -> Result<Self, ExportError> {
        Ok(Self {
            messages: RecordingWriter::new(out)?,
            profile: settings.profile,
            converter: Converter::new(settings),
            sessions: SessionNumbers::default(),
            times: ScanTimes::default(),
            provenances: BTreeSet::new(),
        })
    }

    /// Returns `true` if `head` is the beginning of such a recording.
    #[must_use]
    pub fn is_own_file(head: &[u8]) -> bool {
        messages::begins(head)
    }

    /// Writes the readings in the order of their firing, then the messages of the whole scan.
    fn write_scan(&mut self, scan: &ScanView) -> Result<(), ExportError> {
        let pings = plan_order(scan);
        let firings = self.times.firing_times(scan, &pings, self.converter.window_ns());
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

    /// Returns the metadata of the recording that messages do not contain.
    fn metadata(&self) -> BTreeMap<String, String> {
        let bases: Vec<_> = self.times.bases.iter().map(|base| base.description()).collect();
        let provenances: Vec<_> = self.provenances.iter().cloned().collect();
        BTreeMap::from([
            ("time_base".to_owned(), bases.join(", ")),
            ("provenance".to_owned(), provenances.join(", ")),
            ("profile".to_owned(), self.profile.name().to_owned()),
            ("stamp".to_owned(), "firing".to_owned()),
        ])
    }
}

impl<W: Write> Export for McapExport<W> {
    fn scan(&mut self, _log: &str, scan: &ScanView) -> Result<Option<SkippedScan>, ExportError> {
        let (Some(session), Some((_, is_new))) =
            (scan.session.as_deref(), self.sessions.number(scan.session.as_ref()))
        else {
            return Ok(Some(SkippedScan::NoSession));
        };
        if (is_new || !self.converter.is_in_session())
            && let Err(why) = self.converter.begin_session(session)
        {
            return Ok(Some(why));
        }
        if scan.pose().is_none() {
            return Ok(Some(SkippedScan::NoPose));
        }
        self.provenances.extend(serialized_name(session.provenance));
        self.write_scan(scan).map(|()| None)
    }

    fn attach(&mut self, log: &AttachedLog<'_>, bytes: &mut dyn Read) -> Result<(), ExportError> {
        let attach_error = |source| ExportError::Attach { name: log.name.to_owned(), source };
        let header = AttachmentHeader {
            log_time: self.converter.end().0,
            create_time: nanoseconds(log.modified),
            name: log.name.to_owned(),
            media_type: "application/x-ndjson".to_owned(),
        };
        self.messages.out.start_attachment(log.bytes, header).map_err(write_error)?;
        let mut piece = vec![0; 1 << 16];
        let mut left = log.bytes;
        while left > 0 {
            let length = piece.len().min(usize::try_from(left).unwrap_or(usize::MAX));
            let read = bytes.read(&mut piece[..length]).map_err(attach_error)?;
            if read == 0 {
                return Err(attach_error(io::ErrorKind::UnexpectedEof.into()));
            }
            self.messages.out.put_attachment_bytes(&piece[..read]).map_err(write_error)?;
            left -= read as u64;
        }
        self.messages.out.finish_attachment().map_err(write_error)
    }

    fn finish(self: Box<Self>) -> Result<(), ExportError> {
        let metadata = self.metadata();
        self.messages.finish(metadata)
    }
}
