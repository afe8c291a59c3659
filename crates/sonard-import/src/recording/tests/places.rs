//! Frames, clocks and limits of recordings by other programs.

use super::*;

/// A transform by position and roll, pitch and yaw, degrees.
fn placed(time_s: f64, parent: &str, child: &str, at: [f64; 3], turned_deg: [f64; 3]) -> Transform {
    let [roll, pitch, yaw] = turned_deg.map(f64::to_radians);
    let turn = glam::DQuat::from_euler(glam::EulerRot::ZYX, yaw, pitch, roll);
    let [x, y, z] = at;
    Transform(header(time_s, parent), child.to_owned(), [x, y, z, turn.x, turn.y, turn.z, turn.w])
}

fn scan(time_s: f64, ranges_m: Vec<f32>) -> LaserScan {
    let step_rad = std::f32::consts::TAU / ranges_m.len() as f32;
    LaserScan(
        header(time_s, "laser"),
        [0.0, 6.0, step_rad, 0.0, 0.0, 0.1, 10.0],
        ranges_m,
        Vec::new(),
    )
}

/// Recording of a scanner mounted with this rotation, with one range of 1 m to its left.
fn mounted(turned_deg: [f64; 3]) -> Vec<u8> {
    let mount = vec![placed(0.0, "base_link", "laser", [0.1, 0.0, 0.2], turned_deg)];
    let ranges =
        (0..36).map(|beam| if beam == 9 { 1.0 } else { 3.0 + beam as f32 / 100.0 }).collect();
    Bag::new(Order::Little)
        .add("/tf_static", TRANSFORMS, 1.0, &mount)
        .add("/scan", LASER_SCAN, 2.0, &scan(2.0, ranges))
        .bytes()
}

/// Azimuth of the reading of 1 m.
fn near_deg(bytes: &[u8]) -> f64 {
    let scans = scans(bytes, Mapping::default()).expect("a recording");
    let near = scans[0].1.iter().find(|ping| ping.range_m == Some(1.0)).expect("the near one");
    near.azimuth_deg
}

#[test]
fn directions_follow_frame_rotation() {
    for (turned_deg, direction_deg) in [
        ([0.0, 0.0, 0.0], 90.0),
        ([180.0, 0.0, 0.0], 270.0),
        ([0.0, 180.0, 0.0], 90.0),
        ([180.0, 0.0, 90.0], 0.0),
        ([0.0, 0.0, 20.0], 110.0),
        ([1.5, 1.5, 0.0], 90.0),
    ] {
        let found = near_deg(&mounted(turned_deg));
        let off = wrap(found - direction_deg);
        assert!(off.abs() < 0.1, "{turned_deg:?}: {found}");
    }
}

fn wrap(deg: f64) -> f64 {
    sonard_model::geometry::wrap_180(deg)
}

#[test]
fn mirrors_upside_down_parent() {
    let mounts = vec![
        placed(0.0, "base_link", "plate", [0.0; 3], [180.0, 0.0, 0.0]),
        placed(0.0, "plate", "laser", [0.0; 3], [0.0, 0.0, 30.0]),
    ];
    let ranges =
        (0..36).map(|beam| if beam == 9 { 1.0 } else { 3.0 + beam as f32 / 100.0 }).collect();
    let bag = Bag::new(Order::Little).add("/tf_static", TRANSFORMS, 1.0, &mounts).add(
        "/scan",
        LASER_SCAN,
        2.0,
        &scan(2.0, ranges),
    );
    assert!(wrap(near_deg(&bag.bytes()) - 240.0).abs() < 0.1);
}

#[test]
fn rejects_tilted_planes_and_beams() {
    let bytes = mounted([0.0, 30.0, 0.0]);
    let message = error_text(examine(&bytes, Mapping::default()));
    assert!(
        message.contains("/scan")
            && message.contains("30.0 degrees")
            && message.contains("--no-unit-check"),
        "{message}"
    );
    let open = || -> io::Result<Box<dyn io::Read>> { Ok(Box::new(Cursor::new(bytes.clone()))) };
    let unchecked = Assumptions { skip_checks: true, ..assumptions() };
    ImportSource { open: &open }.examine(Mapping::default(), unchecked).expect("unchecked");
    let down = vec![placed(0.0, "base_link", "cliff", [0.0; 3], [0.0, 90.0, 0.0])];
    let bag = Bag::new(Order::Little)
        .add("/tf_static", TRANSFORMS, 1.0, &down)
        .range("/cliff", 2.0, "cliff", 1.0);
    assert!(
        error_text(examine(&bag.bytes(), Mapping::default())).contains("beam inclined by 90.0")
    );
}

#[test]
fn notes_mount_without_transform() {
    let bag = Bag::new(Order::Little).moves(1.0, [1.0, 2.0, 0.0]).moves(2.0, [2.0, 2.0, 0.0]);
    let bytes = bag.range("/sonar", 1.5, "sonar", 1.0).bytes();
    let found = examine(&bytes, Mapping::default()).expect("a recording");
    assert!(
        found.has_poses && found.notes.join(" ").contains("frame `sonar`"),
        "{:?}",
        found.notes
    );
    let scans = scans(&bytes, Mapping::default()).expect("a recording");
    assert_eq!(scans[0].0.pose, Pose { x_m: 1.5, y_m: 2.0, heading_deg: 0.0 });
}

#[test]
fn sorts_messages_by_stamp() {
    let messages = |order: fn(&mut Vec<(f64, bool)>)| {
        let mut times: Vec<(f64, bool)> = (0..10)
            .flat_map(|at| [(1.0 + 0.1 * f64::from(at), false), (1.05 + 0.1 * f64::from(at), true)])
            .collect();
        order(&mut times);
        let mut bag = Bag::new(Order::Little).mounts("base_link", "a", [0.1, 0.0, 0.0]).mounts(
            "base_link",
            "b",
            [0.1, 0.0, 90.0],
        );
        for (time_s, is_second) in times {
            let (topic, frame) = if is_second { ("/b", "b") } else { ("/a", "a") };
            bag = bag.range(topic, time_s, frame, 1.0 + time_s as f32);
        }
        bag.bytes()
    };
    let readings = |bytes: &[u8]| {
        let scans = scans(bytes, Mapping::default()).expect("a recording");
        scans
            .into_iter()
            .map(|(_, pings)| {
                pings.iter().map(|ping| (ping.time, ping.range_m)).collect::<Vec<_>>()
            })
            .collect::<Vec<_>>()
    };
    let expected = readings(&messages(|_| {}));
    assert_eq!(expected.len(), 10);
    let by_topic = messages(|times| times.sort_by_key(|(_, is_second)| *is_second));
    let shuffled =
        messages(|times| times.sort_by_key(|(time_s, _)| (time_s * 1e3) as u64 * 7919 % 101));
    assert_eq!(readings(&by_topic), expected);
    assert_eq!(readings(&shuffled), expected);
    let found = examine(&by_topic, Mapping::default()).expect("a recording");
    assert!(found.notes.join(" ").contains("order"), "{:?}", found.notes);
}

/// Transforms of wheels are skipped, and those of a resting frame are merged.
#[test]
fn skips_unneeded_frames() {
    let wheels: Vec<Transform> =
        (0..1000).map(|at| transform(1.0, "base_link", &format!("wheel_{at}"), [0.0; 3])).collect();
    let mut bag = driving(Order::Little);
    for _ in 0..50 {
        bag = bag.add("/tf", TRANSFORMS, 1.0, &wheels);
    }
    // One position is NaN, and the frame has two parents.
    let odd = vec![transform(1.0, "axle", "wheel_1", [f64::NAN, 0.0, 0.0])];
    let found = examine(&bag.add("/tf", TRANSFORMS, 1.0, &odd).bytes(), Mapping::default());
    assert_eq!(found.expect("the wheels do not matter").readings, 3);
}

#[test]
fn notes_zeros_and_invalid_limits() {
    let mount = || Bag::new(Order::Little).mounts("base_link", "sonar", [0.0; 3]);
    let ranger = |limits: [f32; 2], ranges: &[f32]| {
        let mut bag = mount();
        for (at, range) in ranges.iter().enumerate() {
            let time_s = 1.0 + at as f64;
            let message = Range(header(time_s, "sonar"), 0, [0.2, limits[0], limits[1], *range]);
            bag = bag.add("/sonar", RANGE, time_s, &message);
        }
        bag.bytes()
    };
    for (limits, ranges, echoes, note) in [
        ([0.02, 4.0], &[0.0, 1.0, 1.1][..], 2, "1 of 3 ranges are 0"),
        ([0.0, 0.0], &[1.0, 1.1, 1.2], 3, "without limits"),
        ([0.5, 0.5], &[f32::NEG_INFINITY, f32::INFINITY], 0, "fixed-distance"),
    ] {
        let found = examine(&ranger(limits, ranges), Mapping::default()).expect(note);
        assert_eq!(found.echoes, echoes, "{note}");
        assert!(found.notes.join("\n").contains(note), "{:?}", found.notes);
    }
    let none = Mapping { none: vec![1.1], ..Mapping::default() };
    assert_eq!(examine(&ranger([0.02, 4.0], &[1.0, 1.1, 1.2]), none).expect("given").echoes, 2);
    let far =
        error_text(examine(&ranger([2.0, 400.0], &[123.0, 124.0, 125.0]), Mapping::default()));
    assert!(far.contains("--range-unit cm"), "{far}");
    let cm = Mapping { range_unit: Some(crate::RangeUnit::Cm), ..Mapping::default() };
    assert_eq!(
        examine(&ranger([2.0, 400.0], &[123.0, 124.0, 125.0]), cm).expect("given").echoes,
        3
    );
    let beyond = error_text(examine(
        &ranger([0.02, 4.0], &[12_300.0, 12_301.0, 12_302.0]),
        Mapping::default(),
    ));
    assert!(beyond.contains("beyond max_range"), "{beyond}");
}

#[test]
fn shifts_board_stamps() {
    let mut bag = Bag::new(Order::Little).mounts("base_link", "sonar", [0.0; 3]);
    for at in 0..4 {
        let message = range(12.0 + f64::from(at), "sonar", 1.0 + at as f32 / 10.0);
        bag = bag.add("/sonar", RANGE, 1_760_000_000.0 + f64::from(at), &message);
    }
    let bytes = bag.bytes();
    let found = examine(&bytes, Mapping::default()).expect("a recording");
    assert!(found.notes.join(" ").contains("start of a board"), "{:?}", found.notes);
    let scans = scans(&bytes, Mapping::default()).expect("a recording");
    let seconds: Vec<_> = scans.iter().map(|(start, _)| start.time.as_second()).collect();
    assert_eq!(seconds, [1_760_000_000, 1_760_000_001, 1_760_000_002, 1_760_000_003]);
}

#[test]
fn sweeps_end_on_reversal() {
    let mut bag = Bag::new(Order::Little);
    let there = (0..=6).map(|at| 30.0 * f64::from(at));
    let directions: Vec<f64> = there
        .clone()
        .chain((0..6).rev().map(|at| 30.0 * f64::from(at)))
        .chain(there.skip(1))
        .collect();
    for (at, azimuth_deg) in directions.into_iter().enumerate() {
        let time_s = 10.0 + at as f64;
        let turned = vec![transform(time_s, "base_link", "sonar", [0.0, 0.0, azimuth_deg])];
        bag = bag.add("/tf", TRANSFORMS, time_s, &turned).range(
            "/sonar",
            time_s,
            "sonar",
            1.0 + at as f32 / 100.0,
        );
    }
    let scans = scans(&bag.bytes(), Mapping::default()).expect("a recording");
    assert_eq!(scans.iter().map(|(_, pings)| pings.len()).collect::<Vec<_>>(), [7, 6, 6]);
}

#[test]
fn rejects_several_robots() {
    let mut bag = Bag::new(Order::Little);
    for robot in ["r1", "r2"] {
        let [base, sonar] = ["base_link", "sonar"].map(|name| format!("{robot}/{name}"));
        bag = bag.mounts(&base, &sonar, [0.1, 0.0, 0.0]);
        for at in 0..3 {
            let time_s = 1_700_000_000.0 + f64::from(at);
            let moved = transform(time_s, "map", &base, [f64::from(at), 0.0, 0.0]);
            bag = bag.add("/tf", super::TRANSFORMS, time_s, &[moved].to_vec());
            bag = bag.range(&format!("/{robot}/sonar"), time_s, &sonar, 1.0);
        }
    }
    let bytes = bag.bytes();
    let message = error_text(examine(&bytes, Mapping::default()));
    assert!(
        message.contains("several robots") && message.contains("--topic /r2/sonar"),
        "{message}"
    );
    let topics = vec!["/r2/sonar".to_owned()];
    let scans = scans(&bytes, Mapping { topics, ..Mapping::default() }).expect("one robot");
    let places: Vec<f64> = scans.iter().map(|(start, _)| start.pose.x_m).collect();
    assert_eq!(places, [0.0, 1.0, 2.0]);
}

#[test]
fn rejects_wrong_message_units() {
    let scan = LaserScan(
        header(1_700_000_000.0, "laser"),
        [-90.0, 90.0, 90.0, 0.0, 0.0, 0.1, 10.0],
        vec![1.0, 1.1, 1.2],
        Vec::new(),
    );
    let bytes = Bag::new(Order::Little).add("/scan", LASER_SCAN, 1_700_000_000.0, &scan).bytes();
    let message = error_text(examine(&bytes, Mapping::default()));
    assert!(message.contains("looks like degrees"), "{message}");
    let near = (0..5).fold(Bag::new(Order::Little), |bag, at| {
        bag.range("/sonar", 1_700_000_000.0 + f64::from(at), "sonar", 0.012)
    });
    let message = error_text(examine(&near.bytes(), Mapping::default()));
    assert!(message.contains("at or below min_range"), "{message}");
}
