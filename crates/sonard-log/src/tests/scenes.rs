//! Scene texts in a log or in its folder.

use std::{fs, path::Path, sync::Arc, time::Duration};

use jiff::Timestamp;
use sonard_model::scene::{Scene, shipped};
use sonard_records::{Record, ScanView, SceneRef, Session};
use uuid::Uuid;

use super::{folder, records};
use crate::{
    LogFolder, LogIndex, LogWriter, MAX_LOGGED_SCENE_BYTES, Rotation, SceneUnavailable, load,
    log_files, logged_scene,
};

fn simple_room() -> Scene {
    Scene::from_json(shipped::text("simple-room").expect("shipped")).expect("right")
}

/// Room whose text is too long for a record because of trailing blanks.
fn long_room() -> Scene {
    let text = shipped::text("simple-room").expect("shipped");
    Scene::from_json(&(text.to_owned() + &" ".repeat(MAX_LOGGED_SCENE_BYTES))).expect("right")
}

/// Records of the fixture in `scene`, with scan number `n`.
fn scan_in(scene: &Scene, n: u128) -> Vec<Record> {
    let mut records = records();
    for record in &mut records {
        match record {
            Record::Session(session) => {
                session.scene = Some(SceneRef::from_scene(scene));
                session.scene_text = Some(Arc::clone(&scene.text));
            }
            Record::ScanStart(start) => start.scan = Uuid::from_u128(n),
            Record::Ping(ping) => ping.scan = Uuid::from_u128(n),
            Record::ScanEnd(end) => end.scan = Uuid::from_u128(n),
            Record::Event(_) => {}
        }
    }
    records
}

fn sessions(log: &Path) -> Vec<Session> {
    let session = |record| match record {
        Record::Session(session) => Some(*session),
        _ => None,
    };
    load(log).expect("readable").records.into_iter().filter_map(session).collect()
}

#[test]
fn text_is_stored_once_per_scene() {
    let (_folder, log) = folder();
    let (room, other) = (simple_room(), shipped::text("corridor").expect("shipped"));
    let other = Scene::from_json(other).expect("right");
    let mut writer = LogWriter::open(&log).expect("opens");
    for (n, scene) in (1..).zip([&room, &room, &other, &room]) {
        scan_in(scene, n).iter().for_each(|record| writer.append(record).expect("room"));
    }
    drop(writer);
    let texts: Vec<bool> =
        sessions(&log).iter().map(|session| session.scene_text.is_some()).collect();
    assert_eq!(texts, [true, false, true, true]);
    let views = ScanView::from_records(load(&log).expect("readable").records);
    for (view, scene) in views.iter().zip([&room, &room, &other, &room]) {
        let session = view.session.as_ref().expect("there");
        assert_eq!(logged_scene(session, &log).expect("held").as_ref(), Some(scene));
    }
}

#[test]
fn long_text_is_stored_in_a_file() {
    let (folder, _) = folder();
    let folder = folder.path();
    let rotation =
        Rotation { max_bytes: 1, daily: false, keep_bytes: 0, sync_interval: Duration::ZERO };
    let scene = long_room();
    let now: Timestamp = "2026-11-22T10:00:00Z".parse().expect("a time");
    let mut log = LogFolder::open(folder, rotation, now).expect("opens");
    for n in 1..4 {
        scan_in(&scene, n).iter().for_each(|record| log.append(record, now).expect("room"));
    }
    drop(log);
    let logs = log_files(folder).expect("readable");
    assert!(logs.len() > 1 && logs.iter().all(|log| log.bytes < 100_000), "{logs:?}");
    let kept: Vec<_> = fs::read_dir(folder.join("scenes")).expect("made").collect();
    assert_eq!(kept.len(), 1);
    let kept = kept[0].as_ref().expect("readable").path();
    assert_eq!(fs::read_to_string(&kept).expect("text"), *scene.text);
    for log in &logs {
        let log = folder.join(&log.name);
        for session in sessions(&log) {
            assert_eq!(logged_scene(&session, &log).expect("held").as_ref(), Some(&scene));
        }
    }
    let first = folder.join(&logs[0].name);
    let session = &sessions(&first)[0];
    fs::write(&kept, "{}").expect("writable");
    assert!(matches!(logged_scene(session, &first), Err(SceneUnavailable::Changed(_))));
    fs::remove_file(&kept).expect("there");
    assert!(matches!(logged_scene(session, &first), Err(SceneUnavailable::Missing(_))));
}

#[test]
fn history_finds_the_text() {
    let (folder, _) = folder();
    let log = folder.path().join("sonard-20261122T000000Z.jsonl");
    let scene = simple_room();
    let mut writer = LogWriter::open(&log).expect("opens");
    for n in 1..3 {
        scan_in(&scene, n).iter().for_each(|record| writer.append(record).expect("room"));
    }
    drop(writer);
    let mut history = LogIndex::new(folder.path().into());
    for n in 1..3 {
        let id = Uuid::from_u128(n);
        let passage = history.scan_span(id).expect("readable").expect("there");
        assert_eq!((passage.view.pings.len(), &passage.path), (0, &log));
        let session = passage.view.session.expect("there");
        assert_eq!(session.scene_text.as_deref(), Some(&*scene.text), "scan {n}");
    }
}

#[test]
fn rejects_a_different_text() {
    let (_folder, log) = folder();
    let Record::Session(mut session) = records().swap_remove(0) else { panic!("a session first") };
    session.scene = Some(SceneRef::from_scene(&simple_room()));
    session.scene_text = Some(shipped::text("corridor").expect("shipped").into());
    assert!(matches!(logged_scene(&session, &log), Err(SceneUnavailable::Changed(_))));
    session.scene_text = None;
    assert!(matches!(logged_scene(&session, &log), Err(SceneUnavailable::Missing(_))));
    session.scene = None;
    assert!(logged_scene(&session, &log).expect("none was given").is_none());
}
