//! Client of the daemon's HTTP API, over its unix socket or TCP.

mod live;
mod scans;

use std::{io, path::PathBuf, time::Duration};

use http_body_util::{BodyExt as _, Full};
use hyper::{
    Request, Response, StatusCode,
    body::{Bytes, Incoming},
    client::conn::http1,
    header,
    http::request::Builder,
};
use hyper_util::rt::TokioIo;
use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;
use tokio::{
    net::{TcpStream, UnixStream},
    time::timeout,
};

pub use live::{IDLE_TIMEOUT, LiveLines};
pub use scans::{RequestedScans, ScansError};

use crate::api::{Accepted, Problem};

/// Timeout for the head of a response, and for each further frame of its body.
const RESPONSE_TIMEOUT: Duration = Duration::from_secs(10);

/// Maximum size of an error response, bytes.
const MAX_ERROR_BYTES: usize = 64 * 1024;

/// Address of a daemon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Endpoint {
    /// Path of a unix socket.
    Socket(PathBuf),
    /// TCP address, `HOST:PORT`.
    Address(String),
}

/// Client of one daemon. Each request opens a connection of its own.
#[derive(Clone)]
pub struct Client {
    place: Endpoint,
    token: Option<String>,
}

/// Failed request to a daemon.
#[derive(Debug, Error)]
pub enum ClientError {
    /// No connection could be established.
    #[error("no daemon responds at {place}: {source}")]
    NoDaemon {
        /// Address of the daemon.
        place: String,
        /// System error of the connection attempt.
        source: io::Error,
    },
    /// No response within the timeout.
    #[error("the daemon did not respond within {} s", RESPONSE_TIMEOUT.as_secs())]
    Timeout,
    /// No data on a live stream, not even its keep-alive lines.
    #[error(
        "no data from the daemon for {} s: it hangs, or the connection is lost",
        IDLE_TIMEOUT.as_secs()
    )]
    IdleTimeout,
    /// Connection that ended without a complete response.
    #[error("the daemon closed the connection: {0}")]
    Closed(hyper::Error),
    /// Response that is not HTTP.
    #[error("invalid response from the daemon: {0}")]
    NotHttp(hyper::Error),
    /// Response body that is not the expected JSON.
    #[error("invalid response from the daemon: {0}")]
    InvalidResponse(#[from] serde_json::Error),
    /// Response body over the size limit, bytes.
    #[error("the daemon's response is longer than {0} bytes")]
    TooLong(usize),
    /// Error response of the daemon.
    #[error("the daemon rejected the request ({status}): {error}")]
    Rejected {
        /// HTTP status of the response.
        status: StatusCode,
        /// Error message of the daemon.
        error: String,
        /// Advice on how to correct the request.
        help: String,
    },
}

impl From<hyper::Error> for ClientError {
    fn from(error: hyper::Error) -> Self {
        if error.is_parse() { Self::NotHttp(error) } else { Self::Closed(error) }
    }
}

impl ClientError {
    /// Returns `true` if a repetition of the request would be rejected, too.
    #[must_use]
    pub fn is_final(&self) -> bool {
        let passing = [StatusCode::REQUEST_TIMEOUT, StatusCode::TOO_MANY_REQUESTS];
        matches!(self, Self::Rejected { status, .. } if status.is_client_error() && !passing.contains(status))
    }

    /// Returns advice on how to resolve the error.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NoDaemon { .. } => "start it with `sonard run` or `systemctl start sonard`; \
                 --socket or --address select it; only the socket's group may use it"
                .into(),
            Self::Timeout | Self::IdleTimeout => {
                "check the log messages of the daemon (`journalctl -u sonard`)".into()
            }
            Self::Closed(_) => "it is stopping, or has too many clients: try again; \
                 `journalctl -u sonard` shows its messages"
                .into(),
            Self::NotHttp(_) | Self::InvalidResponse(_) | Self::TooLong(_) => {
                "check that it is a sonard daemon of this version".into()
            }
            Self::Rejected { help, .. } => help.clone(),
        }
    }
}

impl Client {
    /// Creates a client. Over TCP, writes need the daemon's token; from another computer reads need
    /// it, too.
    #[must_use]
    pub const fn new(place: Endpoint, token: Option<String>) -> Self {
        Self { place, token }
    }

    /// Requests a path. The body of the response can be read as it arrives.
    ///
    /// # Errors
    /// No response, or a response without success.
    pub async fn get(&self, path: &str) -> Result<Response<Incoming>, ClientError> {
        self.send(Request::get(path), Bytes::new()).await
    }

    /// Requests a path and deserializes the whole JSON response.
    ///
    /// # Errors
    /// As [`Self::get`], or a response that is not the expected JSON.
    pub async fn get_json<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        self.get_json_within(path, usize::MAX).await
    }

    /// Requests a path and deserializes a JSON response of at most `max_bytes`; reading stops
    /// there.
    ///
    /// # Errors
    /// As [`Self::get_json`], or a longer response.
    pub async fn get_json_within<T: DeserializeOwned>(
        &self,
        path: &str,
        max_bytes: usize,
    ) -> Result<T, ClientError> {
        let body = self.get(path).await?.into_body();
        Ok(serde_json::from_slice(&read_body(body, max_bytes).await?)?)
    }

    /// Sends a JSON body by POST and deserializes the response.
    ///
    /// # Errors
    /// As [`Self::get_json`].
    pub async fn post<T: DeserializeOwned>(
        &self,
        path: &str,
        body: &impl Serialize,
    ) -> Result<T, ClientError> {
        self.send_json(Request::post(path), body).await
    }

    /// Sends a JSON body by PUT.
    ///
    /// # Errors
    /// As [`Self::get`].
    pub async fn put(&self, path: &str, body: &impl Serialize) -> Result<(), ClientError> {
        self.send_json::<Accepted>(Request::put(path), body).await.map(drop)
    }

    /// Sends a DELETE request.
    ///
    /// # Errors
    /// As [`Self::get`].
    pub async fn delete(&self, path: &str) -> Result<(), ClientError> {
        self.send(Request::delete(path), Bytes::new()).await.map(drop)
    }

    async fn send_json<T: DeserializeOwned>(
        &self,
        request: Builder,
        body: &impl Serialize,
    ) -> Result<T, ClientError> {
        let request = request.header(header::CONTENT_TYPE, "application/json");
        let response = self.send(request, serde_json::to_vec(body)?.into()).await?;
        Ok(serde_json::from_slice(&read_body(response.into_body(), usize::MAX).await?)?)
    }

    async fn send(&self, request: Builder, body: Bytes) -> Result<Response<Incoming>, ClientError> {
        let request = match &self.token {
            Some(token) => request.header(header::AUTHORIZATION, format!("Bearer {token}")),
            None => request,
        };
        let head = timeout(RESPONSE_TIMEOUT, connect_and_send(&self.place, request, body));
        let response = head.await.map_err(|_| ClientError::Timeout)??;
        let status = response.status();
        // An unhealthy daemon reports its health with status 503; the body is the expected one.
        if status.is_success() || status == StatusCode::SERVICE_UNAVAILABLE {
            return Ok(response);
        }
        let body = read_body(response.into_body(), MAX_ERROR_BYTES).await?;
        let Problem { error, help, .. } =
            serde_json::from_slice(&body).unwrap_or_else(|_| Problem {
                error: String::from_utf8_lossy(&body).into_owned(),
                help: "check that it is a sonard daemon of this version".into(),
                ..Problem::default()
            });
        Err(ClientError::Rejected { status, error, help })
    }
}

/// Reads a body of at most `max_bytes`, with a timeout for each frame.
async fn read_body(mut body: Incoming, max_bytes: usize) -> Result<Vec<u8>, ClientError> {
    let mut bytes = Vec::new();
    while let Some(frame) =
        timeout(RESPONSE_TIMEOUT, body.frame()).await.map_err(|_| ClientError::Timeout)?
    {
        let frame = frame?;
        bytes.extend_from_slice(frame.data_ref().map_or(&[][..], |data| data));
        if bytes.len() > max_bytes {
            return Err(ClientError::TooLong(max_bytes));
        }
    }
    Ok(bytes)
}

async fn connect_and_send(
    place: &Endpoint,
    request: Builder,
    body: Bytes,
) -> Result<Response<Incoming>, ClientError> {
    match place {
        Endpoint::Socket(socket) => {
            let stream = UnixStream::connect(socket).await;
            let stream = stream.map_err(|source| no_daemon(&socket.display(), source))?;
            send_on(stream, "localhost", request, body).await
        }
        Endpoint::Address(address) => {
            let stream = TcpStream::connect(address).await;
            let stream = stream.map_err(|source| no_daemon(address, source))?;
            send_on(stream, address, request, body).await
        }
    }
}

async fn send_on<S>(
    stream: S,
    host: &str,
    request: Builder,
    body: Bytes,
) -> Result<Response<Incoming>, ClientError>
where
    S: tokio::io::AsyncRead + tokio::io::AsyncWrite + Send + Unpin + 'static,
{
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await?;
    // The end of the connection ends the body, too.
    #[allow(clippy::disallowed_methods, reason = "its end ends the requests on it")]
    tokio::spawn(async move { drop(connection.await) });
    let request = request.header(header::HOST, host).body(Full::new(body));
    let request = request.map_err(|error| no_daemon(&host, io::Error::other(error)))?;
    Ok(sender.send_request(request).await?)
}

fn no_daemon(place: &impl std::fmt::Display, source: io::Error) -> ClientError {
    ClientError::NoDaemon { place: place.to_string(), source }
}
