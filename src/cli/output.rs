//! Output files of verbs, written under common rules.
//!
//! A file that the command reads is never overwritten, under any name. Outputs are written to a
//! temporary file, synced and renamed, so a full disk or a crash leaves the old file or none. A
//! picture, map, list, table or recording replaces an older one of its kind; any other existing
//! file is rejected unless `--force` is given. Measured logs are appended to, never replaced.

mod stream;

use std::{
    ffi::OsStr,
    fs::{self, File, Metadata, OpenOptions},
    io::{self, BufWriter, Read as _, Write as _},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use clap::{
    ArgMatches, Command,
    builder::{TypedValueParser as _, ValueParser, ValueParserFactory},
    parser::ValueSource,
};

use super::{Failure, Outcome};
use crate::{
    export::{CsvExport, McapExport, ParquetExport, is_geojson},
    store::{
        AtomicFile, FileKind, HEAD_BYTES, LogWriter, RecordWriter, StoreError,
        platform::{self, FileId},
    },
};
pub(super) use stream::Stream;

/// Path of an output on the command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct OutPath(PathBuf);

impl ValueParserFactory for OutPath {
    type Parser = ValueParser;

    fn value_parser() -> ValueParser {
        clap::builder::PathBufValueParser::new().map(Self).into()
    }
}

impl std::ops::Deref for OutPath {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

/// Permission to replace existing files.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::Args)]
pub(super) struct Overwrite {
    /// Overwrite the output; without it, only an older output of the same kind is replaced. Files
    /// that the command reads are never overwritten
    #[arg(long)]
    force: bool,
}

/// Kind of an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Product {
    Svg,
    Png,
    Pgm,
    MapYaml,
    /// JSON objects, one per line, that all have these members.
    List(&'static [&'static str]),
    /// Table of the readings of logs.
    Table,
    /// Table of the readings of logs, with typed columns.
    TypedTable,
    /// Recording of ROS 2 made by this program.
    Recording,
    /// Lines or features found by this program, as GeoJSON.
    GeoJson,
    /// Log, replaced only with `--force`.
    Log,
}

impl Product {
    /// Returns `true` if a file with this beginning is an older output of the same kind.
    fn replaces(self, head: &[u8]) -> bool {
        let kind = FileKind::detect(head);
        match self {
            _ if kind == FileKind::Empty => true,
            Self::Svg => kind == FileKind::Svg,
            Self::Png => kind == FileKind::Png,
            Self::Pgm => kind == FileKind::Pgm,
            Self::MapYaml => kind == FileKind::MapYaml,
            Self::List(members) => is_list_of(head, members),
            Self::Table => head.starts_with(CsvExport::<Vec<u8>>::head().as_bytes()),
            Self::TypedTable => ParquetExport::<Vec<u8>>::is_own_file(head),
            Self::Recording => McapExport::<Vec<u8>>::is_own_file(head),
            Self::GeoJson => is_geojson(head),
            Self::Log => false,
        }
    }
}

/// Returns `true` if the first line is a JSON object with exactly these members.
fn is_list_of(head: &[u8], members: &[&str]) -> bool {
    let first = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let object = serde_json::from_slice::<serde_json::Map<String, serde_json::Value>>(first);
    object.is_ok_and(|object| {
        object.len() == members.len() && members.iter().all(|name| object.contains_key(*name))
    })
}

/// Files that this process reads, with their names; a process runs one command line.
static INPUTS: Mutex<Vec<(FileId, PathBuf)>> = Mutex::new(Vec::new());

/// Registers a file that the command reads but the command line does not name.
pub(super) fn register_input(path: &Path) {
    if path.is_file()
        && let Ok(id) = FileId::of_path(path)
    {
        register(id, path);
    }
}

fn register(id: FileId, path: &Path) {
    INPUTS.lock().unwrap_or_else(PoisonError::into_inner).push((id, path.into()));
}

fn input_name(id: FileId) -> Option<PathBuf> {
    let read = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    read.iter().find(|(known, _)| *known == id).map(|(_, path)| path.clone())
}

/// Registers every file that the command line names other than as an output, and standard input.
///
/// # Errors
///
/// Standard output is one of them.
pub(super) fn register_inputs(command: &Command, matches: &ArgMatches) -> Outcome {
    let mut level = (command, matches);
    while let Some((name, below)) = level.1.subcommand() {
        let Some(command) = level.0.find_subcommand(name) else { break };
        level = (command, below);
        let given = |id: &str| level.1.value_source(id) == Some(ValueSource::CommandLine);
        let arguments = command.get_arguments().filter(|argument| !is_output(argument));
        for argument in arguments.filter(|argument| given(argument.get_id().as_str())) {
            let values = level.1.try_get_raw(argument.get_id().as_str());
            values
                .ok()
                .flatten()
                .into_iter()
                .flatten()
                .for_each(|value| register_input(value.as_ref()));
        }
    }
    if let Some(id) = platform::standard_input().as_ref().and_then(id_of_regular) {
        register(id, Path::new("standard input"));
    }
    match platform::standard_output().as_ref().and_then(id_of_regular).and_then(input_name) {
        Some(read) => Err(Failure::input(
            format!("standard output goes to {}, which this command reads", read.display()),
            "redirect it to another file, and restore this one from a copy if the shell has truncated it",
        )),
        None => Ok(()),
    }
}

/// Returns `true` for arguments that name an output.
pub(super) fn is_output(argument: &clap::Arg) -> bool {
    argument.get_value_parser().type_id() == std::any::TypeId::of::<OutPath>()
}

/// Lists the outputs of every verb below a command, as `VERB --option` or `VERB NAME`.
pub(super) fn arguments(command: &Command) -> Vec<String> {
    let mut all = Vec::new();
    for below in command.get_subcommands() {
        let verb = below.get_name();
        let named = |argument: &clap::Arg| match argument.get_long() {
            Some(long) => format!("{verb} --{long}"),
            None => format!("{verb} {}", argument.get_id().as_str().to_uppercase()),
        };
        all.extend(below.get_arguments().filter(|argument| is_output(argument)).map(named));
        all.extend(arguments(below).into_iter().map(|deeper| format!("{verb} {deeper}")));
    }
    all
}

/// Identity of a file; `None` for a terminal or pipe.
fn id_of_regular(file: &File) -> Option<FileId> {
    if file.metadata().ok()?.is_file() { FileId::of_file(file).ok() } else { None }
}

/// Resolved path of an output, and the existing file.
struct Destination {
    path: PathBuf,
    existing: Option<Metadata>,
}

impl Destination {
    fn find(path: &Path) -> Result<Self, Failure> {
        let cannot = |error: &dyn std::fmt::Display| {
            Failure::input(
                format!("cannot write {}: {error}", path.display()),
                "give a file in a folder that exists and that you may write to",
            )
        };
        let path = match fs::symlink_metadata(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
                if folder.is_some_and(|folder| !folder.is_dir()) {
                    let error = io::Error::new(error.kind(), "no such folder");
                    return Err(failure_from(path, &error));
                }
                return Ok(Self { path: path.into(), existing: None });
            }
            Err(error) => return Err(cannot(&error)),
            Ok(link) if link.is_symlink() => match fs::metadata(path) {
                Ok(existing) if existing.is_file() => {
                    fs::canonicalize(path).map_err(|e| cannot(&e))?
                }
                // For example /dev/stdout when it is a pipe.
                Ok(_) => path.into(),
                Err(error) => {
                    return Err(cannot(&format!("broken symbolic link: {error}")));
                }
            },
            Ok(_) => path.into(),
        };
        let existing = fs::metadata(&path).map_err(|error| cannot(&error))?;
        let kind = existing.file_type();
        if !(kind.is_file() || platform::is_stream(kind)) {
            return Err(cannot(&"not a file"));
        }
        Ok(Self { path, existing: Some(existing) })
    }

    /// Returns `true` for a terminal or pipe, which can't be replaced.
    fn is_stream(&self) -> bool {
        self.existing.as_ref().is_some_and(|existing| !existing.is_file())
    }
}

impl Overwrite {
    /// Returns `true` with `--force`.
    pub(super) const fn is_forced(self) -> bool {
        self.force
    }

    /// Returns a copy that is also forced by `force`.
    pub(super) const fn or_forced(self, force: bool) -> Self {
        Self { force: self.force || force }
    }

    /// Checks that a file may be written, before any work.
    pub(super) fn check(self, path: &Path, product: Product) -> Outcome {
        self.place(path, product).map(drop)
    }

    /// Checks that a file may be written to a folder that may not exist yet.
    pub(super) fn check_in(self, folder: &Path, name: &str, product: Product) -> Outcome {
        if folder.exists() { self.check(&folder.join(name), product) } else { Ok(()) }
    }

    /// Writes a complete file.
    pub(super) fn save(self, path: &Path, product: Product, bytes: &[u8]) -> Outcome {
        let mut file = self.begin(path, product)?;
        file.write_all(bytes)
            .and_then(|()| file.finish())
            .map_err(|error| failure_from(path, &error))
    }

    /// Opens an output file.
    pub(super) fn begin(self, path: &Path, product: Product) -> Result<Stream, Failure> {
        let Destination { path: at, existing } = self.place(path, product)?;
        let stream = match &existing {
            Some(existing) if !existing.is_file() => {
                OpenOptions::new().write(true).open(&at).map(Stream::Device)
            }
            _ => AtomicFile::create(&at).and_then(|file| {
                // The permissions of the existing file are kept.
                existing.map_or(Ok(()), |existing| {
                    file.as_file().set_permissions(existing.permissions())
                })?;
                Ok(Stream::File(BufWriter::new(file)))
            }),
        };
        stream.map_err(|error| failure_from(path, &error))
    }

    fn place(self, path: &Path, product: Product) -> Result<Destination, Failure> {
        let place = Destination::find(path)?;
        if place.existing.is_none() || place.is_stream() {
            return Ok(place);
        }
        reject_input(&place.path)?;
        if self.force {
            return Ok(place);
        }
        let head = head(&place.path).map_err(|error| failure_from(path, &error))?;
        if product.replaces(&head) {
            return Ok(place);
        }
        Err(Failure::input(
            format!("{} exists and is {}", path.display(), FileKind::detect(&head)),
            "give another file, or --force to overwrite this one",
        ))
    }
}

fn failure_from(path: &Path, error: &io::Error) -> Failure {
    Failure::unwritable(&path.display(), error)
}

/// Reads the beginning of a file.
fn head(path: &Path) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    File::open(path)?.take(HEAD_BYTES as u64).read_to_end(&mut head)?;
    Ok(head)
}

/// Opens the output for records: a file, renamed to its destination when complete, or standard
/// output.
pub(super) fn records_to(
    path: Option<&Path>,
    overwrite: Overwrite,
) -> Result<Box<dyn RecordWriter>, Failure> {
    let Some(path) = path else {
        let name = Path::new("standard output");
        return Ok(Box::new(LogWriter::new(Stream::standard(), name)));
    };
    let stream = overwrite.begin(path, Product::Log)?;
    Ok(Box::new(LogWriter::new(stream, path).with_scene_folder()))
}

/// Converts the result of writing records; a closed reader is not a failure.
pub(super) fn closed(written: Result<(), StoreError>) -> Outcome {
    written.or_else(|error| if error.is_broken_pipe() { Ok(()) } else { Err(error.into()) })
}

/// Rejects an output that the command reads.
pub(super) fn reject_input(path: &Path) -> Outcome {
    let Some(read) = FileId::of_path(path).ok().and_then(input_name) else { return Ok(()) };
    let shown = path.display();
    let as_other = if read == path { String::new() } else { format!(" as {}", read.display()) };
    Err(Failure::input(
        format!("{shown} is read by this command{as_other} and can't be overwritten"),
        "give another output",
    ))
}

/// Creates the folder of outputs, if missing.
pub(super) fn make_folder(folder: &Path) -> Outcome {
    fs::create_dir_all(folder)
        .map_err(|error| Failure::unwritable(&format!("the folder {}", folder.display()), &error))
}

/// Returns the format of a picture, by its extension.
pub(super) fn picture_format(path: &Path) -> Result<Product, Failure> {
    let ending = path.extension().map(OsStr::to_ascii_lowercase);
    match ending.as_deref().and_then(OsStr::to_str) {
        Some("svg") => Ok(Product::Svg),
        Some("png") => Ok(Product::Png),
        _ => Err(Failure::input(
            format!("{}: unknown extension of a picture", path.display()),
            "use .svg or .png",
        )),
    }
}

#[cfg(test)]
mod tests;
