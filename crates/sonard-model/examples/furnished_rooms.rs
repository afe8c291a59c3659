//! Cost of a scan in random furnished rooms:
//! `cargo run --release -p sonard-model --example furnished_rooms -- COUNT SEED [FIRST]`.
//!
//! Each room has four or six walls, a floor and a ceiling, low and high boxes at any angle, hanging
//! shelves, tables on legs, and surfaces that reflect from half to 0.99 of the amplitude. From a
//! random place in it the ranger takes a scan of 400 azimuths to its full range, on one core. The
//! output has the times of scans on that core, including the preparation of the scene, and the peak
//! memory of the process.

use std::{error::Error, fs, sync::Arc, time::Instant};

use rand::RngExt;
use rand_pcg::Pcg64;
use sonard_model::{
    acoustics::{Air, Sensor},
    geometry::{DVec2, Pose},
    model::{Options, Simulator},
    scan_plan::ScanPlan,
    scene::{Scene, SceneBuilder},
};

/// Slower scans are named, so that each can be repeated alone.
const SLOW_S: f64 = 0.5;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<u64>());
    let mut next = |usual| arguments.next().unwrap_or(Ok(usual));
    let (count, seed, first) = (next(100)?, next(1)?, next(0)?);
    let (mut seconds, mut echo_count, mut rejected) = (Vec::new(), 0, 0);
    for room in first..first + count {
        // A generator for each room, so that each can be reproduced alone.
        let mut rng = Pcg64::new(seed.into(), room.into());
        let (scene, pose) = furnished_room(&mut rng)?;
        let (begin, begin_s) = (Instant::now(), processor_s());
        let echoes = scan(&scene, &pose);
        // Other programs may have used the core in between.
        let taken_s = match (begin_s, processor_s()) {
            (Some(begin_s), Some(end_s)) => end_s - begin_s,
            _ => begin.elapsed().as_secs_f64(),
        };
        if taken_s > SLOW_S {
            let (walls, round) = (scene.walls.len(), scene.cylinders.len());
            println!("room {room}: {taken_s:.2} s, {walls} walls, {round} legs");
        }
        seconds.push(taken_s);
        match echoes {
            Ok(count) => echo_count += count,
            Err(error) => {
                rejected += 1;
                println!("room {room}: {error}");
            }
        }
    }
    seconds.sort_by(f64::total_cmp);
    let share = |share: f64| 1e3 * seconds[((seconds.len() - 1) as f64 * share) as usize];
    println!(
        "{} rooms, seed {seed}: {echo_count} echoes, {rejected} rejected; median {:.1} ms, 95 % {:.1} ms, worst {:.1} ms; \
         peak memory {} MB",
        seconds.len(),
        share(0.5),
        share(0.95),
        share(1.0),
        peak_memory_mb().map_or("unknown".into(), |mb| mb.to_string())
    );
    Ok(())
}

/// Number of 400 firings with an echo.
fn scan(scene: &Scene, pose: &Pose) -> Result<usize, Box<dyn Error>> {
    let sensor = Sensor::preset("senscomp-6500")?;
    let simulator =
        Simulator::new(Arc::new(scene.clone()), sensor, Air::default(), Options::default())?;
    let predictions = simulator.predict(pose, &ScanPlan::default())?;
    Ok(predictions.iter().filter(|prediction| prediction.range_m.is_some()).count())
}

/// Processor time of this thread so far, where the system provides it.
fn processor_s() -> Option<f64> {
    let status = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = status.split_whitespace().next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}

/// Peak memory of this process, where the system provides it.
fn peak_memory_mb() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kilobytes / 1024)
}

/// A room, and a pose in it with nothing nearer than 20 cm.
fn furnished_room(rng: &mut Pcg64) -> Result<(Scene, Pose), Box<dyn Error>> {
    let (width_m, depth_m) = (rng.random_range(2.5..7.0), rng.random_range(2.5..6.0));
    let ceiling_m = rng.random_range(2.2..3.0);
    let mut corners = vec![[0.0, 0.0], [width_m, 0.0], [width_m, depth_m], [0.0, depth_m]];
    if rng.random_bool(0.3) {
        let notch = [0.6 * width_m, 0.55 * depth_m];
        corners.splice(2..3, [[width_m, notch[1]], notch, [notch[0], depth_m]]);
    }
    let reflectance = |rng: &mut Pcg64| rng.random_range(0.5..0.99);
    let mut builder = Scene::builder("furnished")
        .material("wall", reflectance(rng))
        .material("wood", reflectance(rng))
        .material("metal", 0.99)
        .room("room", &corners, "wall")
        .heights(0.0, ceiling_m);
    let is_free = |at: DVec2, radius_m: f64| {
        let low = [at.x - radius_m, at.y - radius_m];
        let high = [at.x + radius_m - width_m, at.y + radius_m - depth_m];
        low[0] > 0.0 && low[1] > 0.0 && high[0] < 0.0 && high[1] < 0.0
    };
    let place = |rng: &mut Pcg64, radius_m: f64| {
        let at = DVec2::new(rng.random_range(0.0..width_m), rng.random_range(0.0..depth_m));
        is_free(at, radius_m).then_some(at)
    };
    let mut boxes: Vec<(DVec2, f64)> = Vec::new();
    for piece in 0..rng.random_range(0..6) {
        let half = DVec2::new(rng.random_range(0.1..0.6), rng.random_range(0.1..0.45));
        let Some(center) = place(rng, half.length()) else { continue };
        if boxes
            .iter()
            .any(|(other, radius_m)| center.distance(*other) < half.length() + radius_m + 0.05)
        {
            continue;
        }
        boxes.push((center, half.length()));
        builder = furniture(rng, builder, piece, center, half, ceiling_m);
    }
    let scene = builder.build()?;
    loop {
        let Some(at) = place(rng, 0.25) else { continue };
        let is_apart = boxes.iter().all(|(center, radius_m)| at.distance(*center) > *radius_m);
        let in_notch = corners.len() > 4 && at.x > 0.6 * width_m && at.y > 0.55 * depth_m;
        if is_apart && !in_notch && scene.clearance_m(at) > 0.2 {
            let heading_deg = rng.random_range(0.0..360.0);
            return Ok((scene, Pose { x_m: at.x, y_m: at.y, heading_deg }));
        }
    }
}

/// A low box, a high one, a hanging one, or a table on legs.
fn furniture(
    rng: &mut Pcg64,
    builder: SceneBuilder,
    piece: usize,
    center: DVec2,
    half: DVec2,
    ceiling_m: f64,
) -> SceneBuilder {
    let turn = DVec2::from_angle(rng.random_range(0.0..std::f64::consts::TAU));
    let corner = |x: f64, y: f64| (center + turn.rotate(half * DVec2::new(x, y))).to_array();
    let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let material = if rng.random_bool(0.3) { "metal" } else { "wood" };
    let id = format!("piece{piece}");
    let walls = |builder: SceneBuilder| builder.room(&id, &corners, material);
    match rng.random_range(0..10) {
        0..4 => walls(builder).z_range(0.0, rng.random_range(0.3..1.0)),
        4 => walls(builder).z_range(0.0, rng.random_range(1.2..2.0)),
        5 => walls(builder),
        6 => walls(builder).z_range(rng.random_range(1.0..1.6), ceiling_m),
        _ => {
            let (radius_m, top_m) = (rng.random_range(0.01..0.03), rng.random_range(0.4..0.75));
            let legs = corners.iter().zip(0..);
            legs.fold(builder, |builder, (corner, leg)| {
                builder
                    .cylinder(&format!("{id}.leg{leg}"), *corner, radius_m, material)
                    .z_range(0.0, top_m)
            })
        }
    }
}
