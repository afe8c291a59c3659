//! The messages of MCAP files, in the order in which they stand there.

use std::{
    collections::{BTreeMap, VecDeque},
    io::{self, Read},
    sync::Arc,
};

use mcap::{
    McapError,
    read::parse_record,
    records::{ChunkHeader, Record, op},
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use ruzstd::decoding::StreamingDecoder;

use crate::ImportError;

/// How every such file begins and ends.
pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// The longest record that is taken into memory, and what a chunk may become, bytes.
const MOST_BYTES: u64 = 1 << 28;

/// The compression that recorders of ROS 2 and `mcap` prefer.
const ZSTD: &str = "zstd";

/// What stands before the records of a chunk, without the name of its compression: three times eight bytes, a check
/// sum and the lengths of name and records.
const CHUNK_HEAD: usize = 3 * 8 + 4 + 4 + 8;

/// A channel of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    /// Name of its type.
    pub(crate) type_name: String,
    /// How its messages are encoded.
    pub(crate) encoding: String,
}

/// A message as it was recorded.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Message {
    pub(crate) channel: Arc<Channel>,
    /// Nanoseconds since 1970.
    pub(crate) recorded_ns: u64,
    pub(crate) bytes: Vec<u8>,
}

/// The messages of such types in files that follow each other, in their order.
pub(crate) struct Messages<'a, R> {
    files: Files<R>,
    types: &'a [&'a str],
    topics: Option<Topics>,
    /// The rest of a chunk.
    waiting: VecDeque<Message>,
}

impl<'a, R: Read> Messages<'a, io::BufReader<R>> {
    pub(crate) fn of(source: R, types: &'a [&'a str]) -> Self {
        let files = Files { source: io::BufReader::new(source), at: 0 };
        Self { files, types, topics: None, waiting: VecDeque::new() }
    }
}

impl<R: Read> Messages<'_, R> {
    /// Takes the next record in; whether there was one.
    fn read_on(&mut self) -> Result<bool, ImportError> {
        let Some(topics) = &mut self.topics else {
            self.topics = self.files.begin()?.then(Topics::default);
            return Ok(self.topics.is_some());
        };
        let Some((opcode, body)) = self.files.record()? else {
            self.topics = None;
            return Ok(true);
        };
        let files = &self.files;
        let record = parse_record(opcode, &body).map_err(|error| files.damaged(&error))?;
        let Record::Chunk { header, data } = record else {
            self.waiting.extend(topics.take(record, self.types));
            return Ok(true);
        };
        if header.uncompressed_size > MOST_BYTES {
            return Err(files.damaged(&"a chunk of it is too long"));
        }
        let plain;
        let chunk = if header.compression == ZSTD {
            plain = without_zstd(&header, &data).map_err(|error| files.damaged(&error))?;
            &plain
        } else {
            // What is told of it, and its records; more may stand behind them.
            let end = CHUNK_HEAD + header.compression.len() + header.compressed_size as usize;
            body.get(..end).unwrap_or(&body)
        };
        let mut take = |record: Record<'_>| self.waiting.extend(topics.take(record, self.types));
        each_of_chunk(chunk, header.uncompressed_size as usize, &mut take)
            .map_err(|error| files.unpacked(error))?;
        Ok(true)
    }
}

impl<R: Read> Iterator for Messages<'_, R> {
    type Item = Result<Message, ImportError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(message) = self.waiting.pop_front() {
                return Some(Ok(message));
            }
            match self.read_on() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

/// The body of the same chunk, not compressed.
///
/// Zstandard is unpacked here, by a decoder in Rust, because the library's needs a C library of its own.
///
/// # Errors
/// No such data, or another length of it than the chunk's head says.
fn without_zstd(header: &ChunkHeader, data: &[u8]) -> io::Result<Vec<u8>> {
    let length = header.uncompressed_size;
    let mut body = Vec::with_capacity(CHUNK_HEAD + length as usize);
    for number in [header.message_start_time, header.message_end_time, length] {
        body.extend(number.to_le_bytes());
    }
    body.extend(header.uncompressed_crc.to_le_bytes());
    body.extend(0_u32.to_le_bytes()); // no compression's name
    body.extend(length.to_le_bytes());
    let decoder = StreamingDecoder::new(data).map_err(io::Error::other)?;
    // One byte more than there may be tells that there is more.
    let unpacked = decoder.take(length + 1).read_to_end(&mut body)?;
    if unpacked as u64 == length {
        Ok(body)
    } else {
        Err(io::Error::other("a chunk unpacks to another length than it says"))
    }
}

/// Gives each record of a chunk of this body, which unpacks to so many bytes by its own account.
///
/// The library's own reader of chunks knows no limit, and takes a record for as long as it says it is; of a file's
/// records it knows one. So it is given the chunk as a file of nothing else.
fn each_of_chunk(
    body: &[u8],
    unpacked: usize,
    take: &mut impl FnMut(Record<'_>),
) -> Result<(), McapError> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(unpacked.max(body.len()));
    let mut reader = LinearReader::new_with_options(options);
    let length = (body.len() as u64).to_le_bytes();
    let mut source = (&[op::CHUNK][..]).chain(&length[..]).chain(body);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = source.read(reader.insert(wanted))?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } if is_of_messages(opcode) => {
                take(parse_record(opcode, data)?);
            }
            // Of others the library believes lengths that may be lies.
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(())
}

/// Whether a record in a chunk matters.
const fn is_of_messages(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE)
}

/// Files that follow each other.
struct Files<R> {
    source: R,
    /// Bytes that were read.
    at: u64,
}

impl<R: Read> Files<R> {
    /// Whether another file begins.
    fn begin(&mut self) -> Result<bool, ImportError> {
        let mut first = [0];
        if self.source.read(&mut first)? == 0 {
            return Ok(false);
        }
        let mut magic = [0; MAGIC.len()];
        (magic[0], self.at) = (first[0], self.at + 1);
        self.fill(&mut magic[1..])?;
        if magic != MAGIC {
            return Err(ImportError::mapping(
                "it is no MCAP recording",
                "give a recording of ROS 2 in MCAP, or the folder of one",
            ));
        }
        Ok(true)
    }

    /// The next record that can matter: its kind and bytes; `None` at the end of the file.
    fn record(&mut self) -> Result<Option<(u8, Vec<u8>)>, ImportError> {
        loop {
            let mut head = [0; 9];
            self.fill(&mut head)?;
            let [opcode, length @ ..] = head;
            let length = u64::from_le_bytes(length);
            match opcode {
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK if length > MOST_BYTES => {
                    return Err(self.damaged(&format!("a record of {length} bytes is too long")));
                }
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK => {
                    let mut body = Vec::new();
                    self.source.by_ref().take(length).read_to_end(&mut body)?;
                    self.at += body.len() as u64;
                    if (body.len() as u64) < length {
                        return Err(self.cut_off());
                    }
                    return Ok(Some((opcode, body)));
                }
                _ => self.skip(length)?,
            }
            if opcode == op::FOOTER {
                self.fill(&mut [0; MAGIC.len()])?;
                return Ok(None);
            }
        }
    }

    fn skip(&mut self, length: u64) -> Result<(), ImportError> {
        let skipped = io::copy(&mut self.source.by_ref().take(length), &mut io::sink())?;
        self.at += skipped;
        if skipped < length { Err(self.cut_off()) } else { Ok(()) }
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), ImportError> {
        self.source.read_exact(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => self.cut_off(),
            _ => error.into(),
        })?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    fn cut_off(&self) -> ImportError {
        ImportError::mapping(
            format!("the recording ends within a record, behind byte {}", self.at),
            "it was cut off: `mcap recover` saves what is whole",
        )
    }

    fn damaged(&self, error: &dyn std::fmt::Display) -> ImportError {
        ImportError::mapping(
            format!("a record before byte {} is damaged: {error}", self.at),
            "`mcap recover` saves what is whole",
        )
    }

    fn unpacked(&self, error: McapError) -> ImportError {
        match error {
            McapError::UnsupportedCompression(how) => ImportError::mapping(
                format!("its chunks are compressed by {how}"),
                "`mcap compress --compression lz4` writes it as it can be read here",
            ),
            error => self.damaged(&error),
        }
    }
}

/// What the file said of its topics so far.
#[derive(Default)]
struct Topics {
    types: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Arc<Channel>>,
}

impl Topics {
    /// Takes a record in; the message that it is, if it is of such a type.
    fn take(&mut self, record: Record<'_>, types: &[&str]) -> Option<Message> {
        match record {
            Record::Schema { header, .. } => {
                self.types.insert(header.id, header.name);
                None
            }
            Record::Channel(channel) => {
                let type_name = self.types.get(&channel.schema_id).cloned().unwrap_or_default();
                let told =
                    Channel { topic: channel.topic, type_name, encoding: channel.message_encoding };
                self.channels.insert(channel.id, Arc::new(told));
                None
            }
            Record::Message { header, data } => {
                let channel = self.channels.get(&header.channel_id)?;
                let bytes = || data.into_owned();
                let (channel, recorded_ns) = (Arc::clone(channel), header.log_time);
                types.contains(&channel.type_name.as_str()).then(|| Message {
                    channel,
                    recorded_ns,
                    bytes: bytes(),
                })
            }
            _ => None,
        }
    }
}
