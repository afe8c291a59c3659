//! A scan taken by a running daemon, through its API.

use std::{collections::HashSet, time::Duration};

use http_body_util::BodyExt as _;
use hyper::body::Incoming;
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::{Value, json};
use tokio::time::timeout;
use uuid::Uuid;

use super::{Args, output::Output};
use crate::{
    cli::{
        Failure, Outcome,
        runtime::{self, Interrupts},
        status::refuse,
    },
    client::{self, Place},
    compare::compare,
    scan::{Event, Ping, Record, ScanEnd, ScanStart, Session, decode_line},
    scene::Scene,
};

/// How long nothing may come before it is asked whether the request is still known.
const QUIET: Duration = Duration::from_secs(2);
/// What stands in a stream for readings that this client was too slow for.
const DROPPED: &[u8] = br#"{"type":"dropped""#;

pub(super) fn run(args: &Args) -> Outcome {
    let (scene, pose) = args.place.load()?;
    let plan = args.azimuths.plan(args.pings_per_stop)?;
    let wish = json!({"scans": args.repeat, "plan": plan, "pose": pose});
    let mut output = Output::open(args.out.as_deref())?;
    let measured = runtime::new()?.block_on(async {
        let interrupts = Interrupts::listen();
        let mut scans = Scans::ask(args, &scene, &wish, &mut output).await?;
        let followed = tokio::select! {
            followed = scans.follow() => followed,
            () = interrupts.wait() => scans.cancel().await,
        };
        scans.output.end_scan();
        followed
    });
    // Whatever happened, what was measured is closed properly and drawn.
    let closed = output.close(&scene);
    measured?;
    closed
}

/// Scans that a daemon was asked for, as they come in.
struct Scans<'a> {
    place: Place,
    output: &'a mut Output,
    stream: Incoming,
    rest: Vec<u8>,
    request: Uuid,
    wanted: u32,
    /// The scan under way that belongs to the request, and its beams that are in.
    current: Option<(Uuid, HashSet<u32>)>,
    /// Readings were lost on the way here: the daemon has them.
    dropped: bool,
    session: Option<Session>,
    ends: Vec<ScanEnd>,
}

#[derive(Deserialize)]
struct Started {
    request: Uuid,
}

#[derive(Deserialize)]
struct Latest {
    start: ScanStart,
    pings: Vec<Ping>,
}

impl<'a> Scans<'a> {
    /// Asks for them, when it is the daemon's scene that is meant.
    async fn ask(
        args: &Args,
        scene: &Scene,
        wish: &Value,
        output: &'a mut Output,
    ) -> Result<Self, Failure> {
        let place = Place::Socket(args.socket.clone());
        let status: Value = get(&place, "/v1/status").await?;
        check_scene(&status, scene)?;
        // Listening before asking: nothing is missed.
        let live = client::get(&place, "/v1/live/records").await.map_err(|error| refuse(&error))?;
        let answer = client::post(&place, "/v1/start", wish).await;
        let answer = answer.map_err(|error| refuse(&error))?;
        let Started { request } = parse(&answer)?;
        Ok(Self {
            place,
            output,
            stream: live.into_body(),
            rest: Vec::new(),
            request,
            wanted: args.repeat,
            current: None,
            dropped: false,
            session: None,
            ends: Vec::new(),
        })
    }

    /// Takes records in until the last scan is over.
    async fn follow(&mut self) -> Outcome {
        let mut doubts = 0;
        while (self.ends.len() as u32) < self.wanted {
            match timeout(QUIET, self.stream.frame()).await {
                Ok(Some(frame)) => {
                    let frame = frame.map_err(|error| refuse(&error.into()))?;
                    self.rest.extend_from_slice(frame.data_ref().map_or(&[][..], |data| data));
                    self.take_in().await?;
                }
                Ok(None) => {
                    return Err(Failure::device(
                        "the daemon ended the stream of records",
                        "look at its messages (`journalctl -u sonard`); what came is kept",
                    ));
                }
                Err(_quiet) if self.current.is_none() => {
                    doubts = if self.is_forgotten().await? { doubts + 1 } else { 0 };
                    // Between its beginning and its first record a scan is neither asked for nor
                    // under way: one look may fall there, two don't.
                    if doubts == 2 {
                        return Err(Failure::Found(Some(format!(
                            "the daemon was told to stop: {} of {} scans were taken",
                            self.ends.len(),
                            self.wanted
                        ))));
                    }
                }
                Err(_quiet) => {}
            }
        }
        let missing: u32 = self.ends.iter().map(|end| end.missing).sum();
        if missing > 0 {
            return Err(Failure::Found(Some(format!("{missing} beams are missing"))));
        }
        Ok(())
    }

    async fn take_in(&mut self) -> Outcome {
        while let Some(end) = self.rest.iter().position(|&byte| byte == b'\n') {
            let line: Vec<u8> = self.rest.drain(..=end).collect();
            self.dropped |= line.starts_with(DROPPED);
            match decode_line(line.strip_suffix(b"\n").unwrap_or(&line)) {
                Ok(record) => self.record(record).await?,
                // A kind of record that this version does not know is none of its scans'.
                Err(_) => continue,
            }
            if self.ends.len() as u32 >= self.wanted {
                break;
            }
        }
        Ok(())
    }

    async fn record(&mut self, record: Record) -> Outcome {
        match &record {
            Record::ScanStart(start) if start.request == Some(self.request) => {
                let session: Session = get(&self.place, "/v1/session").await?;
                if self.session.as_ref() != Some(&session) {
                    self.output.record(&Record::Session(Box::new(session.clone())))?;
                    self.session = Some(session);
                }
                let turn = self.ends.len() as u32 + 1;
                self.output.begin_scan(turn, self.wanted, start.plan.beams());
                (self.current, self.dropped) = (Some((start.scan, HashSet::new())), false);
                self.output.record(&record)
            }
            Record::Ping(ping) => match &mut self.current {
                Some((scan, seen)) if *scan == ping.scan => {
                    seen.insert(ping.index);
                    self.output.record(&record)
                }
                _ => Ok(()),
            },
            Record::Event(Event { .. }) if self.current.is_some() => self.output.record(&record),
            Record::ScanEnd(end)
                if self.current.as_ref().is_some_and(|(scan, _)| *scan == end.scan) =>
            {
                self.mend(end).await?;
                self.output.record(&record)?;
                self.output.end_scan();
                self.tell(end);
                self.current = None;
                self.ends.push(end.clone());
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Fetches readings that this client was too slow for.
    async fn mend(&mut self, end: &ScanEnd) -> Outcome {
        let Some((scan, seen)) = self.current.as_ref().filter(|_| self.dropped) else {
            return Ok(());
        };
        let latest: Latest = get(&self.place, "/v1/scan/latest").await?;
        if latest.start.scan != *scan {
            return Err(Failure::device(
                "readings were dropped, and the daemon has begun another scan",
                "they are in the daemon's log: GET /v1/logs",
            ));
        }
        let lost: Vec<Ping> =
            latest.pings.into_iter().filter(|ping| !seen.contains(&ping.index)).collect();
        anstream::eprintln!("{} readings of scan {} were fetched again", lost.len(), end.scan);
        for ping in lost {
            self.output.record(&Record::Ping(Box::new(ping)))?;
        }
        Ok(())
    }

    /// Whether the daemon neither scans nor means to.
    async fn is_forgotten(&self) -> Result<bool, Failure> {
        let status: Value = get(&self.place, "/v1/status").await?;
        Ok(status["scanning"]["requested"] == 0 && status["scan"].is_null())
    }

    /// Lets the daemon go back to what it did before.
    async fn cancel(&mut self) -> Outcome {
        let body = json!({ "request": self.request });
        client::post(&self.place, "/v1/cancel", &body).await.map_err(|error| refuse(&error))?;
        // The end of the scan under way is still to come.
        let over = async {
            while self.current.is_some() {
                let Some(Ok(frame)) = self.stream.frame().await else { return Ok(()) };
                self.rest.extend_from_slice(frame.data_ref().map_or(&[][..], |data| data));
                self.take_in().await?;
            }
            Ok::<(), Failure>(())
        };
        timeout(QUIET * 2, over).await.unwrap_or(Ok(()))?;
        Err(Failure::Found(Some(format!(
            "stopped: {} of {} scans were taken",
            self.ends.iter().filter(|end| end.missing == 0).count(),
            self.wanted
        ))))
    }

    /// One screen about a scan.
    fn tell(&self, end: &ScanEnd) {
        let views = self.output.views();
        let compared = compare(&views).0;
        anstream::eprintln!(
            "by the daemon: {} beams, {} missing; {} of {} echo pairs agree; {:.3} s of device time",
            end.beams,
            end.missing,
            compared.agree,
            compared.both_echo,
            end.duration_s,
        );
    }
}

/// Predictions are the daemon's: with another scene they would not be what was asked for.
fn check_scene(status: &Value, scene: &Scene) -> Outcome {
    if status["scene"]["sha256"] == scene.sha256.as_str() {
        return Ok(());
    }
    let of_daemon = status["scene"]["name"].as_str();
    Err(Failure::input(
        format!(
            "the daemon predicts in {}, not in the scene {} as it is here",
            of_daemon.map_or_else(|| "no scene".into(), |name| format!("its scene {name}")),
            scene.name
        ),
        "give --scene that one, or change place.scene of the daemon",
    ))
}

async fn get<T: DeserializeOwned>(place: &Place, path: &str) -> Result<T, Failure> {
    parse(&client::get_whole(place, path).await.map_err(|error| refuse(&error))?)
}

fn parse<T: DeserializeOwned>(body: &[u8]) -> Result<T, Failure> {
    serde_json::from_slice(body).map_err(|error| {
        let help = "make sure that it is a sonard of this version";
        Failure::device(format!("the daemon's answer can't be read: {error}"), help)
    })
}
