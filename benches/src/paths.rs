//! The exact engine beside what it replaces, as ratios in one run: `cargo bench --bench paths`.

use std::{
    f64::consts::TAU,
    hint::black_box,
    sync::Arc,
    time::{Duration, Instant},
};

use parry2d_f64::{
    math::Vector,
    query::{Ray, RayCast},
    shape::Polyline,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use sonard::{
    acoustics::{Air, BeamPattern, Sensor},
    geometry::{DVec2, Pose},
    model::{
        Engine, Fan, FanOptions, FanSettings, Options, PathOptions, Prediction, Simulator,
        paths::{PathEngine, Paths},
    },
    scan::{PingStatus, ScanPlan},
    scene::{Material, Scene, Wall, shipped},
};

const FULL_SCAN: ScanPlan =
    ScanPlan { from_deg: 0.0, to_deg: 360.0, step_deg: 0.9, pings_per_stop: 1 };

fn main() {
    println!("{:72} {:>9}", "", "median, and best; ratios of the best");
    // `cargo bench --bench paths -- robot` runs what has `robot` in its name.
    let only: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    let parts: [(&str, fn()); 4] = [
        ("small_room", small_room),
        ("robot_room", robot_room),
        ("l_room", l_room),
        ("building_plans", building_plans),
    ];
    for (name, part) in parts {
        if only.is_empty() || only.iter().any(|word| name.contains(word.as_str())) {
            part();
        }
    }
}

fn simulator(scene: Arc<Scene>, options: Options) -> Simulator {
    let sensor = Sensor::preset("senscomp-6500").expect("a preset");
    Simulator::new(scene, sensor, Air::default(), options).expect("valid options")
}

/// A scan of 400 azimuths to 10.7 m in the paper's room.
fn small_room() {
    let text = shipped::text("simple-room").expect("a shipped scene");
    let scene = Arc::new(Scene::from_json(text).expect("a valid scene"));
    let pose = scene.poses["fig9"];
    let range = Options { max_range_m: Some(10.7), ..Options::default() };
    let paths = simulator(scene.clone(), range);
    println!("simple-room, fig9, 400 azimuths to 10.7 m");
    let exact = time(|| drop(black_box(paths.predict(&pose, &FULL_SCAN).expect("few paths"))));
    report("paths, the whole scan", exact, None);
    let engine = PathEngine::new(
        &scene,
        BeamPattern::new(paths.sensor(), paths.sound_speed_m_s()),
        None,
        paths.path_settings(),
    );
    let survey = time(|| drop(black_box(engine.arrivals_at(pose.position()).expect("few paths"))));
    report("paths, all echoes to 10.7 m", survey, None);
    let echoes =
        Paths::new(&scene, paths.path_settings()).enumerate(pose.position()).expect("few paths");
    let place = engine.arrivals_at(pose.position()).expect("few paths");
    let mut sounds = Vec::new();
    let mut received = 0;
    let listen = time(|| {
        received = 0;
        for i in 0..400 {
            place.collect_arrivals(f64::from(i) * TAU / 400.0, &mut sounds);
            received += sounds.len();
        }
    });
    report("paths, listening 400 times to all of them", listen, None);
    println!("  {} echo paths, {:.1} sounds a ping", echoes.len(), received as f64 / 400.0);
    fans(&scene, &paths, &pose, range, exact);
}

/// A scan by fans of rays.
fn fans(scene: &Arc<Scene>, paths: &Simulator, pose: &Pose, range: Options, exact: Time) {
    // The fan knows neither pulses nor the face: it is held to what is left of the same paths.
    let faceless = Sensor { face: None, ..paths.sensor().clone() };
    let with = |options| {
        let made = Simulator::new(scene.clone(), faceless.clone(), Air::default(), options);
        made.expect("valid options")
    };
    let ideal = with(Options {
        engine: PathOptions { ideal_receiver: true, ..PathOptions::default() }.into(),
        ..range
    });
    for ray_spacing_deg in [1.0, 0.1, 0.02] {
        let engine = FanOptions { ray_spacing_deg, ..FanOptions::default() }.into();
        let fan = with(Options { engine, ..range });
        let time = time(|| drop(black_box(fan.predict(pose, &FULL_SCAN).expect("few paths"))));
        let off = readings_off(&fan, &ideal, pose);
        report(
            &format!("fan at {ray_spacing_deg} degrees, {off} readings off by 1 mm"),
            time,
            Some(exact),
        );
    }
    let truth = ideal.predict(pose, &FULL_SCAN).expect("few paths");
    for spacing_deg in [1.0, 0.1] {
        let fan = PrintedFan::new(scene, paths, spacing_deg);
        let (off, echoes) = fan.readings_off(pose, &truth);
        let time = time(|| drop(black_box(fan.scan(pose))));
        let what = format!("as printed, at {spacing_deg} degrees, {off} of {echoes} echoes off");
        report(&what, time, Some(exact));
    }
}

/// The paper's appendix A as printed: rays over the whole circle for each direction, up to
/// the first detected one.
struct PrintedFan {
    fan: Fan,
    shortest_m: f64,
    threshold: f64,
}

impl PrintedFan {
    fn new(scene: &Scene, simulator: &Simulator, spacing_deg: f64) -> Self {
        let receiver = simulator.receiver();
        let beam = BeamPattern::new(simulator.sensor(), simulator.sound_speed_m_s());
        let frequency_hz = simulator.sensor().frequency_hz;
        let settings = FanSettings {
            spacing_rad: spacing_deg.to_radians(),
            half_face_m: simulator.sensor().half_width_m(),
            wavelength_m: simulator.sound_speed_m_s() / frequency_hz,
            absorption_db_per_m: simulator.air().absorption_db_per_m(frequency_hz),
            max_path_m: 2.0 * receiver.max_range_m,
            min_amplitude: receiver.threshold,
            max_order: u32::MAX,
        };
        let fan = Fan::new(scene, beam, settings);
        Self { fan, shortest_m: 2.0 * receiver.min_range_m(), threshold: receiver.threshold }
    }

    /// Ranges, metres.
    fn scan(&self, pose: &Pose) -> Vec<Option<f64>> {
        let range_m = |i: u32| {
            let direction_rad = pose.direction_rad(FULL_SCAN.step_deg * f64::from(i));
            let Self { fan, shortest_m, threshold } = self;
            let echo = fan.first_echo(pose.position(), direction_rad, *shortest_m, *threshold);
            echo.map(|echo| echo.length_m / 2.0)
        };
        (0..FULL_SCAN.beams()).map(range_m).collect()
    }

    /// Counts the echoes that are missed or off by a millimetre, and those
    /// there are. It knows no minimum range.
    fn readings_off(&self, pose: &Pose, truth: &[Prediction]) -> (usize, usize) {
        let echoes = |prediction: &Prediction| prediction.status == PingStatus::Echo;
        let is_off = |(mine, truth): &(Option<f64>, &Prediction)| match (mine, truth.range_m) {
            (Some(mine), Some(range_m)) => (mine - range_m).abs() > 1e-3,
            _ => true,
        };
        let scan = self.scan(pose);
        let pairs = || scan.iter().copied().zip(truth).filter(|(_, truth)| echoes(truth));
        (pairs().filter(is_off).count(), pairs().count())
    }
}

/// The room with a round robot body: the worst case, a cylinder that nearly all beams meet.
fn robot_room() {
    let text = shipped::text("simple-room-robot").expect("a shipped scene");
    let scene = Scene::from_json(text).expect("a valid scene");
    let pose = scene.poses["fig9"];
    let scene = Arc::new(scene.with_robot_at(&pose));
    println!("\nsimple-room-robot, fig9, 400 azimuths");
    for max_range_m in [2.5, 5.0, 10.7] {
        let paths = simulator(
            scene.clone(),
            Options { max_range_m: Some(max_range_m), ..Options::default() },
        );
        let exact = time(|| drop(black_box(paths.predict(&pose, &FULL_SCAN).expect("few paths"))));
        report(&format!("paths to {max_range_m} m"), exact, None);
        let fan = simulator(
            scene.clone(),
            Options {
                engine: FanOptions::default().into(),
                max_range_m: Some(max_range_m),
                ..Options::default()
            },
        );
        let time = time(|| drop(black_box(fan.predict(&pose, &FULL_SCAN).expect("few paths"))));
        report("fan at its usual spacing", time, Some(exact));
    }
}

/// Counts the readings that differ by more than a millimetre, or have no echo where
/// it is not.
fn readings_off(one: &Simulator, other: &Simulator, pose: &Pose) -> usize {
    let readings = one
        .predict(pose, &FULL_SCAN)
        .expect("few paths")
        .into_iter()
        .zip(other.predict(pose, &FULL_SCAN).expect("few paths"));
    let is_off = |pair: &(Prediction, Prediction)| match (pair.0.range_m, pair.1.range_m) {
        (Some(one), Some(other)) => (one - other).abs() > 1e-3,
        (one, other) => one.is_some() != other.is_some(),
    };
    readings.filter(is_off).count()
}

/// All echo paths of a six-walled room to order 8, without loss: `benches/peers/` times the same
/// with pyroomacoustics.
fn l_room() {
    let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.5, 2.0], [2.5, 5.0], [0.0, 5.0]];
    let corners = corners.map(DVec2::from_array);
    let walls = corners.iter().zip(corners.iter().cycle().skip(1)).map(|(&a, &b)| (a, b));
    let room = plan_scene(walls.collect());
    let settings = sonard::model::paths::PathSettings {
        max_path_m: 200.0,
        max_order: Some(8),
        floor: 1e-6,
        repeated_contact_ratio: 1.0,
        unrestricted_m: 0.0,
        edge_law: None,
        double_diffraction: false,
        absorption_np_per_m: 0.0,
        wave_number_per_m: TAU * 49_400.0 / 343.2,
        sensor_z_m: None,
        tilt_rad: 0.0,
        scatter_height_rad: 0.0,
        direct: false,
    };
    let paths = Paths::new(&room, settings);
    let at = DVec2::new(1.13, 0.87);
    println!("\nL-room, order 8: {} echoes", paths.enumerate(at).expect("few paths").len());
    report("paths", time(|| drop(black_box(paths.enumerate(at).expect("few paths")))), None);
}

/// Offices along corridors: a ping beside ray casts, and growth with the number of walls.
fn building_plans() {
    for count in [100, 1_000, 10_000] {
        let walls = offices(count);
        let middle = 0.5 * walls.iter().map(|wall| wall.1).fold(DVec2::ZERO, DVec2::max);
        let poses = standing_places(middle, 16);
        let rays = time(|| {
            let mesh = polyline(&walls);
            drop(black_box(mesh));
        });
        let mesh = polyline(&walls);
        let cast = time(|| {
            for at in &poses {
                black_box(fifteen_casts(&mesh, *at));
            }
        })
        .each_of(poses.len());
        let scene = Arc::new(plan_scene(walls));
        println!("\nbuilding plan, {} walls", scene.walls.len());
        report("parry: build", rays, None);
        report(
            "paths: build",
            time(|| drop(black_box(simulator(scene.clone(), Options::default())))),
            None,
        );
        let model = simulator(scene.clone(), Options::default());
        let scan = time(|| {
            for at in &poses {
                let pose = Pose { x_m: at.x, y_m: at.y, heading_deg: 0.0 };
                black_box(model.predict(&pose, &FULL_SCAN).expect("few paths"));
            }
        })
        .each_of(poses.len());
        report("paths: scan of 400 azimuths", scan, None);
        report("paths: a ping's share of it", scan.each_of(400), None);
        report("parry: 15 ray casts", cast, Some(scan.each_of(400)));
        let point = model.at(poses[0]);
        let received: usize = (0..400)
            .map(|i| point.arrivals(f64::from(i) * TAU / 400.0).map_or(0, |all| all.len()))
            .sum();
        println!("  {:.1} sounds a ping", received as f64 / 400.0);
    }
}

fn fifteen_casts(mesh: &Polyline, at: DVec2) -> f64 {
    let origin = Vector::new(at.x, at.y);
    (0..15)
        .map(|i| {
            let direction = DVec2::from_angle(f64::from(i).to_radians());
            let ray = Ray::new(origin, Vector::new(direction.x, direction.y));
            mesh.cast_local_ray(&ray, 10.7, false).unwrap_or(10.7)
        })
        .sum()
}

fn polyline(walls: &[(DVec2, DVec2)]) -> Polyline {
    let points = walls.iter().flat_map(|(a, b)| [*a, *b]).map(|p| Vector::new(p.x, p.y)).collect();
    let ends = (0..walls.len() as u32).map(|i| [2 * i, 2 * i + 1]).collect();
    Polyline::new(points, Some(ends))
}

/// Rooms of 4 m by 3 m with a door in each wall and a cupboard in every other room: about
/// `count` walls.
fn offices(count: usize) -> Vec<(DVec2, DVec2)> {
    let mut random = Pcg64::seed_from_u64(7);
    let mut walls = Vec::new();
    // Four pieces of wall a room and two for half a cupboard.
    let side = ((count as f64 / 6.0).sqrt().round() as u32).max(2);
    let size = DVec2::new(4.0, 3.0);
    for row in 0..side {
        for column in 0..side {
            let corner = size * DVec2::new(f64::from(column), f64::from(row));
            for along in [DVec2::new(size.x, 0.0), DVec2::new(0.0, size.y)] {
                let door = random.random_range(0.5..along.length() - 1.4);
                let unit = along.normalize();
                walls.push((corner, corner + door * unit));
                walls.push((corner + (door + 0.9) * unit, corner + along));
            }
            if (row + column) % 2 == 0 {
                let low = corner + DVec2::new(random.random_range(1.0..2.0), 1.2);
                let box_size = DVec2::new(0.8, 0.4);
                let (right, up) = (DVec2::new(box_size.x, 0.0), DVec2::new(0.0, box_size.y));
                let corners = [low, low + right, low + box_size, low + up];
                walls.extend((0..4).map(|i| (corners[i], corners[(i + 1) % 4])));
            }
        }
    }
    walls
}

/// Places near the middle of a building.
fn standing_places(middle: DVec2, count: usize) -> Vec<DVec2> {
    let mut random = Pcg64::seed_from_u64(11);
    let cell = DVec2::new(4.0, 3.0);
    let room = (middle / cell).floor() * cell;
    (0..count)
        .map(|_| room + DVec2::new(random.random_range(0.2..3.8), random.random_range(0.2..1.1)))
        .collect()
}

fn plan_scene(walls: Vec<(DVec2, DVec2)>) -> Scene {
    let material = Material::smooth(0.97);
    let wall = |(i, (a, b)): (usize, (DVec2, DVec2))| Wall {
        id: Arc::from(format!("w{i}")),
        a,
        b,
        material,
        z_m: None,
    };
    let text = r#"{"name":"plan","materials":{},"walls":[]}"#;
    let mut scene = Scene::from_json(text).expect("an empty scene");
    scene.walls = walls.into_iter().enumerate().map(wall).collect();
    scene
}

/// Median time of a run, over at least 9 runs and half a second, and the shortest: what it takes
/// when nothing else is at work.
#[derive(Clone, Copy)]
struct Time {
    median: Duration,
    best: Duration,
}

impl Time {
    fn each_of(self, count: usize) -> Self {
        Self { median: self.median / count as u32, best: self.best / count as u32 }
    }
}

fn time(mut run: impl FnMut()) -> Time {
    run();
    let mut times = Vec::new();
    let start = Instant::now();
    while times.len() < 9 || (start.elapsed() < Duration::from_millis(500) && times.len() < 2000) {
        let before = Instant::now();
        run();
        times.push(before.elapsed());
    }
    times.sort();
    Time { median: times[times.len() / 2], best: times[0] }
}

fn report(what: &str, time: Time, beside: Option<Time>) {
    let micros = |time: Duration| time.as_secs_f64() * 1e6;
    print!("  {what:48} {:12.1} us {:12.1} us", micros(time.median), micros(time.best));
    match beside {
        Some(other) => println!(" {:10.2} times", micros(time.best) / micros(other.best)),
        None => println!(),
    }
}
