//! Recordings in SQLite databases, as rosbag2 writes them, made of the messages of a recording in MCAP.

use std::{fs, path::Path};

use rusqlite::{Connection, params};

use super::{done, places, received, refused};
use crate::common::{run, stderr};

const TABLES: &str = "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
    CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
        serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL);
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
        data BLOB NOT NULL);
    CREATE INDEX timestamp_idx ON messages (timestamp ASC);";

fn converted(recording: &str, database: &Path) {
    let bytes = fs::read(recording).expect("written");
    let connection = Connection::open(database).expect("a database");
    connection.execute_batch(TABLES).expect("tables");
    connection.execute_batch("BEGIN").expect("begins");
    let mut topics = Vec::new();
    for message in mcap::MessageStream::new(&bytes).expect("a recording") {
        let message = message.expect("whole");
        let topic = message.channel.topic.clone();
        let number = topics.iter().position(|known| *known == topic).unwrap_or_else(|| {
            let schema = message.channel.schema.as_ref().expect("a type");
            let row = params![topics.len() as i64, topic, schema.name];
            connection
                .execute("INSERT INTO topics VALUES (?1, ?2, ?3, 'cdr', '', '')", row)
                .expect("taken");
            topics.push(topic);
            topics.len() - 1
        });
        let row = params![number as i64, message.log_time as i64, message.data.as_ref()];
        connection
            .execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)", row)
            .expect("taken");
    }
    connection.execute_batch("COMMIT").expect("whole");
}

#[test]
fn sqlite_equals_mcap() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (log, recording, bag) = (path("log.jsonl"), path("log.mcap"), path("bag"));
    done(&["simulate", "--scene", "simple-room", "--pose", "fig9", "-o", &log]);
    done(&["export", &log, "-o", &recording]);
    fs::create_dir(&bag).expect("writable");
    let database = folder.path().join("bag/bag_0.db3");
    converted(&recording, &database);
    let of_mcap = done(&["import", &recording]);
    for given in [&bag, &path("bag/bag_0.db3")] {
        let of_database = done(&["import", given]);
        assert_eq!(received(&of_database), received(&of_mcap));
        assert_eq!(places(&of_database), places(&of_mcap));
        assert_eq!(of_database, done(&["import", given]), "the same log whenever it is imported");
    }
    // Its session names the file, not the conversion.
    let sum = std::process::Command::new("sha256sum").arg(&database).output().expect("starts");
    let sum = String::from_utf8_lossy(&sum.stdout)[..64].to_owned();
    assert!(done(&["import", &path("bag/bag_0.db3")]).contains(&sum));
}

#[test]
fn invalid_databases() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    fs::write(path("cut.db3"), b"SQLite format 3\0\x10\0\x01").expect("writable");
    assert!(refused(&["import", &path("cut.db3")]).contains("SQLite"));
    // Another's database, and one whose table is a question that never ends.
    let endless = "CREATE TABLE topics(id, name, type, serialization_format);
        CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)
            SELECT id, 0 AS topic_id, 0 AS timestamp, x'00' AS data FROM n;";
    for (name, tables) in [("photos.db3", "CREATE TABLE photos(id)"), ("endless.db3", endless)] {
        let database = Connection::open(path(name)).expect("a database");
        database.execute_batch(tables).expect("tables");
        drop(database);
        let reported = refused(&["import", &path(name)]);
        assert!(reported.contains("not a recording of ROS 2"), "{name}: {reported}");
    }
    let empty = Connection::open(path("empty.db3")).expect("a database");
    empty.execute_batch(TABLES).expect("tables");
    drop(empty);
    assert!(refused(&["import", &path("empty.db3")]).contains("no sensor_msgs/Range"));
}

#[test]
fn any_changed_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    let (log, recording) = (path("log.jsonl"), path("log.mcap"));
    let plan = ["simulate", "--scene", "simple-room", "--pose", "fig9", "--step-deg", "45"];
    done(&[&plan[..], &["-o", &log]].concat());
    done(&["export", &log, "--without-log", "-o", &recording]);
    let database = folder.path().join("bag.db3");
    converted(&recording, &database);
    let whole = fs::read(&database).expect("written");
    for part in 0..40 {
        let mut damaged = whole.clone();
        let at = 100 + part * (damaged.len() - 100) / 40;
        damaged[at] ^= 0xff;
        fs::write(&database, &damaged).expect("writable");
        let output = run(&["import", &path("bag.db3")]);
        assert!(matches!(output.status.code(), Some(0 | 2)), "{at}: {}", stderr(&output));
        assert!(!stderr(&output).contains("panicked"), "{at}: {}", stderr(&output));
    }
}
