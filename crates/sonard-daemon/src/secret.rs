//! Files that hold a secret: a token, a password, a key.

use std::{
    fs::OpenOptions,
    io::{self, Read as _},
    os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _},
    path::Path,
};

use rustix::fs::OFlags;
use thiserror::Error;

/// A secret that can't be read from its file.
#[derive(Debug, Error)]
pub enum SecretError {
    /// It can't be read.
    #[error("{0}")]
    Unreadable(#[from] io::Error),
    /// A folder, a pipe, a device.
    #[error("it is no regular file")]
    NoFile,
    /// Others than its owner may read it.
    #[error("its permissions are {:03o}: others than its owner may read the {what}", mode & 0o777)]
    Open {
        /// What is in it.
        what: &'static str,
        /// Its permissions.
        mode: u32,
    },
    /// No such secret is that large.
    #[error("it is larger than {0} bytes")]
    TooLarge(u64),
    /// Not text.
    #[error("it is no text")]
    NoText,
    /// It could be guessed.
    #[error("the {what} in it is shorter than {least} characters")]
    TooShort {
        /// What is in it.
        what: &'static str,
        /// Least length, characters.
        least: usize,
    },
}

impl SecretError {
    /// What a person can do about it, if it is not the file's contents: then `None`.
    #[must_use]
    pub fn help(&self, path: &Path) -> Option<String> {
        matches!(self, Self::Open { .. }).then(|| format!("chmod 600 {}", path.display()))
    }
}

/// The kind of secret in a file.
#[derive(Debug, Clone, Copy)]
pub struct Secret {
    /// What errors call it.
    pub what: &'static str,
    /// Shortest, characters.
    pub least: usize,
    /// Largest file, bytes.
    pub most_bytes: u64,
}

/// The secret in a file that only its owner may read, without blanks around it.
///
/// # Errors
/// Anything but a small regular file with text in it; nothing is waited for.
pub fn read_secret(path: &Path, wanted: Secret) -> Result<String, SecretError> {
    let Secret { what, least, most_bytes } = wanted;
    let (text, mode) = read_small_file(path, most_bytes)?;
    if mode & 0o077 != 0 {
        return Err(SecretError::Open { what, mode });
    }
    let secret = text.trim().to_owned();
    if secret.len() < least { Err(SecretError::TooShort { what, least }) } else { Ok(secret) }
}

/// The text of a regular file of at most so many bytes, and the file's permissions.
///
/// # Errors
/// When it is something else; nothing is waited for.
pub fn read_small_file(path: &Path, most_bytes: u64) -> Result<(String, u32), SecretError> {
    // Opening a pipe would wait for whoever writes into it.
    let nonblocking = OFlags::NONBLOCK.bits().cast_signed();
    let file = OpenOptions::new().read(true).custom_flags(nonblocking).open(path)?;
    let metadata = file.metadata()?;
    if !metadata.is_file() {
        return Err(SecretError::NoFile);
    }
    let mut bytes = Vec::new();
    file.take(most_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most_bytes {
        return Err(SecretError::TooLarge(most_bytes));
    }
    let text = String::from_utf8(bytes).map_err(|_| SecretError::NoText)?;
    Ok((text, metadata.permissions().mode()))
}
