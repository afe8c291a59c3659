//! Unix socket endpoint, whose file other processes can remove or replace.

use std::{
    fs, io,
    os::unix::{
        fs::{DirBuilderExt as _, FileTypeExt as _, MetadataExt as _, PermissionsExt as _, chown},
        net::{UnixListener as StdListener, UnixStream},
    },
    path::{Path, PathBuf},
    sync::Arc,
};

use rustix::{
    fs::{CWD, RenameFlags, renameat_with},
    io::Errno,
};
use tokio::{net::UnixListener, sync::watch};
use uuid::Uuid;

use super::listener::DynamicListener;

/// Device and inode of a file. The inode is not reused while a socket is bound to it.
type FileId = (u64, u64);

/// Unix socket bound to a path.
#[derive(Debug)]
pub(super) struct UnixEndpoint {
    path: PathBuf,
    /// Permissions of the file; `None` for a socket created by systemd.
    mode: Option<u32>,
    /// File created by this process.
    id: Option<FileId>,
    /// User and group of the file at the last check.
    owner: Option<(u32, u32)>,
    folder: Option<FolderAttributes>,
    listener: watch::Sender<Option<Arc<UnixListener>>>,
}

/// Ownership and permissions of the socket's folder at the first bind.
#[derive(Debug, Clone, Copy)]
struct FolderAttributes {
    mode: u32,
    owner: u32,
    group: u32,
}

/// Result of a check of a socket.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum SocketState {
    /// The file is the bound socket.
    Unchanged,
    /// The file was removed, and the socket has been bound again.
    Rebound,
    /// The path does not lead to this process, for this reason.
    Unreachable(String),
}

impl UnixEndpoint {
    /// Binds `path` with permissions `mode`. A stale socket of an exited process is replaced; a
    /// socket in use and any other file is left untouched. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// System errors, [`io::ErrorKind::AddrInUse`] for a socket in use, and
    /// [`io::ErrorKind::AlreadyExists`] for any other file of that name.
    pub(super) fn bind(
        path: &Path,
        mode: u32,
    ) -> io::Result<(Self, DynamicListener<UnixListener>)> {
        remove_stale(path)?;
        let (listener, id) = bind(path, mode)?;
        let (listener, sender) = DynamicListener::new(Some(listener));
        let folder = folder_of(path);
        let (path, mode, id) = (path.into(), Some(mode), Some(id));
        Ok((Self { path, mode, id, owner: None, folder, listener: sender }, listener))
    }

    /// Creates the endpoint of a socket bound by systemd; `None` for one without a file, which
    /// needs no checks.
    pub(super) fn inherited(
        listener: UnixListener,
    ) -> (Option<Self>, DynamicListener<UnixListener>) {
        let path = listener.local_addr().ok().and_then(|at| at.as_pathname().map(Path::to_owned));
        let (listener, sender) = DynamicListener::new(Some(listener));
        let id = path.as_deref().and_then(id_of);
        let endpoint = path.map(|path| Self {
            path,
            mode: None,
            id,
            owner: None,
            folder: None,
            listener: sender,
        });
        (endpoint, listener)
    }

    /// Path of the socket.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Compares the file at the path with the bound one, and binds again if it is missing. A file
    /// of another process is left untouched. File system calls can block.
    pub(super) fn check(&mut self) -> SocketState {
        match fs::symlink_metadata(&self.path) {
            Ok(there) if self.id == Some((there.dev(), there.ino())) => {
                self.owner = Some((there.uid(), there.gid()));
                SocketState::Unchanged
            }
            Ok(there) => {
                let what = if there.file_type().is_socket() { "socket" } else { "file" };
                SocketState::Unreachable(format!(
                    "another process has created a {what} at this path, which is not removed"
                ))
            }
            Err(error) if is_missing(&error) => self.rebind(),
            Err(error) => SocketState::Unreachable(format!("the file cannot be examined: {error}")),
        }
    }

    fn rebind(&mut self) -> SocketState {
        let Some(mode) = self.mode else {
            return SocketState::Unreachable(
                "the file of systemd's socket was removed: restart the socket unit".into(),
            );
        };
        let bound = self.restore_folder().and_then(|()| bind(&self.path, mode));
        match bound {
            Ok((listener, id)) => {
                self.id = Some(id);
                if let Some((user, group)) = self.owner {
                    // Keeping the group can fail if the administrator chose one that this user is
                    // not in.
                    drop(chown(&self.path, Some(user), Some(group)));
                }
                self.listener.send_replace(Some(Arc::new(listener)));
                SocketState::Rebound
            }
            Err(error) => SocketState::Unreachable(format!(
                "the file was removed, and the socket cannot be bound again: {error}"
            )),
        }
    }

    /// Recreates the socket's folder if only that is missing.
    fn restore_folder(&self) -> io::Result<()> {
        let (Some(folder), Some(path)) = (self.folder, parent(&self.path)) else { return Ok(()) };
        match fs::DirBuilder::new().mode(folder.mode).create(path) {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(()),
            Err(error) => return Err(error),
        }
        fs::set_permissions(path, fs::Permissions::from_mode(folder.mode))?;
        // An unprivileged user can create folders only for itself.
        drop(chown(path, Some(folder.owner), Some(folder.group)));
        Ok(())
    }
}

/// Removes the socket's file, unless another file has replaced it.
impl Drop for UnixEndpoint {
    fn drop(&mut self) {
        if self.mode.is_some() && self.id.is_some() && id_of(&self.path) == self.id {
            // A failure to remove the file has no remedy here.
            drop(fs::remove_file(&self.path));
        }
    }
}

/// Binds a socket at `path`, which must not exist. The socket is bound at a temporary path and then
/// renamed, so that it accepts connections and has its permissions when it appears, and its id is
/// not that of a file that replaces it meanwhile.
fn bind(path: &Path, mode: u32) -> io::Result<(UnixListener, FileId)> {
    // In the same folder, and as short as most names: the length of a socket's path is limited.
    let draft = path.with_file_name(format!(".{:08x}.sock", Uuid::new_v4().as_fields().0));
    let listener = StdListener::bind(&draft)?;
    let prepared = || {
        fs::set_permissions(&draft, fs::Permissions::from_mode(mode))?;
        listener.set_nonblocking(true)?;
        let there = fs::symlink_metadata(&draft)?;
        rename_to_free(&draft, path)?;
        Ok((there.dev(), there.ino()))
    };
    match prepared() {
        Ok(id) => Ok((UnixListener::from_std(listener)?, id)),
        Err(error) => {
            drop(fs::remove_file(&draft));
            Err(error)
        }
    }
}

/// Renames a file, unless a file of the new name exists.
fn rename_to_free(from: &Path, to: &Path) -> io::Result<()> {
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // The file system does not support the flag.
        Err(Errno::INVAL | Errno::NOSYS) => {
            fs::hard_link(from, to)?;
            fs::remove_file(from)
        }
        renamed => Ok(renamed?),
    }
}

/// Removes a stale socket of an exited process.
fn remove_stale(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
        Ok(there) if !there.file_type().is_socket() => {
            let error = "a file of that name exists and is not a socket";
            Err(io::Error::new(io::ErrorKind::AlreadyExists, error))
        }
        Ok(_) => match UnixStream::connect(path) {
            Ok(_) => Err(io::ErrorKind::AddrInUse.into()),
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => fs::remove_file(path),
            Err(error) => Err(error),
        },
    }
}

fn id_of(path: &Path) -> Option<FileId> {
    let there = fs::symlink_metadata(path).ok()?;
    Some((there.dev(), there.ino()))
}

fn parent(path: &Path) -> Option<&Path> {
    path.parent().filter(|folder| !folder.as_os_str().is_empty())
}

fn folder_of(path: &Path) -> Option<FolderAttributes> {
    let there = fs::metadata(parent(path)?).ok()?;
    Some(FolderAttributes { mode: there.mode() & 0o7777, owner: there.uid(), group: there.gid() })
}

/// Returns `true` if the file or its folder does not exist.
fn is_missing(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bound(path: &Path) -> (UnixEndpoint, DynamicListener<UnixListener>) {
        UnixEndpoint::bind(path, 0o640).expect("a free path")
    }

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).expect("exists").mode() & 0o7777
    }

    async fn reaches(path: &Path, listener: &DynamicListener<UnixListener>) -> bool {
        let _client = UnixStream::connect(path).expect("connects");
        let accepted = listener.accept();
        tokio::time::timeout(std::time::Duration::from_secs(5), accepted).await.is_ok()
    }

    #[tokio::test]
    async fn removed_file_is_bound_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        let (mut endpoint, listener) = bound(&path);
        assert_eq!(endpoint.check(), SocketState::Unchanged);
        // Only root can change the group.
        let group = chown(&path, None, Some(1)).is_ok().then_some(1);
        assert_eq!(endpoint.check(), SocketState::Unchanged);
        for _ in 0..3 {
            fs::remove_file(&path).expect("exists");
            assert_eq!(endpoint.check(), SocketState::Rebound);
            assert_eq!(mode(&path), 0o640);
            let there = fs::metadata(&path).expect("exists");
            assert!(group.is_none_or(|group| group == there.gid()), "{}", there.gid());
            assert!(reaches(&path, &listener).await);
            assert_eq!(endpoint.check(), SocketState::Unchanged);
        }
        drop(endpoint);
        assert!(!path.exists());
    }

    #[tokio::test]
    async fn sockets_are_complete_when_they_appear() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        // Without the rename, the mode can be that of the process, and connections are refused.
        let watched = path.clone();
        let watching = std::thread::spawn(move || {
            for _ in 0..100 {
                let there = loop {
                    if let Ok(there) = fs::metadata(&watched)
                        && there.file_type().is_socket()
                    {
                        break there;
                    }
                };
                assert_eq!(there.mode() & 0o7777, 0o640);
                UnixStream::connect(&watched).expect("connects");
                // A file of the same name is not the endpoint's, however early it is created.
                fs::remove_file(&watched).expect("exists");
                fs::write(&watched, "theirs").expect("there is room");
            }
        });
        for _ in 0..100 {
            let (endpoint, _listener) = bound(&path);
            while !fs::read(&path).is_ok_and(|content| content == b"theirs") {}
            drop(endpoint);
            assert_eq!(fs::read(&path).expect("kept"), b"theirs");
            fs::remove_file(&path).expect("exists");
        }
        watching.join().expect("no failure");
        assert_eq!(fs::read_dir(folder.path()).expect("exists").count(), 0);
    }

    #[tokio::test]
    async fn failed_bind_leaves_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        fs::write(&path, "theirs").expect("there is room");
        let error = bind(&path, 0o640).expect_err("the path exists");
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&path).expect("kept"), b"theirs");
        assert_eq!(fs::read_dir(folder.path()).expect("exists").count(), 1);
    }

    #[tokio::test]
    async fn removed_folder_is_restored() {
        let outer = tempfile::tempdir().expect("a folder");
        let folder = outer.path().join("run");
        fs::DirBuilder::new().mode(0o751).create(&folder).expect("a folder");
        let path = folder.join("s");
        let (mut endpoint, listener) = bound(&path);
        fs::remove_dir_all(&folder).expect("exists");
        assert_eq!(endpoint.check(), SocketState::Rebound);
        assert_eq!((mode(&folder), mode(&path)), (0o751, 0o640));
        fs::rename(&folder, outer.path().join("moved")).expect("exists");
        assert_eq!(endpoint.check(), SocketState::Rebound);
        assert!(reaches(&path, &listener).await);
        // The folder has been recreated by another process.
        fs::remove_dir_all(&folder).expect("exists");
        fs::DirBuilder::new().mode(0o700).create(&folder).expect("a folder");
        assert_eq!(endpoint.check(), SocketState::Rebound);
        assert_eq!(mode(&folder), 0o700);
    }

    #[tokio::test]
    async fn foreign_files_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        let (mut endpoint, listener) = bound(&path);
        fs::remove_file(&path).expect("exists");
        fs::write(&path, "theirs").expect("there is room");
        assert!(
            matches!(endpoint.check(), SocketState::Unreachable(why) if why.contains("a file"))
        );
        assert_eq!(fs::read(&path).expect("exists"), b"theirs");

        fs::remove_file(&path).expect("exists");
        let other = StdListener::bind(&path).expect("a free path");
        let theirs = id_of(&path);
        assert!(
            matches!(endpoint.check(), SocketState::Unreachable(why) if why.contains("a socket"))
        );
        // The file is kept even when no process uses it.
        drop(other);
        assert!(matches!(endpoint.check(), SocketState::Unreachable(_)));
        assert_eq!(id_of(&path), theirs);

        fs::remove_file(&path).expect("exists");
        assert_eq!(endpoint.check(), SocketState::Rebound);
        assert!(reaches(&path, &listener).await);
        fs::rename(folder.path().join("s"), folder.path().join("aside")).expect("exists");
        let _third = StdListener::bind(&path).expect("a free path");
        drop(endpoint);
        assert!(path.exists(), "only the own file is removed");
    }

    #[tokio::test]
    async fn inherited_socket_is_not_rebound() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        let listener = UnixListener::bind(&path).expect("a free path");
        let (endpoint, _listener) = UnixEndpoint::inherited(listener);
        let mut endpoint = endpoint.expect("it has a path");
        assert_eq!(endpoint.check(), SocketState::Unchanged);
        fs::remove_file(&path).expect("exists");
        assert!(
            matches!(endpoint.check(), SocketState::Unreachable(why) if why.contains("socket unit"))
        );
        assert!(!path.exists());
        fs::write(&path, "").expect("there is room");
        drop(endpoint);
        assert!(path.exists());
    }
}
