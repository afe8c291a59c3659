//! File, environment and options, and taking changes in while running.

use std::{fs, os::unix::fs::PermissionsExt as _};

use sonard_test_support::in_process::Daemon as InProcess;

use super::{Daemon, clean_log, logs, write_token};
use crate::common::{run, sonard, stderr};

#[test]
fn shipped_file_is_printed() {
    let printed = run(&["run", "--print-config"]);
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/config/sonard.toml");
    let text = fs::read_to_string(shipped).expect("it is shipped");
    assert_eq!(String::from_utf8_lossy(&printed.stdout), text);
    let checked = run(&["run", "--check", "--config", shipped, "--port", "/dev/ttyACM0"]);
    assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
    assert!(String::from_utf8_lossy(&checked.stdout).contains("step_deg = 0.9"));
}

/// An instance's file is a copy of the shipped one: it must not send the instance to the folder and
/// socket of another.
#[test]
fn shipped_file_keeps_defaults() {
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/config/sonard.toml");
    let start = ["--simulate", "--scene", "corridor", "--pose", "2,1,0"];
    let output = sonard(&["run", "--check", "--config", shipped])
        .args(start)
        .env("STATE_DIRECTORY", "/var/lib/sonard/front")
        .env("RUNTIME_DIRECTORY", "/run/sonard/front")
        .output()
        .expect("the program starts");
    let printed = String::from_utf8_lossy(&output.stdout);
    for part in [
        "folder = \"/var/lib/sonard/front\"",
        "socket = \"/run/sonard/front/sonard.sock\"",
        "mode = \"continuous\"",
    ] {
        assert!(printed.contains(part), "no {part} in {printed}{}", stderr(&output));
    }
}

#[test]
fn wrong_configurations() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("s.toml");
    let port = ["--port", "/dev/ttyACM0"];
    for (text, further, parts) in [
        ("[plan]\nstep_dge = 1\n", &port[..], &["s.toml:2:1", "did you mean `step_deg`"][..]),
        (
            "[plan]\nfrom_deg = 90\nto_deg = 10\n",
            &port[..],
            &["s.toml:3:10", "greater than from_deg"],
        ),
        (
            "[place]\nscene = \"simple-rom\"\n",
            &port[..],
            &["simple-rom", "did you mean `simple-room`"],
        ),
        ("[place]\nscene = \"simple-room\"\npose = \"99,99\"\n", &port[..], &["room spans"]),
        (
            "[model]\nengine = \"fan\"\nedge_law = \"utd\"\n",
            &port[..],
            &["s.toml:3:12", "edge_law is not an option of", "the engine paths"],
        ),
        (
            "[model]\nray_spacing_deg = 0.1\n",
            &port[..],
            &["s.toml:2:19", "ray_spacing_deg is not an option", "choose the engine fan"],
        ),
        ("[model]\nsensor = \"hc\"\n", &port[..], &["presets"]),
        ("", &[][..], &["device.port is not set", "--mock"]),
        ("", &["--mock"][..], &["needs a scene"]),
        ("[server]\nsocket_mode = \"9999\"\n", &port[..], &["s.toml:2:15", "three octal digits"]),
        ("[server]\nsocket_mode = \"00660\"\n", &port[..], &["three octal digits"]),
        ("[fleet]\nrobot = \"a/b\"\n", &port[..], &["s.toml:2:9", "letters, digits"]),
        ("[fleet]\nrobot = \"\"\n", &port[..], &["s.toml:2:9", "letters, digits"]),
        ("[ros]\nenabled = true\nnamespace = \"kiwi\"\n", &port[..], &["s.toml:3:13", "/kiwi"]),
        ("[ros]\nenabled = true\nnetworks = [\"*\"]\n", &port[..], &["s.toml:3:12", "wlan0"]),
        ("[ros]\ndomain = 233\n", &port[..], &["s.toml:2:10", "232"]),
        ("[server]\nlisten = \"localhost\"\n", &port[..], &["s.toml:2:10", "127.0.0.1:8765"]),
        ("", &["--port", "x", "--set", "link.retry_max_s=0.1"][..], &["--set", "retry_min_s"]),
    ] {
        fs::write(&file, text).expect("a file");
        let arguments = ["run", "--check", "--config", file.to_str().expect("plain path")];
        let output = sonard(&arguments).args(further).env_remove("SONARD_PLAN_STEP_DEG").output();
        let output = output.expect("the program starts");
        // A terminal's width breaks lines where it likes.
        let printed = stderr(&output).replace("\n  │ ", "").replace('\n', " ");
        assert_eq!(output.status.code(), Some(2), "{text}: {printed}");
        for part in parts {
            assert!(printed.contains(part), "{text}: no {part:?} in {printed}");
        }
    }
    let missing = run(&["run", "--check", "--config", "/no/such.toml"]);
    assert_eq!(missing.status.code(), Some(2));
    let output =
        sonard(&["run", "--check", "--port", "x"]).env("SONARD_PLAN_STEP_DEG", "fast").output();
    assert!(stderr(&output.expect("starts")).contains("SONARD_PLAN_STEP_DEG"));
}

#[test]
fn robot_name() {
    let host = rustix::system::uname();
    let host = host.nodename().to_str().expect("plain");
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = InProcess::start_mock(folder.path(), &["--set", "plan.to_deg=9"]);
    assert_eq!(daemon.status()["robot"], host);
    daemon.stop();

    let named = ["--set", "plan.to_deg=9", "--set", "fleet.robot=kiwi-7"];
    let daemon = InProcess::start_mock(folder.path(), &named);
    assert_eq!(daemon.status()["robot"], "kiwi-7");
    let figures = String::from_utf8(daemon.get("/metrics").body).expect("text");
    let info = format!(
        "\nsonard_robot_info{{robot=\"kiwi-7\",version=\"{}\"}} 1\n",
        env!("CARGO_PKG_VERSION")
    );
    assert!(figures.contains(&info), "{figures}");
    daemon.wait_for("ready");
    assert_eq!(daemon.send("POST", "/v1/start", r#"{"scans":1}"#).status, 202);
    daemon.wait_for_scans(1);
    assert_eq!(daemon.get("/v1/session").json()["robot"], "kiwi-7");
    daemon.stop();
    let log = clean_log(folder.path());
    let session = log.of_type("session").next().expect("a session");
    assert_eq!(session["robot"], "kiwi-7");
    let shown = run(&["log", "show", logs(folder.path())[0].to_str().expect("plain path")]);
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    assert!(shown.contains("robot   kiwi-7"), "{shown}");
}

#[test]
fn reload_on_hangup() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("s.toml");
    fs::write(&file, "[plan]\nto_deg = 90\n").expect("a file");
    let config = ["--config", file.to_str().expect("plain path")];
    let mut daemon = InProcess::start_mock(folder.path(), &config);
    assert_eq!(daemon.status()["plan"]["to_deg"], 90.0);

    fs::write(&file, "[plan]\nto_deg = 45\n[server]\nmax_clients = 7\n").expect("a file");
    daemon.reload();
    daemon.wait_until("the new plan", || daemon.status()["plan"]["to_deg"] == 45.0);
    let configuration = &daemon.status()["configuration"];
    assert_eq!(configuration["needs_restart"], serde_json::json!(["server"]));

    fs::write(&file, "[plan]\nto_dge = 30\n").expect("a file");
    daemon.reload();
    daemon.wait_until("the refusal", || daemon.status()["configuration"]["error"].is_string());
    let status = daemon.status();
    assert_eq!(status["plan"]["to_deg"], 45.0);
    let error = status["configuration"]["error"].as_str().expect("text");
    assert!(error.contains("s.toml:2:1") && error.contains("to_deg"), "{error}");
    daemon.stop();
}

#[test]
fn unusable_token_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let token = write_token(folder.path(), "0123456789abcdef");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let start = |token: &str| {
        let key = format!("server.token_file={token}");
        let mock = ["run", "--mock", "--scene", "simple-room", "--pose", "fig9", "--set", &key];
        let output = run(&[&mock[..], &["--log", &path("log"), "--socket", &path("s")]].concat());
        let printed = stderr(&output).replace("\n  │ ", "").replace('\n', " ");
        assert_eq!(output.status.code(), Some(2), "{token}: {printed}");
        printed
    };
    let mode = |mode: u32| fs::set_permissions(&token, fs::Permissions::from_mode(mode));
    mode(0o640).expect("it is ours");
    let printed = start(&token.display().to_string());
    assert!(printed.contains("chmod 600") && printed.contains("640"), "{printed}");
    let printed = start("/dev/zero");
    assert!(printed.contains("not a regular file"), "{printed}");
    // The same file in a client's hands.
    let status = ["status", "--address", "localhost:1", "--token-file", "/dev/zero"];
    assert_eq!(run(&status).status.code(), Some(2));
}

#[test]
fn second_daemon_is_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let daemon = Daemon::start_mock(folder.path(), &[]);
    let mock = ["run", "--mock", "--scene", "simple-room", "--pose", "fig9"];
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (log, socket, other) = (path("log"), path("s"), path("other"));
    let second = run(&[&mock[..], &["--log", &log, "--socket", &other]].concat());
    assert_eq!(second.status.code(), Some(3));
    assert!(stderr(&second).contains("another process"), "{}", stderr(&second));
    let third = run(&[&mock[..], &["--log", &other, "--socket", &socket]].concat());
    assert_eq!(third.status.code(), Some(3));
    assert!(stderr(&third).contains("another sonard"), "{}", stderr(&third));
    assert_eq!(daemon.status()["link"]["state"], "ready");
}
