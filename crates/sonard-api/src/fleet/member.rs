//! Addresses of the daemons of a fleet, from options, configuration and files.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

use crate::{
    client::{Client, Endpoint},
    config::{ConfigLayers, FleetKeys, Keys, is_robot_name},
};

/// Maximum number of daemons in a fleet.
pub const MAX_MEMBERS: usize = 32;

/// Address and expected robot of a daemon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    /// Expected name of the robot, if configured.
    pub robot: Option<String>,
    /// Address of the daemon.
    pub endpoint: Endpoint,
    /// File with the access token of the daemon.
    pub token_file: Option<PathBuf>,
}

/// Daemon of a fleet with its client.
#[derive(Clone)]
pub struct PolledDaemon {
    /// Address and expected robot.
    pub member: Member,
    /// Client of the daemon.
    pub client: Client,
}

/// Error in a list of daemons.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct MemberError {
    /// Error message in English.
    pub message: String,
    /// Advice on how to correct the list.
    pub help: String,
}

impl Member {
    /// Parses `[NAME=]PLACE`, where the place is `HOST:PORT`, `http://HOST:PORT`, or the path of a
    /// socket.
    ///
    /// # Errors
    /// Invalid name or address.
    pub fn parse(text: &str) -> Result<Self, MemberError> {
        let (robot, place) = match text.split_once('=') {
            // A path can contain an equals sign.
            Some((robot, place)) if !text.starts_with('/') => (Some(robot), place),
            _ => (None, text),
        };
        if let Some(robot) = robot.filter(|robot| !is_robot_name(robot)) {
            return Err(MemberError {
                message: format!("{robot:?} is not a valid robot name"),
                help: "expected letters, digits, `-`, `_` and `.`: kiwi=10.0.0.7:8765".into(),
            });
        }
        let place = read_endpoint(place).ok_or_else(|| MemberError {
            message: format!("{place:?} is not a daemon's address"),
            help:
                "expected HOST:PORT, or the path of a socket, which begins with /; the protocol is \
                   plain HTTP, so use a tunnel on untrusted networks"
                    .into(),
        })?;
        Ok(Self { robot: robot.map(str::to_owned), endpoint: place, token_file: None })
    }

    /// Daemon at a unix socket.
    #[must_use]
    pub const fn from_socket(path: PathBuf) -> Self {
        Self { robot: None, endpoint: Endpoint::Socket(path), token_file: None }
    }

    /// Address for display.
    #[must_use]
    pub fn address(&self) -> String {
        match &self.endpoint {
            Endpoint::Socket(path) => path.display().to_string(),
            Endpoint::Address(address) => address.clone(),
        }
    }

    /// URL of the live page, if the daemon is reached over TCP.
    #[must_use]
    pub fn page_url(&self) -> Option<String> {
        match &self.endpoint {
            Endpoint::Socket(_) => None,
            Endpoint::Address(address) => Some(format!("http://{address}/")),
        }
    }
}

fn read_endpoint(text: &str) -> Option<Endpoint> {
    if text.starts_with('/') {
        return Some(Endpoint::Socket(text.into()));
    }
    let address = text.strip_prefix("http://").unwrap_or(text);
    let address = address.strip_suffix('/').unwrap_or(address);
    let (host, port) = address.rsplit_once(':')?;
    let is_host = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.:[]".contains(&byte);
    let is_good = !host.is_empty() && host.bytes().all(is_host) && port.parse::<u16>().is_ok();
    is_good.then(|| Endpoint::Address(address.to_owned()))
}

/// Returns the daemons of a configuration, including those of its `fleet.file`.
///
/// # Errors
/// Invalid address, unreadable file, or too many daemons.
pub fn members_from_keys(keys: &FleetKeys) -> Result<Vec<Member>, MemberError> {
    let mut members = Vec::new();
    for text in &keys.daemons {
        let member = Member::parse(text)?;
        let token_file = match member.endpoint {
            Endpoint::Address(_) => keys.token_file.as_ref().map(PathBuf::from),
            Endpoint::Socket(_) => None,
        };
        members.push(Member { token_file, ..member });
    }
    if let Some(file) = &keys.file {
        members.extend(read_members(Path::new(file))?);
    }
    check_members(members)
}

/// Structure of a file with a list of daemons.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MemberFile {
    daemon: Vec<MemberEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MemberEntry {
    #[serde(default)]
    robot: Option<String>,
    #[serde(default)]
    address: Option<String>,
    #[serde(default)]
    socket: Option<String>,
    #[serde(default)]
    token_file: Option<PathBuf>,
}

/// Reads daemons from a file: a list of `[[daemon]]`, or a configuration with `[fleet]`.
///
/// # Errors
/// Unreadable or invalid file, or one with no or too many daemons.
pub fn read_members(path: &Path) -> Result<Vec<Member>, MemberError> {
    let name = path.display();
    let invalid = |message: String| MemberError {
        message: format!("{name}: {message}"),
        help: "expected one [[daemon]] each, with address = \"HOST:PORT\" or socket = \"PATH\", \
               optionally robot and token_file; or a configuration with [fleet]"
            .into(),
    };
    let text = std::fs::read_to_string(path).map_err(|error| invalid(error.to_string()))?;
    let table: toml::Table =
        toml::from_str(&text).map_err(|error| invalid(at_line(&text, &error)))?;
    if table.contains_key("fleet") && !table.contains_key("daemon") {
        let layers = ConfigLayers::<Keys>::new().with_file(&name.to_string(), &text);
        let keys =
            layers.and_then(ConfigLayers::into_keys).map_err(|error| invalid(error.to_string()))?;
        // `fleet.file` is ignored here: a file that names itself would recurse for ever.
        let members = members_from_keys(&FleetKeys { file: None, ..keys.fleet })?;
        return if members.is_empty() {
            Err(invalid("fleet.daemons is empty".into()))
        } else {
            Ok(members)
        };
    }
    let file: MemberFile =
        toml::from_str(&text).map_err(|error| invalid(at_line(&text, &error)))?;
    let members = file.daemon.into_iter().map(|entry| convert_entry(entry, path));
    let members: Vec<_> = members.collect::<Result<_, _>>().map_err(|error: MemberError| {
        MemberError { message: format!("{name}: {}", error.message), ..error }
    })?;
    if members.is_empty() {
        return Err(invalid("no daemon in the list".into()));
    }
    check_members(members)
}

/// Converts an entry of the file. A relative path of a token file is relative to the list.
fn convert_entry(entry: MemberEntry, list: &Path) -> Result<Member, MemberError> {
    let place = match (entry.address, entry.socket) {
        (Some(address), None) if !address.starts_with('/') => address,
        (None, Some(socket)) if socket.starts_with('/') => socket,
        _ => {
            return Err(MemberError {
                message: "a [[daemon]] needs exactly one address".into(),
                help: "address = \"HOST:PORT\", or socket = \"/PATH\"".into(),
            });
        }
    };
    let name = entry.robot.map(|robot| format!("{robot}=")).unwrap_or_default();
    let token_file = entry.token_file.map(|file| list.with_file_name(file));
    Ok(Member { token_file, ..Member::parse(&format!("{name}{place}"))? })
}

fn at_line(text: &str, error: &toml::de::Error) -> String {
    let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
    format!("line {}: {}", before.matches('\n').count() + 1, error.message())
}

/// Checks the number of daemons and that their addresses and names are unique.
///
/// # Errors
/// Too many daemons, or duplicates.
pub fn check_members(members: Vec<Member>) -> Result<Vec<Member>, MemberError> {
    if members.len() > MAX_MEMBERS {
        return Err(MemberError {
            message: format!("{} daemons", members.len()),
            help: format!("the maximum is {MAX_MEMBERS}"),
        });
    }
    for (i, member) in members.iter().enumerate() {
        if members.iter().take(i).any(|before| before.endpoint == member.endpoint) {
            return Err(MemberError {
                message: format!("{} is listed twice", member.address()),
                help: "list each daemon once".into(),
            });
        }
        let is_taken = |before: &Member| before.robot.is_some() && before.robot == member.robot;
        if members.iter().take(i).any(is_taken) {
            return Err(MemberError {
                message: format!("two daemons of robot {}", member.robot.as_deref().unwrap_or("")),
                help: "give each robot a unique name (fleet.robot)".into(),
            });
        }
    }
    Ok(members)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn parses_name_and_address() {
        let parsed = |text: &str| Member::parse(text).expect(text);
        let kiwi = parsed("kiwi=http://10.0.0.7:8765/");
        assert_eq!(kiwi.robot.as_deref(), Some("kiwi"));
        assert_eq!(kiwi.endpoint, Endpoint::Address("10.0.0.7:8765".into()));
        assert_eq!(kiwi.page_url().as_deref(), Some("http://10.0.0.7:8765/"));
        assert_eq!(parsed("[::1]:80").endpoint, Endpoint::Address("[::1]:80".into()));
        assert_eq!(parsed("/run/a=b.sock"), Member::from_socket("/run/a=b.sock".into()));
        for bad in ["", "kiwi", "kiwi=", "a b=h:1", "h:port", "h:99999", "https://h:1", "h:1/x"] {
            assert!(Member::parse(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn reads_list_or_configuration() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("fleet.toml");
        let read = |text: &str| {
            fs::write(&file, text).expect("there is room");
            read_members(&file)
        };
        let members = read(
            "[[daemon]]\nrobot = \"kiwi\"\naddress = \"h:1\"\ntoken_file = \"kiwi.token\"\n\
             [[daemon]]\nsocket = \"/run/s\"\n",
        );
        let members = members.expect("valid");
        assert_eq!(members[0].token_file.as_deref(), Some(&*folder.path().join("kiwi.token")));
        assert_eq!(members[1].endpoint, Endpoint::Socket("/run/s".into()));
        let members = read("[fleet]\ndaemons = [\"a=h:1\", \"/s\"]\ntoken_file = \"/t\"\n");
        let members = members.expect("valid");
        assert_eq!(members[0].token_file.as_deref(), Some(Path::new("/t")));
        assert_eq!(members[1].token_file, None, "a socket needs none");
        for (text, part) in [
            ("[[daemon]]\naddress = 3\n", "line 2"),
            ("[[daemon]]\nport = \"h:1\"\n", "line 2"),
            ("[[daemon]]\nrobot = \"a\"\n", "exactly one address"),
            ("daemon = []\n", "no daemon"),
            ("[fleet]\n", "is empty"),
            ("[[daemon]]\naddress = \"h:1\"\n[[daemon]]\naddress = \"h:1\"\n", "twice"),
            (
                "[[daemon]]\nrobot = \"a\"\naddress = \"h:1\"\n\
                 [[daemon]]\nrobot = \"a\"\naddress = \"h:2\"\n",
                "two daemons of robot a",
            ),
            ("{", "line 1"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.message.contains(part), "{text}: {error}");
        }
        let many: String = (0..33).map(|i| format!("[[daemon]]\naddress = \"h:{i}\"\n")).collect();
        assert!(read(&many).expect_err("too many").help.contains("32"));
    }
}
