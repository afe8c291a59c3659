//! Effects of a systemd unit's restrictions on a log folder.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use crate::{cli::Failure, store::StoreError};

/// Converts the failure to open a log folder; if a unit's restrictions are the cause, with the
/// drop-in that permits it.
pub(super) fn log_failure(folder: &Path, error: StoreError) -> Failure {
    let StoreError::Open { source, .. } = &error else { return error.into() };
    let cgroup = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    match unit_name(&cgroup).and_then(|unit| drop_in(&absolute(folder), source.kind(), unit)) {
        Some(help) => Failure::device(&error, help),
        None => error.into(),
    }
}

/// Warns of a log folder that is removed when the service stops.
pub(super) fn warn_of_private_folder(folder: &Path) {
    let mounts = fs::read_to_string("/proc/self/mountinfo").unwrap_or_default();
    if is_private(&absolute(folder), &mounts) {
        tracing::warn!(
            "log.folder {} is in the service's own temporary folder (PrivateTmp=): logs are removed when \
             the service stops; name a folder elsewhere",
            folder.display()
        );
    }
}

fn absolute(folder: &Path) -> PathBuf {
    std::path::absolute(folder).unwrap_or_else(|_| folder.into())
}

/// Name of the service that this process belongs to, from `/proc/self/cgroup`.
fn unit_name(cgroup: &str) -> Option<&str> {
    // The hierarchy of version 2, and systemd's own one of version 1.
    let mut paths = cgroup.lines().filter_map(|line| {
        line.strip_prefix("0::").or_else(|| Some(line.split_once(":name=systemd:")?.1))
    });
    let unit = paths.find_map(|path| path.rsplit('/').find(|part| part.ends_with(".service")))?;
    // A user session is a service, too, but without these restrictions.
    (!unit.starts_with("user@")).then_some(unit)
}

/// The drop-in that lets a unit write a folder; `None` if restrictions are not the cause.
fn drop_in(folder: &Path, error: io::ErrorKind, unit: &str) -> Option<String> {
    let is_home = ["/home", "/root", "/run/user"].iter().any(|home| folder.starts_with(home));
    let is_forbidden = match error {
        io::ErrorKind::ReadOnlyFilesystem => true,
        io::ErrorKind::PermissionDenied | io::ErrorKind::NotFound => is_home,
        _ => false,
    };
    if !is_forbidden {
        return None;
    }
    let folder = folder.display();
    let home = if is_home { "\nProtectHome=no" } else { "" };
    Some(format!(
        "{unit} may write below /var/lib/sonard only, unless a drop-in allows more. Make the folder \
         (`sudo install -d -o sonard -g sonard {folder}`), run `sudo systemctl edit {unit}`, \
         enter\n\n[Service]\nReadWritePaths={folder}{home}\n\nand restart it. If it still fails, its \
         file system is mounted read-only."
    ))
}

/// `true` for a folder below a temporary folder of the service's own.
fn is_private(folder: &Path, mounts: &str) -> bool {
    let mounted = mounts.lines().filter_map(|line| {
        let mut fields = line.split(' ').skip(3);
        Some((fields.next()?, fields.next()?))
    });
    let above = mounted.filter(|(_, at)| folder.starts_with(at));
    let nearest = above.max_by_key(|(_, at)| at.len());
    nearest.is_some_and(|(root, _)| root.contains("/systemd-private-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_of_a_service() {
        for (cgroup, unit) in [
            ("0::/system.slice/sonard.service\n", Some("sonard.service")),
            (
                "0::/system.slice/system-sonard.slice/sonard@front.service\n",
                Some("sonard@front.service"),
            ),
            ("12:pids:/x\n0::/system.slice/sonard.service/child\n", Some("sonard.service")),
            ("0::/user.slice/user-1000.slice/user@1000.service/app.slice/x.scope\n", None),
            ("1:name=systemd:/system.slice/sonard.service\n0::/\n", Some("sonard.service")),
            ("0::/\n", None),
            ("", None),
        ] {
            assert_eq!(unit_name(cgroup), unit, "{cgroup}");
        }
    }

    #[test]
    fn drop_in_for_forbidden_folders() {
        use io::ErrorKind as Kind;
        let data = Path::new("/data/sonar");
        let help = drop_in(data, Kind::ReadOnlyFilesystem, "sonard.service").expect("a drop-in");
        assert!(help.contains("systemctl edit sonard.service"), "{help}");
        assert!(help.contains("[Service]\nReadWritePaths=/data/sonar\n"), "{help}");
        assert_eq!(drop_in(data, Kind::PermissionDenied, "sonard.service"), None, "its owner");
        let home = Path::new("/home/robot/log");
        let help = drop_in(home, Kind::PermissionDenied, "sonard.service").expect("a drop-in");
        assert!(help.contains("ProtectHome=no"), "{help}");
        assert_eq!(drop_in(data, Kind::StorageFull, "sonard.service"), None);
    }

    #[test]
    fn private_temporary_folder() {
        let mounts = "21 1 8:1 / / rw - ext4 /dev/sda1 rw\n\
                      40 21 8:1 /tmp/systemd-private-1-sonard.service-x/tmp /tmp rw - ext4 /dev/sda1 rw\n";
        assert!(is_private(Path::new("/tmp/log"), mounts));
        assert!(!is_private(Path::new("/var/lib/sonard"), mounts));
        assert!(!is_private(Path::new("/tmp/log"), "21 1 8:1 / / rw - ext4 /dev/sda1 rw\n"));
        assert!(!is_private(Path::new("/tmp"), "malformed\n"));
    }
}
