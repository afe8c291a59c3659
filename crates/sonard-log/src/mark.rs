//! Places in logs, remembered in a file beside them.

use std::{
    fs::{self, File},
    io::{self, Read as _},
    path::Path,
};

use serde::de::DeserializeOwned;
use sha2::{Digest as _, Sha256};

/// So many bytes before a place tell whether a log is the one it was.
pub const MARK_BYTES: u64 = 256;

/// The last bytes before a place in a log, at most [`MARK_BYTES`].
#[derive(Debug, Clone, Default)]
pub struct Mark(Vec<u8>);

impl Mark {
    /// Goes on by what comes next in the log.
    pub fn push(&mut self, bytes: &[u8]) {
        let most = MARK_BYTES as usize;
        self.0.extend_from_slice(bytes.get(bytes.len().saturating_sub(most)..).unwrap_or_default());
        self.0.drain(..self.0.len().saturating_sub(most));
    }

    /// What the log is known by.
    #[must_use]
    pub fn sha256(&self) -> String {
        hexadecimal(&Sha256::digest(&self.0))
    }
}

/// A digest in hexadecimal digits.
#[must_use]
pub fn hexadecimal(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Size and SHA-256 of a file, read piece by piece.
///
/// # Errors
/// When it can't be read.
pub fn digest_of(file: &mut File) -> io::Result<(u64, String)> {
    let (mut hash, mut bytes, mut piece) = (Sha256::new(), 0, vec![0; 1 << 16]);
    loop {
        let read = file.read(&mut piece)?;
        if read == 0 {
            return Ok((bytes, hexadecimal(&hash.finalize())));
        }
        bytes += read as u64;
        hash.update(piece.get(..read).unwrap_or_default());
    }
}

/// What a small file of JSON says; `None` where there is no file.
///
/// # Errors
/// When there is one that can't be read, is longer than `most_bytes`, or says something else.
pub fn read_small<T: DeserializeOwned>(path: &Path, most_bytes: u64) -> io::Result<Option<T>> {
    match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Ok(metadata) if metadata.is_file() && metadata.len() <= most_bytes => {}
        Ok(_) => return Err(io::ErrorKind::InvalidData.into()),
        Err(error) => return Err(error),
    }
    Ok(Some(serde_json::from_slice(&fs::read(path)?)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_of_the_last_bytes_however_they_came() {
        let bytes: Vec<u8> = (0..=255).cycle().take(1000).collect();
        let (mut whole, mut pieces) = (Mark::default(), Mark::default());
        whole.push(&bytes);
        bytes.chunks(7).for_each(|piece| pieces.push(piece));
        assert_eq!((whole.sha256(), whole.0.len()), (pieces.sha256(), 256));
        assert_eq!(whole.0, bytes[744..]);
    }

    #[test]
    fn a_file_longer_than_a_piece_has_the_digest_of_its_bytes() {
        let bytes: Vec<u8> = (0..=250).cycle().take(200_001).collect();
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        fs::write(&path, &bytes).expect("written");
        let digest = digest_of(&mut File::open(path).expect("a file")).expect("read");
        assert_eq!(digest, (200_001, hexadecimal(&Sha256::digest(&bytes))));
    }
}
