//! What a table says of itself beside its rows.

use std::collections::BTreeSet;

use ::parquet::file::metadata::KeyValue;
use sonard_records::Session;

/// Keys and values of a file's metadata, which every reader has in memory as a whole.
#[derive(Debug, Default)]
pub(super) struct Remarks {
    all: Vec<KeyValue>,
    scenes: BTreeSet<String>,
    bytes: usize,
    left_out: u32,
}

/// The most that is said.
const MOST_BYTES: usize = 1 << 24;

impl Remarks {
    pub(super) fn add(&mut self, key: &str, value: String) {
        self.bytes += key.len() + value.len();
        self.all.push(KeyValue::new(key.to_owned(), value));
    }

    /// The record of a session, and once the text of its scene.
    pub(super) fn add_session(&mut self, number: u32, session: &Session) {
        let mut record = session.clone();
        let text = record.scene_text.take();
        // A record of a log is JSON.
        let Ok(record) = serde_json::to_string(&record) else { return };
        let hash = session.scene.as_ref().map(|scene| scene.sha256.as_str());
        let scene = text.zip(hash).filter(|(_, hash)| !self.scenes.contains(*hash));
        let more = record.len() + scene.as_ref().map_or(0, |(text, _)| text.len());
        if self.bytes + more > MOST_BYTES {
            self.left_out += 1;
            return;
        }
        self.add(&format!("sonard.session.{number}"), record);
        if let Some((text, hash)) = scene {
            self.scenes.insert(hash.to_owned());
            self.add(&format!("sonard.scene.{hash}"), text.as_ref().to_owned());
        }
    }

    /// All of them, and how many sessions there was no room for.
    pub(super) fn take(&mut self) -> Vec<KeyValue> {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        self.all.push(KeyValue::new("sonard.version".to_owned(), version));
        if self.left_out > 0 {
            let left_out = self.left_out.to_string();
            self.all.push(KeyValue::new("sonard.sessions_left_out".to_owned(), left_out));
        }
        std::mem::take(&mut self.all)
    }
}
