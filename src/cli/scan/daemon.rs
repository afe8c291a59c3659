//! A scan taken by a running daemon, through its API.

use super::{Args, output::Output, summary};
use crate::{
    api::{LinkState, ScanRequest, Status},
    cli::{
        Failure, Outcome,
        daemon::{check_scene, refuse, refuse_scans},
        runtime::{self, Interrupts},
    },
    client::RequestedScans,
    geometry::Pose,
    scan::{Record, ScanEnd, ScanPlan},
};

pub(super) fn run(args: &Args) -> Outcome {
    let (scene, pose) = args.place.load()?;
    let plan = args.azimuths.plan(args.pings_per_stop)?;
    let request = ScanRequest { scans: Some(args.repeat), plan: Some(plan), pose: Some(pose) };
    let client = args.at.client()?;
    let output = Output::open(args.out.as_deref())?;
    let mut scans =
        Scans { output, wanted: args.repeat, ends: Vec::new(), told_again: 0, pose, plan };
    let measured = runtime::run_interruptible(async |interrupts| {
        let status: Status = client.get_json("/v1/status").await.map_err(|error| refuse(&error))?;
        check_scene(status.scene.as_ref(), &scene)?;
        let requested =
            RequestedScans::ask(client, &request).await.map_err(|error| refuse(&error))?;
        notice!("the daemon takes {} scan(s), {}", args.repeat, first(&status));
        let followed = scans.follow(requested, &interrupts).await;
        scans.output.end_scan();
        followed
    });
    // Whatever happened, what was measured is closed properly and drawn.
    let closed = scans.output.close(&scene);
    measured?;
    closed
}

/// Scans that a daemon was asked for, as they come in.
struct Scans {
    output: Output,
    wanted: u32,
    ends: Vec<ScanEnd>,
    /// Readings fetched again that were told of.
    told_again: usize,
    pose: Pose,
    plan: ScanPlan,
}

impl Scans {
    /// Takes records in until the last scan is over.
    async fn follow(&mut self, mut scans: RequestedScans, interrupts: &Interrupts) -> Outcome {
        while (self.ends.len() as u32) < self.wanted {
            let record = tokio::select! {
                record = scans.next() => record,
                () = interrupts.clone().wait() => return self.cancel(&mut scans).await,
            };
            let record = record.map_err(|error| {
                let anyone = refuse_scans(&error);
                let Failure::Found(Some(why)) = anyone else { return anyone };
                Failure::Found(Some(format!(
                    "{why}: {} of {} scans were taken",
                    self.ends.len(),
                    self.wanted
                )))
            })?;
            self.take_in(&record)?;
            let again = scans.fetched_again() - self.told_again;
            if again > 0 {
                notice!("{again} readings were fetched again");
                self.told_again += again;
            }
        }
        let missing: u32 = self.ends.iter().map(|end| end.missing).sum();
        if missing > 0 {
            return Err(Failure::Found(Some(format!("{missing} beams are missing"))));
        }
        Ok(())
    }

    fn take_in(&mut self, record: &Record) -> Outcome {
        if let Record::Session(session) = record {
            self.output.add_to_earlier(session, self.pose, self.plan)?;
        }
        if let Record::ScanStart(start) = record {
            let turn = self.ends.len() as u32 + 1;
            let (wanted, beams) = (self.wanted, start.plan.beams());
            notice!("scan {turn} of {wanted} has begun: {beams} beams");
            self.output.begin_scan(turn, wanted, beams);
        }
        self.output.record(record)?;
        if let Record::ScanEnd(end) = record {
            self.output.end_scan();
            summary::print_of_daemon(end, &self.output);
            self.ends.push(end.clone());
        }
        Ok(())
    }

    /// Lets the daemon go back to what it did before.
    async fn cancel(&mut self, scans: &mut RequestedScans) -> Outcome {
        for record in scans.cancel().await.map_err(|error| refuse_scans(&error))? {
            self.take_in(&record)?;
        }
        Err(Failure::Found(Some(format!(
            "stopped: {} of {} scans were taken",
            self.ends.iter().filter(|end| end.missing == 0).count(),
            self.wanted
        ))))
    }
}

/// What the daemon does before the scans that it was asked for, as its status has it.
fn first(status: &Status) -> String {
    match (&status.scan, status.link.state) {
        (Some(scan), _) => {
            let (done, beams) = (scan.done, scan.beams);
            format!("after the one it is at, {done} of {beams} beams of which are measured")
        }
        (None, LinkState::Ready) => "at once".into(),
        (None, state) => format!("once its ranger is ready; it is {} now", state.name()),
    }
}
