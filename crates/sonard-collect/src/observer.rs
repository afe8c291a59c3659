//! Progress reports and prompts of a running collection.

use super::{CollectError, CollectionFolder, CollectionHistory};

/// Receiver of progress reports that answers prompts: a terminal, or an unattended process.
pub trait Observer: Send + Sync {
    /// Reports the start of a scan, after `done` of `total` scans; `left_s` is the estimated
    /// remaining time in seconds.
    fn scan_started(&self, label: &str, done: u32, total: u32, left_s: f64);

    /// Reports one recorded beam.
    fn beam_recorded(&self);

    /// Reports a message to the operator.
    fn message(&self, line: &str);

    /// Reports the number of remaining scans and their estimated duration in seconds.
    fn scans_planned(&self, scans: u32, left_s: f64);

    /// Reports that measuring pauses until the next scan starts.
    fn measuring_paused(&self);

    /// Prompts the operator and waits for the answer; `None` without a terminal. Cancel-safe: an
    /// unanswered prompt is repeated by the next call.
    fn prompt(&mut self, question: &str) -> impl Future<Output = Option<String>> + Send;

    /// Writes the report of a complete collection, before its manifest is written.
    ///
    /// # Errors
    /// Returns an error if the report cannot be written.
    fn write_report(
        &self,
        folder: &CollectionFolder,
        history: &CollectionHistory,
    ) -> Result<(), CollectError>;
}
