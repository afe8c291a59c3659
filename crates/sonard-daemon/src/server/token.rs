//! File with the access token.

use std::path::Path;

use crate::secret::{SecretError, SecretKind, read_secret};

/// Limits of a token file; `openssl rand -hex 8` generates 16 characters.
const TOKEN: SecretKind = SecretKind { name: "token", min_chars: 16, max_bytes: 4096 };

/// Reads the token from a file that only its owner may read.
///
/// # Errors
/// Anything but a small regular file with a token. Never blocks on pipes or devices.
pub fn read_token(path: &Path) -> Result<String, SecretError> {
    read_secret(path, TOKEN)
}

/// Returns advice on how to correct a token file.
#[must_use]
pub fn token_help(error: &SecretError, path: &Path) -> String {
    let path_shown = path.display();
    error.help(path).unwrap_or_else(|| {
        format!("create a token with `(umask 077; openssl rand -hex 32 >{path_shown})`")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{
        fs::{self, Permissions},
        os::unix::fs::PermissionsExt as _,
    };

    #[test]
    fn needs_a_private_small_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("token");
        let read = |bytes: &[u8], mode: u32| {
            fs::write(&file, bytes).expect("there is room");
            fs::set_permissions(&file, Permissions::from_mode(mode)).expect("it is ours");
            read_token(&file).map_err(|error| token_help(&error, &file))
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
    fn special_files_are_rejected() {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join("pipe");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, mode).expect("a pipe");
        for path in [&pipe, folder.path(), Path::new("/dev/zero"), Path::new("/no/such/file")] {
            let error = read_token(path).expect_err("no token");
            assert!(
                matches!(error, SecretError::NotRegularFile | SecretError::Unreadable(_)),
                "{error}"
            );
        }
    }
}
