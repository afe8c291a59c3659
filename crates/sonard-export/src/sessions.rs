//! Sessions by number.

use std::sync::Arc;

use sonard_records::Session;

/// Counts sessions from 1, in the order in which scans of them come.
#[derive(Debug, Default)]
pub(crate) struct Sessions {
    count: u32,
    last: Option<Arc<Session>>,
}

impl Sessions {
    /// The number of a scan's session, and whether no scan of it came before; `None` of a scan without one.
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
