//! Tests of the engine with a fake device and operator.

use std::{
    path::Path,
    sync::{Arc, Mutex},
    time::Duration,
};

use jiff::Timestamp;
use sonard_api::{AirOrder, config::ConfigLayers};
use sonard_log::LogWriter;
use sonard_model::{
    acoustics::Sensor,
    model::{Options, Simulator},
    scene::{Scene, shipped},
};
use sonard_records::{Device as DeviceRecord, Provenance, Record, ScanPlan, ScanView};
use sonard_runtime::interrupts::Interrupts;

use super::*;
use crate::{
    CollectionHistory, CollectionKeys, ConnectedDevice, Poses, RecordedScan, SavedSettings,
    ScanTask, read_journal,
};

/// Remote device whose readings are the model's; the first `lost` scans fail.
struct FakeDevice {
    scene: Arc<Scene>,
    taken: u32,
    /// Remaining scans to fail.
    lost: u32,
    restored: Arc<Mutex<u32>>,
}

impl ScanDevice for FakeDevice {
    fn is_local(&self) -> bool {
        false
    }

    fn prepare(&mut self, _: &CollectionPlan, _: &PreparedScan) -> Result<(), CollectError> {
        unreachable!("only for local devices")
    }

    fn resume(&mut self, _: Duration, _: Option<SavedSettings>) {}

    async fn connect(&mut self) -> Result<ConnectedDevice, CollectError> {
        let device = DeviceRecord {
            serial: "REMOTE".into(),
            firmware: "1".into(),
            protocol: 1,
            boot: "1".into(),
            tick_hz: 2_000_000,
            steps_per_revolution: 400,
        };
        Ok(ConnectedDevice { device, provenance: Provenance::Simulated })
    }

    fn move_to(&mut self, _: &PreparedScan) -> Result<(), CollectError> {
        unreachable!("only for local devices")
    }

    async fn settings_to_save(
        &self,
        _: Option<&AirOrder>,
    ) -> Result<Option<SavedSettings>, CollectError> {
        Ok(None)
    }

    async fn apply_settings(
        &mut self,
        _: Option<SavedSettings>,
        _: Option<&AirOrder>,
    ) -> Result<(), CollectError> {
        Ok(())
    }

    async fn restore_settings(&mut self) -> Result<bool, CollectError> {
        *self.restored.lock().expect("not poisoned") += 1;
        Ok(false)
    }

    async fn temperature_c(&self) -> Option<f64> {
        None
    }

    async fn record_scan(
        &mut self,
        order: ScanTask<'_>,
        beam: &(dyn Fn() + Sync),
    ) -> Result<RecordedScan, CollectError> {
        assert!(order.prepared.is_none(), "a remote device predicts by itself");
        let mut log = LogWriter::open(order.path)?;
        let (view, lost) = if self.lost > 0 {
            self.lost -= 1;
            (None, Some(CollectError::failed("no response", "wait")))
        } else {
            self.taken += 1;
            let view = simulate(&self.scene, &order);
            let mut session = view.session.as_deref().cloned().expect("a session");
            session.collection = Some(Box::new(order.collection));
            log.append(&Record::Session(Box::new(session)))?;
            log.append(&Record::ScanStart(view.start.clone().expect("a start")))?;
            for ping in &view.pings {
                log.append(&Record::Ping(Box::new(ping.clone())))?;
                beam();
            }
            log.append(&Record::ScanEnd(view.end.clone().expect("an end")))?;
            (Some(view), None)
        };
        log.close()?;
        Ok(RecordedScan {
            view,
            needs_reconnect: lost.is_some(),
            failure: lost,
            stopped: false,
            wall_s: 0.1,
        })
    }

    async fn close(self) {}
}

fn simulate(scene: &Scene, order: &ScanTask<'_>) -> ScanView {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    let scene = Arc::new(scene.with_robot_at(&order.pose));
    let simulator =
        Simulator::new(scene, sensor, Air::default(), Options::default()).expect("good options");
    ScanView::simulated(&simulator, Uuid::new_v4(), &order.pose, &order.plan, Timestamp::now())
        .expect("few paths")
}

/// Unattended observer that collects the messages.
#[derive(Default)]
struct FakeWatcher(Arc<Mutex<Vec<String>>>);

impl Observer for FakeWatcher {
    fn scan_started(&self, label: &str, _: u32, _: u32, _: f64) {
        self.message(label);
    }

    fn beam_recorded(&self) {}

    fn message(&self, line: &str) {
        self.0.lock().expect("not poisoned").push(line.to_owned());
    }

    fn scans_planned(&self, scans: u32, _: f64) {
        self.message(&format!("{scans} scans"));
    }

    fn measuring_paused(&self) {}

    async fn prompt(&mut self, _: &str) -> Option<String> {
        None
    }

    fn write_report(
        &self,
        _: &CollectionFolder,
        history: &CollectionHistory,
    ) -> Result<(), CollectError> {
        self.message(&format!("report of {} scans", history.accepted().count()));
        Ok(())
    }
}

fn plan(folder: &Path, extra_keys: &str) -> CollectionPlan {
    let text = format!(
        "[place]\nscene = \"simple-room\"\n[poses]\nlist = [\"fig7\", \"fig9\"]\n\
         [plan]\nto_deg = 18\nstep_deg = 1.8\n{extra_keys}"
    );
    let layers =
        ConfigLayers::<CollectionKeys>::new().with_file("plan.toml", &text).expect("valid");
    let keys = layers.clone().into_keys().expect("valid");
    let scene_text = shipped::text("simple-room").expect("shipped").to_owned();
    let scene = Arc::new(Scene::from_json(&scene_text).expect("a scene"));
    let poses = ["fig7", "fig9"].map(|name| NamedPose::parse(name, &scene).expect("a pose"));
    CollectionPlan {
        azimuths: ScanPlan { to_deg: 18.0, step_deg: 1.8, ..ScanPlan::default() },
        keys,
        text,
        folder: folder.into(),
        scene,
        scene_text,
        sensor: Sensor::preset("senscomp-6500").expect("a preset"),
        poses: Poses::Listed(poses.into()),
        steps_per_revolution: 400,
        layers,
        name: "plan.toml".into(),
    }
}

async fn run(
    folder: &Path,
    extra_keys: &str,
    lost: u32,
) -> (Result<(), CollectError>, Vec<String>) {
    let plan = plan(folder, extra_keys);
    let (restored, messages) = (Arc::default(), Arc::default());
    let device = FakeDevice {
        scene: Arc::clone(&plan.scene),
        taken: 0,
        lost,
        restored: Arc::clone(&restored),
    };
    let watcher = FakeWatcher(Arc::clone(&messages));
    let outcome = collect(plan, RunOptions::default(), device, watcher, Interrupts::listen()).await;
    let messages = messages.lock().expect("not poisoned").clone();
    if !messages.is_empty() {
        assert_eq!(*restored.lock().expect("not poisoned"), 1);
    }
    (outcome, messages)
}

#[tokio::test]
async fn takes_every_scan_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("collection");
    let twice = "[collection]\nrepeats = 2\n";
    let (outcome, messages) = run(&root, twice, 0).await;
    outcome.expect("complete");
    assert_eq!(messages.first().map(String::as_str), Some("4 scans"), "{messages:?}");
    assert!(messages.contains(&"report of 4 scans".to_owned()), "{messages:?}");
    let history = read_journal(&CollectionFolder::existing(&root).journal()).expect("readable");
    let taken: Vec<_> = history.accepted().map(|take| (take.slot.pose, take.slot.repeat)).collect();
    assert_eq!(taken, [(1, 1), (1, 2), (2, 1), (2, 2)]);
    assert_eq!(CollectionFolder::existing(&root).scans().expect("readable").len(), 4);
    // A second run has nothing to do, and a different plan is rejected.
    run(&root, twice, 0).await.0.expect("complete");
    let (other, _) = run(&root, "[collection]\nrepeats = 3\n", 0).await;
    assert!(
        matches!(&other, Err(CollectError::Invalid { message, .. }) if message.contains("repeats")),
        "{other:?}"
    );
}

#[tokio::test]
async fn retries_until_the_deadline() {
    let folder = tempfile::tempdir().expect("a folder");
    let (outcome, messages) = run(&folder.path().join("once"), "", 1).await;
    outcome.expect("complete");
    let retry = "repeating the scan in 1 s: no response";
    assert!(messages.iter().any(|line| line.contains(retry)), "{messages:?}");
    let (outcome, _) =
        run(&folder.path().join("never"), "[collection]\nretry_limit_s = 0\n", u32::MAX).await;
    assert!(matches!(&outcome, Err(CollectError::Failed { .. })), "{outcome:?}");
}
