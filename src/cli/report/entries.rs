//! Contents of a report.

use std::{
    collections::VecDeque,
    env, fs,
    io::{self, BufRead as _, BufReader},
    path::{Path, PathBuf},
};

use jiff::Timestamp;
use serde_json::Value;

use super::{Args, system};
use crate::{
    cli::{
        Failure, LONG_VERSION, doctor,
        output::register_input,
        run::{file_and_environment, one_line},
        runtime,
    },
    client::Client,
    config::Keys,
};

/// Maximum length of an included line, bytes: longer ones are cut.
const MAX_LINE_BYTES: usize = 1 << 20;

/// File of a report.
pub(super) struct Entry {
    pub(super) name: String,
    /// Short description for the list.
    pub(super) about: String,
    pub(super) bytes: Vec<u8>,
}

impl Entry {
    fn new(name: impl Into<String>, about: impl Into<String>, text: impl Into<String>) -> Self {
        let mut text = text.into();
        if !text.ends_with('\n') {
            text.push('\n');
        }
        Self { name: name.into(), about: about.into(), bytes: text.into_bytes() }
    }

    /// Entry of a result, or of the reason why there is none.
    fn from_result(name: &str, about: &str, result: Result<String, String>) -> Self {
        match result {
            Ok(text) => Self::new(name, about, text),
            Err(error) => {
                let name = format!("{}.txt", name.rsplit_once('.').map_or(name, |(stem, _)| stem));
                Self::new(name, format!("{about}: not available"), error)
            }
        }
    }
}

/// Collects everything; what is not available is stated in its entry.
///
/// # Errors
///
/// Logs of the command line that can't be read.
pub(super) fn collect(args: &Args, now: Timestamp) -> Result<Vec<Entry>, Failure> {
    let configuration = configuration(args.config.as_deref());
    let (status, health) = daemon(&args.daemon.client()?);
    let mut logs = Vec::new();
    for log in &args.logs {
        logs.push(log_entry(log, args.lines).map_err(|error| {
            Failure::input(format!("cannot read {}: {error}", log.display()), "give a readable log")
        })?);
    }
    let known = args.logs.iter().filter_map(|log| fs::canonicalize(log).ok()).collect::<Vec<_>>();
    let current = newest_log(&status, &configuration)
        .filter(|log| fs::canonicalize(log).map_or(true, |log| !known.contains(&log)));
    if let Some(log) = current {
        let entry = log_entry(&log, args.lines);
        let failed = |error: io::Error| {
            Entry::new(
                "log.txt",
                "the daemon's log: not available",
                format!("{}: {error}", log.display()),
            )
        };
        logs.push(entry.unwrap_or_else(failed));
    }
    let mut entries = vec![
        Entry::new("version.txt", "program, commit, features, time", version(now)),
        Entry::from_result(
            "configuration.toml",
            "effective configuration, without comments and secrets",
            configuration.map(|keys| without_secrets(&toml::to_string(&keys).unwrap_or_default())),
        ),
        Entry::from_result(
            "status.json",
            "state of the daemon",
            status.map(|status| pretty(&status)),
        ),
        Entry::from_result(
            "health.json",
            "health of the daemon",
            health.map(|health| pretty(&health)),
        ),
        Entry::new("messages.txt", "last messages of the daemon's units", system::messages()),
        Entry::new("system.txt", "kernel, distribution, memory, user", system::describe()),
        Entry::new("ports.txt", "serial ports and their users", system::ports()),
        Entry::new(
            "kernel.txt",
            "kernel messages about USB and serial ports",
            system::kernel_messages(),
        ),
    ];
    if let Some(port) = &args.port {
        let checked = checked(port);
        entries.push(Entry::from_result(
            "doctor.json",
            "checks of the port, without motion",
            checked,
        ));
    }
    entries.extend(number_names(logs));
    Ok(entries)
}

/// Logs of one name get a number each.
fn number_names(mut logs: Vec<Entry>) -> Vec<Entry> {
    let names: Vec<String> = logs.iter().map(|log| log.name.clone()).collect();
    for (number, log) in logs.iter_mut().enumerate() {
        let same = names.iter().filter(|name| **name == log.name).count();
        if same > 1 {
            log.name = format!("{}-{}", number + 1, log.name);
        }
    }
    logs
}

fn version(now: Timestamp) -> String {
    let program = env::current_exe().map_or_else(|_| "?".into(), |path| path.display().to_string());
    format!("sonard {LONG_VERSION}\nprogram {program}\ntime {now:.0}\n")
}

/// Effective configuration, as `sonard run` reads it without options.
fn configuration(file: Option<&Path>) -> Result<Keys, String> {
    let layers = file_and_environment(file).map_err(|failure| one_line(&failure))?;
    layers.into_keys().map_err(|error| format!("{error}; {}", error.help))
}

/// Configuration without user names and passwords of addresses, and without values of keys that
/// hold secrets.
fn without_secrets(text: &str) -> String {
    let line = |line: &str| {
        let (key, value) = line.split_once(" = ")?;
        let is_secret = ["password", "token", "secret"].iter().any(|name| key.ends_with(name));
        if is_secret {
            return Some(format!("{key} = \"(removed)\"\n"));
        }
        let (scheme, rest) = value.split_once("://")?;
        let end = rest.find(['/', '"']).unwrap_or(rest.len());
        let at = rest[..end].rfind('@')?;
        Some(format!("{key} = {scheme}://(removed){}\n", &rest[at..]))
    };
    text.lines().map(|text| line(text).unwrap_or_else(|| format!("{text}\n"))).collect()
}

/// State and health of the daemon, or why they are not available.
fn daemon(client: &Client) -> (Result<Value, String>, Result<Value, String>) {
    let requested = runtime::new().map(|runtime| {
        runtime.block_on(async {
            let get = async |path| client.get_json::<Value>(path).await.map_err(|e| e.to_string());
            (get("/v1/status").await, get("/v1/health").await)
        })
    });
    let failed = || Err("the program could not start its network tasks".to_owned());
    requested.unwrap_or_else(|_| (failed(), failed()))
}

fn pretty(value: &Value) -> String {
    serde_json::to_string_pretty(value).unwrap_or_default()
}

/// Result of `sonard doctor --no-motion`.
fn checked(port: &str) -> Result<String, String> {
    doctor::check_without_motion(port).map_err(|failure| match failure {
        Failure::Found(text) => text.unwrap_or_default(),
        Failure::Input(diagnostic) | Failure::Device(diagnostic) => diagnostic.to_string(),
    })
}

/// Log that the daemon writes, or the newest one of the configured folder.
fn newest_log(
    status: &Result<Value, String>,
    configuration: &Result<Keys, String>,
) -> Option<PathBuf> {
    let written = status.as_ref().ok().and_then(|status| status["log"]["file"].as_str());
    if let Some(written) = written {
        return Some(written.into());
    }
    let folder = PathBuf::from(&configuration.as_ref().ok()?.log.folder);
    let newest = crate::store::log_files(&folder).ok()?.pop()?;
    Some(folder.join(newest.name))
}

/// Last lines of a log, after the last session before them.
fn log_entry(log: &Path, count: usize) -> io::Result<Entry> {
    register_input(log);
    let mut reader = BufReader::new(fs::File::open(log)?);
    let (mut last, mut session) = (VecDeque::new(), None);
    let mut line = Vec::new();
    while reader.read_until(b'\n', &mut line)? > 0 {
        if line.len() > MAX_LINE_BYTES {
            line.truncate(MAX_LINE_BYTES - 1);
            line.push(b'\n');
        }
        last.push_back(std::mem::take(&mut line));
        if last.len() > count
            && let Some(dropped) = last.pop_front()
            && is_session(&dropped)
        {
            session = Some(dropped);
        }
    }
    let starts_with_session = last.front().is_some_and(|first| is_session(first));
    let bytes =
        session.filter(|_| !starts_with_session).into_iter().chain(last).flatten().collect();
    let name = log.file_name().unwrap_or_default().to_string_lossy();
    let about = format!("last lines of {}, with their session", log.display());
    Ok(Entry { name: format!("log-{name}"), about, bytes })
}

fn is_session(line: &[u8]) -> bool {
    line.starts_with(br#"{"type":"session""#) || line.starts_with(br#"{"type": "session""#)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_are_removed() {
        let text = "[mqtt]\nbroker = \"mqtts://robot:hunter2@broker.local:8883\"\npassword_file = \"/etc/p\"\n\
                    password = \"hunter2\"\n[server]\ntoken = \"abc\"\nlisten = \"127.0.0.1:8765\"\n";
        let cleaned = without_secrets(text);
        assert!(!cleaned.contains("hunter2") && !cleaned.contains("abc"), "{cleaned}");
        for kept in ["mqtts://(removed)@broker.local:8883\"", "\"/etc/p\"", "\"127.0.0.1:8765\""] {
            assert!(cleaned.contains(kept), "{kept}: {cleaned}");
        }
        assert!(toml::from_str::<toml::Table>(&cleaned).is_ok(), "{cleaned}");
    }

    #[test]
    fn last_lines_keep_their_session() {
        let folder = tempfile::tempdir().expect("a folder");
        let log = folder.path().join("scan.jsonl");
        let lines = [
            "{\"type\":\"session\",\"a\":1}",
            "{\"type\":\"ping\",\"b\":1}",
            "{\"type\":\"ping\",\"b\":2}",
        ];
        fs::write(&log, lines.join("\n") + "\n").expect("there is room");
        let last =
            |count| String::from_utf8(log_entry(&log, count).expect("it").bytes).expect("UTF-8");
        assert_eq!(last(1), format!("{}\n{}\n", lines[0], lines[2]));
        assert_eq!(last(5), lines.join("\n") + "\n");
        assert_eq!(last(0), format!("{}\n", lines[0]));
        // A line that is cut ends like the others.
        fs::write(&log, format!("{}\n{}\n", "x".repeat(MAX_LINE_BYTES + 5), lines[1]))
            .expect("there is room");
        assert!(last(2).ends_with(&format!("x\n{}\n", lines[1])));
    }

    #[test]
    fn logs_of_one_name() {
        let entry = |name: &str| Entry::new(name, "", "");
        let names = number_names(vec![entry("log-a"), entry("log-b"), entry("log-a")]);
        let names: Vec<_> = names.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(names, ["1-log-a", "log-b", "3-log-a"]);
    }
}
