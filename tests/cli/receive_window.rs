//! Receive windows that end before the blanking, in every verb that takes scans.

use crate::{
    collect::{Case, joined_stderr},
    common::{run, stderr},
};

#[test]
fn window_shorter_than_blanking() {
    let scan = ["scan", "--mock", "--scene", "simple-room", "--pose", "fig9"];
    for short in [["--window-ms", "1"], ["--max-range", "0.3"], ["--window-ms", "2.38"]] {
        let output = run(&[&scan[..], &short].concat());
        let text = joined_stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{short:?}: {text}");
        assert!(text.contains("no echo could be detected"), "{text}");
        assert!(text.contains("more than 2.38 ms") && text.contains("0.41 m"), "{text}");
    }
    let longer = run(&[&scan[..], &["--window-ms", "2.5", "--to-deg", "9"]].concat());
    assert_eq!(longer.status.code(), Some(0), "{}", stderr(&longer));
    let case = Case::new("[poses]\nlist = [\"fig9\"]\n[motion]\nwindow_ms = 1\n");
    let text = joined_stderr(&case.collect(&[]));
    assert!(text.contains("no echo could be detected"), "{text}");
    let daemon = ["run", "--check", "--mock", "--scene", "simple-room", "--pose", "fig9"];
    let output = run(&[&daemon[..], &["--set", "motion.window_ms=1"]].concat());
    let text = joined_stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(
        text.contains("motion.window_ms") && text.contains("no echo could be detected"),
        "{text}"
    );
}
