//! A shard that has not its place yet.

use std::{
    fs::{self, File, Permissions},
    io,
    os::unix::fs::PermissionsExt as _,
    path::Path,
};

use rustix::fs::{FlockOperation, flock};
use tempfile::{Builder, TempDir};

use super::DataSetError;
use crate::sync_folder;

/// A new folder is for whom the umask leaves it.
const MODE: u32 = 0o777;
/// What its name ends in.
const ENDING: &str = ".draft";

/// A hidden folder beside a shard's place. It is locked as long as somebody writes into it, so that what a killed
/// process left can be told from what another one is still at.
#[derive(Debug)]
pub(super) struct Draft {
    folder: TempDir,
    _lock: File,
}

impl Draft {
    /// Begins one for the shard of this name.
    pub(super) fn begin(root: &Path, shard: &str) -> Result<Self, DataSetError> {
        let fail = |error| DataSetError::io("make a folder in", root, error);
        let folder = Builder::new()
            .prefix(&format!(".{shard}."))
            .suffix(ENDING)
            .permissions(Permissions::from_mode(MODE))
            .tempdir_in(root)
            .map_err(fail)?;
        let lock = File::open(folder.path()).map_err(fail)?;
        // A file system without locks: then nobody clears away what others left.
        let _ = flock(&lock, FlockOperation::NonBlockingLockExclusive);
        Ok(Self { folder, _lock: lock })
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Brings the folder to the disk and renames it to its place, where nothing may be.
    pub(super) fn take_place(self, place: &Path) -> Result<(), DataSetError> {
        let fail = |error| DataSetError::io("write", place, error);
        sync_folder(self.folder.path()).map_err(fail)?;
        fs::rename(self.path(), place).map_err(fail)?;
        // It has another name now: there is nothing to be removed.
        drop(self.folder.keep());
        let root = place.parent().unwrap_or(Path::new("."));
        sync_folder(root).map_err(fail)
    }

    /// Removes what killed processes left of shards that are there now. What can't be removed stays: it is hidden,
    /// and nobody takes it for a shard.
    pub(super) fn clear(root: &Path) {
        let Ok(entries) = fs::read_dir(root) else { return };
        for entry in entries.filter_map(Result::ok) {
            let name = entry.file_name();
            let draft = name.to_str().filter(|name| name.ends_with(ENDING));
            let shard = draft.and_then(|name| name.strip_prefix('.')?.split('.').next());
            if shard.is_some_and(|shard| root.join(shard).is_dir()) {
                let _ = remove(&entry.path());
            }
        }
    }
}

/// Removes a folder that nobody writes into.
fn remove(path: &Path) -> io::Result<()> {
    let lock = File::open(path)?;
    flock(&lock, FlockOperation::NonBlockingLockExclusive)?;
    fs::remove_dir_all(path)
}
