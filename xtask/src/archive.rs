//! Archives that depend on their contents only.

use std::{
    fs::{self, File},
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use flate2::{Compression, GzBuilder};
use lzma_rust2::{XzOptions, XzWriter, filter::FilterType};
use tar::{Builder, EntryType, Header};

use crate::Failure;

/// Compression of an archive.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Format {
    /// Unpacked by every system.
    Gzip,
    /// A third smaller; unpacked where the program `xz` is installed.
    Xz(Contents),
}

/// Contents that a filter before the compression makes more uniform.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Contents {
    /// Machine code of x86-64, mostly.
    X86,
    Other,
}

/// Packs a folder as a compressed archive. Entries are sorted and have no owner, the given time
/// (seconds since 1970), and permissions by whether they are executable.
///
/// # Errors
/// An unreadable file, or an archive that can't be written.
pub(crate) fn pack(
    folder: &Path,
    time_s: u64,
    format: Format,
    archive: &Path,
) -> Result<(), Failure> {
    let file = File::create(archive)?;
    match format {
        Format::Gzip => {
            let encoder = GzBuilder::new().mtime(0).operating_system(255);
            let encoder = encoder.write(file, Compression::best());
            write_entries(folder, time_s, encoder)?.finish()?.flush()?;
        }
        Format::Xz(contents) => {
            let mut options = XzOptions::with_preset(9);
            // Smaller for machine code: more context, less alignment, the longest matches.
            options.lzma_options.lc = 4;
            options.lzma_options.pb = 1;
            options.lzma_options.nice_len = 273;
            if contents == Contents::X86 {
                options.prepend_pre_filter(FilterType::BcjX86, 0);
            }
            write_entries(folder, time_s, XzWriter::new(file, options)?)?.finish()?.flush()?;
        }
    }
    Ok(())
}

/// Writes a folder and its contents as tar, and returns the writer.
fn write_entries<W: io::Write>(folder: &Path, time_s: u64, writer: W) -> Result<W, Failure> {
    let root = PathBuf::from(folder.file_name().ok_or("a folder without a name")?);
    let mut tar = Builder::new(writer);
    append(&mut tar, folder, &root, time_s)?;
    Ok(tar.into_inner()?)
}

fn append<W: io::Write>(
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
    tar.append_data(&mut header, name, io::empty())?;
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
    use std::{
        io::Read as _,
        time::{Duration, SystemTime},
    };

    use lzma_rust2::XzReader;

    use super::*;

    /// Archive of three files that are written in the given order, as if some time ago.
    fn packed(format: Format, order: [&str; 3], age_s: u64) -> Vec<u8> {
        let folder = tempfile::tempdir().expect("a folder");
        let source = folder.path().join("sonard");
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
        let archive = folder.path().join("archive");
        pack(&source, 1_000_000_000, format, &archive).expect("packed");
        fs::read(archive).expect("there")
    }

    #[test]
    fn times_and_order_of_creation_do_not_matter() {
        for format in [Format::Gzip, Format::Xz(Contents::Other), Format::Xz(Contents::X86)] {
            assert_eq!(
                packed(format, ["a", "b", "c"], 0),
                packed(format, ["c", "a", "b"], 86_400),
                "{format:?}"
            );
        }
    }

    #[test]
    fn formats_have_the_same_contents() {
        let order = ["a", "b", "c"];
        let mut plain = Vec::new();
        flate2::read::GzDecoder::new(&*packed(Format::Gzip, order, 0))
            .read_to_end(&mut plain)
            .expect("valid");
        for contents in [Contents::X86, Contents::Other] {
            let mut other = Vec::new();
            let archive = packed(Format::Xz(contents), order, 0);
            XzReader::new(&*archive, false).read_to_end(&mut other).expect("valid");
            assert_eq!(plain, other, "{contents:?}");
        }
    }
}
