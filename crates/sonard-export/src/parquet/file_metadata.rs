//! Key-value metadata of a Parquet file.

use std::collections::BTreeSet;

use ::parquet::file::metadata::KeyValue;
use sonard_records::Session;

/// Metadata of a file, which every reader holds in memory as a whole.
#[derive(Debug, Default)]
pub(super) struct FileMetadata {
    entries: Vec<KeyValue>,
    scenes: BTreeSet<String>,
    bytes: usize,
    omitted: u32,
}

/// Maximum size of the metadata.
const MAX_BYTES: usize = 1 << 24;

impl FileMetadata {
    pub(super) fn add(&mut self, key: &str, value: String) {
        self.bytes += key.len() + value.len();
        self.entries.push(KeyValue::new(key.to_owned(), value));
    }

    /// Adds a session record and, once, the text of its scene.
    pub(super) fn add_session(&mut self, number: u32, session: &Session) {
        let mut record = session.clone();
        let text = record.scene_text.take();
        // Records of a log are serializable as JSON.
        let Ok(record) = serde_json::to_string(&record) else { return };
        let hash = session.scene.as_ref().map(|scene| scene.sha256.as_str());
        let scene = text.zip(hash).filter(|(_, hash)| !self.scenes.contains(*hash));
        let more = record.len() + scene.as_ref().map_or(0, |(text, _)| text.len());
        if self.bytes + more > MAX_BYTES {
            self.omitted += 1;
            return;
        }
        self.add(&format!("sonard.session.{number}"), record);
        if let Some((text, hash)) = scene {
            self.scenes.insert(hash.to_owned());
            self.add(&format!("sonard.scene.{hash}"), text.as_ref().to_owned());
        }
    }

    /// Removes and returns all entries, with the number of omitted sessions.
    pub(super) fn take(&mut self) -> Vec<KeyValue> {
        let version = env!("CARGO_PKG_VERSION").to_owned();
        self.entries.push(KeyValue::new("sonard.version".to_owned(), version));
        if self.omitted > 0 {
            let omitted = self.omitted.to_string();
            self.entries.push(KeyValue::new("sonard.sessions_left_out".to_owned(), omitted));
        }
        std::mem::take(&mut self.entries)
    }
}
