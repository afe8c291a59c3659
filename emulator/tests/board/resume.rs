//! The real scanner on the emulated board, through a pty and at the pace of the wall clock: a
//! supply that sags in the middle of a sweep costs time, but no beam.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::{SETTINGS, commanded, config, elf};
use firmware_protocol::host::HostConfig;
use firmware_protocol::messages::Settings;
use sonard_device::{
    link::{self, Pty},
    ranger::{Driver, Ranger, ScanJob, ScanSummary},
};
use sonard_emulator::{Emulator, HZ, serve};
use sonard_model::geometry::Pose;
use sonard_records::{EventKind, Record, ScanPlan, Sink, SinkError};

const MS: u64 = HZ / 1000;
const BEAMS: u32 = 60;

#[derive(Default)]
struct Kept(Vec<Record>);

impl Sink for Kept {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        self.0.push(record.clone());
        Ok(())
    }
}

/// A scan of [`BEAMS`] beams on a board whose supply sags at these firings.
fn scan(dips_at: &[usize]) -> (ScanSummary, Vec<Record>) {
    let pty = Pty::open(None).expect("a pty");
    let port = pty.path().display().to_string();
    let stop = Arc::new(AtomicBool::new(false));
    let (stopped, dips_at) = (Arc::clone(&stop), dips_at.to_vec());
    let board = std::thread::spawn(move || {
        let mut emulator =
            Emulator::new(&elf(), &config(), Box::new(commanded(&[5 * MS]))).expect("a firmware");
        let mut fired = 0;
        let mut dips = dips_at.iter().copied().peekable();
        serve(&mut emulator, &pty, &stopped, |emulator| {
            fired += emulator.take_init_rises().len();
            if dips.next_if(|at| *at <= fired).is_some() {
                emulator.dip(20);
            }
        })
        .expect("plays");
    });
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let taken = runtime.expect("a runtime").block_on(take(&port));
    stop.store(true, Ordering::Relaxed);
    board.join().expect("the board plays to its end");
    taken
}

async fn take(port: &str) -> (ScanSummary, Vec<Record>) {
    let line = link::open(port).expect("opens");
    let config = HostConfig { max_attempts: 7, ..HostConfig::new(link::BAUD, 1) };
    let mut ranger = Ranger::meet(Driver::new(line, config)).await.expect("answers");
    let job = ScanJob {
        pose: Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
        plan: ScanPlan { to_deg: f64::from(BEAMS) * 0.9, ..ScanPlan::default() },
        settings: Settings { window_ticks: 20_000, ..SETTINGS },
        sound_speed_m_s: 343.4,
        air: None,
        request: None,
        blanking_us: 2_380.0,
        predictions: Vec::new(),
    };
    let mut kept = Kept::default();
    let summary = ranger.scan(&job, &mut kept, std::future::pending()).await.expect("scans");
    (summary, kept.0)
}

#[test]
fn a_dip_in_a_sweep_is_noticed_marked_and_made_good() {
    let (summary, records) = scan(&[20, 35]);
    assert_eq!(summary.restarts, 2);
    assert_eq!((summary.end.beams, summary.end.missing), (BEAMS, 0));
    let mut beams: Vec<u32> = records
        .iter()
        .filter_map(|record| match record {
            Record::Ping(ping) => Some(ping.index),
            _ => None,
        })
        .collect();
    beams.sort_unstable();
    assert_eq!(beams, (0..BEAMS).collect::<Vec<_>>(), "each beam once");
    let marks = |kind| -> Vec<&str> {
        records
            .iter()
            .filter_map(|record| match record {
                Record::Event(event) if event.kind == kind => Some(&event.detail[..]),
                _ => None,
            })
            .collect()
    };
    assert_eq!(marks(EventKind::Reboot).len(), 2, "{records:?}");
    let resumed = marks(EventKind::Reconnected);
    assert_eq!(resumed.len(), 2, "{records:?}");
    assert!(resumed.iter().all(|detail| detail.contains("BrownOut")), "{resumed:?}");
    assert_eq!(summary.end.home_drift_steps, Some(0), "it went home after each restart");
}

#[test]
fn without_a_dip_nothing_is_marked() {
    let (summary, records) = scan(&[]);
    assert_eq!((summary.restarts, summary.end.beams), (0, BEAMS));
    assert!(!records.iter().any(|record| matches!(record, Record::Event(_))));
}
