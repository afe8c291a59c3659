//! Reaction of the host to each reply fault, on a real line.

use firmware_protocol::{
    host::HostConfig,
    messages::{Blanking, Settings},
};
use sonard_device::{
    link,
    ranger::{Driver, Ranger, ScanError, ScanJob, ScanSummary},
};
use sonard_model::geometry::Pose;
use sonard_records::{Event, Ping, PingStatus, Record, ScanPlan, Sink, SinkError};
use tokio::sync::oneshot;

use super::{
    super::{FaultPlan, INVALID_REPLIES, InvalidReply, MockPort},
    board,
};

const BEAMS: usize = 40;

/// Expected reaction of a host, with a part of the message.
enum Reaction {
    /// The device is rejected when it is identified.
    NotIdentified(&'static str),
    /// The scan fails.
    ScanFails(&'static str),
    /// A beam is lost, and an event has the reason.
    BeamLost(&'static str),
}

fn expected_reaction(lie: InvalidReply) -> Reaction {
    use Reaction::{BeamLost, NotIdentified, ScanFails};
    match lie {
        InvalidReply::BootZero => NotIdentified("its boot nonce is 0"),
        InvalidReply::NoTicks => NotIdentified("its clock has 0 ticks per second"),
        InvalidReply::SlowTicks => NotIdentified("its clock has 1000000 ticks per second"),
        InvalidReply::NoSteps => NotIdentified("0 steps per revolution"),
        InvalidReply::SmallRing => NotIdentified("its reading buffer has 4 bytes"),
        InvalidReply::OtherSerial => ScanFails("its serial number is OTHER-0002, not MOCK-00001"),
        InvalidReply::OtherSteps => ScanFails("its motor has 800 steps per revolution, not 400"),
        InvalidReply::Emulator => ScanFails("+EMULATED -SIMULATED"),
        InvalidReply::NoIndex => ScanFails("-INDEX_SENSOR"),
        InvalidReply::LateEcho => BeamLost("echo after 2097151 ticks, beyond the window of 46512"),
        InvalidReply::SilentEcho => BeamLost("status is no echo, but the echo count is 1"),
        InvalidReply::MissingEcho => BeamLost("status is echo, but there are no echoes"),
        InvalidReply::FallingEchoes => BeamLost("echo times do not increase"),
        InvalidReply::ManyEchoes => BeamLost("8 echoes, but at most 3 were requested"),
        InvalidReply::FiredBefore | InvalidReply::FiredTwice => BeamLost("ticks too early"),
        // The clock is virtual, so only the next beam is rejected as too early.
        InvalidReply::FiredLater => BeamLost("ticks too early"),
        InvalidReply::WrongStep => ScanFails("reading 7 was taken at step 8 instead of 7"),
        InvalidReply::WrongIndex => ScanFails("reading 65535 is not in the plan"),
        InvalidReply::EndlessHome => ScanFails("still reports the request as in progress"),
        InvalidReply::FarHome => ScanFails("home is 10000 steps from its expected position"),
    }
}

#[derive(Default)]
struct RecordedScan(Vec<Record>);

impl Sink for RecordedScan {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        self.0.push(record.clone());
        Ok(())
    }
}

impl RecordedScan {
    fn pings(&self) -> Vec<&Ping> {
        let pings = self.0.iter().filter_map(|record| match record {
            Record::Ping(ping) => Some(&**ping),
            _ => None,
        });
        pings.collect()
    }

    fn lost(&self) -> Vec<u32> {
        let lost = self.pings().into_iter().filter(|ping| ping.status == PingStatus::LinkLost);
        lost.map(|ping| ping.index).collect()
    }

    fn has_event(&self, text: &str) -> bool {
        self.0.iter().any(
            |record| matches!(record, Record::Event(Event { detail, .. }) if detail.contains(text)),
        )
    }
}

fn job() -> ScanJob {
    ScanJob {
        pose: Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
        plan: ScanPlan { from_deg: 0.0, to_deg: 36.0, step_deg: 0.9, pings_per_stop: 1 },
        settings: Settings {
            window_ticks: 46_512,
            min_interval_ticks: 0,
            settle_ticks: 10_000,
            max_echoes: 3,
            blanking: Blanking::Internal,
            speed: 4_000,
            acceleration: 200_000,
            hold_s: 60,
        },
        sound_speed_m_s: 343.4,
        air: None,
        request: None,
        blanking_us: 2_380.0,
        predictions: Vec::new(),
    }
}

/// Identifies a mock with a reply fault, and takes a scan if the identity is accepted.
async fn scan(lie: InvalidReply) -> Result<(Result<ScanSummary, ScanError>, RecordedScan), String> {
    // The mock restarts occasionally if the fault concerns restarts.
    let after_restart = matches!(
        lie,
        InvalidReply::OtherSerial
            | InvalidReply::OtherSteps
            | InvalidReply::Emulator
            | InvalidReply::NoIndex
    );
    let reset = if after_restart { 0.1 } else { 0.0 };
    let board = board(FaultPlan { lie: Some(lie), reset, ..FaultPlan::default() });
    let port = MockPort::open(board, None).expect("a pty");
    let path = port.path().display().to_string();
    let (stop, stopped) = oneshot::channel::<()>();
    let serving = tokio::spawn(port.run(async move { drop(stopped.await) }, |_| {}));
    let line = link::open(&path).expect("opens");
    let identified = Ranger::identify(Driver::new(line, HostConfig::new(link::BAUD, 1))).await;
    let outcome = match identified {
        Err(error) => Err(error.to_string()),
        Ok(mut ranger) => {
            let mut records = RecordedScan::default();
            let outcome = ranger.scan(&job(), &mut records, std::future::pending()).await;
            if after_restart {
                let (job, mut nothing) = (job(), RecordedScan::default());
                let again = ranger.scan(&job, &mut nothing, std::future::pending()).await;
                let error = again.expect_err("still another board");
                assert!(nothing.0.is_empty(), "no scan is started on another board");
                assert!(error.to_string().starts_with("another device"), "{error}");
            }
            Ok((outcome, records))
        }
    };
    drop(stop);
    serving.await.expect("runs").expect("the pty works");
    outcome
}

#[tokio::test]
async fn each_reply_fault_is_rejected() {
    for (name, lie) in INVALID_REPLIES {
        let outcome = scan(lie).await;
        match (expected_reaction(lie), outcome) {
            (Reaction::NotIdentified(text), Err(error)) => {
                assert!(error.contains(text), "{name}: {error}");
            }
            (Reaction::ScanFails(text), Ok((Err(error), records))) => {
                assert!(error.to_string().contains(text), "{name}: {error}");
                assert!(records.has_event(text), "{name}: {:?}", records.0);
                let measured = records.pings().len() - records.lost().len();
                assert_eq!(records.pings().len(), BEAMS, "{name}: each beam once");
                assert!(measured < BEAMS, "{name}");
                assert!(matches!(records.0.last(), Some(Record::ScanEnd(_))), "{name}");
            }
            (Reaction::BeamLost(text), Ok((Ok(summary), records))) => {
                assert!(records.has_event(text), "{name}: {:?}", records.0);
                assert_eq!(records.pings().len(), BEAMS, "{name}: each beam once");
                let lost = records.lost();
                assert_eq!(summary.end.missing as usize, lost.len(), "{name}");
                assert!(!lost.is_empty(), "{name}");
                if lie != InvalidReply::FiredLater {
                    assert_eq!(lost, [7], "{name}");
                }
            }
            (_, outcome) => panic!("{name}: {outcome:?}"),
        }
    }
}

impl std::fmt::Debug for RecordedScan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} records, {:?} lost", self.0.len(), self.lost())
    }
}
