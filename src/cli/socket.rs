//! Places of a daemon that no configuration names: the system's, or those of a user without rights
//! to them.

use std::{
    env, fs, io,
    os::unix::fs::{DirBuilderExt as _, MetadataExt as _},
    path::{Path, PathBuf},
};

use rustix::{
    fs::{Access, access},
    process::geteuid,
};

/// Socket of the packaged daemon.
pub(super) const SYSTEM_SOCKET: &str = "/run/sonard/sonard.sock";
/// Name of a user's folder, and of the socket in it.
const FOLDER: &str = "sonard";
const SOCKET: &str = "sonard.sock";

/// Socket that clients use without an option: the user's if it exists, then the system's, then the
/// one that `sonard run` of this user makes.
pub(super) fn default_socket() -> PathBuf {
    let own = user_socket();
    // A daemon of another user, in a folder that anyone may create, is not taken for this user's.
    let is_running = own.exists() && own.parent().is_some_and(is_private);
    let has_system = Path::new(SYSTEM_SOCKET).exists() || is_writable(SYSTEM_SOCKET);
    if is_running || !has_system { own } else { SYSTEM_SOCKET.into() }
}

/// Place of a file of a user without rights to the system's folder; `None` with them.
pub(super) fn instead_of(system: &str, own: impl FnOnce() -> Option<PathBuf>) -> Option<PathBuf> {
    if is_writable(system) { None } else { own() }
}

/// Socket of a user: in $XDG_RUNTIME_DIR, or else in a folder of the user in /tmp.
pub(super) fn user_socket() -> PathBuf {
    let runtime = env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|path| path.is_dir());
    let folder = match runtime {
        Some(runtime) => runtime.join(FOLDER),
        None => env::temp_dir().join(format!("{FOLDER}-{}", geteuid().as_raw())),
    };
    folder.join(SOCKET)
}

/// Log folder of a user: in $XDG_STATE_HOME, or else in ~/.local/state.
pub(super) fn user_logs() -> Option<PathBuf> {
    let absolute = |variable| {
        env::var_os(variable).map(PathBuf::from).filter(|path: &PathBuf| path.is_absolute())
    };
    let state = absolute("XDG_STATE_HOME");
    let state = state.or_else(|| absolute("HOME").map(|home| home.join(".local/state")));
    state.map(|state| state.join(FOLDER))
}

/// Creates the folder of a user's socket, which no other user may write to.
///
/// # Errors
///
/// A folder that can't be created, or that belongs to another user.
pub(super) fn create_user_folder(socket: &Path) -> io::Result<()> {
    let Some(folder) = socket.parent() else { return Ok(()) };
    match fs::DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    if !is_private(folder) {
        return Err(io::Error::new(
            io::ErrorKind::PermissionDenied,
            format!("{} belongs to another user, or others may write to it", folder.display()),
        ));
    }
    Ok(())
}

/// Creates the folder of the system's socket, which systemd creates for the packaged unit only. An
/// error is that of the socket, which cannot be opened then.
pub(super) fn create_system_folder() {
    if let Some(folder) = Path::new(SYSTEM_SOCKET).parent() {
        let _ = fs::DirBuilder::new().mode(0o755).create(folder);
    }
}

/// Returns `true` for a folder of this user that no other user may write to.
fn is_private(folder: &Path) -> bool {
    fs::symlink_metadata(folder).is_ok_and(|found| {
        found.is_dir() && found.uid() == geteuid().as_raw() && found.mode() & 0o022 == 0
    })
}

/// Returns `true` if this process may make a file, or the folder that it is to be in.
fn is_writable(path: &str) -> bool {
    let folders = Path::new(path).ancestors().skip(1);
    let existing = folders.into_iter().find(|folder| folder.exists());
    existing.is_some_and(|folder| access(folder, Access::WRITE_OK).is_ok())
}
