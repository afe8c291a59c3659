//! The topics of a recording, and how messages come into it.

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
    conversion::{MessageSink, stands_still},
    ros::{
        cdr::{Cdr, Encode},
        interface::Interface,
        message::Stamp,
    },
};

/// A recording that is being written: messages by topic.
pub(crate) struct Messages<W: Write> {
    pub(super) out: Writer<NoSeek<W>>,
    channels: BTreeMap<String, Channel>,
    /// The bytes of a message, kept for the next.
    buffer: Vec<u8>,
}

#[derive(Debug, Clone, Copy)]
struct Channel {
    id: u16,
    sequence: u32,
}

/// Messages are compressed together, so many bytes of them: what waits in memory.
const CHUNK_BYTES: u64 = 1 << 20;

const LIBRARY: &str = "sonard ";

/// Whether a file that begins so is a recording of this program.
pub(super) fn begins(head: &[u8]) -> bool {
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    /// Behind it: kind and length of the header, length and name of the profile, length of the library.
    const BEFORE_LIBRARY: usize = 8 + 9 + 4 + 4 + 4;
    let library = head.get(BEFORE_LIBRARY..).unwrap_or_default();
    head.starts_with(MAGIC) && library.starts_with(LIBRARY.as_bytes())
}

impl<W: Write> Messages<W> {
    pub(crate) fn new(out: W) -> Result<Self, ExportError> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true);
        Ok(Self {
            out: options.create(NoSeek::new(out)).map_err(refused)?,
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
            self.channels.insert(topic.to_owned(), Channel { id, sequence: 0 });
        }
        let Some(channel) = self.channels.get_mut(topic) else { return Ok(()) };
        channel.sequence = channel.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.sequence,
            log_time: at.0,
            publish_time: at.0,
        };
        let bytes = Cdr::of(message, &mut self.buffer);
        self.out.write_to_known_channel(&header, bytes).map_err(refused)
    }

    fn add_channel(&mut self, topic: &str, interface: Interface) -> Result<u16, ExportError> {
        let definition = interface.definition();
        let schema = self.out.add_schema(interface.name, "ros2msg", definition.as_bytes());
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_owned(), quality_of_service(topic)),
            ("topic_type_hash".to_owned(), interface.hash.to_owned()),
        ]);
        self.out.add_channel(schema.map_err(refused)?, topic, "cdr", &metadata).map_err(refused)
    }

    /// Says what a reader of the recording must know and no message says, and ends it.
    pub(crate) fn finish(mut self, remarks: BTreeMap<String, String>) -> Result<(), ExportError> {
        let remarks = Metadata { name: "sonard".to_owned(), metadata: remarks };
        self.out.write_metadata(&remarks).map_err(refused)?;
        self.out.finish().map_err(refused)?;
        Ok(self.out.into_inner().into_inner().flush()?)
    }
}

impl<W: Write> MessageSink for Messages<W> {
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

/// The profile that a topic was offered with, as rosbag2 has it in its text.
fn quality_of_service(topic: &str) -> String {
    let (depth, durability) = match stands_still(topic) {
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

pub(super) fn refused(error: McapError) -> ExportError {
    match error {
        McapError::Io(error) => error.into(),
        other => io::Error::other(other).into(),
    }
}
