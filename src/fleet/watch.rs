//! One task that owns what is known of a fleet, and one for each robot that asks it.

use std::{sync::Arc, time::Duration};

use hyper::body::Bytes;
use jiff::Timestamp;
use tokio::{
    sync::{Semaphore, mpsc, watch},
    task::JoinSet,
    time::{MissedTickBehavior, interval},
};
use uuid::Uuid;

use super::{Asked, Roll, Told, Unheard, ask, picture};
use crate::{api::FleetPicture, client::Client};

/// From question to question.
const EVERY: Duration = Duration::from_secs(2);
/// All pictures together, bytes of JSON: as many clients as there may be stay within the server's bound.
const MOST_PICTURE_BYTES: usize = 96 * 1024;

/// What comes of asking.
enum News {
    Answer(Box<Result<Told, Unheard>>),
    Picture(Uuid, FleetPicture),
}

/// Asks daemons every 2 s, for as long as somebody holds what is told: a [`Fleet`](crate::api::Fleet) as
/// JSON, the same bytes for all. Must be called within a tokio runtime.
#[must_use]
pub fn watch(fleet: Vec<Asked>) -> watch::Receiver<Bytes> {
    let roll = Roll::new(fleet.iter().map(|one| &one.member), Timestamp::now());
    let (tell, told) = watch::channel(written(&roll));
    tokio::spawn(keep(roll, fleet, tell));
    told
}

/// Owns the roll until nobody looks at it any more.
async fn keep(mut roll: Roll, fleet: Vec<Asked>, tell: watch::Sender<Bytes>) {
    let picture_bytes = MOST_PICTURE_BYTES / fleet.len().max(1);
    // Scans are large: one is read at a time.
    let drawing = Arc::new(Semaphore::new(1));
    let (send, mut news) = mpsc::channel(fleet.len().max(1));
    // Those that ask end with this task.
    let mut asking = JoinSet::new();
    let clients: Vec<Client> = fleet.into_iter().map(|one| one.client).collect();
    for (number, client) in clients.iter().enumerate() {
        asking.spawn(keep_asking(number, client.clone(), send.clone()));
    }
    let mut wanted = vec![None; clients.len()];
    loop {
        let (number, news) = tokio::select! {
            news = news.recv() => match news {
                Some(news) => news,
                None => return,
            },
            () = tell.closed() => return,
        };
        match news {
            News::Answer(answer) => roll.take(number, *answer, Timestamp::now()),
            News::Picture(scan, picture) => roll.show(number, scan, picture),
        }
        let lacking = roll.lacks_picture(number);
        // A scan that can't be had is not asked for again.
        if let Some(scan) = lacking.filter(|scan| wanted[number] != Some(*scan)) {
            wanted[number] = Some(scan);
            let (client, send, turn) =
                (clients[number].clone(), send.clone(), Arc::clone(&drawing));
            asking.spawn(async move {
                let Ok(_turn) = turn.acquire().await else { return };
                if let Some(picture) = picture::fetch(&client, scan, picture_bytes).await {
                    drop(send.send((number, News::Picture(scan, picture))).await);
                }
            });
        }
        while asking.try_join_next().is_some() {}
        let now = written(&roll);
        tell.send_if_modified(|before| {
            let is_news = *before != now;
            *before = now;
            is_news
        });
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

fn written(roll: &Roll) -> Bytes {
    serde_json::to_vec(&roll.fleet()).unwrap_or_default().into()
}
