//! Text encodings: all of the WHATWG standard with the feature `texts`, otherwise only UTF-8. The
//! tables of the other encodings are larger than the rest of a page's WebAssembly.

use std::io::Read;

#[cfg(feature = "texts")]
pub(crate) use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

#[cfg(not(feature = "texts"))]
pub(crate) use plain::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// Decodes a text to UTF-8 and removes its byte order mark.
#[cfg(feature = "texts")]
pub(crate) fn decoded<R: Read>(source: R, encoding: &'static Encoding) -> impl Read + use<R> {
    encoding_rs_io::DecodeReaderBytesBuilder::new()
        .encoding(Some(encoding))
        .strip_bom(true)
        .build(source)
}

/// Returns `true` if this build decodes the encoding.
pub(crate) fn is_supported(encoding: &'static Encoding) -> bool {
    cfg!(feature = "texts") || encoding == UTF_8
}

/// Removes the byte order mark of a UTF-8 text.
#[cfg(not(feature = "texts"))]
pub(crate) fn decoded<R: Read>(mut source: R, _: &'static Encoding) -> impl Read + use<R> {
    let mut start = Vec::new();
    // The next read returns the same error.
    let _ = source.by_ref().take(plain::MARK.len() as u64).read_to_end(&mut start);
    if start == plain::MARK {
        start.clear();
    }
    std::io::Cursor::new(start).chain(source)
}

#[cfg(not(feature = "texts"))]
mod plain {
    use std::borrow::Cow;

    /// UTF-8 byte order mark.
    pub(crate) const MARK: [u8; 3] = *b"\xef\xbb\xbf";

    /// Named encoding.
    #[derive(Debug, PartialEq, Eq)]
    pub(crate) struct Encoding(&'static str);

    pub(crate) const UTF_8: &Encoding = &Encoding("UTF-8");
    pub(crate) const UTF_16LE: &Encoding = &Encoding("UTF-16LE");
    pub(crate) const UTF_16BE: &Encoding = &Encoding("UTF-16BE");
    pub(crate) const WINDOWS_1252: &Encoding = &Encoding("windows-1252");

    impl Encoding {
        pub(crate) fn for_bom(bytes: &[u8]) -> Option<(&'static Self, usize)> {
            let marks = [(&MARK[..], UTF_8), (b"\xff\xfe", UTF_16LE), (b"\xfe\xff", UTF_16BE)];
            let found = marks.into_iter().find(|(mark, _)| bytes.starts_with(mark));
            found.map(|(mark, encoding)| (encoding, mark.len()))
        }

        pub(crate) fn for_label(label: &[u8]) -> Option<&'static Self> {
            label.eq_ignore_ascii_case(b"utf-8").then_some(UTF_8)
        }

        pub(crate) const fn name(&self) -> &'static str {
            self.0
        }

        pub(crate) fn decode_with_bom_removal<'a>(&self, bytes: &'a [u8]) -> (Cow<'a, str>, bool) {
            let text = String::from_utf8_lossy(bytes.strip_prefix(&MARK).unwrap_or(bytes));
            let is_lossy = text.contains(char::REPLACEMENT_CHARACTER);
            (text, is_lossy)
        }
    }
}
