//! Access control of requests by connection, method, path and headers. Pure.
//!
//! On the unix socket the permissions of its file decide. A TCP port is reachable for any program
//! on the computer and for any web page in a browser on it. Requests of foreign pages are
//! recognized by `Host` (DNS rebinding), `Origin` or `Sec-Fetch-Site`, and writes need a token that
//! no page has.

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
use sonard_api::WriteAccess;

use super::routes::{FOXGLOVE, is_public};

/// Kind of connection of a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
    /// Connection over the unix socket.
    Unix,
    /// Connection over TCP to a loopback address.
    Loopback,
    /// Connection over TCP to any other address.
    Network,
}

/// Authorization of an accepted request. Each kind has a request rate limit of its own, so that
/// none can exhaust another's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Principal {
    /// Client of the unix socket, authorized by the permissions of its file.
    Socket,
    /// Client with a valid token.
    Token,
    /// Client without a token: reads from this computer, or public paths.
    Guest,
}

/// Rejection of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessDenied {
    /// HTTP status of the response.
    pub status: StatusCode,
    /// Error message.
    pub message: String,
    /// Advice on how to correct the request.
    pub help: &'static str,
}

/// Access rules of the server.
#[derive(Debug, Clone, Default)]
pub struct Access {
    hosts: Vec<String>,
    /// Web origins that may open the viewer WebSocket.
    viewers: Vec<String>,
    token: Option<[u8; 32]>,
}

impl Access {
    /// Creates rules that accept `hosts` in addition to the loopback names, and `token`.
    #[must_use]
    pub fn new(hosts: &[String], token: Option<&str>) -> Self {
        Self {
            hosts: hosts.iter().map(|host| host.to_ascii_lowercase()).collect(),
            viewers: Vec::new(),
            token: token.map(|token| digest(token.trim())),
        }
    }

    /// Adds the address that the server listens on to the accepted hosts.
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

    /// Adds web origins, as sent by browsers, whose pages may open the viewer WebSocket. Web
    /// viewers are pages of other sites.
    #[must_use]
    pub fn with_viewers(mut self, origins: &[String]) -> Self {
        self.viewers.extend(origins.iter().map(|origin| origin.to_ascii_lowercase()));
        self
    }

    /// Authorizes a request.
    ///
    /// # Errors
    /// Status and reason of the rejection.
    pub fn check(
        &self,
        peer: Peer,
        method: &Method,
        uri: &Uri,
        headers: &HeaderMap,
    ) -> Result<Principal, AccessDenied> {
        self.check_origin(uri, headers)?;
        if peer == Peer::Unix {
            return Ok(Principal::Socket);
        }
        self.check_host(uri, headers)?;
        if self.has_token(uri, headers) {
            return Ok(Principal::Token);
        }
        let reads = matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS);
        // A browser has no token before it has loaded the page that prompts for it.
        if reads && (peer == Peer::Loopback || is_public(uri.path())) {
            return Ok(Principal::Guest);
        }
        Err(self.token_error())
    }

    /// Permission of a client to change settings.
    #[must_use]
    pub const fn write_access(&self, principal: Principal) -> WriteAccess {
        match principal {
            Principal::Socket | Principal::Token => WriteAccess::Yes,
            Principal::Guest if self.token.is_some() => WriteAccess::Token,
            Principal::Guest => WriteAccess::No,
        }
    }

    fn check_origin(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), AccessDenied> {
        let Some(origin) = headers.get(ORIGIN) else { return check_site(uri, headers) };
        let host = origin
            .to_str()
            .ok()
            .and_then(|origin| origin.strip_prefix("http://").or(origin.strip_prefix("https://")));
        if host.is_some_and(|host| self.is_own_host(host)) {
            return Ok(());
        }
        let is_for_viewers = uri.path() == FOXGLOVE;
        if is_for_viewers && self.viewers.iter().any(|viewer| origin == viewer.as_str()) {
            return Ok(());
        }
        Err(AccessDenied {
            status: StatusCode::FORBIDDEN,
            message: format!("origin {origin:?} is not allowed"),
            help: match is_for_viewers {
                true => "add the origin to foxglove.origins",
                false => "open the page from this server itself, or add its host to server.hosts",
            },
        })
    }

    fn check_host(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), AccessDenied> {
        let mut hosts = headers.get_all(HOST).iter();
        let (first, second) = (hosts.next(), hosts.next());
        let named = first.and_then(|host| host.to_str().ok()).filter(|_| second.is_none());
        let in_uri = uri.authority().is_none_or(|authority| self.is_own_host(authority.as_str()));
        if named.is_some_and(|host| self.is_own_host(host)) && in_uri {
            return Ok(());
        }
        Err(AccessDenied {
            status: StatusCode::FORBIDDEN,
            message: format!("host {} is not allowed", named.unwrap_or("(missing or invalid)")),
            help: "use localhost, or add the host to server.hosts",
        })
    }

    fn has_token(&self, uri: &Uri, headers: &HeaderMap) -> bool {
        let in_header = headers
            .get(AUTHORIZATION)
            .and_then(|value| value.to_str().ok())
            .and_then(|value| value.split_once(' '))
            .filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"))
            .map(|(_, token)| token.to_owned());
        let token = in_header.or_else(|| token_in_query(uri));
        // Comparing digests avoids a timing side channel.
        token.is_some_and(|token| self.token == Some(digest(token.trim())))
    }

    fn token_error(&self) -> AccessDenied {
        if self.token.is_none() {
            return AccessDenied {
                status: StatusCode::FORBIDDEN,
                message: "read only: no access token is configured (server.token_file)".into(),
                help: "use the unix socket, or set server.token_file",
            };
        }
        AccessDenied {
            status: StatusCode::UNAUTHORIZED,
            message: "the token is missing or wrong".into(),
            help: "send `Authorization: Bearer TOKEN` with the contents of server.token_file",
        }
    }

    /// Returns `true` if a host, with or without a port, is one of this server's names.
    fn is_own_host(&self, host: &str) -> bool {
        let name = match host.rsplit_once(':') {
            // The colons of an IPv6 address are within brackets.
            Some((name, port)) if port.chars().all(|digit| digit.is_ascii_digit()) => name,
            _ => host,
        };
        let name = name.to_ascii_lowercase();
        ["localhost", "127.0.0.1", "[::1]"].contains(&name.as_str()) || self.hosts.contains(&name)
    }
}

/// Returns the token from the query of a WebSocket request, for which browsers can't set headers.
fn token_in_query(uri: &Uri) -> Option<String> {
    #[derive(Deserialize)]
    struct TokenQuery {
        token: String,
    }
    let query = (uri.path() == FOXGLOVE).then(|| Query::<TokenQuery>::try_from_uri(uri))?;
    query.ok().map(|Query(query)| query.token)
}

/// Rejects cross-site requests for images and scripts, which browsers send without `Origin` but
/// mark by `Sec-Fetch-Site`. Links to the live page may be followed from any site.
fn check_site(uri: &Uri, headers: &HeaderMap) -> Result<(), AccessDenied> {
    let has = |name: &str, value: &str| headers.get(name).is_some_and(|found| found == value);
    let follows_link = has("sec-fetch-mode", "navigate") && is_public(uri.path());
    if !has("sec-fetch-site", "cross-site") || follows_link {
        return Ok(());
    }
    Err(AccessDenied {
        status: StatusCode::FORBIDDEN,
        message: "cross-site requests are not allowed".into(),
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

    fn check(
        access: &Access,
        peer: Peer,
        method: &Method,
        headers: &[(&'static str, &str)],
    ) -> Result<(), u16> {
        check_path("/v1/status", access, peer, method, headers)
    }

    fn check_path(
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
        access.check(peer, method, &uri, &map).map(drop).map_err(|denied| denied.status.as_u16())
    }

    #[test]
    fn principals() {
        let access = Access::new(&[], Some("secret"));
        let check = |peer, token: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(HOST, HeaderValue::from_static("localhost"));
            headers.insert(AUTHORIZATION, HeaderValue::from_str(token).expect("a header"));
            access.check(peer, &Method::GET, &Uri::from_static("/v1/status"), &headers)
        };
        assert_eq!(check(Peer::Unix, "Bearer secret"), Ok(Principal::Socket));
        assert_eq!(check(Peer::Loopback, "bEARER  secret"), Ok(Principal::Token));
        assert_eq!(check(Peer::Network, "bearer secret"), Ok(Principal::Token));
        assert_eq!(check(Peer::Loopback, "Bearer wrong"), Ok(Principal::Guest));
        assert_eq!(check(Peer::Loopback, "Basic secret"), Ok(Principal::Guest));
    }

    #[test]
    fn write_access_depends_on_the_token() {
        let (open, closed) = (Access::new(&[], Some("secret")), Access::default());
        for (access, principal, write) in [
            (&open, Principal::Socket, WriteAccess::Yes),
            (&open, Principal::Token, WriteAccess::Yes),
            (&open, Principal::Guest, WriteAccess::Token),
            (&closed, Principal::Socket, WriteAccess::Yes),
            (&closed, Principal::Guest, WriteAccess::No),
        ] {
            assert_eq!(access.write_access(principal), write, "{principal:?}");
        }
    }

    #[test]
    fn cross_site_requests() {
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
            let result = check_path(path, &access, Peer::Loopback, &Method::GET, &headers);
            assert_eq!(result, expected, "{path} {headers:?}");
        }
    }

    #[test]
    fn hosts_origins_and_tokens() {
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
            assert_eq!(check(&access, Peer::Loopback, method, &headers), expected, "{headers:?}");
        }
    }

    #[test]
    fn network_reads_need_the_token() {
        let access = Access::new(&[], Some("secret"))
            .with_address("192.168.1.5".parse().expect("an address"));
        let host = ("host", "192.168.1.5:8765");
        assert_eq!(check(&access, Peer::Network, &Method::GET, &[host]), Err(401));
        let token = ("authorization", "Bearer secret");
        assert_eq!(check(&access, Peer::Network, &Method::GET, &[host, token]), Ok(()));
        // The page itself, which prompts for the token, is public.
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
            let result = check_path(path, &access, Peer::Network, &Method::GET, headers);
            assert_eq!(result, expected, "{path}");
        }
        assert_eq!(check_path("/", &access, Peer::Network, &Method::POST, &[host]), Err(401));
    }

    #[test]
    fn viewer_origin_and_query_token() {
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
            let result = check_path(path, &access, Peer::Network, &Method::GET, headers);
            assert_eq!(result, expected, "{path} {headers:?}");
        }
        let unset = Access::default();
        let result = check_path(
            "/foxglove/",
            &unset,
            Peer::Loopback,
            &Method::GET,
            &[("host", "localhost"), from],
        );
        assert_eq!(result, Err(403));
    }

    #[test]
    fn no_token_configured() {
        let access = Access::default();
        let headers = [("host", "localhost")];
        assert_eq!(check(&access, Peer::Loopback, &Method::POST, &headers), Err(403));
        assert_eq!(check(&access, Peer::Unix, &Method::POST, &headers), Ok(()));
        assert_eq!(check(&access, Peer::Unix, &Method::POST, &[]), Ok(()));
        let foreign = [("origin", "http://evil.example")];
        assert_eq!(check(&access, Peer::Unix, &Method::GET, &foreign), Err(403));
    }
}
