//! Recordings of ROS 2: MCAP with messages in CDR.

mod frames;
mod messages;
mod readings;
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
    ros::{
        interface::{LASER_SCAN, MARKERS, POINT_CLOUD, RANGE, TRANSFORMS},
        message::{Header, Markers, Range, Stamp, Transforms},
    },
    sessions::Sessions,
};
pub(crate) use frames::MAP;
pub(crate) use messages::Messages;
use messages::refused;
use readings::{Figures, Heard, in_order, laser_scan, paths, points};
pub(crate) use times::nanoseconds;
use times::{Firings, Times};

/// What a `Range` says of silence and of what is too near. REP 117 and the obstacle layer of nav2 contradict
/// each other: that leaves out infinite ranges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Profile {
    /// Infinite, as REP 117 says: positive for silence, negative for what is too near.
    #[default]
    Rep117,
    /// Exactly the greatest range for silence, and the least for what is too near: nav2's `RangeSensorLayer` then
    /// clears the beam, and marks what is near.
    Nav2,
}

impl Profile {
    const fn in_words(self) -> &'static str {
        match self {
            Self::Rep117 => "rep117",
            Self::Nav2 => "nav2",
        }
    }
}

/// How a recording is made.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// What a `Range` says of silence.
    pub profile: Profile,
    /// Full angle of what a reading is valid for, degrees; without it, as far as the beam is 6 dB down, there and
    /// back.
    pub field_of_view_deg: Option<f64>,
    /// The frame of the transducer, which others are named after.
    pub frame: String,
}

impl Default for Settings {
    fn default() -> Self {
        Self { profile: Profile::default(), field_of_view_deg: None, frame: "sonar".to_owned() }
    }
}

/// Topics that every recording has; of those of arrays it says `/sonar/RANGER/range`.
mod topic {
    pub(super) const TRANSFORMS: &str = "/tf";
    pub(super) const FIXED_TRANSFORMS: &str = "/tf_static";
    pub(super) const RANGE: &str = "range";
    pub(super) const SCAN: &str = "/sonar/scan";
    pub(super) const POINTS: &str = "/sonar/points";
    pub(super) const PATHS: &str = "/sonar/paths";
    pub(super) const PREDICTED_POINTS: &str = "/sonar/predicted/points";
}

/// A recording as ROS 2, Foxglove and others read it: each reading a `Range`, each scan a `LaserScan` where it has
/// the form of one, a `PointCloud2` and the paths of its sound, with the frames of robot and rangers.
pub struct McapExport<W: Write> {
    messages: Messages<W>,
    settings: Settings,
    sessions: Sessions,
    /// Of the session of the last scan.
    figures: Option<Figures>,
    /// Whether the transforms that do not change in that session are written.
    is_fixed_told: bool,
    times: Times,
    provenances: BTreeSet<String>,
    /// When the last scan ended.
    end: Stamp,
}

impl<W: Write> McapExport<W> {
    /// A recording that is written to `out`, from its beginning to its end.
    ///
    /// # Errors
    /// When `out` refuses the beginning.
    pub fn new(out: W, settings: Settings) -> Result<Self, ExportError> {
        Ok(Self {
            messages: Messages::new(out)?,
            settings,
            sessions: Sessions::default(),
            figures: None,
            is_fixed_told: false,
            times: Times::default(),
            provenances: BTreeSet::new(),
            end: Stamp(0),
        })
    }

    /// Whether a file that begins so is such a recording.
    #[must_use]
    pub fn begins(head: &[u8]) -> bool {
        messages::begins(head)
    }

    fn write_scan(&mut self, scan: &ScanView, figures: &Figures) -> Result<(), ExportError> {
        let pings = in_order(scan);
        let firings = self.times.of(scan, &pings, figures.window_ns);
        let Some(first) = firings.fired.iter().flatten().min().copied() else { return Ok(()) };
        if !self.is_fixed_told {
            self.write_fixed(figures, first)?;
            self.is_fixed_told = true;
        }
        let both = (pings.as_slice(), &firings);
        self.end = self.write_readings(scan, both, figures)?;
        if let Some(laser) = laser_scan(scan, both, figures, first) {
            self.messages.write(topic::SCAN, LASER_SCAN, self.end, &laser)?;
        }
        let header = Header { stamp: first, frame: MAP };
        let cloud = points(scan, both, header, |ping| Some(Heard::measured(ping)));
        self.messages.write(topic::POINTS, POINT_CLOUD, self.end, &cloud)?;
        if pings.iter().any(|ping| ping.sim.is_some()) {
            let cloud = points(scan, both, header, Heard::predicted);
            self.messages.write(topic::PREDICTED_POINTS, POINT_CLOUD, self.end, &cloud)?;
        }
        if pings.iter().any(|ping| ping.sound_path().is_some()) {
            self.messages.write(
                topic::PATHS,
                MARKERS,
                self.end,
                &Markers(paths(scan, &pings, header)),
            )?;
        }
        Ok(())
    }

    /// Each reading with the transforms at its firing and at the end of its window; when the last one ended.
    fn write_readings(
        &mut self,
        scan: &ScanView,
        (pings, firings): (&[&Ping], &Firings),
        figures: &Figures,
    ) -> Result<Stamp, ExportError> {
        let fired = pings.iter().zip(&firings.fired);
        let mut fired: Vec<(Stamp, &Ping)> =
            fired.filter_map(|(ping, fired)| Some((fired.as_ref().copied()?, *ping))).collect();
        fired.sort_by_key(|(fired, _)| *fired);
        let mut end = self.end;
        for (place, (at, ping)) in fired.iter().enumerate() {
            let Some(robot) = ping.pose.or_else(|| scan.pose()) else { continue };
            let next = fired.get(place + 1).map_or(u64::MAX, |(next, _)| next.0);
            // Before the motor steps on, and before the next scan begins: no frame is at two places at one time.
            let window_ns = firings.window_ns.saturating_sub(1);
            end = Stamp(at.0.saturating_add(window_ns).min(next.saturating_sub(1)).max(at.0));
            for stamp in [*at, end] {
                let moving = Transforms(figures.frames.moving(stamp, &robot, ping));
                self.messages.write(topic::TRANSFORMS, TRANSFORMS, stamp, &moving)?;
            }
            self.write_range(*at, end, ping, figures)?;
        }
        Ok(end)
    }

    fn write_range(
        &mut self,
        at: Stamp,
        heard_at: Stamp,
        ping: &Ping,
        figures: &Figures,
    ) -> Result<(), ExportError> {
        let Some((frame, ranger)) = figures.frames.of_reading(ping) else { return Ok(()) };
        let readings =
            [("/sonar", Some(Heard::measured(ping))), ("/sonar/predicted", Heard::predicted(ping))];
        for (above, heard) in readings {
            let range = heard.and_then(|heard| figures.range(self.settings.profile, heard));
            let Some(range) = range else { continue };
            let message = Range {
                header: Header { stamp: at, frame },
                field_of_view: figures.field_of_view_rad as f32,
                min_range: figures.min_range_m as f32,
                max_range: figures.max_range_m as f32,
                range,
            };
            let name = match ranger {
                Some(ranger) => format!("{above}/{ranger}/{}", topic::RANGE),
                None => format!("{above}/{}", topic::RANGE),
            };
            self.messages.write(&name, RANGE, heard_at, &message)?;
        }
        Ok(())
    }

    fn write_fixed(&mut self, figures: &Figures, stamp: Stamp) -> Result<(), ExportError> {
        let fixed = Transforms(figures.frames.fixed(stamp));
        self.messages.write(topic::FIXED_TRANSFORMS, TRANSFORMS, stamp, &fixed)
    }

    /// What a reader of the recording must know and no message says.
    fn remarks(&self) -> BTreeMap<String, String> {
        let bases: Vec<_> = self.times.bases.iter().map(|base| base.in_words()).collect();
        let provenances: Vec<_> = self.provenances.iter().cloned().collect();
        BTreeMap::from([
            ("time_base".to_owned(), bases.join(", ")),
            ("provenance".to_owned(), provenances.join(", ")),
            ("profile".to_owned(), self.settings.profile.in_words().to_owned()),
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
        if is_new || self.figures.is_none() {
            (self.figures, self.is_fixed_told) = (None, false);
            self.figures = match Figures::of(session, &self.settings) {
                Ok(figures) => Some(figures),
                Err(why) => return Ok(Some(why)),
            };
        }
        if scan.pose().is_none() {
            return Ok(Some(LeftOut::NoPose));
        }
        self.provenances.extend(logged_word(session.provenance));
        let Some(figures) = self.figures.take() else { return Ok(Some(LeftOut::NoSession)) };
        let written = self.write_scan(scan, &figures);
        self.figures = Some(figures);
        written.map(|()| None)
    }

    fn attach(&mut self, log: &LogFile<'_>, bytes: &mut dyn Read) -> Result<(), ExportError> {
        let cannot = |source| ExportError::Attach { name: log.name.to_owned(), source };
        let header = AttachmentHeader {
            log_time: self.end.0,
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
