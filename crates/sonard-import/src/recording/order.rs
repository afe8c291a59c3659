//! Sorting of messages by time stamp.

use super::mcap::RecordedMessage;
use crate::ImportError;

/// Maximum size of the messages that are sorted in memory.
const MAX_BYTES: usize = 256 << 20;

/// Sorts messages by `stamp_ns`, stably.
///
/// # Errors
/// Returns an error for an unreadable message, or if the messages exceed the memory limit.
pub(super) fn sort_by_stamp(
    messages: impl Iterator<Item = Result<RecordedMessage, ImportError>>,
    stamp_ns: impl Fn(&RecordedMessage) -> Result<i64, ImportError>,
) -> Result<impl Iterator<Item = Result<RecordedMessage, ImportError>>, ImportError> {
    let mut bytes = 0;
    let mut all = Vec::new();
    for message in messages {
        let message = message?;
        bytes += message.bytes.len() + size_of::<RecordedMessage>();
        if bytes > MAX_BYTES {
            return Err(ImportError::mapping(
                format!(
                    "the messages are out of order and exceed the {} MB that can be sorted in memory",
                    MAX_BYTES >> 20
                ),
                "sort them first: `mcap sort FILE -o SORTED`",
            ));
        }
        all.push((stamp_ns(&message)?, message));
    }
    all.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    Ok(all.into_iter().map(|(_, message)| Ok(message)))
}
