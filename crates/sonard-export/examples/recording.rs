//! Converts a log to a recording and prints the throughput.
//!
//! ```sh
//! cargo run --release -p sonard-export --example recording -- scan.jsonl scan.mcap [nav2]
//! ```

use std::{
    env,
    error::Error,
    fs::File,
    io::{BufRead as _, BufReader, BufWriter},
    time::Instant,
};

use jiff::Timestamp;
use sonard_export::{AttachedLog, Export as _, ExportSettings, McapExport, Profile};
use sonard_records::{ScanView, decode_line};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let log = arguments.next().ok_or("give a log")?;
    let out = BufWriter::new(File::create(arguments.next().ok_or("give a file to write")?)?);
    let profile = match arguments.next().as_deref() {
        Some("nav2") => Profile::Nav2,
        _ => Profile::Rep117,
    };
    let mut export =
        Box::new(McapExport::new(out, ExportSettings { profile, ..ExportSettings::default() })?);
    let lines = BufReader::new(File::open(&log)?).split(b'\n').map_while(Result::ok);
    let records = lines.filter_map(|line| decode_line(&line).ok());
    let start = Instant::now();
    let (mut readings, mut writing_s) = (0, 0.0);
    for scan in ScanView::stream(records) {
        readings += scan.pings.len();
        let start = Instant::now();
        if let Some(why) = export.scan(&log, &scan)? {
            println!("scan {} skipped: {why}", scan.scan);
        }
        writing_s += start.elapsed().as_secs_f64();
    }
    let mut file = File::open(&log)?;
    let name = log.rsplit('/').next().unwrap_or(&log);
    let bytes = file.metadata()?.len();
    export.attach(&AttachedLog { name, bytes, modified: Timestamp::UNIX_EPOCH }, &mut file)?;
    export.finish()?;
    println!(
        "{readings} readings: {:.0} per second, {:.0} per second without reading the log",
        readings as f64 / start.elapsed().as_secs_f64(),
        readings as f64 / writing_s
    );
    Ok(())
}
