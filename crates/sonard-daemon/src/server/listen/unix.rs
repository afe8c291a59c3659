//! A unix socket and its file, which others may remove or replace while it is listened on.

use std::{
    fs, io,
    os::unix::{
        fs::{DirBuilderExt as _, FileTypeExt as _, MetadataExt as _, PermissionsExt as _, chown},
        net::{UnixListener as StdListener, UnixStream},
    },
    path::{Path, PathBuf},
    sync::Arc,
};

use tokio::{net::UnixListener, sync::watch};

use super::kept::Kept;

/// Device and inode of a file. An inode is not given to another file while a socket is bound to it.
type FileId = (u64, u64);

/// A place of the file system that a unix socket is bound to.
#[derive(Debug)]
pub(super) struct UnixPlace {
    path: PathBuf,
    /// Permissions of the file; `None` for a socket of systemd, which systemd alone makes.
    mode: Option<u32>,
    /// The file while it is ours.
    id: Option<FileId>,
    /// User and group that the file belonged to at the last look.
    owner: Option<(u32, u32)>,
    folder: Option<Folder>,
    listener: watch::Sender<Option<Arc<UnixListener>>>,
}

/// Ownership and permissions of the folder that the socket was first bound in.
#[derive(Debug, Clone, Copy)]
struct Folder {
    mode: u32,
    owner: u32,
    group: u32,
}

/// The state of a place.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The file is the one that was bound.
    Same,
    /// It was removed and has been bound again.
    Bound,
    /// Clients do not reach this process by the path, for this reason.
    Unreachable(String),
}

impl UnixPlace {
    /// Binds `path` with these permissions. A socket that a dead process has left is replaced; one that is listened on
    /// is not, and nothing else is touched. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// As the system reports, [`io::ErrorKind::AddrInUse`] for a socket that is listened on and
    /// [`io::ErrorKind::AlreadyExists`] for anything else of that name.
    pub(super) fn bind(path: &Path, mode: u32) -> io::Result<(Self, Kept<UnixListener>)> {
        clear(path)?;
        let (listener, id) = bind(path, mode)?;
        let (kept, sender) = Kept::new(Some(listener));
        let folder = folder_of(path);
        let (path, mode, id) = (path.into(), Some(mode), Some(id));
        Ok((Self { path, mode, id, owner: None, folder, listener: sender }, kept))
    }

    /// A socket that systemd has bound; one without a file is `None` and needs no look.
    pub(super) fn inherited(listener: UnixListener) -> (Option<Self>, Kept<UnixListener>) {
        let path = listener.local_addr().ok().and_then(|at| at.as_pathname().map(Path::to_owned));
        let (kept, sender) = Kept::new(Some(listener));
        let id = path.as_deref().and_then(id_of);
        let place = path.map(|path| Self {
            path,
            mode: None,
            id,
            owner: None,
            folder: None,
            listener: sender,
        });
        (place, kept)
    }

    /// The path of the socket.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Compares the file of that name with the one that was bound, and binds again if there is none. What another
    /// process has put there is left alone. Blocks as long as the file system does.
    pub(super) fn look(&mut self) -> Outcome {
        match fs::symlink_metadata(&self.path) {
            Ok(there) if self.id == Some((there.dev(), there.ino())) => {
                self.owner = Some((there.uid(), there.gid()));
                Outcome::Same
            }
            Ok(there) => {
                let what = if there.file_type().is_socket() { "socket" } else { "file" };
                Outcome::Unreachable(format!(
                    "another process has put a {what} of its own there, which is not removed"
                ))
            }
            Err(error) if is_missing(&error) => self.bind_again(),
            Err(error) => Outcome::Unreachable(format!("its file cannot be examined: {error}")),
        }
    }

    fn bind_again(&mut self) -> Outcome {
        let Some(mode) = self.mode else {
            return Outcome::Unreachable(
                "the file of systemd's socket was removed: restart the socket unit".into(),
            );
        };
        let bound = self.make_folder().and_then(|()| bind(&self.path, mode));
        match bound {
            Ok((listener, id)) => {
                self.id = Some(id);
                if let Some((user, group)) = self.owner {
                    // Somebody may have given the first one to a group that this user is not in.
                    drop(chown(&self.path, Some(user), Some(group)));
                }
                self.listener.send_replace(Some(Arc::new(listener)));
                Outcome::Bound
            }
            Err(error) => Outcome::Unreachable(format!(
                "its file was removed, and it cannot be bound again: {error}"
            )),
        }
    }

    /// Makes the socket's folder as it was, if that alone is gone.
    fn make_folder(&self) -> io::Result<()> {
        let (Some(folder), Some(path)) = (self.folder, parent(&self.path)) else { return Ok(()) };
        match fs::DirBuilder::new().mode(folder.mode).create(path) {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Ok(()),
            Err(error) => return Err(error),
        }
        fs::set_permissions(path, fs::Permissions::from_mode(folder.mode))?;
        // The daemon's own user may make folders only for itself.
        drop(chown(path, Some(folder.owner), Some(folder.group)));
        Ok(())
    }
}

/// The socket's file goes with it, unless something else has taken its name.
impl Drop for UnixPlace {
    fn drop(&mut self) {
        if self.mode.is_some() && self.id.is_some() && id_of(&self.path) == self.id {
            // Nothing more can be done about one that cannot be removed.
            drop(fs::remove_file(&self.path));
        }
    }
}

fn bind(path: &Path, mode: u32) -> io::Result<(UnixListener, FileId)> {
    // Fails if anything of that name is there.
    let listener = StdListener::bind(path)?;
    let prepared = || {
        fs::set_permissions(path, fs::Permissions::from_mode(mode))?;
        listener.set_nonblocking(true)?;
        let there = fs::symlink_metadata(path)?;
        Ok((there.dev(), there.ino()))
    };
    match prepared() {
        Ok(id) => Ok((UnixListener::from_std(listener)?, id)),
        Err(error) => {
            drop(fs::remove_file(path));
            Err(error)
        }
    }
}

/// Removes a socket that a dead process has left.
fn clear(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
        Ok(there) if !there.file_type().is_socket() => {
            let error = "there is a file of that name, which is no socket";
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

fn folder_of(path: &Path) -> Option<Folder> {
    let there = fs::metadata(parent(path)?).ok()?;
    Some(Folder { mode: there.mode() & 0o7777, owner: there.uid(), group: there.gid() })
}

/// Neither the file nor, perhaps, its folder is there.
fn is_missing(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bound(path: &Path) -> (UnixPlace, Kept<UnixListener>) {
        UnixPlace::bind(path, 0o640).expect("a free path")
    }

    fn mode(path: &Path) -> u32 {
        fs::metadata(path).expect("it is there").mode() & 0o7777
    }

    async fn reaches(path: &Path, kept: &Kept<UnixListener>) -> bool {
        let _client = UnixStream::connect(path).expect("somebody listens");
        let accepted = kept.accept();
        tokio::time::timeout(std::time::Duration::from_secs(5), accepted).await.is_ok()
    }

    #[tokio::test]
    async fn a_removed_file_is_bound_again_with_its_permissions() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        let (mut place, kept) = bound(&path);
        assert_eq!(place.look(), Outcome::Same);
        // Only root may give it away.
        let group = chown(&path, None, Some(1)).is_ok().then_some(1);
        assert_eq!(place.look(), Outcome::Same);
        for _ in 0..3 {
            fs::remove_file(&path).expect("it is there");
            assert_eq!(place.look(), Outcome::Bound);
            assert_eq!(mode(&path), 0o640);
            let there = fs::metadata(&path).expect("it is there");
            assert!(group.is_none_or(|group| group == there.gid()), "{}", there.gid());
            assert!(reaches(&path, &kept).await);
            assert_eq!(place.look(), Outcome::Same);
        }
        drop(place);
        assert!(!path.exists());
    }

    #[tokio::test]
    async fn a_removed_or_renamed_folder_is_made_as_it_was() {
        let outer = tempfile::tempdir().expect("a folder");
        let folder = outer.path().join("run");
        fs::DirBuilder::new().mode(0o751).create(&folder).expect("a folder");
        let path = folder.join("s");
        let (mut place, kept) = bound(&path);
        fs::remove_dir_all(&folder).expect("it is there");
        assert_eq!(place.look(), Outcome::Bound);
        assert_eq!((mode(&folder), mode(&path)), (0o751, 0o640));
        fs::rename(&folder, outer.path().join("moved")).expect("it is there");
        assert_eq!(place.look(), Outcome::Bound);
        assert!(reaches(&path, &kept).await);
        // Somebody else has made it already.
        fs::remove_dir_all(&folder).expect("it is there");
        fs::DirBuilder::new().mode(0o700).create(&folder).expect("a folder");
        assert_eq!(place.look(), Outcome::Bound);
        assert_eq!(mode(&folder), 0o700);
    }

    #[tokio::test]
    async fn what_another_process_has_put_there_is_never_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        let (mut place, kept) = bound(&path);
        fs::remove_file(&path).expect("it is there");
        fs::write(&path, "theirs").expect("there is room");
        assert!(matches!(place.look(), Outcome::Unreachable(why) if why.contains("a file")));
        assert_eq!(fs::read(&path).expect("it is there"), b"theirs");

        fs::remove_file(&path).expect("it is there");
        let other = StdListener::bind(&path).expect("a free path");
        let theirs = id_of(&path);
        assert!(matches!(place.look(), Outcome::Unreachable(why) if why.contains("a socket")));
        // Not even once nobody listens on it.
        drop(other);
        assert!(matches!(place.look(), Outcome::Unreachable(_)));
        assert_eq!(id_of(&path), theirs);

        fs::remove_file(&path).expect("it is there");
        assert_eq!(place.look(), Outcome::Bound);
        assert!(reaches(&path, &kept).await);
        fs::rename(folder.path().join("s"), folder.path().join("aside")).expect("it is there");
        let _third = StdListener::bind(&path).expect("a free path");
        drop(place);
        assert!(path.exists(), "at the end only the own file goes");
    }

    #[tokio::test]
    async fn the_file_of_an_inherited_socket_is_reported_and_left_to_systemd() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("s");
        let listener = UnixListener::bind(&path).expect("a free path");
        let (place, _kept) = UnixPlace::inherited(listener);
        let mut place = place.expect("it has a path");
        assert_eq!(place.look(), Outcome::Same);
        fs::remove_file(&path).expect("it is there");
        assert!(matches!(place.look(), Outcome::Unreachable(why) if why.contains("socket unit")));
        assert!(!path.exists());
        fs::write(&path, "").expect("there is room");
        drop(place);
        assert!(path.exists());
    }
}
