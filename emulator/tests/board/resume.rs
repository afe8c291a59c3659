//! Real scanner on the emulated board, through a pty in real time. A supply dip during a sweep
//! costs time, but no beam.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::common::{SETTINGS, config, elf, scripted};
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
struct Records(Vec<Record>);

impl Sink for Records {
    fn record(&mut self, record: &Record) -> Result<(), SinkError> {
        self.0.push(record.clone());
        Ok(())
    }
}

/// Scan of [`BEAMS`] beams on a board whose supply dips at the given firings.
fn scan(dips_at: &[usize]) -> (ScanSummary, Vec<Record>) {
    let pty = Pty::open(None).expect("a pty");
    let port = pty.path().display().to_string();
    let stop = Arc::new(AtomicBool::new(false));
    let (stopped, dips_at) = (Arc::clone(&stop), dips_at.to_vec());
    let board = std::thread::spawn(move || {
        let mut emulator =
            Emulator::new(&elf(), &config(), Box::new(scripted(&[5 * MS]))).expect("a firmware");
        let mut fired = 0;
        let mut dips = dips_at.iter().copied().peekable();
        serve(&mut emulator, &pty, &stopped, |emulator| {
            fired += emulator.take_init_rises().len();
            if dips.next_if(|at| *at <= fired).is_some() {
                emulator.dip(20);
            }
        })
        .expect("serves");
    });
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let result = runtime.expect("a runtime").block_on(record_scan(&port));
    stop.store(true, Ordering::Relaxed);
    board.join().expect("the board runs to its end");
    result
}

async fn record_scan(port: &str) -> (ScanSummary, Vec<Record>) {
    let line = link::open(port).expect("opens");
    let config = HostConfig { max_attempts: 7, ..HostConfig::new(link::BAUD, 1) };
    let mut ranger = Ranger::identify(Driver::new(line, config)).await.expect("answers");
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
    let mut records = Records::default();
    let summary = ranger.scan(&job, &mut records, std::future::pending()).await.expect("scans");
    (summary, records.0)
}

#[test]
fn dip_loses_no_beam() {
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
    assert_eq!(summary.end.home_drift_steps, Some(0), "homed after each restart");
}

#[test]
fn no_events_without_dip() {
    let (summary, records) = scan(&[]);
    assert_eq!((summary.restarts, summary.end.beams), (0, BEAMS));
    assert!(!records.iter().any(|record| matches!(record, Record::Event(_))));
}
