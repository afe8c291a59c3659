//! Phenomena of the paper: the false lower wall, the minimum range, corners, a corridor.

use super::*;
use crate::{
    model::{Mechanism, Prediction},
    reading::PingStatus,
    scan_plan::ScanPlan,
};

fn scan(scene_name: &str, pose_name: &str, step_deg: f64) -> (Simulator, Vec<(f64, Prediction)>) {
    let scene = shipped_scene(scene_name);
    let pose = pose(&scene, pose_name);
    let plan = ScanPlan { step_deg, ..ScanPlan::default() };
    let simulator = simulator(scene, Options::default());
    let predictions = simulator.predict(&pose, &plan).expect("few paths");
    let readings = (0..).map(|stop| plan.azimuth_deg(stop)).zip(predictions).collect::<Vec<_>>();
    (simulator, readings)
}

fn echo_m(readings: &[(f64, Prediction)], azimuth_deg: f64) -> Option<f64> {
    let (_, prediction) = readings.iter().find(|(at, _)| (at - azimuth_deg).abs() < 1e-6)?;
    prediction.range_m.filter(|_| prediction.status == PingStatus::Echo)
}

/// Half an echo's path, compared with its range: a weak echo is late, one that only grazes the
/// threshold by the whole rise of the pulse (five standard deviations of 22.7 us, 20 mm), and none
/// is early by more than the contribution of others that begin with it.
fn near_path(prediction: &Prediction) -> f64 {
    let range_m = prediction.range_m.expect("a range");
    let path_m = prediction.arrival.as_ref().expect("an echo").length_m / 2.0;
    assert!((-1e-3..20e-3).contains(&(range_m - path_m)), "{range_m} for {path_m}");
    path_m
}

fn at(readings: &[(f64, Prediction)], azimuth_deg: f64) -> &Prediction {
    let reading = readings.iter().find(|(at, _)| (at - azimuth_deg).abs() < 1e-6);
    &reading.expect("a reading").1
}

fn walls_of(simulator: &Simulator, prediction: &Prediction) -> Vec<String> {
    prediction.arrival.as_ref().map_or_else(Vec::new, |arrival| names(simulator, arrival))
}

fn names(simulator: &Simulator, arrival: &Arrival) -> Vec<String> {
    arrival.path.mechanisms().map(|mechanism| mechanism.name(simulator.scene())).collect()
}

fn length_m(prediction: &Prediction) -> f64 {
    prediction.arrival.as_ref().expect("an arrival").length_m
}

/// A peak of an echo trace: half its path (metres), height, walls.
type SeenPeak = (f64, f64, Vec<String>);

/// Echo traces of the set-ups of figure 1, facing straight ahead.
fn trace(set_up: &str) -> (Vec<SeenPeak>, Prediction) {
    let scene = shipped_scene("echo-traces");
    let pose = pose(&scene, set_up);
    let simulator = simulator(scene, Options::default());
    let point = simulator.at(pose.position());
    let direction_rad = pose.direction_rad(0.0);
    let trace = point.trace(direction_rad, 5.0, 2.0).expect("few paths");
    let peaks = trace.peaks.iter().map(|peak| {
        let arrival = point.arrival(direction_rad, &peak.arrival).expect("few paths");
        (arrival.length_m / 2.0, peak.peak.0, names(&simulator, &arrival))
    });
    (peaks.collect(), point.ping_rearmed(direction_rad).expect("few paths"))
}

fn strongest(peaks: &[SeenPeak]) -> &SeenPeak {
    peaks.iter().max_by(|first, second| first.1.total_cmp(&second.1)).expect("a peak")
}

/// Figure 2 (a): only the transmission.
#[test]
fn empty_environment() {
    let (peaks, prediction) = trace("a");
    assert!(peaks.is_empty(), "{peaks:?}");
    assert_eq!((prediction.status, prediction.arrival), (PingStatus::NoEcho, None));
}

/// Figure 2 (b): one clean echo from a slightly turned plate.
#[test]
fn turned_plate() {
    let (peaks, prediction) = trace("b");
    close(near_path(&prediction), 0.6 * 5f64.to_radians().cos(), 1e-3, "the plate");
    let (_, highest, walls) = strongest(&peaks);
    assert_eq!(walls, &["b-plate"]);
    let others = peaks.iter().filter(|peak| peak.2 != ["b-plate"]).map(|peak| peak.1);
    assert!(others.fold(0.0, f64::max) < 0.05 * highest, "{peaks:?}");
    assert_eq!(prediction.echoes_us.len(), 1);
}

/// Figure 2 (d): the strongest echo goes by the plate to the far object and back, and a weak early
/// one comes straight from the plate.
#[test]
fn plate_at_45_degrees() {
    let (peaks, prediction) = trace("d");
    close(near_path(&prediction), 1.8, 1e-3, "plate and far object");
    let (_, highest, walls) = strongest(&peaks);
    assert_eq!(walls, &["d-plate", "d-far-object", "d-plate"]);
    let early = peaks.iter().find(|peak| peak.0 < 0.9).expect("the plate's own echo");
    assert!(
        early.2 == ["d-plate.b"] && early.1 < 0.05 * highest,
        "an edge of the plate: {early:?}"
    );
}

/// Figure 4: the wall near its perpendicular only, long readings beyond the critical angle, and an
/// arc by the blackboard's protruding edge.
#[test]
fn laboratory() {
    let (simulator, readings) = scan("mcgill-lab", "fig4", 5.0);
    for azimuth_deg in [85.0, 90.0, 95.0] {
        close(near_path(at(&readings, azimuth_deg)), 0.95, 1e-3, "the near wall");
    }
    for azimuth_deg in [60.0, 65.0, 70.0, 75.0, 105.0, 110.0, 115.0, 120.0, 125.0, 130.0] {
        let wall_m = 0.95 / (azimuth_deg - 90.0_f64).to_radians().cos();
        let range_m = at(&readings, azimuth_deg).range_m;
        assert!(range_m.is_none_or(|range_m| range_m > 2.0 * wall_m), "{azimuth_deg}: {range_m:?}");
    }
    // The edge and the adjacent wall form a corner 20 mm deep that reflects everything back.
    let corner_m = DVec2::new(2.207 - 3.477, 0.95).length();
    for azimuth_deg in [140.0, 145.0] {
        let prediction = at(&readings, azimuth_deg);
        close(near_path(prediction), corner_m, 2e-3, "the protruding edge");
        assert_eq!(walls_of(&simulator, prediction), ["north", "blackboard.0"]);
        assert!(prediction.margin_db.expect("a margin") > 15.0);
    }
}

/// Figure 10: two arcs that do not join, the lower wall's behind the upper one.
#[test]
fn oblique_corner() {
    let (simulator, readings) = scan("oblique-corner", "robot", 3.0);
    let seen = |wall: &str| {
        readings
            .iter()
            .filter(|(_, prediction)| prediction.status == PingStatus::Echo)
            .filter(|(_, prediction)| walls_of(&simulator, prediction) == [wall])
            .map(|(azimuth_deg, prediction)| (*azimuth_deg, near_path(prediction)))
            .collect::<Vec<_>>()
    };
    let (upper, lower) = (seen("upper"), seen("lower"));
    let end = upper.iter().map(|seen| seen.0).fold(0.0, f64::max);
    let start = lower.iter().map(|seen| seen.0).fold(360.0, f64::min);
    assert!(start - end > 20.0, "a hole from {end} to {start}");
    let mut between = readings.iter().filter(|(at, _)| (end + 1.0..start - 1.0).contains(at));
    assert!(between.all(|(_, prediction)| prediction.status == PingStatus::NoEcho));
    // In the direction of the lower arc's beginning the upper wall is located, and nearer.
    let (azimuth_deg, range_m) = lower[0];
    let direction = DVec2::from_angle(azimuth_deg.to_radians());
    let (a, b) = (DVec2::new(-0.5993, 0.562), DVec2::new(-0.6374, -0.6374));
    let upper_m = (b - a).perp_dot(a) / (b - a).perp_dot(direction);
    assert!(range_m > upper_m + 0.03, "{range_m} behind {upper_m}");
}

/// Figure 6: readings of one bounce, and between them readings of several.
#[test]
fn single_and_multiple_bounces() {
    let (simulator, readings) = scan("two-surface-room", "middle", 3.0);
    for (azimuth_deg, wall, range_m) in
        [(0.0, "east", 2.4), (90.0, "north", 2.0), (180.0, "west", 1.2), (270.0, "south", 1.0)]
    {
        let prediction = at(&readings, azimuth_deg);
        assert_eq!(walls_of(&simulator, prediction), [wall]);
        close(near_path(prediction), range_m, 1e-6, wall);
    }
    let orders = readings.iter().map(|(_, p)| walls_of(&simulator, p).len());
    let several = orders.filter(|order| *order > 1).count();
    assert!(several > readings.len() / 3, "{several} of {}", readings.len());
    // The concave corners appear at their vertices.
    let vertex = DVec2::new(-1.2, 2.0);
    let azimuth_deg = 3.0 * (vertex.to_angle().to_degrees() / 3.0).round();
    close(near_path(at(&readings, azimuth_deg)), vertex.length(), 1e-6, "the corner");
}

/// Figure 9: sound from the near wall passes the ranger, and the wall appears 827 mm away.
#[test]
fn false_lower_wall_at_827_mm() {
    let (simulator, readings) = scan("simple-room", "fig9", 0.9);
    for azimuth_deg in [262.8, 266.4, 270.0, 273.6, 277.2] {
        let range_m = echo_m(&readings, azimuth_deg).expect("an echo");
        close(range_m, 0.827, 0.01, &format!("range at {azimuth_deg}"));
    }
    let (_, straight) = readings.iter().find(|(at, _)| *at == 270.0).expect("a reading");
    assert_eq!(walls_of(&simulator, straight), ["south", "north", "south"]);
    close(length_m(straight), 1.654, 1e-6, "length");
    // The apparent corridor is twice as wide as the room is deep.
    let upper_m = echo_m(&readings, 90.0).expect("the upper wall");
    close(upper_m + 0.827, 2.0 * 0.742, 1e-3, "width");
}

/// Figure 7: the top wall's echo (794 mm of path) still arrives when the receiver opens.
#[test]
fn top_wall_is_minimum_range() {
    let (simulator, readings) = scan("simple-room", "fig7", 0.9);
    let (_, up) = readings.iter().find(|(at, _)| *at == 90.0).expect("a reading");
    assert_eq!(up.status, PingStatus::MinRange);
    let speed_m_s = simulator.sound_speed_m_s();
    close(up.range_m.expect("a range"), speed_m_s * 2.38e-3 / 2.0, 1e-9, "minimum range");
    assert_eq!(walls_of(&simulator, up), ["north"]);
    close(length_m(up), 0.794, 1e-6, "length");
    let circle = readings.iter().filter(|(_, p)| p.status == PingStatus::MinRange).count();
    assert!((10..200).contains(&circle), "{circle}");
    close(near_path(at(&readings, 180.0)), 0.834, 1e-6, "far wall");
}

/// Figure 7, on the right: the wall is 94 mm away and all its own echoes are over before the
/// receiver opens. But the sound is reflected repeatedly between wall and face, and the fourth
/// round is still arriving. The paper's model, whose ranger is transparent, had no echo here.
#[test]
fn near_wall_is_minimum_range() {
    let (simulator, readings) = scan("simple-room", "fig7", 0.9);
    let (_, right) = readings.iter().find(|(at, _)| *at == 0.0).expect("a reading");
    assert_eq!(right.status, PingStatus::MinRange);
    let reflections = ["east", "transducer"].repeat(4);
    assert_eq!(walls_of(&simulator, right), reflections[..7]);
    close(length_m(right), 8.0 * 0.094, 1e-9, "length");
    let near: Vec<f64> = readings
        .iter()
        .filter(|(at, p)| (*at < 90.0 || *at > 270.0) && p.status == PingStatus::MinRange)
        .filter(|(_, p)| p.arrival.as_ref().is_some_and(|a| a.length_m > 0.75))
        .map(|(at, _)| *at)
        .collect();
    assert!(near.len() >= 3, "{near:?}");
}

/// Figure 9 with a robot's body behind the ranger: the body blocks the sound that passed the
/// ranger, and sound reflected repeatedly between body and wall still arrives when the receiver
/// opens. Instead of the false lower wall, the minimum range is read.
#[test]
fn body_removes_the_false_wall() {
    let scene = shipped_scene("simple-room-robot");
    let pose = pose(&scene, "fig9");
    let plan = ScanPlan::default();
    let scene = scene.with_robot_at(&pose);
    let read = |engine: EngineKind| {
        let options = Options { max_range_m: Some(2.0), ..engine.options().into() };
        simulator(scene.clone(), options).predict(&pose, &plan).expect("few paths")
    };
    let (paths, fan) = (read(EngineKind::Paths), read(EngineKind::Fan));
    for readings in [&paths, &fan] {
        let ahead = &readings[0];
        assert_eq!(ahead.status, PingStatus::MinRange, "{ahead:?}");
        let path = &ahead.arrival.as_ref().expect("what sounded").path;
        let at_body =
            path.reflectors().filter(|mechanism| *mechanism == Reflector::Cylinder(0)).count();
        assert!(
            at_body >= 2 || path.mechanisms().any(|mechanism| mechanism == Mechanism::Transducer),
            "{path:?}"
        );
    }
    // Also facing the body, from which the repeated reflections in front of it are received as
    // well.
    let is_near = |reading: &&Prediction| reading.status == PingStatus::MinRange;
    let behind = &paths[100..300];
    assert!(behind.iter().filter(is_near).count() > 40);
    // All such readings of the fan are also those of the exact paths. With interference, arrivals
    // that are below the threshold individually are detected, too: over half as many directions
    // again.
    let both = paths.iter().zip(&fan).filter(|(one, other)| is_near(one) && is_near(other)).count();
    let (more, fewer) = (paths.iter().filter(is_near).count(), fan.iter().filter(is_near).count());
    assert!(fewer > 90 && both * 50 >= fewer * 49, "{both} of {fewer}");
    assert!(more * 2 < fewer * 3, "{more} and {fewer}");
}

/// A post that is too thin and far away to be detected still explains a missing echo.
#[test]
fn weak_post_explains_no_echo() {
    let mut post = scene(Vec::new());
    post.cylinders = vec![cylinder((5.0, 0.0), 0.01)];
    let simulator = simulator(post, Options::default());
    let silence = simulator.at(DVec2::ZERO).ping(0.0).expect("few paths");
    assert_eq!(silence.status, PingStatus::NoEcho);
    let candidate = silence.arrival.expect("a candidate");
    let diffractors: Vec<Diffractor> = candidate.path.diffractors().collect();
    assert_eq!(diffractors, [Diffractor::Post { cylinder: 0 }]);
    let lacks_db = silence.margin_db.expect("what it lacked");
    // sqrt(r / (r + d)) of a wall's echo, 10 m of air at 1.641 dB/m, and a threshold of -35.1 dB.
    let expected_db = 10.0 * (0.01_f64 / 5.0).log10() - 9.98 * 1.641 + 35.1;
    assert!((lacks_db - expected_db).abs() < 4.0, "{lacks_db} instead of {expected_db}");
}

/// Figure 1 (c): a plate parallel to the transducer returns more than one echo.
#[test]
fn plate_returns_an_echo_train() {
    let scene = shipped_scene("echo-traces");
    let pose = pose(&scene, "c");
    let simulator = simulator(scene, Options::default());
    let direction_rad = pose.direction_rad(0.0);
    let arrivals = simulator.at(pose.position()).arrivals(direction_rad).expect("few paths");
    let multiple: Vec<f64> = of_kind(&arrivals, PathKind::Specular).map(|a| a.length_m).collect();
    for (echo, round) in multiple.iter().zip(1..) {
        close(*echo, 1.2 * f64::from(round), 1e-9, "round");
    }
    assert!(multiple.len() >= 2, "{multiple:?}");
    assert!(
        simulator
            .at(pose.position())
            .ping_rearmed(direction_rad)
            .expect("few paths")
            .echoes_us
            .len()
            >= 2
    );
}

/// Figure 12: an arc around the corner's vertex, and a hole on each side of it.
#[test]
fn right_angled_corner_is_an_arc() {
    let (_, readings) = scan("right-angle-corner", "robot", 0.9);
    let vertex = DVec2::new(-0.8, -0.65);
    let bearing_deg = vertex.to_angle().to_degrees() + 360.0;
    let near =
        |deg: f64, within: f64| readings.iter().filter(move |(at, _)| (at - deg).abs() < within);
    for (at, prediction) in near(bearing_deg, 7.0) {
        assert_eq!(prediction.status, PingStatus::Echo, "{at}");
        close(near_path(prediction), vertex.length(), 1e-6, "arc");
    }
    for wall_deg in [180.0, 270.0] {
        let hole_deg = (wall_deg + bearing_deg) / 2.0;
        for (at, prediction) in near(hole_deg, 4.0) {
            assert_eq!(prediction.status, PingStatus::NoEcho, "{at}: {prediction:?}");
            assert!(prediction.margin_db.is_none_or(|margin_db| margin_db < 0.0), "{at}");
        }
    }
    close(near_path(at(&readings, 180.0)), 0.8, 1e-6, "west wall");
    close(near_path(at(&readings, 270.0)), 0.65, 1e-6, "south wall");
}

/// A corridor, the ranger near one wall: side walls are right at the perpendicular, missing echoes
/// or phantoms ahead and behind, never the wall on the beam axis.
#[test]
fn corridor() {
    let (_, readings) = scan("corridor", "beside-wall", 0.9);
    close(near_path(at(&readings, 90.0)), 1.3, 1e-6, "north wall");
    close(near_path(at(&readings, 270.0)), 0.5, 1e-6, "south wall");
    let slanting = readings.iter().filter(|(at, _)| (205.0..240.0).contains(at));
    let mut wrong = 0;
    for (at, prediction) in slanting {
        let wall_m = 0.5 / (at - 270.0_f64).to_radians().cos();
        if prediction.range_m.is_none_or(|range_m| (range_m - wall_m).abs() > 0.05) {
            wrong += 1;
        }
    }
    assert!(wrong > 30, "{wrong}");
}
