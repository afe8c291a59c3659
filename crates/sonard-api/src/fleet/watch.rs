//! One task that owns what is known of a fleet, and one for each robot that asks it.

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

use super::{Asked, Roll, Told, Unheard, ask, picture};
use crate::{api::FleetPicture, client::Client};

/// From question to question.
const EVERY: Duration = Duration::from_secs(2);
/// All pictures together, bytes of JSON: as many clients as there may be stay within the server's bound.
const MOST_PICTURE_BYTES: usize = 64 * 1024;
/// How often a scan is asked for that can't be had.
const MOST_TRIES: u8 = 3;

/// What comes of asking.
enum News {
    Answer(Box<Result<Told, Unheard>>),
    Picture(Uuid, Option<FleetPicture>),
}

/// A scan whose picture is wanted.
#[derive(Debug, Clone, Copy, Default)]
struct PictureRequest {
    scan: Option<Uuid>,
    tries: u8,
    is_pending: bool,
}

/// Asks daemons every 2 s, for as long as somebody holds what is told: a [`Fleet`](crate::api::Fleet) as
/// JSON, the same bytes for all. Must be called within a tokio runtime.
#[must_use]
pub fn watch(fleet: Vec<Asked>, supervisor: &Supervisor) -> watch::Receiver<Bytes> {
    let roll = Roll::new(fleet.iter().map(|one| &one.member), Timestamp::now());
    let (tell, told) = watch::channel(written(&roll, Duration::ZERO));
    drop(supervisor.spawn_finite(Task::Fleet, keep(roll, fleet, tell)));
    told
}

/// Owns the roll until nobody looks at it any more.
async fn keep(mut roll: Roll, fleet: Vec<Asked>, tell: watch::Sender<Bytes>) {
    let began = Instant::now();
    let (send, mut news) = mpsc::channel(fleet.len().max(1));
    // Those that ask end with this task.
    let mut asking = JoinSet::new();
    let clients: Vec<Client> = fleet.into_iter().map(|one| one.client).collect();
    for (number, client) in clients.iter().enumerate() {
        asking.spawn(keep_asking(number, client.clone(), send.clone()));
    }
    // Scans are large: one is read at a time.
    let drawing = Arc::new(Semaphore::new(1));
    let most_bytes = MOST_PICTURE_BYTES / clients.len().max(1);
    let mut requests = vec![PictureRequest::default(); clients.len()];
    loop {
        let (number, news) = tokio::select! {
            Some(news) = news.recv() => news,
            () = tell.closed() => return,
        };
        // Each daemon reports under the number that it was spawned with.
        let Some((request, client)) = requests.get_mut(number).zip(clients.get(number)) else {
            continue;
        };
        match news {
            News::Answer(answer) => {
                roll.take(number, *answer, (Timestamp::now(), began.elapsed()));
            }
            News::Picture(scan, picture) => {
                request.is_pending = false;
                picture.into_iter().for_each(|picture| roll.show(number, scan, picture));
            }
        }
        if let Some(scan) = request.next(roll.lacks_picture(number)) {
            let (client, send) = (client.clone(), send.clone());
            let turn = Arc::clone(&drawing);
            asking.spawn(async move {
                let Ok(_turn) = turn.acquire().await else { return };
                let picture = picture::fetch(&client, scan, most_bytes).await;
                drop(send.send((number, News::Picture(scan, picture))).await);
            });
        }
        while asking.try_join_next().is_some() {}
        let now = written(&roll, began.elapsed());
        tell.send_if_modified(|before| {
            let is_news = *before != now;
            *before = now;
            is_news
        });
    }
}

impl PictureRequest {
    /// The scan to ask for now, if one is lacking that may be had.
    fn next(&mut self, lacking: Option<Uuid>) -> Option<Uuid> {
        let scan = lacking.filter(|_| !self.is_pending)?;
        if self.scan != Some(scan) {
            *self = Self { scan: Some(scan), ..Self::default() };
        }
        if self.tries == MOST_TRIES {
            return None;
        }
        self.tries += 1;
        self.is_pending = true;
        Some(scan)
    }
}

async fn keep_asking(number: usize, client: Client, send: mpsc::Sender<(usize, News)>) {
    let mut turns = interval(EVERY);
    turns.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        turns.tick().await;
        let answer = Box::new(ask(&client).await);
        if send.send((number, News::Answer(answer))).await.is_err() {
            return;
        }
    }
}

fn written(roll: &Roll, at: Duration) -> Bytes {
    serde_json::to_vec(&roll.fleet(at)).unwrap_or_default().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_is_asked_for_once_at_a_time_and_not_for_ever() {
        let (scan, next) = (Uuid::from_u128(1), Uuid::from_u128(2));
        let mut request = PictureRequest::default();
        assert_eq!(request.next(None), None);
        for _ in 0..MOST_TRIES {
            assert_eq!(request.next(Some(scan)), Some(scan));
            assert_eq!(request.next(Some(next)), None, "one is on its way");
            request.is_pending = false;
        }
        assert_eq!(request.next(Some(scan)), None);
        assert_eq!(request.next(Some(next)), Some(next));
    }
}
