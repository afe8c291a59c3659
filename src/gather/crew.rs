//! All daemons that are gathered from, round by round.

use std::{path::PathBuf, sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::{task::JoinSet, time::Instant};

use super::{
    pull::{Order, PullError, Tally, Watcher, pull},
    settle::{Claim, settle},
    shelf::{Shelf, ShelfError},
};
use crate::{
    api::FleetState,
    fleet::{Asked, Seen, ask, judge, plain},
};

/// How long a daemon is left alone that could not be taken from, from the first time to the longest.
const LEAST_WAIT: Duration = Duration::from_secs(2);
const MOST_WAIT: Duration = Duration::from_secs(30);

/// Sources and destination of gathering.
#[derive(Debug, Clone)]
pub struct Choices {
    /// The folder of all robots' folders.
    pub root: PathBuf,
    /// Logs that ended before are left out.
    pub since: Option<Timestamp>,
    /// How long a round may take from one daemon, so that the others come in turn; the rest is left for the next.
    pub turn: Option<Duration>,
}

/// The daemons, each with its robot's folder once it said which robot it is of.
pub struct Crew {
    choices: Choices,
    mates: Vec<Mate>,
}

struct Mate {
    asked: Asked,
    /// The robot it was taken for.
    robot: Option<String>,
    shelf: Option<Shelf>,
    due: Instant,
    wait: Duration,
}

/// The result for one daemon.
#[derive(Debug)]
pub struct Report {
    /// Its robot, if it said so or was named.
    pub robot: Option<String>,
    /// Where it is.
    pub address: String,
    /// How it is, as `sonard status` would say.
    pub state: FleetState,
    /// What was taken from it.
    pub tally: Tally,
    /// Why not all could be taken, and what a person can do about it.
    pub wrong: Option<(String, String)>,
}

impl Crew {
    /// Prepares to gather from daemons into a folder, which is made.
    ///
    /// # Errors
    /// When it can't be made, or must not be written to.
    pub fn new(choices: Choices, daemons: Vec<Asked>) -> Result<Self, ShelfError> {
        Shelf::check_root(&choices.root)?;
        let mate = |asked: Asked| Mate {
            asked,
            robot: None,
            shelf: None,
            due: Instant::now(),
            wait: LEAST_WAIT,
        };
        Ok(Self { choices, mates: daemons.into_iter().map(mate).collect() })
    }

    /// Takes from all daemons side by side what is new, but for those that are left alone for now. Must be called
    /// within a multi-threaded tokio runtime. Dropped meanwhile, what came is kept.
    pub async fn round(&mut self, watcher: &Arc<dyn Watcher>) -> Vec<Report> {
        let mut reports = self.ask().await;
        let mut pulling = JoinSet::new();
        for (number, report) in &reports {
            if report.wrong.is_some() {
                continue;
            }
            let mate = &mut self.mates[*number];
            let Some(mut shelf) = mate.shelf.take() else { continue };
            let (client, watcher) = (mate.asked.client.clone(), Arc::clone(watcher));
            let number = *number;
            let until = self.choices.turn.map(|turn| Instant::now() + turn);
            let order = Order { since: self.choices.since, until };
            pulling.spawn(async move {
                let mut tally = Tally::default();
                let pulled = pull(&client, &mut shelf, order, &*watcher, &mut tally).await;
                (number, shelf, tally, pulled)
            });
        }
        while let Some(done) = pulling.join_next().await {
            // A panic was printed already; its robot's folder is opened anew.
            let Ok((number, shelf, tally, pulled)) = done else { continue };
            self.mates[number].shelf = Some(shelf);
            if let Some((_, report)) = reports.iter_mut().find(|(of, _)| *of == number) {
                report.tally = tally;
                report.wrong = pulled.err().map(|error| words(&error));
            }
        }
        for (number, report) in &reports {
            self.mates[*number].is_well(report.wrong.is_none());
        }
        reports.into_iter().map(|(_, report)| report).collect()
    }

    /// Asks who is there, and opens the folders of those that are taken from.
    async fn ask(&mut self) -> Vec<(usize, Report)> {
        let mut asking = JoinSet::new();
        let now = Instant::now();
        for (number, mate) in self.mates.iter().enumerate().filter(|(_, mate)| mate.due <= now) {
            let expected = mate.robot.clone().or(mate.asked.member.robot.clone());
            let client = mate.asked.client.clone();
            asking.spawn(async move { (number, judge(expected.as_deref(), ask(&client).await)) });
        }
        let mut seen = asking.join_all().await;
        seen.sort_by_key(|(number, _)| *number);
        let addresses: Vec<_> =
            seen.iter().map(|(n, _)| self.mates[*n].asked.member.address()).collect();
        let there: Vec<_> = (0..seen.len()).filter(|row| seen[*row].1.told.is_some()).collect();
        let claims: Vec<_> = there
            .iter()
            .filter_map(|row| {
                let (number, seen) = &seen[*row];
                let says = &seen.told.as_ref()?.status.robot;
                let is_known = self.mates[*number].robot.is_some();
                Some(Claim { address: &addresses[*row], says, is_known })
            })
            .collect();
        let mut settled = settle(&claims).into_iter();
        let mut reports = Vec::new();
        for ((number, seen), address) in seen.iter().zip(&addresses) {
            let mut report =
                report(seen, address, self.mates[*number].asked.member.robot.as_deref());
            if let (Some(told), Some(outcome)) =
                (&seen.told, seen.told.as_ref().and_then(|_| settled.next()))
            {
                let taken = outcome
                    .map_err(|why| (why, String::new()))
                    .and_then(|()| self.take_for(*number, &told.status.robot, address));
                report.wrong = taken.err();
            }
            reports.push((*number, report));
        }
        reports
    }

    /// Takes a daemon for a robot: opens its folder.
    fn take_for(
        &mut self,
        number: usize,
        robot: &str,
        address: &str,
    ) -> Result<(), (String, String)> {
        let is_another =
            |(other, mate): (usize, &Mate)| other != number && mate.robot.as_deref() == Some(robot);
        if self.mates.iter().enumerate().any(is_another) {
            let why = format!("another daemon was taken for {robot} before");
            return Err((why, "give each robot a name of its own (fleet.robot)".into()));
        }
        let mate = &mut self.mates[number];
        if mate.shelf.is_none() {
            let was_named = mate.asked.member.robot.is_some() || mate.robot.is_some();
            let shelf = Shelf::open(&self.choices.root, robot, address, was_named);
            mate.shelf = Some(shelf.map_err(|error| (error.message, error.help))?);
            mate.robot = Some(robot.into());
        }
        Ok(())
    }
}

impl Mate {
    /// Sets when it is asked again.
    fn is_well(&mut self, well: bool) {
        if well {
            self.wait = LEAST_WAIT;
            self.due = Instant::now();
        } else {
            self.due = Instant::now() + self.wait;
            self.wait = (self.wait * 2).min(MOST_WAIT);
        }
    }
}

fn report(seen: &Seen, address: &str, named: Option<&str>) -> Report {
    let said = seen.told.as_ref().map(|told| &*told.status.robot);
    let help = match seen.state {
        FleetState::OtherRobot => "see which robot is there (fleet.robot); nothing was taken",
        FleetState::Refusing => "give the daemon's token with --token-file, or in the fleet's file",
        _ => "what it has logged is taken when it is back",
    };
    Report {
        robot: said.or(named).map(str::to_owned),
        address: address.to_owned(),
        state: seen.state,
        tally: Tally::default(),
        wrong: seen.told.is_none().then(|| (seen.wrong.join("; "), help.to_owned())),
    }
}

/// Part of it are another's words.
fn words(error: &PullError) -> (String, String) {
    let message = match error {
        PullError::Shelf(error) => error.message.clone(),
        error => plain(&error.to_string()),
    };
    (message, plain(&error.help()))
}
