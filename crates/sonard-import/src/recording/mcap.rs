//! Reading of messages from MCAP files, in file order.

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

use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

use crate::ImportError;

/// Magic bytes at both ends of a file.
pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Maximum size of a record and of a decompressed chunk.
const MAX_BYTES: u64 = 1 << 28;

/// Names of the compressions that the format defines.
const ZSTD: &str = "zstd";
const LZ4: &str = "lz4";

/// Size of a chunk's head without the name of its compression: three 8-byte numbers, a checksum,
/// and the lengths of name and records.
const CHUNK_HEAD: usize = 3 * 8 + 4 + 4 + 8;

/// Channel of a recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChannelInfo {
    pub(crate) topic: String,
    /// Message type, such as `sensor_msgs/msg/Range`.
    pub(crate) type_name: String,
    /// Message encoding, such as `cdr`.
    pub(crate) encoding: String,
}

/// Message with its channel and time of recording.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RecordedMessage {
    pub(crate) channel: Arc<ChannelInfo>,
    /// Time of recording, nanoseconds since 1970.
    pub(crate) recorded_ns: u64,
    pub(crate) bytes: Vec<u8>,
}

/// Iterator over the messages of some types in consecutive files.
pub(crate) struct MessageReader<'a, R> {
    files: FileReader<R>,
    types: &'a [&'a str],
    channels: Option<ChannelTable>,
    /// Remaining messages of the current chunk.
    pending: VecDeque<RecordedMessage>,
}

impl<'a, R: Read> MessageReader<'a, io::BufReader<R>> {
    pub(crate) fn new(source: R, types: &'a [&'a str]) -> Self {
        let files = FileReader { source: io::BufReader::new(source), at: 0 };
        Self { files, types, channels: None, pending: VecDeque::new() }
    }
}

impl<R: Read> MessageReader<'_, R> {
    /// Reads the next record; returns `false` at the end of the last file.
    fn read_record(&mut self) -> Result<bool, ImportError> {
        let Some(channels) = &mut self.channels else {
            self.channels = self.files.begin()?.then(ChannelTable::default);
            return Ok(self.channels.is_some());
        };
        let Some((opcode, body)) = self.files.record()? else {
            self.channels = None;
            return Ok(true);
        };
        let files = &self.files;
        let record = parse_record(opcode, &body).map_err(|error| files.damaged(&error))?;
        let Record::Chunk { header, data } = record else {
            self.pending.extend(channels.take(record, self.types));
            return Ok(true);
        };
        if header.uncompressed_size > MAX_BYTES {
            return Err(files.damaged(&"a chunk is too long"));
        }
        let plain = decompress(&header, &data).map_err(|error| files.damaged(&error))?;
        // Head and records of the chunk; padding may follow.
        let end = CHUNK_HEAD + header.compression.len() + header.compressed_size as usize;
        let chunk = plain.as_deref().unwrap_or(body.get(..end).unwrap_or(&body));
        let mut take = |record: Record<'_>| self.pending.extend(channels.take(record, self.types));
        for_each_record(chunk, header.uncompressed_size as usize, &mut take)
            .map_err(|error| files.unpacked(error))?;
        Ok(true)
    }
}

impl<R: Read> Iterator for MessageReader<'_, R> {
    type Item = Result<RecordedMessage, ImportError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(message) = self.pending.pop_front() {
                return Some(Ok(message));
            }
            match self.read_record() {
                Ok(true) => {}
                Ok(false) => return None,
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

/// Returns a compressed chunk as an uncompressed one, `None` for other compressions than
/// Zstandard and LZ4.
///
/// Decoders in Rust are used because those of the `mcap` crate need C libraries.
///
/// # Errors
/// Returns an error for invalid data, or if the decompressed length differs from the chunk's head.
fn decompress(header: &ChunkHeader, data: &[u8]) -> io::Result<Option<Vec<u8>>> {
    match header.compression.as_str() {
        ZSTD => {
            let decoder = StreamingDecoder::new(data).map_err(io::Error::other)?;
            uncompressed_chunk(header, decoder).map(Some)
        }
        LZ4 => uncompressed_chunk(header, FrameDecoder::new(data)).map(Some),
        _ => Ok(None),
    }
}

/// Builds an uncompressed chunk from the records that `decoder` returns.
fn uncompressed_chunk(header: &ChunkHeader, decoder: impl Read) -> io::Result<Vec<u8>> {
    let length = header.uncompressed_size;
    let mut body = Vec::with_capacity(CHUNK_HEAD + length as usize);
    for number in [header.message_start_time, header.message_end_time, length] {
        body.extend(number.to_le_bytes());
    }
    body.extend(header.uncompressed_crc.to_le_bytes());
    body.extend(0_u32.to_le_bytes()); // empty name of the compression
    body.extend(length.to_le_bytes());
    // Reading one more byte than stated detects longer data.
    let unpacked = decoder.take(length + 1).read_to_end(&mut body)?;
    if unpacked as u64 == length {
        Ok(body)
    } else {
        Err(io::Error::other("a chunk decompresses to another length than stated"))
    }
}

/// Calls `take` for each record of a chunk that states a decompressed size of `unpacked` bytes.
///
/// The chunk reader of the `mcap` crate has no length limit and trusts the stated length of each
/// record. Its file reader has a limit, so the chunk is passed as a file that contains nothing
/// else.
fn for_each_record(
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
            LinearReadEvent::Record { data, opcode } if is_relevant(opcode) => {
                take(parse_record(opcode, data)?);
            }
            // The `mcap` crate trusts lengths in other records, which may be wrong.
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(())
}

/// Returns `true` for the records in a chunk that are needed to read messages.
const fn is_relevant(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE)
}

/// Consecutive MCAP files in one stream.
struct FileReader<R> {
    source: R,
    /// Number of bytes read.
    at: u64,
}

impl<R: Read> FileReader<R> {
    /// Reads the magic bytes of the next file; returns `false` at the end of the stream.
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
                "not an MCAP recording",
                "give a ROS 2 recording in MCAP, or its folder",
            ));
        }
        Ok(true)
    }

    /// Reads the next relevant record, as opcode and body; `None` at the end of the file.
    fn record(&mut self) -> Result<Option<(u8, Vec<u8>)>, ImportError> {
        loop {
            let mut head = [0; 9];
            self.fill(&mut head)?;
            let [opcode, length @ ..] = head;
            let length = u64::from_le_bytes(length);
            match opcode {
                op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK if length > MAX_BYTES => {
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
            format!("the recording ends within a record, after byte {}", self.at),
            "the file is truncated: `mcap recover` saves the intact part",
        )
    }

    fn damaged(&self, error: &dyn std::fmt::Display) -> ImportError {
        ImportError::mapping(
            format!("a record before byte {} is damaged: {error}", self.at),
            "`mcap recover` saves the intact part",
        )
    }

    fn unpacked(&self, error: McapError) -> ImportError {
        match error {
            McapError::UnsupportedCompression(how) => ImportError::mapping(
                format!("unsupported chunk compression: {how}"),
                "convert it: `mcap compress --compression lz4`",
            ),
            error => self.damaged(&error),
        }
    }
}

/// Schemas and channels of the current file.
#[derive(Default)]
struct ChannelTable {
    types: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Arc<ChannelInfo>>,
}

impl ChannelTable {
    /// Processes a record; returns its message if the type is one of `types`.
    fn take(&mut self, record: Record<'_>, types: &[&str]) -> Option<RecordedMessage> {
        match record {
            Record::Schema { header, .. } => {
                self.types.insert(header.id, header.name);
                None
            }
            Record::Channel(channel) => {
                let type_name = self.types.get(&channel.schema_id).cloned().unwrap_or_default();
                let info = ChannelInfo {
                    topic: channel.topic,
                    type_name,
                    encoding: channel.message_encoding,
                };
                self.channels.insert(channel.id, Arc::new(info));
                None
            }
            Record::Message { header, data } => {
                let channel = self.channels.get(&header.channel_id)?;
                let bytes = || data.into_owned();
                let (channel, recorded_ns) = (Arc::clone(channel), header.log_time);
                types.contains(&channel.type_name.as_str()).then(|| RecordedMessage {
                    channel,
                    recorded_ns,
                    bytes: bytes(),
                })
            }
            _ => None,
        }
    }
}
