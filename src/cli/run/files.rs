//! Files named by the configuration other than scene and sensor: secrets, certificates, lists.

use std::{
    collections::BTreeMap,
    fs::{self, OpenOptions},
    io::{self, Read as _},
    os::unix::fs::OpenOptionsExt as _,
    path::{Path, PathBuf},
};

use rustix::fs::{Access as Permission, OFlags, access};
use sha2::{Digest as _, Sha256};

use super::broker::Broker;
use crate::{
    cli::{Failure, Outcome, daemon::connect_all},
    config::{FleetKeys, Keys},
    daemon::JournalThread,
    fleet::{PolledDaemon, members_from_keys},
    server::{read_token, token_help},
    store::StoreError,
};

/// Maximum length of a compared file, bytes; all of these files are smaller.
const MAX_COMPARED_BYTES: u64 = 1 << 20;
/// Longest path of a unix socket, bytes: `sun_path` with its terminating zero.
const MAX_SOCKET_PATH_BYTES: usize = 107;
/// Page of a playground, as `web/build.sh` makes it.
const PLAYGROUND_PAGE: &str = "index.html";

/// Contents of the files, checked.
pub(super) struct Files {
    /// The token of `server.token_file`.
    pub(super) token: Option<String>,
    /// Clients of the other daemons of the fleet.
    pub(super) fleet: Vec<PolledDaemon>,
    pub(super) broker: Broker,
}

impl Files {
    /// Reads and checks every file.
    pub(super) fn read(keys: &Keys) -> Result<Self, Failure> {
        let token = keys.server.token_file.as_deref().map(token).transpose()?;
        if let Some(folder) = &keys.server.playground {
            check_playground(folder)?;
        }
        let fleet = fleet(&keys.fleet)?;
        Ok(Self { token, fleet, broker: Broker::open(keys)? })
    }
}

/// Digests of the files' contents, by the keys that name them, for a comparison after a reload. An
/// unreadable file has none; reading it is an error elsewhere.
pub(super) fn digests(keys: &Keys, fleet: &[PolledDaemon]) -> BTreeMap<&'static str, [u8; 32]> {
    let Keys { server, mqtt, fleet: list, .. } = keys;
    let path = |file: &Option<String>| file.iter().map(PathBuf::from).collect::<Vec<_>>();
    let tokens = fleet.iter().filter_map(|client| client.member.token_file.clone()).collect();
    [
        ("server.token_file", path(&server.token_file)),
        ("fleet.file", path(&list.file)),
        ("fleet.token_file", tokens),
        ("mqtt.password_file", path(&mqtt.password_file)),
        ("mqtt.ca_file", path(&mqtt.ca_file)),
        ("mqtt.certificate_file", path(&mqtt.certificate_file)),
        ("mqtt.key_file", path(&mqtt.key_file)),
    ]
    .into_iter()
    .filter(|(_, files)| !files.is_empty())
    .filter_map(|(key, files)| Some((key, digest(&files).ok()?)))
    .collect()
}

fn digest(files: &[PathBuf]) -> io::Result<[u8; 32]> {
    let mut digest = Sha256::new();
    for file in files {
        // Opening a pipe would block until it has a writer.
        let nonblocking = OFlags::NONBLOCK.bits().cast_signed();
        let file = OpenOptions::new().read(true).custom_flags(nonblocking).open(file)?;
        let mut bytes = Vec::new();
        file.take(MAX_COMPARED_BYTES).read_to_end(&mut bytes)?;
        digest.update((bytes.len() as u64).to_le_bytes());
        digest.update(&bytes);
    }
    Ok(digest.finalize().into())
}

fn token(file: &str) -> Result<String, Failure> {
    read_token(Path::new(file)).map_err(|error| {
        let help = token_help(&error, Path::new(file));
        Failure::input(format!("server.token_file {file}: {error}"), help)
    })
}

fn fleet(keys: &FleetKeys) -> Result<Vec<PolledDaemon>, Failure> {
    let members = members_from_keys(keys)
        .map_err(|error| Failure::input(format!("[fleet]: {error}"), &error.help))?;
    connect_all(members)
}

fn check_playground(folder: &str) -> Outcome {
    let page = Path::new(folder).join(PLAYGROUND_PAGE);
    let found = fs::metadata(&page).and_then(|found| match found.is_file() {
        true => Ok(()),
        false => Err(io::Error::other("no regular file")),
    });
    found.map_err(|error| {
        Failure::input(
            format!("server.playground {folder}: {PLAYGROUND_PAGE}: {error}"),
            "give the folder made by web/build.sh",
        )
    })
}

/// Closes the log of a rejected start, and removes its file if it is empty.
pub(super) fn remove_empty_log(log: JournalThread) {
    let empty = log.close().file.filter(|file| fs::metadata(file).is_ok_and(|log| log.len() == 0));
    // Only the rejection is reported.
    empty.into_iter().for_each(|file| drop(fs::remove_file(file)));
}

/// Checks, without creating anything, that log folder and socket are possible at the configured
/// paths on any boot. A missing folder, or one writable by another user, is not an error here.
pub(super) fn check_places(keys: &Keys) -> Outcome {
    let folder = Path::new(&keys.log.folder);
    check_folder(folder).map_err(|source| StoreError::Open { path: folder.into(), source })?;
    if keys.server.socket.is_empty() {
        return Ok(());
    }
    let socket = Path::new(&keys.server.socket);
    check_socket(socket).map_err(|error| {
        let help = "set server.socket to a path in a folder of its own, or to \"\" for none";
        Failure::device(format!("server.socket {}: {error}", socket.display()), help)
    })
}

fn check_socket(socket: &Path) -> io::Result<()> {
    use std::os::unix::{ffi::OsStrExt as _, fs::FileTypeExt as _};
    let length = socket.as_os_str().as_bytes().len();
    if length > MAX_SOCKET_PATH_BYTES {
        let error = format!("a socket's path has at most {MAX_SOCKET_PATH_BYTES} bytes");
        return Err(io::Error::other(error));
    }
    if fs::symlink_metadata(socket).is_ok_and(|there| !there.file_type().is_socket()) {
        return Err(io::Error::other("a file of that name exists and is not a socket"));
    }
    match socket.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        Some(folder) => check_folder(folder),
        None => check_folder(Path::new(".")),
    }
}

/// Checks that the folder, or its nearest existing ancestor, is a folder on a writable file system.
fn check_folder(folder: &Path) -> io::Result<()> {
    for folder in folder.ancestors() {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        match fs::metadata(folder) {
            Ok(found) if !found.is_dir() => return Err(io::ErrorKind::NotADirectory.into()),
            Ok(_) => {
                return match access(folder, Permission::WRITE_OK) {
                    Err(rustix::io::Errno::ROFS) => Err(io::ErrorKind::ReadOnlyFilesystem.into()),
                    // The daemon may run as another user.
                    _ => Ok(()),
                };
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => return Ok(()),
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digest_depends_on_all_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let files = ["a", "b"].map(|name| folder.path().join(name));
        let write = |contents: [&str; 2]| {
            for (file, text) in files.iter().zip(contents) {
                fs::write(file, text).expect("there is room");
            }
            digest(&files).expect("readable")
        };
        let first = write(["one", "two"]);
        assert_eq!(first, write(["one", "two"]));
        assert_ne!(first, write(["one", "too"]));
        assert_ne!(first, write(["onet", "wo"]));
        fs::remove_file(&files[1]).expect("it is there");
        assert!(digest(&files).is_err());
    }

    #[test]
    fn impossible_and_missing_places() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("there is room");
        assert!(check_folder(&folder.path().join("not/yet")).is_ok());
        assert!(check_folder(Path::new("relative")).is_ok());
        for path in [file.clone(), file.join("below"), file.join("far/below")] {
            assert!(check_folder(&path).is_err(), "{}", path.display());
        }
        assert!(check_socket(&folder.path().join("s")).is_ok());
        assert!(check_socket(Path::new("s")).is_ok());
        assert!(check_socket(&file).is_err());
        assert!(check_socket(&folder.path().join("s".repeat(108))).is_err());
    }
}
