//! A client of the daemon's API, over its unix socket or loopback TCP.

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
use serde_json::Value;
use thiserror::Error;
use tokio::{
    net::{TcpStream, UnixStream},
    time::timeout,
};

use crate::server::Problem;

/// How long a daemon may take for its answer to begin.
const PATIENCE: Duration = Duration::from_secs(10);

/// Where a daemon is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// At a unix socket.
    Socket(PathBuf),
    /// At a TCP address, `HOST:PORT`.
    Address(String),
}

/// Why a daemon did not answer as asked.
#[derive(Debug, Error)]
pub enum ClientError {
    /// Nobody is there.
    #[error("no daemon answers at {place}: {source}")]
    NoDaemon {
        /// Where.
        place: String,
        /// What the system says.
        source: io::Error,
    },
    /// It answers too slowly.
    #[error("the daemon did not answer within {} s", PATIENCE.as_secs())]
    TooSlow,
    /// It speaks something else, or broke off.
    #[error("the daemon's answer can't be read: {0}")]
    Http(#[from] hyper::Error),
    /// It refused.
    #[error("the daemon refused ({status}): {error}")]
    Refused {
        /// Status of the answer.
        status: StatusCode,
        /// What it says is wrong.
        error: String,
        /// What it says would be right.
        help: String,
    },
}

impl ClientError {
    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NoDaemon { .. } => "start it with `sonard run` or `systemctl start sonard`; \
                 --socket or --address say where it is; the socket's group may use it"
                .into(),
            Self::TooSlow => "look at its messages (`journalctl -u sonard`)".into(),
            Self::Http(_) => "make sure that it is a sonard of this version".into(),
            Self::Refused { help, .. } => help.clone(),
        }
    }
}

/// Asks for a path; the answer's body can be read as it comes.
///
/// # Errors
/// When nobody answers, or the answer is not of success.
pub async fn get(place: &Place, path: &str) -> Result<Response<Incoming>, ClientError> {
    ask(place, Request::get(path), Bytes::new()).await
}

/// The whole body of an answer.
///
/// # Errors
/// As [`get`].
pub async fn get_whole(place: &Place, path: &str) -> Result<Bytes, ClientError> {
    Ok(get(place, path).await?.into_body().collect().await?.to_bytes())
}

/// Gives an order with a JSON body, and returns the whole answer.
///
/// # Errors
/// As [`get`]; over TCP a daemon takes orders only with its token.
pub async fn post(place: &Place, path: &str, body: &Value) -> Result<Bytes, ClientError> {
    let request = Request::post(path).header(header::CONTENT_TYPE, "application/json");
    let answer = ask(place, request, body.to_string().into()).await?;
    Ok(answer.into_body().collect().await?.to_bytes())
}

async fn ask(
    place: &Place,
    request: Builder,
    body: Bytes,
) -> Result<Response<Incoming>, ClientError> {
    let begun = timeout(PATIENCE, begin(place, request, body));
    let response = begun.await.map_err(|_| ClientError::TooSlow)??;
    let status = response.status();
    // A daemon that is not well says so with a body that is wanted all the same.
    if status.is_success() || status == StatusCode::SERVICE_UNAVAILABLE {
        return Ok(response);
    }
    let body = response.into_body().collect().await?.to_bytes();
    let Problem { error, help } = serde_json::from_slice(&body).unwrap_or_else(|_| Problem {
        error: String::from_utf8_lossy(&body).into_owned(),
        help: "make sure that it is a sonard of this version".into(),
    });
    Err(ClientError::Refused { status, error, help })
}

async fn begin(
    place: &Place,
    request: Builder,
    body: Bytes,
) -> Result<Response<Incoming>, ClientError> {
    match place {
        Place::Socket(socket) => {
            let stream = UnixStream::connect(socket).await;
            let stream = stream.map_err(|source| no_daemon(&socket.display(), source))?;
            send(stream, "localhost", request, body).await
        }
        Place::Address(address) => {
            let stream = TcpStream::connect(address).await;
            let stream = stream.map_err(|source| no_daemon(address, source))?;
            send(stream, address, request, body).await
        }
    }
}

async fn send<S>(
    stream: S,
    host: &str,
    request: Builder,
    body: Bytes,
) -> Result<Response<Incoming>, ClientError>
where
    S: tokio::io::AsyncRead + tokio::io::AsyncWrite + Send + Unpin + 'static,
{
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await?;
    // Its end shows in the body.
    tokio::spawn(async move { drop(connection.await) });
    let request = request.header(header::HOST, host).body(Full::new(body));
    let request = request.map_err(|error| no_daemon(&host, io::Error::other(error)))?;
    Ok(sender.send_request(request).await?)
}

fn no_daemon(place: &impl std::fmt::Display, source: io::Error) -> ClientError {
    ClientError::NoDaemon { place: place.to_string(), source }
}
