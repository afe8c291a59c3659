//! Who may ask for what. Pure: it sees the headers and says yes or no.
//!
//! On the unix socket the file's permissions decide. Over TCP any program on the computer, and
//! any page in a browser on it, could knock: a page gives itself away by `Host` (a name made to
//! point here), `Origin` or `Sec-Fetch-Site`, and writing needs a token that no page knows.

use std::net::IpAddr;

use axum::{
    extract::Query,
    http::{
        HeaderMap, Method, StatusCode, Uri,
        header::{AUTHORIZATION, HOST, ORIGIN},
    },
};
use serde::Deserialize;
use sha2::{Digest as _, Sha256};

use super::routes::{FOXGLOVE, is_public};

/// The way in which a client connected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// By the unix socket.
    Unix,
    /// By TCP on a loopback address.
    Loopback,
    /// By TCP on another address.
    Network,
}

/// On what ground a request is let in. Each has requests a second of its own, so that none takes
/// them from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// It came by the unix socket, whose permissions say who may.
    Socket,
    /// It shows the token.
    Token,
    /// It only reads, from this computer, or asks for what everybody may see.
    Guest,
}

/// The reason why a request is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refused {
    /// Status of the answer.
    pub status: StatusCode,
    /// What is wrong.
    pub message: String,
    /// What would be right.
    pub help: &'static str,
}

/// The rules.
#[derive(Debug, Clone, Default)]
pub struct Access {
    hosts: Vec<String>,
    /// Origins of pages that may ask for live messages for viewers.
    viewers: Vec<String>,
    token: Option<[u8; 32]>,
}

impl Access {
    /// Rules that accept these host names besides those of loopback, and this token.
    #[must_use]
    pub fn new(hosts: &[String], token: Option<&str>) -> Self {
        Self {
            hosts: hosts.iter().map(|host| host.to_ascii_lowercase()).collect(),
            viewers: Vec::new(),
            token: token.map(|token| digest(token.trim())),
        }
    }

    /// Accepts the address that the server listens on as a host, too.
    #[must_use]
    pub fn with_address(mut self, address: IpAddr) -> Self {
        if !address.is_unspecified() {
            self.hosts.push(match address {
                IpAddr::V4(address) => address.to_string(),
                IpAddr::V6(address) => format!("[{address}]"),
            });
        }
        self
    }

    /// Lets pages of these origins, as browsers name them, ask for live messages, which need a page from elsewhere.
    #[must_use]
    pub fn with_viewers(mut self, origins: &[String]) -> Self {
        self.viewers.extend(origins.iter().map(|origin| origin.to_ascii_lowercase()));
        self
    }

    /// On what ground a request may go on.
    ///
    /// # Errors
    /// Why not.
    pub fn check(
        &self,
        peer: Peer,
        method: &Method,
        uri: &Uri,
        headers: &HeaderMap,
    ) -> Result<Standing, Refused> {
        self.check_origin(uri, headers)?;
        if peer == Peer::Unix {
            return Ok(Standing::Socket);
        }
        self.check_host(uri, headers)?;
        if self.shows_token(uri, headers) {
            return Ok(Standing::Token);
        }
        let reads = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS);
        // A browser can't show a token before the page is there that asks for it.
        if reads && (peer == Peer::Loopback || is_public(uri.path())) {
            return Ok(Standing::Guest);
        }
        Err(self.lacks_token())
    }

    fn check_origin(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Refused> {
        let Some(origin) = headers.get(ORIGIN) else { return check_site(uri, headers) };
        let host = origin
            .to_str()
            .ok()
            .and_then(|origin| origin.strip_prefix("http://").or(origin.strip_prefix("https://")));
        if host.is_some_and(|host| self.knows(host)) {
            return Ok(());
        }
        let is_for_viewers = uri.path() == FOXGLOVE;
        if is_for_viewers && self.viewers.iter().any(|viewer| origin == viewer.as_str()) {
            return Ok(());
        }
        Err(Refused {
            status: StatusCode::FORBIDDEN,
            message: format!("pages of {origin:?} may not ask here"),
            help: match is_for_viewers {
                true => "name the origin in foxglove.origins",
                false => "open the page from this server itself, or name its host in server.hosts",
            },
        })
    }

    fn check_host(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), Refused> {
        let mut hosts = headers.get_all(HOST).iter();
        let (first, second) = (hosts.next(), hosts.next());
        let named = first.and_then(|host| host.to_str().ok()).filter(|_| second.is_none());
        let in_uri = uri.authority().is_none_or(|authority| self.knows(authority.as_str()));
        if named.is_some_and(|host| self.knows(host)) && in_uri {
            return Ok(());
        }
        Err(Refused {
            status: StatusCode::FORBIDDEN,
            message: format!("there is no {} here", named.unwrap_or("host of that name")),
            help: "ask for localhost, or name the host in server.hosts",
        })
    }

    fn shows_token(&self, uri: &Uri, headers: &HeaderMap) -> bool {
        let in_header = headers
            .get(AUTHORIZATION)
            .and_then(|value| value.to_str().ok())
            .and_then(|value| value.split_once(' '))
            .filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"))
            .map(|(_, shown)| shown.to_owned());
        let shown = in_header.or_else(|| token_in_query(uri));
        // Digests are compared, so that the time says nothing about the token.
        shown.is_some_and(|shown| self.token == Some(digest(shown.trim())))
    }

    fn lacks_token(&self) -> Refused {
        if self.token.is_none() {
            return Refused {
                status: StatusCode::FORBIDDEN,
                message: "nothing may be changed over TCP: there is no token".into(),
                help: "use the unix socket, or set server.token_file",
            };
        }
        Refused {
            status: StatusCode::UNAUTHORIZED,
            message: "the token is missing or wrong".into(),
            help: "send `Authorization: Bearer TOKEN` with what is in server.token_file",
        }
    }

    /// Whether a host, with or without a port, is one of this server's names.
    fn knows(&self, host: &str) -> bool {
        let name = match host.rsplit_once(':') {
            // The colons of an IPv6 address stand in brackets.
            Some((name, port)) if port.chars().all(|digit| digit.is_ascii_digit()) => name,
            _ => host,
        };
        let name = name.to_ascii_lowercase();
        ["localhost", "127.0.0.1", "[::1]"].contains(&name.as_str()) || self.hosts.contains(&name)
    }
}

/// A browser can't send a header with the request for a WebSocket: for those the token may stand in the query.
fn token_in_query(uri: &Uri) -> Option<String> {
    #[derive(Deserialize)]
    struct Shown {
        token: String,
    }
    let shown = (uri.path() == FOXGLOVE).then(|| Query::<Shown>::try_from_uri(uri))?;
    shown.ok().map(|Query(shown)| shown.token)
}

/// Images and scripts of a page are asked for without `Origin`, but browsers say that they belong to
/// a page from elsewhere. A link to the live page may be followed from anywhere.
fn check_site(uri: &Uri, headers: &HeaderMap) -> Result<(), Refused> {
    let says = |name: &str, word: &str| headers.get(name).is_some_and(|value| value == word);
    let follows_link = says("sec-fetch-mode", "navigate") && is_public(uri.path());
    if !says("sec-fetch-site", "cross-site") || follows_link {
        return Ok(());
    }
    Err(Refused {
        status: StatusCode::FORBIDDEN,
        message: "pages from elsewhere may not ask here".into(),
        help: "open the page from this server itself",
    })
}

fn digest(token: &str) -> [u8; 32] {
    Sha256::digest(token.as_bytes()).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn ask(
        access: &Access,
        peer: Peer,
        method: &Method,
        headers: &[(&'static str, &str)],
    ) -> Result<(), u16> {
        ask_for("/v1/status", access, peer, method, headers)
    }

    fn ask_for(
        path: &str,
        access: &Access,
        peer: Peer,
        method: &Method,
        headers: &[(&'static str, &str)],
    ) -> Result<(), u16> {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(*name, HeaderValue::from_str(value).expect("a header"));
        }
        let uri = path.parse().expect("a path");
        access.check(peer, method, &uri, &map).map(drop).map_err(|refused| refused.status.as_u16())
    }

    #[test]
    fn each_request_stands_on_its_own_ground() {
        let access = Access::new(&[], Some("secret"));
        let ask = |peer, token: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(HOST, HeaderValue::from_static("localhost"));
            headers.insert(AUTHORIZATION, HeaderValue::from_str(token).expect("a header"));
            access.check(peer, &Method::GET, &Uri::from_static("/v1/status"), &headers)
        };
        assert_eq!(ask(Peer::Unix, "Bearer secret"), Ok(Standing::Socket));
        assert_eq!(ask(Peer::Loopback, "bEARER  secret"), Ok(Standing::Token));
        assert_eq!(ask(Peer::Network, "bearer secret"), Ok(Standing::Token));
        assert_eq!(ask(Peer::Loopback, "Bearer wrong"), Ok(Standing::Guest));
        assert_eq!(ask(Peer::Loopback, "Basic secret"), Ok(Standing::Guest));
    }

    #[test]
    fn images_of_foreign_pages_are_refused_and_links_to_the_page_followed() {
        let (access, host) = (Access::default(), ("host", "localhost:8765"));
        let foreign = ("sec-fetch-site", "cross-site");
        let navigates = ("sec-fetch-mode", "navigate");
        for (path, headers, expected) in [
            ("/v1/status", vec![host, foreign, ("sec-fetch-mode", "no-cors")], Err(403)),
            ("/v1/status", vec![host, foreign, navigates], Err(403)),
            ("/page/main.js", vec![host, foreign, ("sec-fetch-mode", "no-cors")], Err(403)),
            ("/", vec![host, foreign, navigates], Ok(())),
            ("/v1/status", vec![host, ("sec-fetch-site", "same-origin")], Ok(())),
            ("/v1/status", vec![host, ("sec-fetch-site", "none"), navigates], Ok(())),
        ] {
            let answer = ask_for(path, &access, Peer::Loopback, &Method::GET, &headers);
            assert_eq!(answer, expected, "{path} {headers:?}");
        }
    }

    #[test]
    fn foreign_hosts_and_origins_are_refused_and_writing_needs_the_token() {
        let access = Access::new(&["robot.local".into()], Some("secret\n"));
        let (get, put) = (Method::GET, Method::PUT);
        let host = ("host", "localhost:8765");
        let token = ("authorization", "Bearer secret");
        for (method, headers, expected) in [
            (&get, vec![host], Ok(())),
            (&get, vec![("host", "[::1]:8765")], Ok(())),
            (&get, vec![("host", "ROBOT.local")], Ok(())),
            (&get, vec![("host", "evil.example")], Err(403)),
            (&get, vec![("host", "localhost.evil.example:8765")], Err(403)),
            (&get, vec![("host", "evil.example:8765:localhost")], Err(403)),
            (&get, vec![], Err(403)),
            (&get, vec![host, ("host", "evil.example")], Err(403)),
            (&get, vec![host, ("origin", "http://localhost:8765")], Ok(())),
            (&get, vec![host, ("origin", "https://evil.example")], Err(403)),
            (&get, vec![host, ("origin", "null")], Err(403)),
            (&get, vec![host, ("origin", "http://localhost.evil.example")], Err(403)),
            (&put, vec![host], Err(401)),
            (&put, vec![host, ("authorization", "Bearer wrong")], Err(401)),
            (&put, vec![host, ("authorization", "secret")], Err(401)),
            (&put, vec![host, token], Ok(())),
            (&put, vec![host, ("authorization", "bearer secret")], Ok(())),
            (&put, vec![host, token, ("origin", "http://evil.example")], Err(403)),
        ] {
            assert_eq!(ask(&access, Peer::Loopback, method, &headers), expected, "{headers:?}");
        }
    }

    #[test]
    fn from_the_network_even_reading_needs_the_token() {
        let access = Access::new(&[], Some("secret"))
            .with_address("192.168.1.5".parse().expect("an address"));
        let host = ("host", "192.168.1.5:8765");
        assert_eq!(ask(&access, Peer::Network, &Method::GET, &[host]), Err(401));
        let token = ("authorization", "Bearer secret");
        assert_eq!(ask(&access, Peer::Network, &Method::GET, &[host, token]), Ok(()));
        // The page itself, which asks for the token, holds nothing to hide.
        for (path, headers, expected) in [
            ("/", &[host][..], Ok(())),
            ("/page/main.js", &[host], Ok(())),
            ("/fleet", &[host], Ok(())),
            ("/fleet", &[("host", "evil.example")], Err(403)),
            ("/v1/fleet", &[host], Err(401)),
            ("/", &[("host", "evil.example")], Err(403)),
            ("/pages", &[host], Err(401)),
            ("/v1/scans", &[host], Err(401)),
        ] {
            let answer = ask_for(path, &access, Peer::Network, &Method::GET, headers);
            assert_eq!(answer, expected, "{path}");
        }
        assert_eq!(ask_for("/", &access, Peer::Network, &Method::POST, &[host]), Err(401));
    }

    #[test]
    fn viewers_may_come_from_elsewhere_and_show_the_token_in_the_query_but_on_their_route_alone() {
        let viewer = "https://app.foxglove.dev";
        let access = Access::new(&[], Some("se+cret"))
            .with_viewers(&[viewer.to_owned()])
            .with_address("192.168.1.5".parse().expect("an address"));
        let host = ("host", "192.168.1.5:8765");
        let (from, elsewhere) = (("origin", viewer), ("origin", "https://evil.example"));
        let site = ("sec-fetch-site", "cross-site");
        for (path, headers, expected) in [
            ("/foxglove/?token=se%2Bcret", &[host][..], Ok(())),
            ("/foxglove/?token=se%2Bcret", &[host, from, site], Ok(())),
            ("/foxglove/?a=b&token=se%2Bcret", &[host], Ok(())),
            ("/foxglove/?token=se%2Bcret", &[host, elsewhere], Err(403)),
            ("/foxglove/?token=wrong", &[host], Err(401)),
            ("/foxglove/?token=wrong&token=se%2Bcret", &[host], Err(401)),
            ("/foxglove/?token=", &[host, from], Err(401)),
            ("/foxglove/", &[host, from], Err(401)),
            ("/foxglove?token=se%2Bcret", &[host], Err(401)),
            ("/v1/status?token=se%2Bcret", &[host], Err(401)),
            ("/v1/status?token=se%2Bcret", &[host, from], Err(403)),
        ] {
            let answer = ask_for(path, &access, Peer::Network, &Method::GET, headers);
            assert_eq!(answer, expected, "{path} {headers:?}");
        }
        let unset = Access::default();
        let refused = ask_for(
            "/foxglove/",
            &unset,
            Peer::Loopback,
            &Method::GET,
            &[("host", "localhost"), from],
        );
        assert_eq!(refused, Err(403));
    }

    #[test]
    fn without_a_token_nothing_is_written_over_tcp_and_anything_over_the_socket() {
        let access = Access::default();
        let headers = [("host", "localhost")];
        assert_eq!(ask(&access, Peer::Loopback, &Method::POST, &headers), Err(403));
        assert_eq!(ask(&access, Peer::Unix, &Method::POST, &headers), Ok(()));
        assert_eq!(ask(&access, Peer::Unix, &Method::POST, &[]), Ok(()));
        let foreign = [("origin", "http://evil.example")];
        assert_eq!(ask(&access, Peer::Unix, &Method::GET, &foreign), Err(403));
    }
}
