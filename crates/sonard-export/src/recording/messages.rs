//! Writing of messages and topics to a recording.

use std::{
    collections::BTreeMap,
    io::{self, Write},
};

use mcap::{
    Compression, McapError, WriteOptions, Writer,
    records::{MessageHeader, Metadata},
    write::NoSeek,
};

use crate::{
    ExportError,
    conversion::{MessageSink, is_static_topic},
    ros::{
        cdr::{CdrWriter, Encode},
        interface::Interface,
        message::Stamp,
    },
};

/// Writer of a recording.
pub(crate) struct RecordingWriter<W: Write> {
    pub(super) out: Writer<NoSeek<W>>,
    channels: BTreeMap<String, ChannelState>,
    /// Buffer of an encoded message, reused.
    buffer: Vec<u8>,
}

#[derive(Debug, Clone, Copy)]
struct ChannelState {
    id: u16,
    sequence: u32,
}

/// Size of a chunk, which is held in memory and compressed as a whole.
const CHUNK_BYTES: u64 = 1 << 20;
/// Compression of chunks. The `mcap` crate compresses by a library in C.
const COMPRESSION: Option<Compression> = {
    #[cfg(feature = "lz4")]
    let compression = Some(Compression::Lz4);
    #[cfg(not(feature = "lz4"))]
    let compression = None;
    compression
};

const LIBRARY: &str = "sonard ";

/// Returns `true` if `head` is the beginning of a recording by this program.
pub(super) fn begins(head: &[u8]) -> bool {
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    /// Offset of the library name: magic, kind and length of the header, length and name of the
    /// profile, length of the library name.
    const BEFORE_LIBRARY: usize = 8 + 9 + 4 + 4 + 4;
    let library = head.get(BEFORE_LIBRARY..).unwrap_or_default();
    head.starts_with(MAGIC) && library.starts_with(LIBRARY.as_bytes())
}

impl<W: Write> RecordingWriter<W> {
    pub(crate) fn new(out: W) -> Result<Self, ExportError> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION")))
            .compression(COMPRESSION)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true);
        Ok(Self {
            out: options.create(NoSeek::new(out)).map_err(write_error)?,
            channels: BTreeMap::new(),
            buffer: Vec::new(),
        })
    }

    pub(crate) fn write(
        &mut self,
        topic: &str,
        interface: Interface,
        at: Stamp,
        message: &impl Encode,
    ) -> Result<(), ExportError> {
        if !self.channels.contains_key(topic) {
            let id = self.add_channel(topic, interface)?;
            self.channels.insert(topic.to_owned(), ChannelState { id, sequence: 0 });
        }
        let Some(channel) = self.channels.get_mut(topic) else { return Ok(()) };
        channel.sequence = channel.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time: at.0,
            publish_time: at.0,
        };
        let bytes = CdrWriter::encode(message, &mut self.buffer);
        self.out.write_to_known_channel(&header, bytes).map_err(write_error)
    }

    fn add_channel(&mut self, topic: &str, interface: Interface) -> Result<u16, ExportError> {
        let definition = interface.definition();
        let schema = self.out.add_schema(interface.name, "ros2msg", definition.as_bytes());
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_owned(), quality_of_service(topic)),
            ("topic_type_hash".to_owned(), interface.hash.to_owned()),
        ]);
        self.out
            .add_channel(schema.map_err(write_error)?, topic, "cdr", &metadata)
            .map_err(write_error)
    }

    /// Writes the metadata and the end of the recording.
    pub(crate) fn finish(mut self, metadata: BTreeMap<String, String>) -> Result<(), ExportError> {
        let metadata = Metadata { name: "sonard".to_owned(), metadata };
        self.out.write_metadata(&metadata).map_err(write_error)?;
        self.out.finish().map_err(write_error)?;
        Ok(self.out.into_inner().into_inner().flush()?)
    }
}

impl<W: Write> MessageSink for RecordingWriter<W> {
    type Error = ExportError;

    fn message(
        &mut self,
        topic: &str,
        interface: Interface,
        at: Stamp,
        message: &impl Encode,
    ) -> Result<(), ExportError> {
        self.write(topic, interface, at, message)
    }
}

/// Returns the QoS profile of a topic, in the text form of rosbag2.
fn quality_of_service(topic: &str) -> String {
    let (depth, durability) = match is_static_topic(topic) {
        true => (1, "transient_local"),
        false => (10, "volatile"),
    };
    let forever = "\n    sec: 9223372036\n    nsec: 854775807";
    format!(
        "- history: keep_last\n  depth: {depth}\n  reliability: reliable\n  durability: {durability}\n  \
         deadline:{forever}\n  lifespan:{forever}\n  liveliness: automatic\n  \
         liveliness_lease_duration:{forever}\n  avoid_ros_namespace_conventions: false\n"
    )
}

pub(super) fn write_error(error: McapError) -> ExportError {
    match error {
        McapError::Io(error) => error.into(),
        other => io::Error::other(other).into(),
    }
}
