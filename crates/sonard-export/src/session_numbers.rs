//! Numbers of sessions in an export.

use std::sync::Arc;

use sonard_records::Session;

/// Counter of sessions from 1, in the order of their scans.
#[derive(Debug, Default)]
pub(crate) struct SessionNumbers {
    count: u32,
    last: Option<Arc<Session>>,
}

impl SessionNumbers {
    /// Returns the number of a scan's session, and whether this is its first scan; `None` without a
    /// session.
    pub(crate) fn number(&mut self, session: Option<&Arc<Session>>) -> Option<(u32, bool)> {
        let session = session?;
        let known = self.last.as_ref();
        let same = known.is_some_and(|last| Arc::ptr_eq(last, session) || last == session);
        if !same {
            self.count += 1;
            self.last = Some(Arc::clone(session));
        }
        Some((self.count, !same))
    }
}
