//! Recordings of rosbag2 in an SQLite database, read as the MCAP recordings that they would be.
//!
//! The database has the tables `topics` (`id, name, type, serialization_format, ...`) and `messages`
//! (`id, topic_id, timestamp, data`): github.com/ros2/rosbag2, rosbag2_storage_sqlite3.

use std::{
    collections::BTreeMap,
    io::{self, Read},
    path::Path,
};

use rusqlite::{Connection, OpenFlags, OptionalExtension as _, limits::Limit, params};

/// The longest message that is taken into memory, bytes.
const MOST_BYTES: i32 = 1 << 28;

const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Kinds of records of an MCAP file: mcap.dev/spec.
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;

/// The bytes of an MCAP file with the messages of a database, made while they are read: a message at a time
/// is in memory.
pub(super) struct Database {
    connection: Connection,
    /// Number of a topic in the database, and of its channel.
    channels: BTreeMap<i64, u16>,
    /// The message that was read last.
    last_id: i64,
    is_over: bool,
    ready: io::Cursor<Vec<u8>>,
}

/// A row of the table `messages`.
struct Row {
    id: i64,
    topic: i64,
    /// When it was recorded, nanoseconds since 1970.
    time_ns: i64,
    data: Vec<u8>,
}

impl Database {
    /// Opens a database for reading alone; `types` are those of the messages that are wanted.
    ///
    /// # Errors
    /// No database of rosbag2, or one that is damaged.
    pub(super) fn open(path: &Path, types: &[&str]) -> io::Result<Self> {
        let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let connection = Connection::open_with_flags(path, flags).map_err(told)?;
        connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, MOST_BYTES).map_err(told)?;
        // A stranger's file may name functions in its schema, and call a query a table.
        connection.pragma_update(None, "trusted_schema", false).map_err(told)?;
        check(&connection)?;
        let mut ready = MCAP_MAGIC.to_vec();
        let channels = channels(&connection, types, &mut ready)?;
        let ready = io::Cursor::new(ready);
        Ok(Self { connection, channels, last_id: i64::MIN, is_over: false, ready })
    }

    /// Makes the record of the next message, or of the file's end.
    fn read_on(&mut self) -> io::Result<()> {
        let mut out = Vec::new();
        match self.next_message()? {
            Some(body) => record(&mut out, MESSAGE, &body),
            None => {
                record(&mut out, FOOTER, &[0; 20]);
                out.extend(MCAP_MAGIC);
                self.is_over = true;
            }
        }
        self.ready = io::Cursor::new(out);
        Ok(())
    }

    fn next_message(&mut self) -> io::Result<Option<Vec<u8>>> {
        loop {
            let Some(row) = self.row_behind(self.last_id)? else { return Ok(None) };
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

    /// The next row of a wanted topic.
    ///
    /// One row a query, found by its number: so nothing borrows the database between two calls.
    fn row_behind(&self, id: i64) -> io::Result<Option<Row>> {
        let topics: Vec<String> = self.channels.keys().map(i64::to_string).collect();
        let sql = format!(
            "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ?1 AND topic_id IN ({}) ORDER BY id \
             LIMIT 1",
            topics.join(", ")
        );
        let mut query = self.connection.prepare_cached(&sql).map_err(told)?;
        query
            .query_row(params![id], |row| {
                let (id, topic) = (row.get(0)?, row.get(1)?);
                Ok(Row { id, topic, time_ns: row.get(2)?, data: row.get(3)? })
            })
            .optional()
            .map_err(told)
    }
}

impl Read for Database {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        loop {
            let read = self.ready.read(into)?;
            if read > 0 || into.is_empty() || self.is_over {
                return Ok(read);
            }
            self.read_on()?;
        }
    }
}

/// Refuses what is no recording: both tables have to be plain ones, and no views.
fn check(connection: &Connection) -> io::Result<()> {
    for name in ["topics", "messages"] {
        let sql: Option<String> = connection
            .query_row(
                "SELECT sql FROM sqlite_schema WHERE name = ?1 AND type = 'table'",
                [name],
                |row| row.get(0),
            )
            .optional()
            .map_err(told)?;
        if !sql.is_some_and(|sql| sql.starts_with("CREATE TABLE")) {
            let what = format!(
                "it is an SQLite database, but no recording of ROS 2: it has no table `{name}`"
            );
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
    }
    Ok(())
}

/// Writes schema and channel of each topic of these types; which channel a topic has.
fn channels(
    connection: &Connection,
    types: &[&str],
    out: &mut Vec<u8>,
) -> io::Result<BTreeMap<i64, u16>> {
    let mut query = connection
        .prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")
        .map_err(told)?;
    let rows = query
        .query_map([], |row| {
            let texts: [String; 3] = [row.get(1)?, row.get(2)?, row.get(3)?];
            Ok((row.get::<_, i64>(0)?, texts))
        })
        .map_err(told)?;
    let mut channels = BTreeMap::new();
    for row in rows {
        let (topic, [name, type_name, encoding]) = row.map_err(told)?;
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

/// What SQLite says of a file.
#[derive(Debug, thiserror::Error)]
#[error("as an SQLite database: {0}")]
struct Unreadable(#[source] rusqlite::Error);

fn told(error: rusqlite::Error) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, Unreadable(error))
}
