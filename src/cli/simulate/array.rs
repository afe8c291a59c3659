//! `sonard simulate --array`: rounds of an array's rangers at one or more poses.

use std::sync::Arc;

use jiff::Timestamp;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use uuid::Uuid;

use super::{Args, SimulatedPoses, SimulationFailure, records_for, simulated_poses};
use crate::{
    acoustics::ReceiverNoise,
    cli::{
        Failure, Outcome, array::load_array, options::engine_options, output::closed, progress,
        scene_file,
    },
    geometry::Pose,
    model::{ArrayAtPose, ArrayModel, ModelError, Prediction, TooCostly},
    scan::{Ping, Record, ScanEnd, ScanStart, Session},
    store::RecordWriter,
};

#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Array")]
pub(super) struct ArrayArgs {
    /// Array of rangers, a preset (`sonard array list`) or a file with an array's data; the rangers
    /// fire in turn, and the pose is the robot's
    #[arg(long, value_name = "NAME|FILE", conflicts_with_all = ["from_deg", "to_deg", "step_deg"])]
    pub(super) array: Option<String>,
    /// Rounds at each pose, between which the robot rotates in place by equal angles; fills the
    /// gaps of an evenly spaced ring
    #[arg(long, value_name = "N", requires = "array", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=200))]
    pub(super) rounds: u32,
}

pub(super) fn run(args: &Args, name: &str) -> Outcome {
    let array = load_array(name)?;
    let scene = scene_file::load(&args.scene)?;
    let SimulatedPoses { poses, skipped } = simulated_poses(args, &scene, |pose| {
        let checked = array.check_poses(&scene, &array.rotated_poses(pose, args.array.rounds));
        checked.map_err(|(_, error)| (error.to_string(), error.help()))
    })?;
    let rounds: Vec<Vec<Pose>> =
        poses.iter().map(|pose| array.rotated_poses(pose, args.array.rounds)).collect();
    let (sensor, air) = (args.sensor.sensor_or(&array.sensor)?, args.air.air()?);
    let model =
        ArrayModel::new(Arc::new(array), &scene, &sensor, air, engine_options(&args.engine)?)
            .map_err(|error| failure_from(&error))?;
    let noise = args.noise.noise()?;
    let mut out = records_for(args)?;
    let mut simulator =
        ArraySimulator { model: &model, noise, rng: Pcg64::seed_from_u64(args.noise.seed) };
    match simulator.fire(&mut *out, &rounds) {
        Ok(()) => {
            closed(out.finish())?;
            skipped
        }
        Err(SimulationFailure::Model(error)) => Err(failure_from(&error)),
        Err(SimulationFailure::Write(error)) => closed(Err(error)),
    }
}

fn failure_from(error: &ModelError) -> Failure {
    Failure::input(error, "see `sonard simulate --help`")
}

struct ArraySimulator<'a> {
    model: &'a ArrayModel,
    noise: Option<ReceiverNoise>,
    rng: Pcg64,
}

impl ArraySimulator<'_> {
    /// Writes the session, and one scan with all rounds per pose.
    fn fire(
        &mut self,
        out: &mut dyn RecordWriter,
        simulated_poses: &[Vec<Pose>],
    ) -> Result<(), SimulationFailure> {
        out.write(&Record::Session(Box::new(Session::for_array(self.model, Timestamp::now()))))?;
        let round: Vec<usize> = self.model.array().round().collect();
        let firings = round.len() * simulated_poses.iter().map(Vec::len).sum::<usize>();
        let progress = progress::bar(firings as u64, "beams");
        for rounds in simulated_poses {
            let Some(first) = rounds.first() else { continue };
            let (scan, count) = (Uuid::new_v4(), rounds.len() as u32);
            let start = ScanStart::for_array(self.model, scan, *first, count, Timestamp::now());
            out.write(&Record::ScanStart(start))?;
            let mut index = 0;
            for pose in rounds {
                let at_pose = self.model.at(*pose).map_err(SimulationFailure::Model)?;
                for (firing, &ranger) in round.iter().enumerate() {
                    let prediction = self.predict(&at_pose, firing)?;
                    let ping = Ping::for_array(&at_pose, scan, first, index, ranger, &prediction);
                    out.write(&Record::Ping(Box::new(ping)))?;
                    index += 1;
                    progress.inc(1);
                }
            }
            let end = ScanEnd::for_array(self.model, scan, [index, 0], Timestamp::now());
            out.write(&Record::ScanEnd(end))?;
        }
        progress.finish_and_clear();
        Ok(())
    }

    fn predict(
        &mut self,
        at_pose: &ArrayAtPose<'_>,
        firing: usize,
    ) -> Result<Prediction, TooCostly> {
        match &self.noise {
            Some(noise) => at_pose.ping_in_noise(firing, noise, &mut self.rng),
            None => at_pose.ping_in_round(firing),
        }
    }
}
