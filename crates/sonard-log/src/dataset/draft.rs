//! Shard under construction in a hidden folder.

use std::{
    fs::{self, File},
    io,
    path::Path,
};

use tempfile::{Builder, TempDir};

use super::DataSetError;
use crate::{
    platform::{open_folder, with_mode},
    sync_folder,
};

/// Mode of a new folder, reduced by the umask.
const MODE: u32 = 0o777;
/// Suffix of the folder's name.
const SUFFIX: &str = ".draft";

/// Hidden folder of a shard under construction. The folder is locked during writing, which
/// distinguishes drafts of killed processes from those of running ones.
#[derive(Debug)]
pub(super) struct ShardDraft {
    folder: TempDir,
    _lock: File,
}

impl ShardDraft {
    /// Creates and locks a draft for the shard of this name.
    pub(super) fn create(root: &Path, shard: &str) -> Result<Self, DataSetError> {
        let fail = |error| DataSetError::io("create a folder in", root, error);
        let prefix = format!(".{shard}.");
        let mut names = Builder::new();
        names.prefix(&prefix).suffix(SUFFIX);
        let folder = with_mode(&mut names, MODE).tempdir_in(root).map_err(fail)?;
        let lock = open_folder(folder.path()).map_err(fail)?;
        // On a file system without locks, drafts of killed processes are not removed.
        let _ = lock.try_lock();
        Ok(Self { folder, _lock: lock })
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Syncs the folder and renames it to `target`, which must not exist.
    pub(super) fn rename_to(self, target: &Path) -> Result<(), DataSetError> {
        let fail = |error| DataSetError::io("write", target, error);
        sync_folder(self.folder.path()).map_err(fail)?;
        fs::rename(self.path(), target).map_err(fail)?;
        // The temporary name no longer exists, so removal on drop is disabled.
        drop(self.folder.keep());
        let root = target.parent().unwrap_or(Path::new("."));
        sync_folder(root).map_err(fail)
    }

    /// Removes drafts of killed processes whose shards exist. Failures are ignored, since hidden
    /// folders are not shards.
    pub(super) fn clear(root: &Path) {
        let Ok(entries) = fs::read_dir(root) else { return };
        for entry in entries.filter_map(Result::ok) {
            let name = entry.file_name();
            let draft = name.to_str().filter(|name| name.ends_with(SUFFIX));
            let shard = draft.and_then(|name| name.strip_prefix('.')?.split('.').next());
            if shard.is_some_and(|shard| root.join(shard).is_dir()) {
                let _ = remove_unlocked(&entry.path());
            }
        }
    }
}

/// Removes a folder unless a process has locked it.
fn remove_unlocked(path: &Path) -> io::Result<()> {
    let lock = open_folder(path)?;
    lock.try_lock()?;
    fs::remove_dir_all(path)
}
