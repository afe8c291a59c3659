//! Reader of secret files: tokens, passwords and keys.

use std::{
    fs::OpenOptions,
    io::{self, Read as _},
    os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _},
    path::Path,
};

use rustix::fs::OFlags;
use thiserror::Error;

/// Error while reading a secret from a file.
#[derive(Debug, Error)]
pub enum SecretError {
    /// File access failed.
    #[error("{0}")]
    Unreadable(#[from] io::Error),
    /// Folder, pipe or device instead of a file.
    #[error("not a regular file")]
    NotRegularFile,
    /// File that others than its owner may read.
    #[error("permissions {:03o}: others than the owner may read the {what}", mode & 0o777)]
    TooPermissive {
        /// Kind of secret.
        what: &'static str,
        /// File mode.
        mode: u32,
    },
    /// File over the size limit, bytes.
    #[error("larger than {0} bytes")]
    TooLarge(u64),
    /// File that is not UTF-8 text.
    #[error("not UTF-8 text")]
    NotText,
    /// Secret too short to be safe.
    #[error("the {what} is shorter than {min_chars} characters")]
    TooShort {
        /// Kind of secret.
        what: &'static str,
        /// Minimum length, characters.
        min_chars: usize,
    },
}

impl SecretError {
    /// Returns advice on the file's permissions; `None` for other errors.
    #[must_use]
    pub fn help(&self, path: &Path) -> Option<String> {
        matches!(self, Self::TooPermissive { .. }).then(|| format!("chmod 600 {}", path.display()))
    }
}

/// Kind of a secret and its limits.
#[derive(Debug, Clone, Copy)]
pub struct SecretKind {
    /// Name in error messages.
    pub name: &'static str,
    /// Minimum length, characters.
    pub min_chars: usize,
    /// Maximum size of the file, bytes.
    pub max_bytes: u64,
}

/// Reads the secret from a file that only its owner may read, and trims white space.
///
/// # Errors
/// Anything but a small regular file with text. Never blocks on pipes or devices.
pub fn read_secret(path: &Path, secret: SecretKind) -> Result<String, SecretError> {
    let SecretKind { name: what, min_chars, max_bytes } = secret;
    let (text, mode) = read_small_file(path, max_bytes)?;
    if mode & 0o077 != 0 {
        return Err(SecretError::TooPermissive { what, mode });
    }
    let secret = text.trim().to_owned();
    if secret.len() < min_chars {
        Err(SecretError::TooShort { what, min_chars })
    } else {
        Ok(secret)
    }
}

/// Reads the text of a regular file of at most `max_bytes`, with the file's mode.
///
/// # Errors
/// Any other file. Never blocks on pipes or devices.
pub fn read_small_file(path: &Path, max_bytes: u64) -> Result<(String, u32), SecretError> {
    // Opening a pipe would otherwise block until it has a writer.
    let nonblocking = OFlags::NONBLOCK.bits().cast_signed();
    let file = OpenOptions::new().read(true).custom_flags(nonblocking).open(path)?;
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(SecretError::NotRegularFile);
    }
    let mut bytes = Vec::new();
    file.take(max_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max_bytes {
        return Err(SecretError::TooLarge(max_bytes));
    }
    let text = String::from_utf8(bytes).map_err(|_| SecretError::NotText)?;
    Ok((text, metadata.permissions().mode()))
}
