//! Archives that depend on their contents only.

use std::{
    fs::{self, File},
    io::Write as _,
    path::{Path, PathBuf},
};

use flate2::{Compression, GzBuilder};
use tar::{Builder, EntryType, Header};

use crate::Failure;

/// Packs a folder as a compressed archive. Entries are sorted and have no owner, the given time
/// (seconds since 1970), and permissions by whether they are executable.
///
/// # Errors
/// An unreadable file, or an archive that can't be written.
pub(crate) fn pack(folder: &Path, time_s: u64, archive: &Path) -> Result<(), Failure> {
    let root = PathBuf::from(folder.file_name().ok_or("a folder without a name")?);
    let encoder = GzBuilder::new()
        .mtime(0)
        .operating_system(255)
        .write(File::create(archive)?, Compression::best());
    let mut tar = Builder::new(encoder);
    append(&mut tar, folder, &root, time_s)?;
    tar.into_inner()?.finish()?.flush()?;
    Ok(())
}

fn append<W: std::io::Write>(
    tar: &mut Builder<W>,
    path: &Path,
    name: &Path,
    time_s: u64,
) -> Result<(), Failure> {
    let metadata = fs::symlink_metadata(path)?;
    let mut header = Header::new_gnu();
    header.set_mtime(time_s);
    if metadata.is_symlink() {
        header.set_entry_type(EntryType::Symlink);
        header.set_mode(0o777);
        header.set_size(0);
        return Ok(tar.append_link(&mut header, name, fs::read_link(path)?)?);
    }
    if !metadata.is_dir() {
        header.set_mode(if is_executable(&metadata) { 0o755 } else { 0o644 });
        header.set_size(metadata.len());
        return Ok(tar.append_data(&mut header, name, File::open(path)?)?);
    }
    header.set_entry_type(EntryType::Directory);
    header.set_mode(0o755);
    header.set_size(0);
    tar.append_data(&mut header, name, std::io::empty())?;
    let mut entries = fs::read_dir(path)?.collect::<Result<Vec<_>, _>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        append(tar, &entry.path(), &name.join(entry.file_name()), time_s)?;
    }
    Ok(())
}

#[cfg(unix)]
fn is_executable(metadata: &fs::Metadata) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    metadata.permissions().mode() & 0o100 != 0
}

#[cfg(not(unix))]
fn is_executable(_metadata: &fs::Metadata) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use super::*;

    #[test]
    fn times_and_order_of_creation_do_not_matter() {
        let folder = tempfile::tempdir().expect("a folder");
        let packed = |order: [&str; 3], age_s: u64| {
            let source = folder.path().join(format!("{age_s}/sonard"));
            fs::create_dir_all(&source).expect("new");
            for name in order {
                fs::write(source.join(name), name).expect("writable");
                let time = SystemTime::now() - Duration::from_secs(age_s);
                File::options()
                    .append(true)
                    .open(source.join(name))
                    .and_then(|file| file.set_modified(time))
                    .expect("set");
            }
            let archive = folder.path().join(format!("{age_s}.tar.gz"));
            pack(&source, 1_000_000_000, &archive).expect("packed");
            fs::read(archive).expect("there")
        };
        assert_eq!(packed(["a", "b", "c"], 0), packed(["c", "a", "b"], 86_400));
    }
}
