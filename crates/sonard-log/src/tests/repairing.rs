//! Repair, at every byte.

use super::*;
use crate::{Repair, load, repair};

#[test]
fn cut_anywhere_every_whole_line_is_kept() {
    let (folder, log) = fast_folder();
    for cut in 0..=LOG.len() {
        written(&log, &LOG[..cut]);
        let done = repair(&log).expect("it can be repaired");
        // A record is whole with its closing brace; the newline can be given back.
        let lines = LOG[..cut].split_inclusive('\n');
        let whole: String = lines
            .filter(|line| line.ends_with("}\n") || LOG.lines().any(|l| l == *line))
            .map(|line| format!("{}\n", line.trim_end()))
            .collect();
        assert_eq!(read(&log), whole, "cut at {cut}");
        assert_eq!(done.left_out, [], "cut at {cut}");
        assert_eq!(done.kept as usize, whole.lines().count(), "cut at {cut}");
        assert_eq!(load(&log).expect("it is there").damaged, [], "cut at {cut}");
        match done.original {
            Some(original) => {
                assert_eq!(read(&original), LOG[..cut], "cut at {cut}");
                std::fs::remove_file(original).expect("it is there");
            }
            None => assert_eq!(whole.len(), cut, "nothing to repair"),
        }
        // Neither drafts nor anything else is left behind.
        assert_eq!(folder.path().read_dir().expect("a folder").count(), 1, "cut at {cut}");
    }
}

#[test]
fn lines_are_copied_not_written_anew() {
    let (_folder, log) = folder();
    // Fields that this program doesn't know, odd spacing and a foreign line end.
    let odd = LOG.replace("{\"type\":\"event\"", "{ \"mood\" : [1.50, 2] ,\"type\":\"event\"");
    let odd = odd.replacen("\n", "\r\n", 2);
    written(&log, format!("{odd}rubbish\n{odd}"));
    let done = repair(&log).expect("it can be repaired");
    assert_eq!(read(&log), format!("{odd}{odd}"));
    let places: Vec<_> = done.left_out.iter().map(|l| (l.line, l.offset, l.length)).collect();
    assert_eq!(places, [(12, odd.len() as u64, 7)]);
}

#[test]
fn the_original_takes_the_next_free_name() {
    let (folder, log) = folder();
    for name in ["scan.jsonl.orig", "scan.jsonl.orig-2", "scan.jsonl.orig-3"] {
        written(&log, format!("{LOG}{{\"torn {name}"));
        let original = repair(&log).expect("it can be repaired").original.expect("it was torn");
        assert_eq!(original.file_name(), Some(name.as_ref()));
    }
    assert_eq!(folder.path().read_dir().expect("a folder").count(), 4);
    let nothing = Repair { kept: 11, ..Repair::default() };
    assert_eq!(repair(&log).expect("it is whole"), nothing);
}

#[test]
fn what_another_version_may_read_is_not_thinned_out() {
    let (_folder, log) = folder();
    let other = LOG
        .replace("\"format\":1", "\"format\":2")
        .replace("\"started\"", "\"begun\"")
        .replace("\"type\":\"scan_end\"", "\"type\":\"scan_over\"")
        .replace("\"index\":4,", "");
    written(&log, format!("{other}rubbish\n{{\"no\":\"type\"}}\n"));
    let done = repair(&log).expect("it can be repaired");
    let numbers = |errors: &[crate::LineError]| -> Vec<u64> {
        errors.iter().map(|error| error.line).collect()
    };
    assert_eq!((done.kept, numbers(&done.kept_unread)), (8, vec![1, 7, 10]));
    assert_eq!(done.left_out.iter().map(|left| left.line).collect::<Vec<_>>(), [12, 13]);
    assert_eq!(read(&log), other);
    assert_eq!(repair(&log).expect("it is there").original, None);
}

#[test]
fn permissions_and_links_survive() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let (folder, log) = folder();
    written(&log, format!("{LOG}torn"));
    std::fs::set_permissions(&log, PermissionsExt::from_mode(0o640)).expect("it is ours");
    let link = folder.path().join("latest");
    symlink(&log, &link).expect("a link");
    repair(&link).expect("it can be repaired");
    assert_eq!(read(&log), LOG);
    assert!(link.is_symlink());
    let mode = std::fs::metadata(&log).expect("it is there").permissions().mode();
    assert_eq!(mode & 0o777, 0o640);
}
