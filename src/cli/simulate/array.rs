//! `sonard simulate --array`: rounds of an array's rangers at one pose or many.

use std::sync::Arc;

use jiff::Timestamp;
use rand::SeedableRng as _;
use rand_pcg::Pcg64;
use uuid::Uuid;

use super::{Args, Places, Stop, places};
use crate::{
    acoustics::ReceiverNoise,
    cli::{
        Failure, Outcome,
        array::load_array,
        options::engine_options,
        output::{closed, records_to},
        progress, scene_file,
    },
    geometry::Pose,
    model::{ArrayAtPose, ArrayModel, ModelError, Prediction, TooCostly},
    scan::{Ping, Record, ScanEnd, ScanStart, Session},
    store::RecordWriter,
};

/// Several rangers instead of one that turns.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Array")]
pub(super) struct ArrayArgs {
    /// Array of rangers, a preset (`sonard array list`) or a file with an array's data;
    /// they fire in turn, and the pose is the robot's
    #[arg(long, value_name = "NAME|FILE", conflicts_with_all = ["from_deg", "to_deg", "step_deg"])]
    pub(super) array: Option<String>,
    /// Rounds at each pose, between which the robot turns in place: of an even ring, so that
    /// directions are spread evenly
    #[arg(long, value_name = "N", requires = "array", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=200))]
    pub(super) rounds: u32,
}

pub(super) fn run(args: &Args, name: &str) -> Outcome {
    let array = load_array(name)?;
    let scene = scene_file::load(&args.scene)?;
    let Places { poses, left_out } = places(args, &scene, |pose| {
        let checked = array.check_poses(&scene, &array.turned(pose, args.array.rounds));
        checked.map_err(|(_, error)| (error.to_string(), error.help()))
    })?;
    let rounds: Vec<Vec<Pose>> =
        poses.iter().map(|pose| array.turned(pose, args.array.rounds)).collect();
    let (sensor, air) = (args.sensor.sensor_or(&array.sensor)?, args.air.air()?);
    let model =
        ArrayModel::new(Arc::new(array), &scene, &sensor, air, engine_options(&args.engine)?)
            .map_err(|error| refuse(&error))?;
    let noise = args.noise.noise()?;
    let mut out = records_to(args.output.as_deref(), args.overwrite)?;
    let mut firing =
        ArrayFiring { model: &model, noise, rng: Pcg64::seed_from_u64(args.noise.seed) };
    match firing.fire(&mut *out, &rounds) {
        Ok(()) => {
            closed(out.finish())?;
            left_out
        }
        Err(Stop::Model(error)) => Err(refuse(&error)),
        Err(Stop::Write(error)) => closed(Err(error)),
    }
}

fn refuse(error: &ModelError) -> Failure {
    Failure::input(error, "see `sonard simulate --help`")
}

struct ArrayFiring<'a> {
    model: &'a ArrayModel,
    noise: Option<ReceiverNoise>,
    rng: Pcg64,
}

impl ArrayFiring<'_> {
    /// Writes the session, and a scan for each place with its rounds.
    fn fire(&mut self, out: &mut dyn RecordWriter, places: &[Vec<Pose>]) -> Result<(), Stop> {
        out.write(&Record::Session(Box::new(Session::of_array(self.model, Timestamp::now()))))?;
        let round: Vec<usize> = self.model.array().round().collect();
        let firings = round.len() * places.iter().map(Vec::len).sum::<usize>();
        let progress = progress::bar(firings as u64, "beams");
        for rounds in places {
            let Some(first) = rounds.first() else { continue };
            let (scan, count) = (Uuid::new_v4(), rounds.len() as u32);
            let start = ScanStart::of_array(self.model, scan, *first, count, Timestamp::now());
            out.write(&Record::ScanStart(start))?;
            let mut index = 0;
            for pose in rounds {
                let stand = self.model.at(*pose).map_err(Stop::Model)?;
                for (firing, &ranger) in round.iter().enumerate() {
                    let prediction = self.listen(&stand, firing)?;
                    let ping = Ping::of_array(&stand, scan, first, index, ranger, &prediction);
                    out.write(&Record::Ping(Box::new(ping)))?;
                    index += 1;
                    progress.inc(1);
                }
            }
            let end = ScanEnd::of_array(self.model, scan, [index, 0], Timestamp::now());
            out.write(&Record::ScanEnd(end))?;
        }
        progress.finish_and_clear();
        Ok(())
    }

    fn listen(&mut self, stand: &ArrayAtPose<'_>, firing: usize) -> Result<Prediction, TooCostly> {
        match &self.noise {
            Some(noise) => stand.ping_in_noise(firing, noise, &mut self.rng),
            None => stand.ping_in_round(firing),
        }
    }
}
