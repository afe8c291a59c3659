//! A scan taken by a running daemon, through its API.

use super::{Args, output::Output, summary};
use crate::{
    api::{LinkState, ScanRequest, Status},
    cli::{
        Failure, Outcome,
        daemon::{check_scene, failure_from, scans_failure},
        interruptible,
        runtime::Interrupts,
    },
    client::RequestedScans,
    geometry::Pose,
    scan::{Record, ScanEnd, ScanPlan, text::format_count},
};

pub(super) fn run(args: &Args) -> Outcome {
    let (scene, pose) = args.place.load()?;
    let plan = args.azimuths.plan(args.pings_per_stop)?;
    let request = ScanRequest { scans: Some(args.repeat), plan: Some(plan), pose: Some(pose) };
    let client = args.at.client()?;
    let output = Output::open(args.out.as_deref())?;
    let mut scans =
        Scans { output, count: args.repeat, ends: Vec::new(), reported_repeats: 0, pose, plan };
    let measured = interruptible::run_interruptible(async |interrupts| {
        let status: Status =
            client.get_json("/v1/status").await.map_err(|error| failure_from(&error))?;
        check_scene(status.scene.as_ref(), &scene)?;
        let requested = RequestedScans::request(client, &request)
            .await
            .map_err(|error| failure_from(&error))?;
        let (count, wait) = (format_count(args.repeat, "scan"), describe_wait(&status));
        notice!("the daemon takes {count}, {wait}");
        let followed = scans.follow(requested, &interrupts).await;
        scans.output.end_scan();
        followed
    });
    // After any outcome, the log is closed and the measured scan is drawn.
    let closed = scans.output.close(&scene);
    measured?;
    closed
}

/// Scans requested from a daemon, as they arrive.
struct Scans {
    output: Output,
    count: u32,
    ends: Vec<ScanEnd>,
    /// Number of re-requested readings already reported.
    reported_repeats: usize,
    pose: Pose,
    plan: ScanPlan,
}

impl Scans {
    /// Receives records until the last scan has ended.
    async fn follow(&mut self, mut scans: RequestedScans, interrupts: &Interrupts) -> Outcome {
        while (self.ends.len() as u32) < self.count {
            let record = tokio::select! {
                record = scans.next() => record,
                () = interrupts.clone().wait() => return self.cancel(&mut scans).await,
            };
            let record = record.map_err(|error| {
                let failure = scans_failure(&error);
                let Failure::Found(Some(why)) = failure else { return failure };
                Failure::Found(Some(format!(
                    "{why}: {} of {} scans taken",
                    self.ends.len(),
                    self.count
                )))
            })?;
            self.add_record(&record)?;
            let repeated = scans.fetched_again() - self.reported_repeats;
            if repeated > 0 {
                notice!("{repeated} readings re-requested");
                self.reported_repeats += repeated;
            }
        }
        let missing: u32 = self.ends.iter().map(|end| end.missing).sum();
        if missing > 0 {
            return Err(Failure::Found(Some(format!("{} missing", format_count(missing, "beam")))));
        }
        Ok(())
    }

    fn add_record(&mut self, record: &Record) -> Outcome {
        if let Record::Session(session) = record {
            self.output.check_same_setup(session, self.pose, self.plan)?;
        }
        if let Record::ScanStart(start) = record {
            let number = self.ends.len() as u32 + 1;
            let (count, beams) = (self.count, start.plan.beams());
            notice!("scan {number} of {count} started: {beams} beams");
            self.output.begin_scan(number, count, beams);
        }
        self.output.record(record)?;
        if let Record::ScanEnd(end) = record {
            self.output.end_scan();
            summary::print_of_daemon(end, &self.output);
            self.ends.push(end.clone());
        }
        Ok(())
    }

    /// Cancels the remaining scans; the daemon resumes its previous mode.
    async fn cancel(&mut self, scans: &mut RequestedScans) -> Outcome {
        for record in scans.cancel().await.map_err(|error| scans_failure(&error))? {
            self.add_record(&record)?;
        }
        Err(Failure::Found(Some(format!(
            "interrupted: {} of {} scans taken",
            self.ends.iter().filter(|end| end.missing == 0).count(),
            self.count
        ))))
    }
}

/// Describes what precedes the requested scans, from the daemon's status.
fn describe_wait(status: &Status) -> String {
    match (&status.scan, status.link.state) {
        (Some(scan), _) => {
            let (done, beams) = (scan.done, scan.beams);
            format!("after the current one ({done} of {beams} beams)")
        }
        (None, LinkState::Ready) => "immediately".into(),
        (None, state) => format!("when its ranger is ready (now {})", state.name()),
    }
}
