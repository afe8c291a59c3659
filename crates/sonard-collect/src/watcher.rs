//! Whoever looks on while a collection is taken.

use super::{Folder, Halt, History};

/// Whoever looks on while a collection is taken, and answers what it asks: a person at a terminal, or
/// nobody.
pub trait Watcher: Send + Sync {
    /// A scan begins: so many are done, of so many, which takes so many seconds more.
    fn begin(&self, doing: &str, done: u32, of: u32, left_s: f64);

    /// A beam is in.
    fn beam(&self);

    /// Something to know.
    fn say(&self, line: &str);

    /// So many scans are to be taken, which takes so many seconds.
    fn announce(&self, scans: u32, left_s: f64);

    /// Nothing is measured until the next scan begins.
    fn rest(&self);

    /// Asks, and waits for an answer; `None` when there is nobody to answer. Cancel-safe: what was asked
    /// and not answered is asked again.
    fn ask(&mut self, question: &str) -> impl Future<Output = Option<String>> + Send;

    /// Every scan is there: reports what the folder holds, before its manifest is made.
    ///
    /// # Errors
    /// When the report can't be written.
    fn report(&self, folder: &Folder, history: &History) -> Result<(), Halt>;
}
