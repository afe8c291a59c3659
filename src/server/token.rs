//! The file with the token.

use std::{
    fs::OpenOptions,
    io::{self, Read as _},
    os::unix::fs::{OpenOptionsExt as _, PermissionsExt as _},
    path::Path,
};

use rustix::fs::OFlags;
use thiserror::Error;

/// Largest file that is taken for a token's, bytes.
const MOST_BYTES: u64 = 4096;
/// Shortest token: `openssl rand -hex 8` makes 16 characters.
const LEAST_CHARACTERS: usize = 16;

/// Why a token can't be had from its file.
#[derive(Debug, Error)]
pub enum TokenError {
    /// It can't be read.
    #[error("{0}")]
    Unreadable(#[from] io::Error),
    /// A folder, a pipe, a device.
    #[error("it is no regular file")]
    NoFile,
    /// Others than its owner may read it.
    #[error("its permissions are {:03o}: others than its owner may read the token", .0 & 0o777)]
    Open(u32),
    /// No token is that large.
    #[error("it is larger than {MOST_BYTES} bytes")]
    TooLarge,
    /// Not text.
    #[error("it is no text")]
    NoText,
    /// It could be guessed.
    #[error("the token in it is shorter than {LEAST_CHARACTERS} characters")]
    TooShort,
}

impl TokenError {
    /// What a person can do about it.
    #[must_use]
    pub fn help(&self, path: &Path) -> String {
        let path = path.display();
        match self {
            Self::Open(_) => format!("chmod 600 {path}"),
            _ => format!("make one with `(umask 077; openssl rand -hex 32 >{path})`"),
        }
    }
}

/// The token in a file that only its owner may read.
///
/// # Errors
/// Anything but a small regular file with a token in it; nothing is waited for.
pub fn read_token(path: &Path) -> Result<String, TokenError> {
    // Opening a pipe would wait for whoever writes into it.
    let nonblocking = OFlags::NONBLOCK.bits().cast_signed();
    let file = OpenOptions::new().read(true).custom_flags(nonblocking).open(path)?;
    let metadata = file.metadata()?;
    let mode = metadata.permissions().mode();
    if !metadata.is_file() {
        return Err(TokenError::NoFile);
    }
    if mode & 0o077 != 0 {
        return Err(TokenError::Open(mode));
    }
    let mut bytes = Vec::new();
    file.take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(TokenError::TooLarge);
    }
    let token = String::from_utf8(bytes).map_err(|_| TokenError::NoText)?.trim().to_owned();
    if token.len() < LEAST_CHARACTERS { Err(TokenError::TooShort) } else { Ok(token) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, Permissions};

    #[test]
    fn only_a_small_file_of_its_owner_is_taken_for_a_token() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("token");
        let read = |bytes: &[u8], mode: u32| {
            fs::write(&file, bytes).expect("there is room");
            fs::set_permissions(&file, Permissions::from_mode(mode)).expect("it is ours");
            read_token(&file).map_err(|error| error.help(&file))
        };
        let good = b" 0123456789abcdef\n";
        assert_eq!(read(good, 0o600), Ok("0123456789abcdef".into()));
        assert_eq!(read(good, 0o400), Ok("0123456789abcdef".into()));
        for mode in [0o640, 0o604, 0o660, 0o622] {
            let chmod = format!("chmod 600 {}", file.display());
            assert_eq!(read(good, mode), Err(chmod), "{mode:o}");
        }
        for bytes in [&b"short"[..], &[b'x'; 5000], b"\xff\xfe0123456789abcdef"] {
            assert!(read(bytes, 0o600).is_err_and(|help| help.contains("openssl")), "{bytes:?}");
        }
    }

    #[test]
    fn pipes_folders_and_devices_are_refused_at_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join("pipe");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, mode).expect("a pipe");
        for path in [&pipe, folder.path(), Path::new("/dev/zero"), Path::new("/no/such/file")] {
            let error = read_token(path).expect_err("no token");
            assert!(matches!(error, TokenError::NoFile | TokenError::Unreadable(_)), "{error}");
        }
    }
}
