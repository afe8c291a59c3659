//! Task that owns the fleet's registry, and one polling task for each robot.

use std::{sync::Arc, time::Duration};

use hyper::body::Bytes;
use jiff::Timestamp;
use sonard_runtime::supervisor::{Supervisor, Task};
use tokio::{
    sync::{Semaphore, mpsc, watch},
    task::JoinSet,
    time::{Instant, MissedTickBehavior, interval},
};
use uuid::Uuid;

use super::{DaemonReport, PollError, PolledDaemon, Registry, picture, poll};
use crate::{api::FleetPicture, client::Client};

/// Poll interval.
const POLL_INTERVAL: Duration = Duration::from_secs(2);
/// Maximum JSON size of all pictures together, bytes. With it, the responses to the maximum number
/// of clients stay within the server's memory limit.
const MAX_PICTURE_BYTES: usize = 64 * 1024;
/// Maximum number of attempts to fetch a scan.
const MAX_TRIES: u8 = 3;

/// Message of a polling task.
enum PollMessage {
    Report(Box<Result<DaemonReport, PollError>>),
    Picture(Uuid, Option<FleetPicture>),
}

/// Pending or failed request for a picture.
#[derive(Debug, Clone, Copy, Default)]
struct PictureRequest {
    scan: Option<Uuid>,
    tries: u8,
    is_pending: bool,
}

/// Polls daemons every 2 s while a receiver of the result exists: a [`Fleet`](crate::api::Fleet) as
/// JSON, serialized once for all receivers. Must be called within a tokio runtime.
#[must_use]
pub fn watch_fleet(fleet: Vec<PolledDaemon>, supervisor: &Supervisor) -> watch::Receiver<Bytes> {
    let registry = Registry::new(fleet.iter().map(|daemon| &daemon.member), Timestamp::now());
    let (sender, receiver) = watch::channel(serialize(&registry, Duration::ZERO));
    drop(supervisor.spawn_finite(Task::Fleet, run(registry, fleet, sender)));
    receiver
}

/// Updates and publishes the registry until all receivers are dropped.
async fn run(mut registry: Registry, fleet: Vec<PolledDaemon>, sender: watch::Sender<Bytes>) {
    let began = Instant::now();
    let (send, mut messages) = mpsc::channel(fleet.len().max(1));
    // The polling tasks end with this task.
    let mut polling = JoinSet::new();
    let clients: Vec<Client> = fleet.into_iter().map(|daemon| daemon.client).collect();
    for (number, client) in clients.iter().enumerate() {
        polling.spawn(poll_forever(number, client.clone(), send.clone()));
    }
    // Scans are large, so only one is fetched at a time.
    let fetching = Arc::new(Semaphore::new(1));
    let max_bytes = MAX_PICTURE_BYTES / clients.len().max(1);
    let mut requests = vec![PictureRequest::default(); clients.len()];
    loop {
        let (number, message) = tokio::select! {
            Some(message) = messages.recv() => message,
            () = sender.closed() => return,
        };
        // Each polling task sends the number that it was spawned with.
        let Some((request, client)) = requests.get_mut(number).zip(clients.get(number)) else {
            continue;
        };
        match message {
            PollMessage::Report(report) => {
                registry.update(number, *report, (Timestamp::now(), began.elapsed()));
            }
            PollMessage::Picture(scan, picture) => {
                request.is_pending = false;
                picture.into_iter().for_each(|picture| registry.set_picture(number, scan, picture));
            }
        }
        if let Some(scan) = request.next(registry.missing_picture(number)) {
            let (client, send) = (client.clone(), send.clone());
            let permits = Arc::clone(&fetching);
            polling.spawn(async move {
                let Ok(_permit) = permits.acquire().await else { return };
                let picture = picture::fetch(&client, scan, max_bytes).await;
                drop(send.send((number, PollMessage::Picture(scan, picture))).await);
            });
        }
        while polling.try_join_next().is_some() {}
        let current = serialize(&registry, began.elapsed());
        sender.send_if_modified(|before| {
            let is_changed = *before != current;
            *before = current;
            is_changed
        });
    }
}

impl PictureRequest {
    /// Returns the scan to fetch now, if a picture is missing and attempts are left.
    fn next(&mut self, lacking: Option<Uuid>) -> Option<Uuid> {
        let scan = lacking.filter(|_| !self.is_pending)?;
        if self.scan != Some(scan) {
            *self = Self { scan: Some(scan), ..Self::default() };
        }
        if self.tries == MAX_TRIES {
            return None;
        }
        self.tries += 1;
        self.is_pending = true;
        Some(scan)
    }
}

async fn poll_forever(number: usize, client: Client, send: mpsc::Sender<(usize, PollMessage)>) {
    let mut ticks = interval(POLL_INTERVAL);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        ticks.tick().await;
        let report = Box::new(poll(&client).await);
        if send.send((number, PollMessage::Report(report))).await.is_err() {
            return;
        }
    }
}

fn serialize(registry: &Registry, at: Duration) -> Bytes {
    serde_json::to_vec(&registry.fleet(at)).unwrap_or_default().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picture_requests_are_limited() {
        let (scan, next) = (Uuid::from_u128(1), Uuid::from_u128(2));
        let mut request = PictureRequest::default();
        assert_eq!(request.next(None), None);
        for _ in 0..MAX_TRIES {
            assert_eq!(request.next(Some(scan)), Some(scan));
            assert_eq!(request.next(Some(next)), None, "a request is pending");
            request.is_pending = false;
        }
        assert_eq!(request.next(Some(scan)), None);
        assert_eq!(request.next(Some(next)), Some(next));
    }
}
