//! Streams a scan from its log as JSON in pieces of bounded size, so memory use is independent of
//! its length.

use std::{io, sync::Arc};

use axum::body::Bytes;
use futures_util::{Stream, stream};
use serde::{Serialize, de::IgnoredAny};
use sonard_api::Annotations;
use sonard_log::{ScanSpan, ScanSpanLines};
use sonard_records::{Record, decode_line};
use tokio::sync::Semaphore;

use crate::{DeadbandFilter, annotated_line};

/// Size of a piece, bytes; the last line may exceed it.
const PIECE_BYTES: usize = 32 * 1024;
/// Start of a reading's line, before the fields that are copied.
const TAG: &[u8] = br#"{"type":"ping","#;

/// Content of a streamed scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ScanForm {
    /// Session, verdicts and viewpoints included, as `WholeScan`.
    Whole,
    /// Readings as measured, as `ScanReport`.
    Report,
}

/// State of a scan that is being streamed.
pub(super) struct ScanPieces {
    passage: ScanSpan,
    form: ScanForm,
    /// Filter of readings that have not moved.
    moved: DeadbandFilter,
    part: ScanPart,
    /// `true` while the current JSON list is empty.
    first: bool,
    /// Prefix and suffix of the scan.
    enclosure: [&'static [u8]; 2],
}

enum ScanPart {
    Head,
    Readings(ScanSpanLines),
    Events(ScanSpanLines),
    Tail,
    Done,
}

impl ScanPieces {
    pub(super) const fn new(passage: ScanSpan, form: ScanForm, moved: DeadbandFilter) -> Self {
        Self { passage, form, moved, part: ScanPart::Head, first: true, enclosure: [b"", b""] }
    }

    /// Sets the prefix and suffix of the scan.
    pub(super) const fn enclosed_in(mut self, enclosure: [&'static [u8]; 2]) -> Self {
        self.enclosure = enclosure;
        self
    }

    /// Returns the filter state for the next scan of the stream.
    pub(super) fn into_moved(self) -> DeadbandFilter {
        self.moved
    }

    /// Returns the next piece; `None` at the end. Reads the disk.
    fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut piece = Vec::new();
        while piece.len() < PIECE_BYTES {
            match &mut self.part {
                ScanPart::Head => {
                    self.write_head(&mut piece)?;
                    self.part = ScanPart::Readings(self.passage.lines(true)?);
                }
                ScanPart::Readings(lines) => match lines.next().transpose()? {
                    Some(line) => self.write_reading(&mut piece, &line),
                    None => {
                        piece.extend_from_slice(br#"],"events":["#);
                        self.first = true;
                        self.part = ScanPart::Events(self.passage.lines(false)?);
                    }
                },
                ScanPart::Events(lines) => match lines.next().transpose()? {
                    Some(line) => self.write_event(&mut piece, &line)?,
                    None => self.part = ScanPart::Tail,
                },
                ScanPart::Tail => {
                    piece.extend_from_slice(br#"],"end":"#);
                    write(&mut piece, &self.passage.view.end)?;
                    piece.push(b'}');
                    piece.extend_from_slice(self.enclosure[1]);
                    self.part = ScanPart::Done;
                }
                ScanPart::Done => break,
            }
        }
        Ok(Some(piece).filter(|piece| !piece.is_empty()))
    }

    fn write_head(&self, piece: &mut Vec<u8>) -> io::Result<()> {
        piece.extend_from_slice(self.enclosure[0]);
        piece.push(b'{');
        if self.form == ScanForm::Whole {
            piece.extend_from_slice(br#""session":"#);
            write(piece, &self.passage.view.session)?;
            piece.push(b',');
        }
        piece.extend_from_slice(br#""start":"#);
        write(piece, &self.passage.view.start)?;
        piece.extend_from_slice(br#","pings":["#);
        Ok(())
    }

    /// Writes a reading. Damaged lines and readings of other scans are skipped.
    fn write_reading(&mut self, piece: &mut Vec<u8>, line: &[u8]) {
        let line = line.trim_ascii_end();
        let Some(fields) = line.strip_prefix(TAG) else { return };
        if self.form == ScanForm::Report && self.moved.passes_all() {
            // The line is copied as it is, provided that it is complete.
            let scan = format!(r#""scan":"{}","#, self.passage.view.scan);
            let whole = fields.starts_with(scan.as_bytes())
                && serde_json::from_slice::<IgnoredAny>(line).is_ok();
            if whole {
                self.separate(piece);
                piece.push(b'{');
                piece.extend_from_slice(fields);
            }
            return;
        }
        let Ok(Record::Ping(ping)) = decode_line(line) else { return };
        if ping.scan != self.passage.view.scan || !self.moved.pass_ping(&ping) {
            return;
        }
        self.separate(piece);
        piece.push(b'{');
        match self.form {
            ScanForm::Whole => {
                let beside = Annotations::for_ping(&ping, Some(&self.passage.view));
                piece.extend_from_slice(&annotated_line(fields, &beside));
            }
            ScanForm::Report => piece.extend_from_slice(fields),
        }
    }

    fn write_event(&mut self, piece: &mut Vec<u8>, line: &[u8]) -> io::Result<()> {
        if let Ok(Record::Event(event)) = decode_line(line.trim_ascii_end()) {
            self.separate(piece);
            write(piece, &event)?;
        }
        Ok(())
    }

    fn separate(&mut self, piece: &mut Vec<u8>) {
        if !std::mem::replace(&mut self.first, false) {
            piece.push(b',');
        }
    }
}

/// Reads the next piece on a blocking thread. One piece is read at a time, so that many clients
/// can't occupy the processors needed for the measurement.
pub(super) async fn next_piece(
    mut pieces: ScanPieces,
    permits: Arc<Semaphore>,
) -> io::Result<(Option<Bytes>, ScanPieces)> {
    let permit = permits.acquire_owned().await;
    let reading = tokio::task::spawn_blocking(move || {
        let _permit = permit;
        let piece = pieces.next()?;
        Ok((piece.map(Bytes::from), pieces))
    });
    reading.await.map_err(io::Error::other)?
}

/// Returns a scan as a stream of pieces.
pub(super) fn stream(
    pieces: ScanPieces,
    permits: Arc<Semaphore>,
) -> impl Stream<Item = io::Result<Bytes>> {
    stream::try_unfold((pieces, permits), |(pieces, permits)| async move {
        let (piece, pieces) = next_piece(pieces, Arc::clone(&permits)).await?;
        Ok(piece.map(|piece| (piece, (pieces, permits))))
    })
}

fn write(piece: &mut Vec<u8>, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(piece, value).map_err(io::Error::other)
}
