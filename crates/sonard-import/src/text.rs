//! Survey of a file in one pass, with detection of its text encoding.

use std::io::{self, Read};

use sha2::{Digest as _, Sha256};

use crate::encoding::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// Length of the head that is kept for detection.
const HEAD_BYTES: usize = 64 * 1024;

/// Hash, head and encoding of a file, gathered in one pass and constant memory.
#[derive(Debug)]
pub(crate) struct Survey {
    /// SHA-256 of the file, hexadecimal.
    pub(crate) sha256: String,
    /// First [`HEAD_BYTES`] of the file.
    pub(crate) head: Vec<u8>,
    /// Length of the file.
    pub(crate) bytes: u64,
    is_utf8: bool,
    /// The last four bytes.
    tail: Vec<u8>,
}

impl Survey {
    pub(crate) fn read(mut source: impl Read) -> io::Result<Self> {
        let (mut hash, mut piece) = (Sha256::new(), vec![0; 1 << 16]);
        let mut survey = Self {
            sha256: String::new(),
            head: Vec::new(),
            bytes: 0,
            is_utf8: true,
            tail: Vec::new(),
        };
        let mut partial = Vec::new();
        loop {
            let count = match source.read(&mut piece) {
                Ok(0) => break,
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            let read = &piece[..count];
            hash.update(read);
            survey.bytes += count as u64;
            let room = HEAD_BYTES.saturating_sub(survey.head.len());
            survey.head.extend(&read[..count.min(room)]);
            survey.tail.extend(&read[count.saturating_sub(4)..]);
            survey.tail.drain(..survey.tail.len().saturating_sub(4));
            survey.is_utf8 = survey.is_utf8 && is_utf8(&mut partial, read);
        }
        survey.sha256 = hexadecimal(hash);
        Ok(survey)
    }

    /// Returns the encoding of a text; `None` for binary content.
    pub(crate) fn encoding(&self) -> Option<&'static Encoding> {
        if let Some((marked, _)) = Encoding::for_bom(&self.head) {
            return Some(marked);
        }
        // ASCII text in UTF-16 has a zero in every second byte.
        let zeros = |from: usize| {
            let bytes = self.head.iter().skip(from).step_by(2);
            let zeros = bytes.filter(|byte| **byte == 0).count();
            (2.0 * zeros as f64) / self.head.len().max(1) as f64
        };
        let (even, odd) = (zeros(0), zeros(1));
        if self.head.len() >= 4 && odd > 0.6 && even < 0.05 {
            return Some(UTF_16LE);
        }
        if self.head.len() >= 4 && even > 0.6 && odd < 0.05 {
            return Some(UTF_16BE);
        }
        if self.head.iter().any(|byte| is_control(*byte)) {
            return None;
        }
        Some(if self.is_utf8 { UTF_8 } else { WINDOWS_1252 })
    }

    /// Returns `true` if the last line is terminated.
    pub(crate) fn ends_with_line_end(&self) -> bool {
        let last = self.tail.iter().rev().find(|byte| **byte != 0);
        self.bytes == 0 || matches!(last, Some(b'\n' | b'\r'))
    }

    /// Returns `true` if the file continues after the head.
    pub(crate) fn is_longer_than_head(&self) -> bool {
        self.bytes > self.head.len() as u64
    }
}

/// Returns `true` if bytes continue a UTF-8 text; `partial` holds a character split by the end of
/// the previous piece.
fn is_utf8(partial: &mut Vec<u8>, piece: &[u8]) -> bool {
    let joined;
    let bytes = if partial.is_empty() {
        piece
    } else {
        joined = [partial, piece].concat();
        &joined
    };
    match std::str::from_utf8(bytes) {
        Ok(_) => {
            partial.clear();
            true
        }
        Err(error) if error.error_len().is_none() => {
            *partial = bytes[error.valid_up_to()..].to_vec();
            true
        }
        Err(_) => false,
    }
}

/// Control characters that do not occur in text. Ctrl-Z terminates texts of old systems.
const fn is_control(byte: u8) -> bool {
    matches!(byte, 0..=8 | 0x0e..=0x19 | 0x1b..=0x1f | 0x7f)
}

pub(crate) fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Decodes the head of a file, without an incomplete last line.
pub(crate) fn head(survey: &Survey, encoding: &'static Encoding) -> String {
    let (text, _) = encoding.decode_with_bom_removal(&survey.head);
    let whole = match survey.is_longer_than_head() {
        true => text.rfind(['\n', '\r']).map(|end| &text[..=end]),
        false => None,
    };
    whole.unwrap_or(&text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    #[cfg(feature = "texts")]
    use crate::encoding::decoded;

    fn survey(bytes: &[u8]) -> Survey {
        Survey::read(bytes).expect("memory is readable")
    }

    #[cfg(feature = "texts")]
    #[test]
    fn detects_encodings() {
        let text = "angle_deg,distance_cm\n15,31\n16,32\n";
        let wide = |order: fn(u16) -> [u8; 2]| -> Vec<u8> {
            text.encode_utf16().flat_map(order).collect()
        };
        let marked = |mark: &[u8], bytes: Vec<u8>| [mark, &bytes].concat();
        for (bytes, encoding) in [
            (text.as_bytes().to_vec(), UTF_8),
            (marked(b"\xef\xbb\xbf", text.into()), UTF_8),
            (wide(u16::to_le_bytes), UTF_16LE),
            (wide(u16::to_be_bytes), UTF_16BE),
            (marked(b"\xff\xfe", wide(u16::to_le_bytes)), UTF_16LE),
            (marked(b"\xfe\xff", wide(u16::to_be_bytes)), UTF_16BE),
            (b"angle [\xb0],b\n1,2\n".to_vec(), WINDOWS_1252),
            ("angle [\u{b0}],b\n1,2\n".into(), UTF_8),
        ] {
            let found = survey(&bytes).encoding().expect("text");
            assert_eq!(found, encoding, "{bytes:?}");
            let mut read = String::new();
            decoded(&bytes[..], found).read_to_string(&mut read).expect("decodes");
            assert!(read.starts_with("angle"), "{read:?}");
            assert_eq!(head(&survey(&bytes), found), read);
        }
        assert_eq!(survey(b"\x1f\x8b\x08\0\xff\xfe").encoding(), None);
        assert_eq!(survey(b"a\0\x01b\x02").encoding(), None);
    }

    #[test]
    fn joins_characters_split_between_pieces() {
        let mut partial = Vec::new();
        assert!(
            is_utf8(&mut partial, b"a\xc2")
                && is_utf8(&mut partial, b"\xb0b")
                && partial.is_empty()
        );
        assert!(is_utf8(&mut partial, b"\xe2") && !is_utf8(&mut partial, b"ab"));
    }

    #[test]
    fn finds_the_last_line_end() {
        for (bytes, is_ended) in [
            (&b"1,2\n"[..], true),
            (b"1,2\r", true),
            (b"1,2", false),
            (b"1\0\r\0\n\0", true),
            (b"\x001\0\r", true),
            (b"\x001\x002", false),
            (b"", true),
        ] {
            assert_eq!(survey(bytes).ends_with_line_end(), is_ended, "{bytes:?}");
        }
    }
}
