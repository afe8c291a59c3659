//! A client of the daemon's API, over its unix socket or TCP.

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

pub use live::LiveLines;
pub use scans::{RequestedScans, ScansError};

use crate::api::{Accepted, Problem};

/// How long a daemon may take for its answer to begin, and for each further piece of it.
const PATIENCE: Duration = Duration::from_secs(10);

/// Longest refusal that is read, bytes.
const MOST_REFUSAL_BYTES: usize = 64 * 1024;

/// The address of a daemon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Endpoint {
    /// At a unix socket.
    Socket(PathBuf),
    /// At a TCP address, `HOST:PORT`.
    Address(String),
}

/// Asks one daemon.
#[derive(Clone)]
pub struct Client {
    place: Endpoint,
    token: Option<String>,
}

/// A request that a daemon did not answer as expected.
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
    /// A live stream lacks even signs of life.
    #[error(
        "the daemon has sent nothing for {} s: it hangs, or can't be reached any more",
        live::SILENCE.as_secs()
    )]
    Silent,
    /// It speaks something else, or broke off.
    #[error("the daemon's answer can't be read: {0}")]
    Http(#[from] hyper::Error),
    /// It answers something else than it should.
    #[error("the daemon's answer can't be read: {0}")]
    Strange(#[from] serde_json::Error),
    /// It answers more than was asked for.
    #[error("the daemon's answer is longer than {0} bytes")]
    TooLong(usize),
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
    /// Whether asking the same again would be refused again.
    #[must_use]
    pub fn is_final(&self) -> bool {
        let passing = [StatusCode::REQUEST_TIMEOUT, StatusCode::TOO_MANY_REQUESTS];
        matches!(self, Self::Refused { status, .. } if status.is_client_error() && !passing.contains(status))
    }

    /// What a person can do about it.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::NoDaemon { .. } => "start it with `sonard run` or `systemctl start sonard`; \
                 --socket or --address say where it is; the socket's group may use it"
                .into(),
            Self::TooSlow | Self::Silent => "look at its messages (`journalctl -u sonard`)".into(),
            Self::Http(_) | Self::Strange(_) | Self::TooLong(_) => {
                "make sure that it is a sonard of this version".into()
            }
            Self::Refused { help, .. } => help.clone(),
        }
    }
}

impl Client {
    /// A client of the daemon there. Over TCP, orders need the daemon's token, and from another
    /// computer every question does.
    #[must_use]
    pub const fn new(place: Endpoint, token: Option<String>) -> Self {
        Self { place, token }
    }

    /// Asks for a path; the answer's body can be read as it comes.
    ///
    /// # Errors
    /// When nobody answers, or the answer is not of success.
    pub async fn get(&self, path: &str) -> Result<Response<Incoming>, ClientError> {
        self.ask(Request::get(path), Bytes::new()).await
    }

    /// The whole of an answer, which is JSON of this type.
    ///
    /// # Errors
    /// As [`Self::get`], or when it is something else.
    pub async fn get_json<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        self.get_json_within(path, usize::MAX).await
    }

    /// The same of an answer that may have so many bytes; no more of one are taken.
    ///
    /// # Errors
    /// As [`Self::get_json`], or when it is longer.
    pub async fn get_json_within<T: DeserializeOwned>(
        &self,
        path: &str,
        most_bytes: usize,
    ) -> Result<T, ClientError> {
        let body = self.get(path).await?.into_body();
        Ok(serde_json::from_slice(&within(body, most_bytes).await?)?)
    }

    /// Gives an order with a JSON body, and returns the whole answer.
    ///
    /// # Errors
    /// As [`Self::get_json`].
    pub async fn post<T: DeserializeOwned>(
        &self,
        path: &str,
        body: &impl Serialize,
    ) -> Result<T, ClientError> {
        self.order(Request::post(path), body).await
    }

    /// Puts something in force.
    ///
    /// # Errors
    /// As [`Self::get`].
    pub async fn put(&self, path: &str, body: &impl Serialize) -> Result<(), ClientError> {
        self.order::<Accepted>(Request::put(path), body).await.map(drop)
    }

    /// Takes something out of force.
    ///
    /// # Errors
    /// As [`Self::get`].
    pub async fn delete(&self, path: &str) -> Result<(), ClientError> {
        self.ask(Request::delete(path), Bytes::new()).await.map(drop)
    }

    async fn order<T: DeserializeOwned>(
        &self,
        request: Builder,
        body: &impl Serialize,
    ) -> Result<T, ClientError> {
        let request = request.header(header::CONTENT_TYPE, "application/json");
        let answer = self.ask(request, serde_json::to_vec(body)?.into()).await?;
        Ok(serde_json::from_slice(&within(answer.into_body(), usize::MAX).await?)?)
    }

    async fn ask(&self, request: Builder, body: Bytes) -> Result<Response<Incoming>, ClientError> {
        let request = match &self.token {
            Some(token) => request.header(header::AUTHORIZATION, format!("Bearer {token}")),
            None => request,
        };
        let begun = timeout(PATIENCE, begin(&self.place, request, body));
        let response = begun.await.map_err(|_| ClientError::TooSlow)??;
        let status = response.status();
        // A daemon that is not well says so with a body that is wanted all the same.
        if status.is_success() || status == StatusCode::SERVICE_UNAVAILABLE {
            return Ok(response);
        }
        let body = within(response.into_body(), MOST_REFUSAL_BYTES).await?;
        let Problem { error, help } = serde_json::from_slice(&body).unwrap_or_else(|_| Problem {
            error: String::from_utf8_lossy(&body).into_owned(),
            help: "make sure that it is a sonard of this version".into(),
        });
        Err(ClientError::Refused { status, error, help })
    }
}

/// A body's bytes, at most so many; none may be waited for longer than for the answer's beginning.
async fn within(mut body: Incoming, most_bytes: usize) -> Result<Vec<u8>, ClientError> {
    let mut bytes = Vec::new();
    while let Some(frame) =
        timeout(PATIENCE, body.frame()).await.map_err(|_| ClientError::TooSlow)?
    {
        let frame = frame?;
        bytes.extend_from_slice(frame.data_ref().map_or(&[][..], |data| data));
        if bytes.len() > most_bytes {
            return Err(ClientError::TooLong(most_bytes));
        }
    }
    Ok(bytes)
}

async fn begin(
    place: &Endpoint,
    request: Builder,
    body: Bytes,
) -> Result<Response<Incoming>, ClientError> {
    match place {
        Endpoint::Socket(socket) => {
            let stream = UnixStream::connect(socket).await;
            let stream = stream.map_err(|source| no_daemon(&socket.display(), source))?;
            send(stream, "localhost", request, body).await
        }
        Endpoint::Address(address) => {
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
    #[allow(clippy::disallowed_methods, reason = "its end ends the requests on it")]
    tokio::spawn(async move { drop(connection.await) });
    let request = request.header(header::HOST, host).body(Full::new(body));
    let request = request.map_err(|error| no_daemon(&host, io::Error::other(error)))?;
    Ok(sender.send_request(request).await?)
}

fn no_daemon(place: &impl std::fmt::Display, source: io::Error) -> ClientError {
    ClientError::NoDaemon { place: place.to_string(), source }
}
