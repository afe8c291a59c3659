//! Messages by their stamps, where they stand in another order.

use super::mcap::Message;
use crate::ImportError;

/// Messages that are sorted in memory, at most, bytes.
const MAX_BYTES: usize = 256 << 20;

/// All messages, sorted by what `stamp_ns` says of them; of equal ones, as they come.
///
/// # Errors
/// They do not fit into memory, or one of them can't be read.
pub(super) fn in_order(
    messages: impl Iterator<Item = Result<Message, ImportError>>,
    stamp_ns: impl Fn(&Message) -> Result<i64, ImportError>,
) -> Result<impl Iterator<Item = Result<Message, ImportError>>, ImportError> {
    let mut bytes = 0;
    let mut all = Vec::new();
    for message in messages {
        let message = message?;
        bytes += message.bytes.len() + size_of::<Message>();
        if bytes > MAX_BYTES {
            return Err(ImportError::mapping(
                format!(
                    "its messages are out of order, and more than the {} MB that are sorted in memory",
                    MAX_BYTES >> 20
                ),
                "bring them into order first: `mcap sort FILE -o SORTED`",
            ));
        }
        all.push((stamp_ns(&message)?, message));
    }
    all.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    Ok(all.into_iter().map(|(_, message)| Ok(message)))
}
