//! Reading of a thermometer's file, whatever the path refers to.

use std::{
    fs::File,
    io::{self, Read as _},
    path::Path,
};

use rustix::fs::{FileType, Mode, OFlags};

use super::ThermometerFault;

/// Maximum length of a thermometer's file, bytes: a page of sysfs.
const MAX_BYTES: u64 = 4096;

/// Name prefixes of chips that measure a part of the computer: processors, graphics, disks, radios,
/// memory, power. Compared with `name` of hwmon and `type` of thermal zones.
const INTERNAL_CHIPS: [&str; 31] = [
    "acpitz",
    "amdgpu",
    "ath1",
    "bcm2711_thermal",
    "bcm2835_thermal",
    "bigcore",
    "core",
    "cpu",
    "cros_ec",
    "drivetemp",
    "fam15h_power",
    "gpu",
    "int3400",
    "iwlwifi",
    "jc42",
    "k10temp",
    "k8temp",
    "littlecore",
    "mt79",
    "nouveau",
    "nvme",
    "pch_",
    "radeon",
    "raspberrypi",
    "rp1_adc",
    "soc",
    "spd5118",
    "thinkpad",
    "x86_pkg_temp",
    "xe",
    "zenpower",
];

/// Reads the text of a regular file of at most a page. A named pipe does not block it.
pub(super) fn read_file(path: &Path) -> Result<String, ThermometerFault> {
    let unreadable = |error: io::Error| ThermometerFault::Unreadable(error.to_string());
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let file =
        rustix::fs::open(path, flags, Mode::empty()).map_err(|error| unreadable(error.into()))?;
    let kind = rustix::fs::fstat(&file).map_err(|error| unreadable(error.into()))?.st_mode;
    match FileType::from_raw_mode(kind) {
        FileType::RegularFile => {}
        FileType::Directory => return Err(ThermometerFault::NotAFile("a folder")),
        FileType::Fifo => return Err(ThermometerFault::NotAFile("a named pipe")),
        FileType::Socket => return Err(ThermometerFault::NotAFile("a socket")),
        _ => return Err(ThermometerFault::NotAFile("a device")),
    }
    let mut bytes = Vec::new();
    File::from(file).take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(ThermometerFault::TooLong);
    }
    let text = String::from_utf8(bytes).map_err(|_| ThermometerFault::NotText)?;
    let is_text = |c: char| !c.is_control() || matches!(c, '\n' | '\r' | '\t');
    if text.chars().all(is_text) { Ok(text) } else { Err(ThermometerFault::NotText) }
}

/// Name of the chip that a file of hwmon or of a thermal zone belongs to.
pub(super) fn chip(file: &Path) -> Option<String> {
    let (name, folder) = (file.file_name()?.to_str()?, file.parent()?);
    let name_file = match name {
        "temp" => "type",
        _ if name.starts_with("temp") && name.ends_with("_input") => "name",
        _ => return None,
    };
    let text = read_file(&folder.join(name_file)).ok()?;
    Some(text.trim().to_owned()).filter(|chip| !chip.is_empty())
}

/// Returns `true` for the name of a chip that does not measure the air.
pub(super) fn is_internal(chip: &str) -> bool {
    let chip = chip.to_ascii_lowercase();
    INTERNAL_CHIPS.iter().any(|prefix| chip.starts_with(prefix))
}
