//! The table of lies: what each device that says what is not so comes to, on a real line.

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
    super::{FaultPlan, LIES, Lie, MockPort},
    board,
};

const BEAMS: usize = 40;

/// What a host says of a lie, and where.
enum Verdict {
    /// As soon as it meets the device.
    NotMet(&'static str),
    /// The scan ends.
    Ends(&'static str),
    /// One beam is lost, and the event says why.
    Refused(&'static str),
}

fn verdict(lie: Lie) -> Verdict {
    use Verdict::{Ends, NotMet, Refused};
    match lie {
        Lie::BootZero => NotMet("its boot nonce is 0"),
        Lie::NoTicks => NotMet("its clock has 0 ticks per second"),
        Lie::SlowTicks => NotMet("its clock has 1000000 ticks per second"),
        Lie::NoSteps => NotMet("0 steps per revolution"),
        Lie::SmallRing => NotMet("its reading buffer has 4 bytes"),
        Lie::OtherSerial => Ends("its serial number is OTHER-0002, not MOCK-00001"),
        Lie::OtherSteps => Ends("its motor has 800 steps per revolution, not 400"),
        Lie::Emulator => Ends("+EMULATED -SIMULATED"),
        Lie::NoIndex => Ends("-INDEX_SENSOR"),
        Lie::LateEcho => Refused("echo after 2097151 ticks, beyond the window of 46512"),
        Lie::SilentEcho => Refused("status is no echo, but the echo count is 1"),
        Lie::MissingEcho => Refused("status is echo, but there are no echoes"),
        Lie::FallingEchoes => Refused("echo times do not increase"),
        Lie::ManyEchoes => Refused("8 echoes, but at most 3 were requested"),
        Lie::FiredBefore | Lie::FiredTwice => Refused("ticks too early"),
        // Its clock is virtual, so only the next beam tells: it seems to be too early.
        Lie::FiredLater => Refused("ticks too early"),
        Lie::WrongStep => Ends("reading 7 was taken at step 8 instead of 7"),
        Lie::WrongIndex => Ends("reading 65535 is not in the plan"),
        Lie::EndlessHome => Ends("still reports the request as in progress"),
        Lie::FarHome => Ends("home is 10000 steps from its expected position"),
    }
}

#[derive(Default)]
struct Records(Vec<Record>);

impl Sink for Records {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        self.0.push(record.clone());
        Ok(())
    }
}

impl Records {
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

    fn says(&self, what: &str) -> bool {
        self.0.iter().any(
            |record| matches!(record, Record::Event(Event { detail, .. }) if detail.contains(what)),
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

/// Meets a mock that lies, and takes a scan if it is met.
async fn scan(lie: Lie) -> Result<(Result<ScanSummary, ScanError>, Records), String> {
    // It restarts now and then, where the lie is about that.
    let after_restart =
        matches!(lie, Lie::OtherSerial | Lie::OtherSteps | Lie::Emulator | Lie::NoIndex);
    let reset = if after_restart { 0.1 } else { 0.0 };
    let board = board(FaultPlan { lie: Some(lie), reset, ..FaultPlan::default() });
    let port = MockPort::open(board, None).expect("a pty");
    let path = port.path().display().to_string();
    let (stop, stopped) = oneshot::channel::<()>();
    let playing = tokio::spawn(port.run(async move { drop(stopped.await) }, |_| {}));
    let line = link::open(&path).expect("opens");
    let met = Ranger::meet(Driver::new(line, HostConfig::new(link::BAUD, 1))).await;
    let outcome = match met {
        Err(error) => Err(error.to_string()),
        Ok(mut ranger) => {
            let mut records = Records::default();
            let outcome = ranger.scan(&job(), &mut records, std::future::pending()).await;
            if after_restart {
                let (job, mut nothing) = (job(), Records::default());
                let again = ranger.scan(&job, &mut nothing, std::future::pending()).await;
                let error = again.expect_err("the other one is there still");
                assert!(nothing.0.is_empty(), "no scan is begun with it");
                assert!(error.to_string().starts_with("another device"), "{error}");
            }
            Ok((outcome, records))
        }
    };
    drop(stop);
    playing.await.expect("plays").expect("the pty holds");
    outcome
}

#[tokio::test]
async fn each_lie_is_told_by_its_name_and_none_is_logged_as_good() {
    for (name, lie) in LIES {
        let outcome = scan(lie).await;
        match (verdict(lie), outcome) {
            (Verdict::NotMet(why), Err(error)) => assert!(error.contains(why), "{name}: {error}"),
            (Verdict::Ends(why), Ok((Err(error), records))) => {
                assert!(error.to_string().contains(why), "{name}: {error}");
                assert!(records.says(why), "{name}: {:?}", records.0);
                let measured = records.pings().len() - records.lost().len();
                assert_eq!(records.pings().len(), BEAMS, "{name}: each beam once");
                assert!(measured < BEAMS, "{name}");
                assert!(matches!(records.0.last(), Some(Record::ScanEnd(_))), "{name}");
            }
            (Verdict::Refused(why), Ok((Ok(summary), records))) => {
                assert!(records.says(why), "{name}: {:?}", records.0);
                assert_eq!(records.pings().len(), BEAMS, "{name}: each beam once");
                let lost = records.lost();
                assert_eq!(summary.end.missing as usize, lost.len(), "{name}");
                assert!(!lost.is_empty(), "{name}");
                if lie != Lie::FiredLater {
                    assert_eq!(lost, [7], "{name}");
                }
            }
            (_, outcome) => panic!("{name}: {outcome:?}"),
        }
    }
}

impl std::fmt::Debug for Records {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} records, {:?} lost", self.0.len(), self.lost())
    }
}
