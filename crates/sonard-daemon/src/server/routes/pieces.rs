//! A scan as JSON, read from its log and written piece by piece: what it costs does not depend on how
//! long it is.

use std::{io, sync::Arc};

use axum::body::Bytes;
use futures_util::{Stream, stream};
use serde::{Serialize, de::IgnoredAny};
use sonard_api::Beside;
use sonard_log::{Passage, PassageLines};
use sonard_records::{Record, decode_line};
use tokio::sync::Semaphore;

use crate::{Moved, judged_line};

/// A piece has so many bytes, or a line more.
const PIECE: usize = 32 * 1024;
/// How a reading's line begins, where only its fields are wanted.
const TAG: &[u8] = br#"{"type":"ping","#;

/// What of a scan is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// With its session, verdicts and viewpoints, as `WholeScan`.
    Whole,
    /// As it was measured, as `ScanReport`.
    Report,
}

/// A scan on its way to a client.
pub(super) struct Pieces {
    passage: Passage,
    form: Form,
    /// Which readings are left out.
    moved: Moved,
    part: Part,
    /// Whether nothing stands in the list that is being written.
    first: bool,
    /// What stands before and after it all.
    around: [&'static [u8]; 2],
}

enum Part {
    Head,
    Readings(PassageLines),
    Events(PassageLines),
    Tail,
    Over,
}

impl Pieces {
    pub(super) const fn new(passage: Passage, form: Form, moved: Moved) -> Self {
        Self { passage, form, moved, part: Part::Head, first: true, around: [b"", b""] }
    }

    /// The same with something before and after it.
    pub(super) const fn within(mut self, around: [&'static [u8]; 2]) -> Self {
        self.around = around;
        self
    }

    /// What was sent by now, for who wants only what moved.
    pub(super) fn into_moved(self) -> Moved {
        self.moved
    }

    /// The next piece; `None` at the end. It reads the disk.
    fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut piece = Vec::new();
        while piece.len() < PIECE {
            match &mut self.part {
                Part::Head => {
                    self.write_head(&mut piece)?;
                    self.part = Part::Readings(self.passage.lines(true)?);
                }
                Part::Readings(lines) => match lines.next().transpose()? {
                    Some(line) => self.write_reading(&mut piece, &line),
                    None => {
                        piece.extend_from_slice(br#"],"events":["#);
                        self.first = true;
                        self.part = Part::Events(self.passage.lines(false)?);
                    }
                },
                Part::Events(lines) => match lines.next().transpose()? {
                    Some(line) => self.write_event(&mut piece, &line)?,
                    None => self.part = Part::Tail,
                },
                Part::Tail => {
                    piece.extend_from_slice(br#"],"end":"#);
                    write(&mut piece, &self.passage.view.end)?;
                    piece.push(b'}');
                    piece.extend_from_slice(self.around[1]);
                    self.part = Part::Over;
                }
                Part::Over => break,
            }
        }
        Ok(Some(piece).filter(|piece| !piece.is_empty()))
    }

    fn write_head(&self, piece: &mut Vec<u8>) -> io::Result<()> {
        piece.extend_from_slice(self.around[0]);
        piece.push(b'{');
        if self.form == Form::Whole {
            piece.extend_from_slice(br#""session":"#);
            write(piece, &self.passage.view.session)?;
            piece.push(b',');
        }
        piece.extend_from_slice(br#""start":"#);
        write(piece, &self.passage.view.start)?;
        piece.extend_from_slice(br#","pings":["#);
        Ok(())
    }

    /// A damaged line is left out, and so is a reading of another scan.
    fn write_reading(&mut self, piece: &mut Vec<u8>, line: &[u8]) {
        let line = line.trim_ascii_end();
        let Some(fields) = line.strip_prefix(TAG) else { return };
        if self.form == Form::Report && self.moved.is_everything() {
            // Nothing has to be known of it but that it is whole.
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
        if ping.scan != self.passage.view.scan || !self.moved.is_news_of(&ping) {
            return;
        }
        self.separate(piece);
        piece.push(b'{');
        match self.form {
            Form::Whole => {
                let beside = Beside::of(&ping, Some(&self.passage.view));
                piece.extend_from_slice(&judged_line(fields, &beside));
            }
            Form::Report => piece.extend_from_slice(fields),
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

/// Reads the next piece beside everything else: disks block. One at a time reads, so that what many
/// clients want leaves processors for who measures.
pub(super) async fn read_on(
    mut pieces: Pieces,
    turns: Arc<Semaphore>,
) -> io::Result<(Option<Bytes>, Pieces)> {
    let turn = turns.acquire_owned().await;
    let reading = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        let piece = pieces.next()?;
        Ok((piece.map(Bytes::from), pieces))
    });
    reading.await.map_err(io::Error::other)?
}

/// A whole scan.
pub(super) fn stream(
    pieces: Pieces,
    turns: Arc<Semaphore>,
) -> impl Stream<Item = io::Result<Bytes>> {
    stream::try_unfold((pieces, turns), |(pieces, turns)| async move {
        let (piece, pieces) = read_on(pieces, Arc::clone(&turns)).await?;
        Ok(piece.map(|piece| (piece, (pieces, turns))))
    })
}

fn write(piece: &mut Vec<u8>, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(piece, value).map_err(io::Error::other)
}
