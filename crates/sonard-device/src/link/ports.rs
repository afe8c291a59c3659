//! Enumeration of the serial ports of this computer, without opening any.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::{LinkError, PortListError, holders::real_path};
use crate::platform::{SystemPort, UsbDevice, serial_ports};

/// Serial port of this computer, described without opening it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct SerialPortInfo {
    /// Path of the device node.
    pub port: String,
    /// Stable name under `/dev/serial/by-id`, which survives replugging.
    pub id: Option<String>,
    /// USB descriptor: manufacturer, product, serial number.
    pub usb: Option<String>,
}

/// Lists the serial ports of this computer, ports with a stable name first. No port is opened.
///
/// # Errors
/// If the system's list of ports can't be read.
pub fn list_ports() -> Result<Vec<SerialPortInfo>, PortListError> {
    PortFolders::system().candidates()
}

/// Result of resolving a port name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Resolved {
    pub(super) path: PathBuf,
    /// Full name under `/dev/serial/by-id`, if a partial name was given.
    pub(super) matched_id: Option<String>,
}

/// Folders in which the system describes serial ports.
#[derive(Debug, Clone, Copy)]
pub(super) struct PortFolders<'a> {
    /// Folder with one subfolder per terminal.
    pub(super) tty: &'a Path,
    /// Folder of symbolic links with stable names.
    pub(super) by_id: &'a Path,
    /// Folder of device nodes.
    pub(super) dev: &'a Path,
}

impl PortFolders<'static> {
    pub(super) fn system() -> Self {
        Self {
            tty: Path::new("/sys/class/tty"),
            by_id: Path::new("/dev/serial/by-id"),
            dev: Path::new("/dev"),
        }
    }
}

impl PortFolders<'_> {
    pub(super) fn candidates(&self) -> Result<Vec<SerialPortInfo>, PortListError> {
        let ids = self.ids()?;
        let mut candidates: Vec<SerialPortInfo> = self
            .ports()?
            .into_iter()
            .map(|SystemPort { path, usb }| SerialPortInfo {
                id: id_of(&ids, &path),
                port: path.to_string_lossy().into_owned(),
                usb: usb.map(UsbDevice::describe),
            })
            .collect();
        candidates.sort_by_key(|candidate| (candidate.id.is_none(), candidate.port.clone()));
        Ok(candidates)
    }

    /// Distinctive name of the device at a path: its stable id, else its USB descriptor.
    pub(super) fn device_name(&self, path: &Path) -> Option<String> {
        let id = id_of(&self.ids().ok()?, path);
        let descriptor = || {
            let device = real_path(path);
            let port = self.ports().ok()?.into_iter().find(|port| port.path == device)?;
            port.usb.map(UsbDevice::describe)
        };
        id.or_else(descriptor)
    }

    /// Paths of the serial ports.
    pub(super) fn present(&self) -> Result<Vec<String>, PortListError> {
        let ports = self.ports()?.into_iter();
        Ok(ports.map(|port| port.path.to_string_lossy().into_owned()).collect())
    }

    /// Resolves `name`: a stable id, a USB serial number, or an unambiguous part of a stable id.
    /// `preferred` is chosen if it is among several matches.
    ///
    /// # Errors
    /// If there is no match, there are several, or the ports can't be listed.
    pub(super) fn find(&self, name: &str, preferred: Option<&str>) -> Result<Resolved, LinkError> {
        let not_listed = |source| LinkError::NotListed { port: name.to_owned(), source };
        if name.is_empty() || name.contains('/') {
            return Err(LinkError::NotFound { port: name.to_owned(), present: self.present() });
        }
        let ids = self.ids().map_err(not_listed)?;
        if let Some(path) = ids.iter().find(|id| file_name(id) == name) {
            return Ok(Resolved { path: path.clone(), matched_id: None });
        }
        let listed = self.ports();
        let has_serial = |port: &&SystemPort| {
            port.usb.as_ref().and_then(|usb| usb.serial.as_deref()) == Some(name)
        };
        let by_serial = listed.iter().flatten().filter(has_serial).map(|port| port.path.clone());
        let full_path = |path: &Path| path.to_string_lossy().into_owned();
        if let Some(path) = only_device(by_serial.collect(), name, full_path)? {
            return Ok(Resolved { path, matched_id: None });
        }
        let mut matching: Vec<PathBuf> =
            ids.into_iter().filter(|id| file_name(id).contains(name)).collect();
        if matching.len() > 1
            && let Some(path) =
                matching.iter().find(|id| Some(file_name(id).as_str()) == preferred).cloned()
        {
            matching = vec![path];
        }
        if let Some(path) = only_device(matching, name, file_name)? {
            return Ok(Resolved { matched_id: Some(file_name(&path)), path });
        }
        let present = listed.map_err(not_listed)?;
        let present = present.iter().map(|port| port.path.to_string_lossy().into_owned());
        Err(LinkError::NotFound { port: name.to_owned(), present: Ok(present.collect()) })
    }

    /// Paths of the stable names; empty if udev created none.
    fn ids(&self) -> Result<Vec<PathBuf>, PortListError> {
        let mut ids = match read_folder(self.by_id) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            listed => listed.map_err(|error| PortListError::new(self.by_id, error))?,
        };
        ids.sort();
        Ok(ids)
    }

    fn ports(&self) -> Result<Vec<SystemPort>, PortListError> {
        let ports = serial_ports(self.tty, self.dev);
        let mut ports = ports.map_err(|error| PortListError::new(self.tty, error))?;
        ports.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(ports)
    }
}

/// Looks up the stable name of the device at a path among `ids`.
fn id_of(ids: &[PathBuf], path: &Path) -> Option<String> {
    let device = fs::canonicalize(path).ok()?;
    let id = ids.iter().find(|id| fs::canonicalize(id).is_ok_and(|path| path == device))?;
    Some(file_name(id))
}

/// Returns the only device among paths; several names of the same device count once.
fn only_device(
    paths: Vec<PathBuf>,
    name: &str,
    describe: impl Fn(&Path) -> String,
) -> Result<Option<PathBuf>, LinkError> {
    let mut devices: Vec<PathBuf> = paths.iter().map(|path| real_path(path)).collect();
    devices.sort();
    devices.dedup();
    if devices.len() > 1 {
        let matches = paths.iter().map(|path| describe(path)).collect();
        return Err(LinkError::Ambiguous { port: name.to_owned(), matches });
    }
    Ok(paths.into_iter().next())
}

fn read_folder(folder: &Path) -> io::Result<Vec<PathBuf>> {
    fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect()
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    /// Temporary copy of the system's port folders.
    struct FakeFolders {
        root: tempfile::TempDir,
    }

    impl FakeFolders {
        fn new() -> Self {
            let fake = Self { root: tempfile::tempdir().expect("a folder") };
            for folder in ["tty", "by-id", "dev", "bus/usb", "bus/usb-serial", "bus/serial-base"] {
                fs::create_dir_all(fake.path(folder)).expect("a folder");
            }
            fake
        }

        fn path(&self, name: &str) -> PathBuf {
            self.root.path().join(name)
        }

        /// Adds a terminal whose device belongs to a subsystem, below a USB device.
        fn add(&self, name: &str, subsystem: &str, serial: Option<&str>) {
            let usb = self.path(&format!("devices/{name}"));
            let device = usb.join("interface");
            let tty = self.path("tty").join(name);
            for folder in [&device, &tty] {
                fs::create_dir_all(folder).expect("a folder");
            }
            symlink(self.path("bus").join(subsystem), device.join("subsystem")).expect("a link");
            symlink(&device, tty.join("device")).expect("a link");
            fs::write(self.path("dev").join(name), "").expect("a file");
            if let Some(serial) = serial {
                fs::write(usb.join("idVendor"), "2341\n").expect("a file");
                fs::write(usb.join("product"), "Uno\n").expect("a file");
                fs::write(usb.join("serial"), format!("{serial}\n")).expect("a file");
            }
        }

        fn add_id(&self, id: &str, name: &str) {
            symlink(self.path("dev").join(name), self.path("by-id").join(id)).expect("a link");
        }

        fn with<T>(&self, work: impl FnOnce(PortFolders) -> T) -> T {
            let [tty, by_id, dev] = ["tty", "by-id", "dev"].map(|name| self.path(name));
            work(PortFolders { tty: &tty, by_id: &by_id, dev: &dev })
        }

        fn find(&self, name: &str, preferred: Option<&str>) -> Result<Resolved, LinkError> {
            self.with(|folders| folders.find(name, preferred))
        }
    }

    fn two_boards() -> FakeFolders {
        let fake = FakeFolders::new();
        for (tty, serial) in [("ttyACM0", "AAAA"), ("ttyACM1", "BBBB")] {
            fake.add(tty, "usb", Some(serial));
            fake.add_id(&format!("usb-Arduino_Uno_{serial}-if00"), tty);
        }
        fake
    }

    #[test]
    fn ports_are_listed() {
        let fake = two_boards();
        fake.add("ttyS0", "serial-base", None);
        fake.add("ttyS1", "serial-base", None);
        fs::write(fake.path("tty/ttyS1/type"), "0\n").expect("a file");
        fs::create_dir(fake.path("tty/console")).expect("a folder");
        let listed = fake.with(|folders| folders.candidates()).expect("they can be listed");
        let names: Vec<_> = listed.iter().map(|port| file_name(Path::new(&port.port))).collect();
        assert_eq!(names, ["ttyACM0", "ttyACM1", "ttyS0"]);
        assert_eq!(listed[0].id.as_deref(), Some("usb-Arduino_Uno_AAAA-if00"));
        assert_eq!(listed[1].usb.as_deref(), Some("Uno BBBB"));
        let link = fake.path("ranger");
        symlink(fake.path("dev/ttyACM1"), &link).expect("a link");
        let name = |path: &Path| fake.with(|folders| folders.device_name(path));
        assert_eq!(name(&link).as_deref(), Some("usb-Arduino_Uno_BBBB-if00"));
        fs::remove_file(fake.path("by-id/usb-Arduino_Uno_BBBB-if00")).expect("removed");
        assert_eq!(name(&fake.path("dev/ttyACM1")).as_deref(), Some("Uno BBBB"));
        assert_eq!(name(&fake.path("dev/ttyS0")), None);
    }

    #[test]
    fn ambiguous_id_lists_all_matches() {
        let fake = two_boards();
        let error = fake.find("Arduino", None).expect_err("two match");
        let text = error.to_string();
        assert!(text.contains("usb-Arduino_Uno_AAAA-if00, usb-Arduino_Uno_BBBB-if00"), "{text}");
        let found = fake.find("Arduino", Some("usb-Arduino_Uno_BBBB-if00")).expect("preferred");
        assert_eq!(found.path, fake.path("by-id/usb-Arduino_Uno_BBBB-if00"));
        for exact in ["AAAA", "usb-Arduino_Uno_AAAA-if00", "Uno_AAAA"] {
            let path = fake.find(exact, None).expect("only one").path;
            assert_eq!(real_path(&path), real_path(&fake.path("dev/ttyACM0")), "{exact}");
        }
    }

    #[test]
    fn aliases_are_not_ambiguous() {
        let fake = FakeFolders::new();
        fake.add("ttyACM0", "usb", None);
        fake.add_id("usb-Arduino_AAAA-if00", "ttyACM0");
        fake.add_id("usb-Arduino_AAAA-if00-port0", "ttyACM0");
        let found = fake.find("Arduino", None).expect("one device");
        assert_eq!(found.matched_id.as_deref(), Some("usb-Arduino_AAAA-if00"));
    }

    #[test]
    fn ambiguous_serial_lists_all_ports() {
        let fake = FakeFolders::new();
        fake.add("ttyUSB0", "usb-serial", Some("0001"));
        fake.add("ttyUSB1", "usb-serial", Some("0001"));
        let error = fake.find("0001", None).expect_err("two match");
        let text = error.to_string();
        assert!(text.contains("dev/ttyUSB0, /") && text.contains("dev/ttyUSB1"), "{text}");
    }

    #[test]
    fn unreadable_folder_is_named() {
        let fake = two_boards();
        fs::remove_dir_all(fake.path("tty")).expect("removed");
        let error = fake.with(|folders| folders.candidates()).expect_err("no list");
        assert!(error.to_string().contains("/tty: No such file"), "{error}");
        let error = fake.find("CCCC", None).expect_err("no list");
        assert!(matches!(error, LinkError::NotListed { .. }), "{error:?}");
        assert!(fake.find("usb-Arduino_Uno_AAAA-if00", None).is_ok(), "the id suffices");
        fs::remove_dir_all(fake.path("by-id")).expect("removed");
        fs::write(fake.path("by-id"), "").expect("a file");
        let error = fake.find("Arduino", None).expect_err("no ids");
        assert!(error.to_string().contains("by-id: Not a directory"), "{error}");
    }
}
