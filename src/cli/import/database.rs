//! Reader of rosbag2 recordings in SQLite databases, which converts them to MCAP.
//!
//! The database has the tables `topics` (`id, name, type, serialization_format, ...`) and
//! `messages` (`id, topic_id, timestamp, data`): github.com/ros2/rosbag2, rosbag2_storage_sqlite3.

use std::{
    collections::BTreeMap,
    io::{self, Read},
    path::Path,
};

use rusqlite::{Connection, OpenFlags, OptionalExtension as _, limits::Limit, params};

/// Maximum size of a message, bytes.
const MAX_MESSAGE_BYTES: i32 = 1 << 28;

const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Opcodes of MCAP records: mcap.dev/spec.
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;

/// MCAP stream of the messages of a database, produced while it is read; one message at a time is
/// in memory.
pub(super) struct Database {
    connection: Connection,
    /// MCAP channel of each topic, by its number in the database.
    channels: BTreeMap<i64, u16>,
    /// Identifier of the last message read.
    last_id: i64,
    finished: bool,
    ready: io::Cursor<Vec<u8>>,
}

/// Row of the table `messages`.
struct Row {
    id: i64,
    topic: i64,
    /// Recording time, nanoseconds since 1970.
    time_ns: i64,
    data: Vec<u8>,
}

impl Database {
    /// Opens a database read-only, for messages of the given types.
    ///
    /// # Errors
    ///
    /// The file is not a rosbag2 database, or is damaged.
    pub(super) fn open(path: &Path, types: &[&str]) -> io::Result<Self> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags).map_err(to_io_error)?;
        connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, MAX_MESSAGE_BYTES).map_err(to_io_error)?;
        // An untrusted schema may call functions, or define a view in place of a table.
        connection.pragma_update(None, "trusted_schema", false).map_err(to_io_error)?;
        check(&connection)?;
        let mut ready = MCAP_MAGIC.to_vec();
        let channels = channels(&connection, types, &mut ready)?;
        let ready = io::Cursor::new(ready);
        Ok(Self { connection, channels, last_id: i64::MIN, finished: false, ready })
    }

    /// Encodes the record of the next message, or the end of the file.
    fn encode_next(&mut self) -> io::Result<()> {
        let mut out = Vec::new();
        match self.next_message()? {
            Some(body) => record(&mut out, MESSAGE, &body),
            None => {
                record(&mut out, FOOTER, &[0; 20]);
                out.extend(MCAP_MAGIC);
                self.finished = true;
            }
        }
        self.ready = io::Cursor::new(out);
        Ok(())
    }

    fn next_message(&mut self) -> io::Result<Option<Vec<u8>>> {
        loop {
            let Some(row) = self.row_after(self.last_id)? else { return Ok(None) };
            let Row { id, topic, time_ns, data } = row;
            self.last_id = id;
            let Some(channel) = self.channels.get(&topic) else { continue };
            let mut body = Vec::with_capacity(22 + data.len());
            body.extend(channel.to_le_bytes());
            body.extend(0_u32.to_le_bytes()); // sequence
            body.extend([time_ns.to_le_bytes(), time_ns.to_le_bytes()].as_flattened());
            body.extend(data);
            return Ok(Some(body));
        }
    }

    /// Returns the next row of a selected topic. A query for each row, by number, avoids a borrow
    /// of the database between calls.
    fn row_after(&self, id: i64) -> io::Result<Option<Row>> {
        let topics: Vec<String> = self.channels.keys().map(i64::to_string).collect();
        let sql = format!(
            "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ?1 AND topic_id IN ({}) ORDER BY id \
             LIMIT 1",
            topics.join(", ")
        );
        let mut query = self.connection.prepare_cached(&sql).map_err(to_io_error)?;
        query
            .query_row(params![id], |row| {
                let (id, topic) = (row.get(0)?, row.get(1)?);
                Ok(Row { id, topic, time_ns: row.get(2)?, data: row.get(3)? })
            })
            .optional()
            .map_err(to_io_error)
    }
}

impl Read for Database {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.ready.read(into)?;
            if read > 0 || into.is_empty() || self.finished {
                return Ok(read);
            }
            self.encode_next()?;
        }
    }
}

/// Rejects databases without the tables; views are not accepted in their place.
fn check(connection: &Connection) -> io::Result<()> {
    for name in ["topics", "messages"] {
        let sql: Option<String> = connection
            .query_row(
                "SELECT sql FROM sqlite_schema WHERE name = ?1 AND type = 'table'",
                [name],
                |row| row.get(0),
            )
            .optional()
            .map_err(to_io_error)?;
        if !sql.is_some_and(|sql| sql.starts_with("CREATE TABLE")) {
            let what =
                format!("SQLite database, but not a recording of ROS 2: it has no table `{name}`");
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
    }
    Ok(())
}

/// Writes schema and channel of each topic of the given types; returns the channels by topic.
fn channels(
    connection: &Connection,
    types: &[&str],
    out: &mut Vec<u8>,
) -> io::Result<BTreeMap<i64, u16>> {
    let mut query = connection
        .prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")
        .map_err(to_io_error)?;
    let rows = query
        .query_map([], |row| {
            let texts: [String; 3] = [row.get(1)?, row.get(2)?, row.get(3)?];
            Ok((row.get::<_, i64>(0)?, texts))
        })
        .map_err(to_io_error)?;
    let mut channels = BTreeMap::new();
    for row in rows {
        let (topic, [name, type_name, encoding]) = row.map_err(to_io_error)?;
        if !types.contains(&type_name.as_str()) {
            continue;
        }
        let number = u16::try_from(channels.len() + 1).map_err(io::Error::other)?;
        let mut schema = number.to_le_bytes().to_vec();
        text(&mut schema, &type_name);
        text(&mut schema, "ros2msg");
        schema.extend(0_u32.to_le_bytes()); // definition
        record(out, SCHEMA, &schema);
        let mut channel = [number.to_le_bytes(), number.to_le_bytes()].as_flattened().to_vec();
        text(&mut channel, &name);
        text(&mut channel, &encoding);
        channel.extend(0_u32.to_le_bytes()); // metadata
        record(out, CHANNEL, &channel);
        channels.insert(topic, number);
    }
    Ok(channels)
}

fn record(out: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    out.push(opcode);
    out.extend((body.len() as u64).to_le_bytes());
    out.extend(body);
}

fn text(out: &mut Vec<u8>, text: &str) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}

/// Error of SQLite while reading a file.
#[derive(Debug, thiserror::Error)]
#[error("as an SQLite database: {0}")]
struct DatabaseError(#[source] rusqlite::Error);

fn to_io_error(error: rusqlite::Error) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, DatabaseError(error))
}
