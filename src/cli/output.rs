//! What verbs write, by one rule.
//!
//! A file that a command reads is never written over, by whatever name it goes. What is written is
//! made beside its place, synced and renamed, so that a full disk or a crash leaves the old file or
//! none. A picture, a map, a list, a table or a recording takes the place of an older one of its kind; anything else that is
//! there is refused unless `--force` says to replace it. Measured logs are added to, never replaced.

mod stream;

use std::{
    ffi::OsStr,
    fs::{self, File, Metadata, OpenOptions},
    io::{self, BufWriter, Read as _, Write as _},
    os::{
        fd::{AsFd, BorrowedFd},
        unix::fs::{FileTypeExt as _, MetadataExt as _},
    },
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
    export::{CsvExport, McapExport, ParquetExport, begins_geojson},
    store::{FileKind, HEAD_BYTES, LogWriter, RecordWriter, StoreError, WholeFile},
};
pub(super) use stream::Stream;

/// A path on the command line that is written to.
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

/// Whether what is there may be replaced.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::Args)]
pub(super) struct Overwrite {
    /// Replace what is there, whatever it is; without it, only an older output of the same kind. What
    /// the command reads is never replaced
    #[arg(long)]
    force: bool,
}

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Product {
    Svg,
    Png,
    Pgm,
    MapYaml,
    /// JSON objects, one a line, that all have these members.
    List(&'static [&'static str]),
    /// A table of the readings of logs.
    Table,
    /// The same with typed columns.
    TypedTable,
    /// A recording of ROS 2 that this program made.
    Recording,
    /// Lines or features that this program found, as GeoJSON.
    GeoJson,
    /// A log: never replaced unasked.
    Log,
}

impl Product {
    /// Whether a file that begins so is an older one of its kind.
    fn replaces(self, head: &[u8]) -> bool {
        let kind = FileKind::of(head);
        match self {
            _ if kind == FileKind::Empty => true,
            Self::Svg => kind == FileKind::Svg,
            Self::Png => kind == FileKind::Png,
            Self::Pgm => kind == FileKind::Pgm,
            Self::MapYaml => kind == FileKind::MapYaml,
            Self::List(members) => is_list(head, members),
            Self::Table => head.starts_with(CsvExport::<Vec<u8>>::head().as_bytes()),
            Self::TypedTable => ParquetExport::<Vec<u8>>::begins(head),
            Self::Recording => McapExport::<Vec<u8>>::begins(head),
            Self::GeoJson => begins_geojson(head),
            Self::Log => false,
        }
    }
}

/// Whether the first line is a JSON object with exactly these members.
fn is_list(head: &[u8], members: &[&str]) -> bool {
    let first = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let object = serde_json::from_slice::<serde_json::Map<String, serde_json::Value>>(first);
    object.is_ok_and(|object| {
        object.len() == members.len() && members.iter().all(|name| object.contains_key(*name))
    })
}

/// A file by what it is instead of by its name.
type FileId = (u64, u64);

/// What this process reads, and the name it goes by: one process runs one command line.
static READ: Mutex<Vec<(FileId, PathBuf)>> = Mutex::new(Vec::new());

/// Notes that the command reads this file. For files that the command line does not name itself.
pub(super) fn note_input(path: &Path) {
    if let Ok(metadata) = fs::metadata(path) {
        note(&metadata, path);
    }
}

fn note(metadata: &Metadata, path: &Path) {
    if metadata.is_file() {
        let id = (metadata.dev(), metadata.ino());
        READ.lock().unwrap_or_else(PoisonError::into_inner).push((id, path.into()));
    }
}

fn read_as(metadata: &Metadata) -> Option<PathBuf> {
    let id = (metadata.dev(), metadata.ino());
    let read = READ.lock().unwrap_or_else(PoisonError::into_inner);
    read.iter().find(|(known, _)| *known == id).map(|(_, path)| path.clone())
}

/// Notes every file that the command line names for anything but output, and standard input.
///
/// # Errors
/// When standard output is one of them.
pub(super) fn guard(command: &Command, matches: &ArgMatches) -> Outcome {
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
                .for_each(|value| note_input(value.as_ref()));
        }
    }
    if let Some(metadata) = of_descriptor(io::stdin().as_fd()) {
        note(&metadata, Path::new("standard input"));
    }
    let out = of_descriptor(io::stdout().as_fd()).filter(Metadata::is_file);
    match out.as_ref().and_then(read_as) {
        Some(read) => Err(Failure::input(
            format!("standard output goes to {}, which this command reads", read.display()),
            "send it to another file, and take this one from a copy if the shell has emptied it",
        )),
        None => Ok(()),
    }
}

/// Whether an argument names a place to write to.
pub(super) fn is_output(argument: &clap::Arg) -> bool {
    argument.get_value_parser().type_id() == std::any::TypeId::of::<OutPath>()
}

/// The outputs of every verb below a command, as `VERB --option` or `VERB NAME`.
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

fn of_descriptor(fd: BorrowedFd<'_>) -> Option<Metadata> {
    File::from(fd.try_clone_to_owned().ok()?).metadata().ok()
}

/// Where a file is to be: behind links, and what is there.
struct Destination {
    path: PathBuf,
    there: Option<Metadata>,
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
                    let error = io::Error::new(error.kind(), "there is no such folder");
                    return Err(failed(path, &error));
                }
                return Ok(Self { path: path.into(), there: None });
            }
            Err(error) => return Err(cannot(&error)),
            Ok(link) if link.is_symlink() => match fs::metadata(path) {
                Ok(there) if there.is_file() => fs::canonicalize(path).map_err(|e| cannot(&e))?,
                // As /dev/stdout is one, to a pipe.
                Ok(_) => path.into(),
                Err(error) => {
                    return Err(cannot(&format!("it is a symbolic link to nothing: {error}")));
                }
            },
            Ok(_) => path.into(),
        };
        let there = fs::metadata(&path).map_err(|error| cannot(&error))?;
        let kind = there.file_type();
        if !(kind.is_file() || kind.is_char_device() || kind.is_fifo()) {
            return Err(cannot(&"it is no file"));
        }
        Ok(Self { path, there: Some(there) })
    }

    /// A terminal, a pipe: nothing to be replaced.
    fn is_stream(&self) -> bool {
        self.there.as_ref().is_some_and(|there| !there.is_file())
    }
}

impl Overwrite {
    /// Whether it was asked for.
    pub(super) const fn is_forced(self) -> bool {
        self.force
    }

    /// The same, or as if it was asked for.
    pub(super) const fn or_forced(self, force: bool) -> Self {
        Self { force: self.force || force }
    }

    /// Checks that a file may be written there. Before any work, so that a refusal costs none.
    pub(super) fn check(self, path: &Path, product: Product) -> Outcome {
        self.place(path, product).map(drop)
    }

    /// The same of a file in a folder that need not be there yet.
    pub(super) fn check_in(self, folder: &Path, name: &str, product: Product) -> Outcome {
        if folder.exists() { self.check(&folder.join(name), product) } else { Ok(()) }
    }

    /// Writes a whole file.
    pub(super) fn save(self, path: &Path, product: Product, bytes: &[u8]) -> Outcome {
        let mut file = self.begin(path, product)?;
        file.write_all(bytes).and_then(|()| file.finish()).map_err(|error| failed(path, &error))
    }

    /// Begins a file, or standard output where there is no name.
    pub(super) fn begin(self, path: &Path, product: Product) -> Result<Stream, Failure> {
        let Destination { path: at, there } = self.place(path, product)?;
        let stream = match &there {
            Some(there) if !there.is_file() => {
                OpenOptions::new().write(true).open(&at).map(Stream::Device)
            }
            _ => WholeFile::create(&at).and_then(|file| {
                // What was kept from others stays so.
                there
                    .map_or(Ok(()), |there| file.as_file().set_permissions(there.permissions()))?;
                Ok(Stream::File(BufWriter::new(file)))
            }),
        };
        stream.map_err(|error| failed(path, &error))
    }

    fn place(self, path: &Path, product: Product) -> Result<Destination, Failure> {
        let place = Destination::find(path)?;
        if place.there.is_none() || place.is_stream() {
            return Ok(place);
        }
        refuse_input(&place.path)?;
        if self.force {
            return Ok(place);
        }
        let head = head(&place.path).map_err(|error| failed(path, &error))?;
        if product.replaces(&head) {
            return Ok(place);
        }
        Err(Failure::input(
            format!("{} is there already and is {}", path.display(), FileKind::of(&head)),
            "give another file, or --force to replace this one",
        ))
    }
}

fn failed(path: &Path, error: &io::Error) -> Failure {
    Failure::unwritable(&path.display(), error)
}

/// The beginning of a file.
fn head(path: &Path) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    File::open(path)?.take(HEAD_BYTES as u64).read_to_end(&mut head)?;
    Ok(head)
}

/// Where a verb's records go: a file that takes its place when it is whole, or standard output.
pub(super) fn records_to(
    path: Option<&Path>,
    overwrite: Overwrite,
) -> Result<Box<dyn RecordWriter>, Failure> {
    let Some(path) = path else {
        let name = Path::new("standard output");
        return Ok(Box::new(LogWriter::new(Stream::standard(), name)));
    };
    let stream = overwrite.begin(path, Product::Log)?;
    Ok(Box::new(LogWriter::new(stream, path).with_scenes_beside()))
}

/// How it went to write records; that their reader went away is no failure.
pub(super) fn closed(written: Result<(), StoreError>) -> Outcome {
    written.or_else(|error| if error.is_broken_pipe() { Ok(()) } else { Err(error.into()) })
}

/// Refuses to write to a file that the command reads.
pub(super) fn refuse_input(path: &Path) -> Outcome {
    let Some(read) = fs::metadata(path).ok().as_ref().and_then(read_as) else { return Ok(()) };
    let shown = path.display();
    let as_other = if read == path { String::new() } else { format!(" as {}", read.display()) };
    Err(Failure::input(
        format!("{shown} is read by this command{as_other}: it is not written over"),
        "give another file to write to",
    ))
}

/// Makes a folder for what is to be written, if there is none.
pub(super) fn make_folder(folder: &Path) -> Outcome {
    fs::create_dir_all(folder)
        .map_err(|error| Failure::unwritable(&format!("the folder {}", folder.display()), &error))
}

/// The format of a picture, by the end of its name.
pub(super) fn picture(path: &Path) -> Result<Product, Failure> {
    let ending = path.extension().map(OsStr::to_ascii_lowercase);
    match ending.as_deref().and_then(OsStr::to_str) {
        Some("svg") => Ok(Product::Svg),
        Some("png") => Ok(Product::Png),
        _ => Err(Failure::input(
            format!("{}: the format of a picture follows from its ending", path.display()),
            "let the name end in .svg or .png",
        )),
    }
}

#[cfg(test)]
mod tests;
