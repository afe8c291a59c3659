//! `sonard map`.

mod summary;

use std::path::PathBuf;

use super::{
    Failure, Outcome,
    answer::print_result,
    findings::{self, ScanOrigin},
    logs::first_log,
    map_file,
    output::{OutPath, Overwrite, Product, make_folder},
    progress, scene_file,
    sweeps::for_each_sweep,
};
use crate::{
    geometry::DVec2,
    interpret::{
        Extents, Sweep,
        grid::Grid,
        mapping::{MapSettings, Mapper},
        prediction::Assessment,
    },
    plot::{MapView, badge_for, draw_map},
    scan::{Provenance, Session},
    scene::Scene,
    store::logged_scene,
};

/// Options of `sonard map`.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// Logs whose scans have poses, or folders of logs; - for standard input
    #[arg(required = true, value_name = "LOG")]
    logs: Vec<PathBuf>,
    /// Output folder; map.pgm, map.yaml, map.mcap and map.png
    #[arg(long, value_name = "DIR")]
    out: OutPath,
    /// Reduce the weight of readings that contradict predicted features
    #[arg(long, value_enum, value_name = "ON|OFF", default_value_t = Switch::On)]
    feature_prediction: Switch,
    /// Inverse sensor model: occupancy in front of the ranger given a reading
    #[arg(long, value_enum, default_value_t = ModelName::Gaussian)]
    model: ModelName,
    /// Side of a cell, metres
    #[arg(long, value_name = "M", default_value_t = MapSettings::default().resolution_m)]
    resolution: f64,
    /// Maximum range, metres, instead of the sensor's; longer ranges count as no echo [default: the
    /// sensor's, at most 5]
    #[arg(long, value_name = "M")]
    max_range: Option<f64>,
    /// Region to map: X0,Y0,X1,Y1 in metres [default: the observed area]
    #[arg(long, value_name = "REGION", allow_hyphen_values = true, value_parser = parse_region)]
    region: Option<[f64; 4]>,
    /// Update this map (a folder or its .yaml), with its own cells
    #[arg(long, value_name = "MAP", conflicts_with_all = ["region", "resolution"])]
    update: Option<PathBuf>,
    /// Beam width, degrees [default: that of a plane's arc; of an array, 25]
    #[arg(long, value_name = "DEG")]
    beam_deg: Option<f64>,
    /// Exponent of the decrease of confidence with the feature's distance
    #[arg(long, value_name = "E", default_value_t = MapSettings::default().exponent)]
    exponent: f64,
    /// Extension of walls beyond their observed part, metres
    #[arg(long, value_name = "M", default_value_t = MapSettings::default().extend_m)]
    extend: f64,
    /// Minimum confidence of the readings used; 0.5 is full confidence
    #[arg(long, value_name = "C", default_value_t = MapSettings::default().min_confidence)]
    min_reading_confidence: f64,
    /// Number of times each scan counts [default: 5 divided by the number of scans, rounded up,
    /// because few scans would leave every cell undecided; 1 with --update]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=20))]
    scan_weight: Option<u8>,
    /// File for the confidence of every reading, one JSON object per line
    #[arg(long, value_name = "FILE")]
    confidences: Option<OutPath>,
    /// Scene file, or the name of a shipped scene (`sonard scene list`); only its walls are drawn,
    /// instead of those of the scene in the log
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    /// JSON instead of text; one object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    overwrite: Overwrite,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Switch {
    On,
    Off,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ModelName {
    /// Gaussian in direction and distance
    Gaussian,
    /// From the sensor's beam pattern and threshold
    Physical,
}

pub(super) const ABOUT: &str = "\
Make an occupancy grid from the scans of logs.

Each scan is placed at its pose. Feature Prediction (O'Sullivan and others) predicts walls from \
consistent readings and lowers the confidence of readings that contradict them, so that specular \
walls are not mapped as free space. Writes map.pgm and map.yaml for ROS's map_server (bright is \
free, dark occupied, in between the probability), the same map as a recording of ROS 2 (map.mcap, \
topic /map), and map.png with the trajectory of the ranger.";

const HELP: &str = "\
Examples:
  sonard map run/*.jsonl --out map
  sonard map scan.jsonl --out map --feature-prediction off --resolution 0.02 --json
  sonard map today.jsonl --update map --out map-today
  sonard-papers benchmark score map simple-room

A confidence is 0.5 for a reading without contradiction, and less otherwise; clear_m is the \
distance up to which the reading is certainly correct.

Exit codes: 0 done, 2 wrong usage or input, \
3 write error.";

pub(super) fn run(args: &Args) -> Outcome {
    if let Some(map) = &args.update {
        map_file::register_inputs(map);
    }
    map_file::check(&args.out, args.overwrite)?;
    args.overwrite.check_in(&args.out, "map.png", Product::Png)?;
    args.overwrite.check_in(&args.out, "map.mcap", Product::Recording)?;
    if let Some(path) = &args.confidences {
        args.overwrite.check(path, CONFIDENCES)?;
    }
    let MapInput { session, provenance, origin, sweeps: taken } = sweeps(args)?;
    let refuse = |error: &dyn std::fmt::Display| {
        Failure::input(error.to_string(), "see `sonard map --help`")
    };
    let extents = Extents::from_session(&session).map_err(|error| {
        Failure::input(format!("session: {error}"), "correct the session's record in the log")
    })?;
    let mapping = args.mapping();
    let max_range_m = mapping.max_range_m(&extents);
    if !(max_range_m.is_finite() && max_range_m > 0.0) {
        return Err(refuse(&format!("--max-range {max_range_m}: give a length greater than 0")));
    }
    let begun = match &args.update {
        Some(map) => map_file::read(map)?,
        None => {
            Grid::new(mapping.shape(taken.iter().map(|(_, sweep)| sweep), max_range_m).map_err(
                |error| Failure::input(error, "choose another --resolution or --region"),
            )?)
        }
    };
    let mapper = Mapper::new(&mapping, begun, extents, session.array.is_some(), taken.len());
    let scene = match &args.scene {
        Some(given) => Some(scene_file::load(given)?),
        // Drawn walls are optional: a log without a scene is mapped as well.
        None => logged_scene(&session, &first_log(&args.logs)).ok().flatten(),
    };
    make_folder(&args.out)?;

    let mapped = map(args, &taken, mapper)?;
    let trajectory: Vec<DVec2> = taken.iter().map(|(_, sweep)| sweep.pose.position()).collect();
    let summary = mapped.summary(args, &taken);
    let png = draw_map(&MapView {
        title: title(&session, scene.as_ref()),
        lines: vec![summary.describe_cells()],
        badge: badge_for(Some(provenance)),
        grid: &mapped.grid,
        scene: scene.as_ref(),
        trajectory: &trajectory,
    })
    .map_err(|error| refuse(&error))?;
    map_file::write(&args.out, &mapped.grid, args.overwrite)?;
    args.overwrite.save(&args.out.join("map.png"), Product::Png, &png)?;
    let place = origin.place(Some(&mapped.grid), &[], &[]);
    findings::write(&args.out.join("map.mcap"), Product::Recording, args.overwrite, &place)?;
    print_result(args.json, [&summary], |out| summary.print(out))
}

/// Title with the name of the mapped room.
fn title(session: &Session, scene: Option<&Scene>) -> String {
    let logged = session.scene.as_ref().map(|scene| scene.name.as_str());
    let name = scene.map(|scene| scene.name.as_str()).or(logged).unwrap_or("unknown place");
    format!("{name}, occupancy grid")
}

impl Args {
    fn mapping(&self) -> MapSettings {
        MapSettings {
            resolution_m: self.resolution,
            region: self.region.map(|[x0, y0, x1, y1]| [DVec2::new(x0, y0), DVec2::new(x1, y1)]),
            range_limit_m: self.max_range,
            beam_deg: self.beam_deg,
            exponent: self.exponent,
            extend_m: self.extend,
            min_confidence: self.min_reading_confidence,
            // The existing map has already weighted its scans.
            evidence: self.scan_weight.or_else(|| self.update.is_some().then_some(1)),
            predicts_features: self.feature_prediction == Switch::On,
            is_physical: self.model == ModelName::Physical,
        }
    }
}

/// Scans that can be mapped.
struct MapInput {
    /// Session of the first scan.
    session: Session,
    /// Provenance of the first simulated scan, if any.
    provenance: Provenance,
    origin: ScanOrigin,
    sweeps: Vec<(uuid::Uuid, Sweep)>,
}

fn sweeps(args: &Args) -> Result<MapInput, Failure> {
    let (mut session, mut sweeps, mut simulated) = (None, Vec::new(), None);
    let mut origin = ScanOrigin::default();
    for_each_sweep(&args.logs, |scan, sweep| {
        origin.add(&scan);
        sweeps.push((scan.scan, sweep));
        let Some(of_scan) = scan.session.as_deref() else { return };
        if of_scan.provenance != Provenance::Hardware {
            simulated.get_or_insert(of_scan.provenance);
        }
        if session.is_none() {
            session = Some(of_scan.clone());
        }
    })?;
    let session = session.ok_or_else(|| {
        Failure::input(
            "no scan with a session and a pose to map",
            "give logs written by `sonard scan` or `sonard simulate`",
        )
    })?;
    let provenance = simulated.unwrap_or(session.provenance);
    Ok(MapInput { session, provenance, origin, sweeps })
}

/// Finished map with its statistics.
struct Mapped {
    grid: Grid,
    readings: usize,
    discarded: usize,
    poses_outside: usize,
    confidence: f64,
}

fn map(args: &Args, taken: &[(uuid::Uuid, Sweep)], mut mapper: Mapper) -> Result<Mapped, Failure> {
    let (mut readings, mut discarded, mut confidence) = (0, 0, 0.0);
    let mut confidences = Vec::new();
    let bar = progress::bar(taken.len() as u64, "scans");
    for (scan, sweep) in taken {
        let added = mapper.add(sweep);
        discarded += added.discarded;
        readings += sweep.beams.len();
        for (beam, worth) in sweep.beams.iter().zip(added.assessments.unwrap_or_default()) {
            confidence += worth.confidence;
            if args.confidences.is_some() {
                write_confidence(&mut confidences, *scan, beam.index, &worth);
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(path) = &args.confidences {
        args.overwrite.save(path, CONFIDENCES, &confidences)?;
    }
    let grid = mapper.finish();
    let is_outside = |sweep: &Sweep| grid.shape().index_at(sweep.pose.position()).is_none();
    let poses_outside = taken.iter().filter(|(_, sweep)| is_outside(sweep)).count();
    Ok(Mapped { grid, readings, discarded, poses_outside, confidence })
}

const CONFIDENCES: Product = Product::List(&["scan", "index", "confidence", "clear_m"]);

fn write_confidence(bytes: &mut Vec<u8>, scan: uuid::Uuid, index: u32, worth: &Assessment) {
    let Assessment { confidence, clear_m } = *worth;
    let line = serde_json::json!({
        "scan": scan, "index": index, "confidence": confidence, "clear_m": clear_m
    });
    bytes.extend_from_slice(line.to_string().as_bytes());
    bytes.push(b'\n');
}

fn parse_region(text: &str) -> Result<[f64; 4], String> {
    let parts: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    parts.try_into().map_err(|_| "give X0,Y0,X1,Y1 in metres, as in -1,-1,4,3".to_owned())
}
