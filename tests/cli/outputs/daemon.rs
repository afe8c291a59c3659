//! Files that a daemon replaces: its socket, and logs in its folder.

use super::*;

#[test]
fn stale_socket_is_replaced() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name);
    let socket = place("s").display().to_string();
    let start = |log: &str| {
        let log = place(log).display().to_string();
        run(&[
            "run",
            "--mock",
            "--scene",
            "simple-room",
            "--pose",
            "fig9",
            "--log",
            &log,
            "--socket",
            &socket,
        ])
    };
    let refused = |what: &str| {
        let output = start("log");
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(3), "{what}: {message}");
        assert!(
            message.replace(['\n', '\u{2502}', ' '], "").contains(&socket),
            "{what}: {message}"
        );
    };
    fs::write(&socket, "a thesis").expect("writable");
    refused("a file");
    assert_eq!(fs::read_to_string(&socket).expect("kept"), "a thesis");
    fs::rename(&socket, place("thesis")).expect("ours");
    symlink(place("thesis"), &socket).expect("writable");
    refused("a link to a file");
    assert_eq!(fs::read_to_string(place("thesis")).expect("kept"), "a thesis");
    assert!(fs::symlink_metadata(&socket).expect("kept").is_symlink());
    fs::remove_file(&socket).expect("ours");
    symlink(place("nothing"), &socket).expect("writable");
    refused("a link to nothing");
    assert!(fs::symlink_metadata(&socket).expect("kept").is_symlink());
    fs::remove_file(&socket).expect("ours");
    fs::create_dir(&socket).expect("writable");
    refused("a folder");
    fs::remove_dir(&socket).expect("kept, and empty");
    let (fifo, mode) = (rustix::fs::FileType::Fifo, rustix::fs::Mode::RUSR);
    rustix::fs::mknodat(rustix::fs::CWD, socket.as_str(), fifo, mode, 0).expect("a pipe");
    refused("a pipe");
    assert!(fs::metadata(&socket).expect("kept").file_type().is_fifo());
    fs::remove_file(&socket).expect("ours");
    // A listener that is gone without its file is what a killed daemon leaves.
    drop(std::os::unix::net::UnixListener::bind(&socket).expect("a socket"));
    let mut daemon = sonard(&["run", "--mock", "--scene", "simple-room", "--pose", "fig9"]);
    daemon.args(["--log", place("log").to_str().expect("plain"), "--socket", &socket]);
    let mut daemon = daemon.stderr(Stdio::null()).spawn().expect("starts");
    crate::common::wait_until("the socket", || {
        std::os::unix::net::UnixStream::connect(&socket).is_ok()
    });
    // What takes the socket's name meanwhile is not the daemon's to remove.
    fs::remove_file(&socket).expect("ours");
    fs::write(&socket, "another's").expect("writable");
    crate::common::interrupt(daemon.id());
    assert!(daemon.wait().expect("ends").success());
    assert_eq!(fs::read_to_string(&socket).expect("kept"), "another's");
}

#[test]
fn links_in_the_log_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let logs = folder.path().join("log");
    fs::create_dir(&logs).expect("writable");
    let precious = folder.path().join("precious.txt");
    fs::write(&precious, "one line\nand half a").expect("writable");
    symlink(&precious, logs.join("sonard-20991122T000000Z.jsonl")).expect("writable");
    let (log, socket) = (logs.display().to_string(), folder.path().join("s").display().to_string());
    let mut daemon = sonard(&["run", "--mock", "--scene", "simple-room", "--pose", "fig9"]);
    daemon.args(["--log", &log, "--socket", &socket]).stderr(Stdio::null());
    let mut daemon = daemon.spawn().expect("starts");
    crate::common::wait_until("the socket", || {
        std::os::unix::net::UnixStream::connect(&socket).is_ok()
    });
    crate::common::interrupt(daemon.id());
    assert!(daemon.wait().expect("ends").success());
    assert_eq!(fs::read_to_string(&precious).expect("kept"), "one line\nand half a");
    let beside: Vec<_> = fs::read_dir(folder.path()).expect("there").flatten().collect();
    assert!(beside.iter().all(|entry| !entry.file_name().to_string_lossy().contains("torn")));
    // The same of one scan's log, and of a repair's.
    let out = folder.path().join("out");
    fs::create_dir(&out).expect("writable");
    symlink(&precious, out.join("scan.jsonl")).expect("writable");
    let scan = short_scan("fig9", &out, &[]);
    assert_eq!(scan.status.code(), Some(2), "{}", stderr(&scan));
    assert_eq!(fs::read_to_string(&precious).expect("kept"), "one line\nand half a");
}
