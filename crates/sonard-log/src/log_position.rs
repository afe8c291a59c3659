//! Fingerprints of log positions and file digests.

use std::{
    fs::{self, File},
    io::{self, Read as _},
    path::Path,
};

use serde::de::DeserializeOwned;
use sha2::{Digest as _, Sha256};

/// Number of bytes before a position that identify a log.
pub const FINGERPRINT_BYTES: u64 = 256;

/// Fingerprint of a position in a log: the preceding bytes, at most [`FINGERPRINT_BYTES`].
#[derive(Debug, Clone, Default)]
pub struct PositionFingerprint(Vec<u8>);

impl PositionFingerprint {
    /// Advances the position by the next bytes of the log.
    pub fn advance(&mut self, bytes: &[u8]) {
        let max = FINGERPRINT_BYTES as usize;
        self.0.extend_from_slice(bytes.get(bytes.len().saturating_sub(max)..).unwrap_or_default());
        self.0.drain(..self.0.len().saturating_sub(max));
    }

    /// SHA-256 of the fingerprint, hexadecimal.
    #[must_use]
    pub fn sha256(&self) -> String {
        to_hex(&Sha256::digest(&self.0))
    }
}

/// Formats a digest in hexadecimal digits.
#[must_use]
pub fn to_hex(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Computes size and SHA-256 of a file, read in chunks.
///
/// # Errors
/// Returns an error if the file cannot be read.
pub fn file_digest(file: &mut File) -> io::Result<(u64, String)> {
    let (mut hash, mut bytes, mut piece) = (Sha256::new(), 0, vec![0; 1 << 16]);
    loop {
        let read = file.read(&mut piece)?;
        if read == 0 {
            return Ok((bytes, to_hex(&hash.finalize())));
        }
        bytes += read as u64;
        hash.update(piece.get(..read).unwrap_or_default());
    }
}

/// Reads and parses a small JSON file; `None` if there is no file.
///
/// # Errors
/// Returns an error if the file cannot be read or parsed, or is longer than `max_bytes`.
pub fn read_small_json<T: DeserializeOwned>(path: &Path, max_bytes: u64) -> io::Result<Option<T>> {
    match fs::metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Ok(metadata) if metadata.is_file() && metadata.len() <= max_bytes => {}
        Ok(_) => return Err(io::ErrorKind::InvalidData.into()),
        Err(error) => return Err(error),
    }
    Ok(Some(serde_json::from_slice(&fs::read(path)?)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fingerprint_of_chunks() {
        let bytes: Vec<u8> = (0..=255).cycle().take(1000).collect();
        let (mut whole, mut pieces) =
            (PositionFingerprint::default(), PositionFingerprint::default());
        whole.advance(&bytes);
        bytes.chunks(7).for_each(|piece| pieces.advance(piece));
        assert_eq!((whole.sha256(), whole.0.len()), (pieces.sha256(), 256));
        assert_eq!(whole.0, bytes[744..]);
    }

    #[test]
    fn digest_over_several_chunks() {
        let bytes: Vec<u8> = (0..=250).cycle().take(200_001).collect();
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("file");
        fs::write(&path, &bytes).expect("written");
        let digest = file_digest(&mut File::open(path).expect("a file")).expect("read");
        assert_eq!(digest, (200_001, to_hex(&Sha256::digest(&bytes))));
    }
}
