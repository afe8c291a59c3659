//! Repair of logs.

use super::*;
use crate::{Repair, load, repair};

#[test]
fn truncation_at_any_byte() {
    let (folder, log) = fast_folder();
    for cut in 0..=LOG.len() {
        written(&log, &LOG[..cut]);
        let done = repair(&log).expect("repaired");
        // A record is complete with its closing brace; repair adds the newline.
        let lines = LOG[..cut].split_inclusive('\n');
        let whole: String = lines
            .filter(|line| line.ends_with("}\n") || LOG.lines().any(|l| l == *line))
            .map(|line| format!("{}\n", line.trim_end()))
            .collect();
        assert_eq!(read(&log), whole, "cut at {cut}");
        assert_eq!(done.removed, [], "cut at {cut}");
        assert_eq!(done.kept as usize, whole.lines().count(), "cut at {cut}");
        assert_eq!(load(&log).expect("exists").damaged, [], "cut at {cut}");
        match done.original {
            Some(original) => {
                assert_eq!(read(&original), LOG[..cut], "cut at {cut}");
                std::fs::remove_file(original).expect("exists");
            }
            None => assert_eq!(whole.len(), cut, "nothing to repair"),
        }
        // No drafts or other files remain.
        assert_eq!(folder.path().read_dir().expect("a folder").count(), 1, "cut at {cut}");
    }
}

#[test]
fn copies_lines_byte_for_byte() {
    let (_folder, log) = folder();
    // Unknown fields, unusual spacing and Windows line ends.
    let odd = LOG.replace("{\"type\":\"event\"", "{ \"mood\" : [1.50, 2] ,\"type\":\"event\"");
    let odd = odd.replacen("\n", "\r\n", 2);
    written(&log, format!("{odd}rubbish\n{odd}"));
    let done = repair(&log).expect("repaired");
    assert_eq!(read(&log), format!("{odd}{odd}"));
    let places: Vec<_> = done.removed.iter().map(|l| (l.line, l.offset, l.length)).collect();
    assert_eq!(places, [(12, odd.len() as u64, 7)]);
}

#[test]
fn name_of_the_original() {
    let (folder, log) = folder();
    for name in ["scan.jsonl.orig", "scan.jsonl.orig-2", "scan.jsonl.orig-3"] {
        written(&log, format!("{LOG}{{\"torn {name}"));
        let original = repair(&log).expect("repaired").original.expect("it was torn");
        assert_eq!(original.file_name(), Some(name.as_ref()));
    }
    assert_eq!(folder.path().read_dir().expect("a folder").count(), 4);
    let nothing = Repair { kept: 11, ..Repair::default() };
    assert_eq!(repair(&log).expect("it is whole"), nothing);
}

#[test]
fn keeps_unreadable_records() {
    let (_folder, log) = folder();
    let other = LOG
        .replace("\"format\":1", "\"format\":2")
        .replace("\"started\"", "\"begun\"")
        .replace("\"type\":\"scan_end\"", "\"type\":\"scan_over\"")
        .replace("\"index\":4,", "");
    written(&log, format!("{other}rubbish\n{{\"no\":\"type\"}}\n"));
    let done = repair(&log).expect("repaired");
    let numbers = |errors: &[crate::LineError]| -> Vec<u64> {
        errors.iter().map(|error| error.line).collect()
    };
    assert_eq!((done.kept, numbers(&done.kept_unread)), (8, vec![1, 7, 10]));
    assert_eq!(done.removed.iter().map(|left| left.line).collect::<Vec<_>>(), [12, 13]);
    assert_eq!(read(&log), other);
    assert_eq!(repair(&log).expect("exists").original, None);
}

#[test]
fn keeps_permissions_and_links() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let (folder, log) = folder();
    written(&log, format!("{LOG}torn"));
    std::fs::set_permissions(&log, PermissionsExt::from_mode(0o640)).expect("it is ours");
    let link = folder.path().join("latest");
    symlink(&log, &link).expect("a link");
    repair(&link).expect("repaired");
    assert_eq!(read(&log), LOG);
    assert!(link.is_symlink());
    let mode = std::fs::metadata(&log).expect("exists").permissions().mode();
    assert_eq!(mode & 0o777, 0o640);
}
