//! A scan simulated with the library alone: `cargo run --example scan`.

use std::{error::Error, sync::Arc};

use sonard::{
    acoustics::{Air, Sensor},
    model::{Options, Simulator},
    scan::{PathRecord, ScanPlan},
    scene::{Scene, shipped},
};

fn main() -> Result<(), Box<dyn Error>> {
    let scene = Arc::new(Scene::from_json(shipped::text("simple-room").ok_or("not shipped")?)?);
    let pose = scene.pose("fig9")?;
    let sensor = Sensor::preset("senscomp-6500")?;
    let simulator = Simulator::new(scene, sensor, Air::default(), Options::default())?;
    let plan = ScanPlan { step_deg: 9.0, ..ScanPlan::default() };
    for (stop, reading) in (0..).zip(simulator.predict(&pose, &plan)?) {
        let path = reading.arrival.map(|arrival| {
            PathRecord::from_path(simulator.scene(), &arrival.path, arrival.length_m)
        });
        let way = path.map_or_else(|| "nothing".to_owned(), |path| path.describe());
        println!(
            "{:5.1} deg  {:?}  {:?} m  {way}",
            plan.azimuth_deg(stop),
            reading.status,
            reading.range_m
        );
    }
    Ok(())
}
