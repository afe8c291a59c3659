//! End of file and unplugging never make anything spin.

use std::{ops::ControlFlow, time::Duration};

use firmware_protocol::host::{Command, HostConfig, HostError};
use rustix::time::{ClockId, clock_gettime};
use sonard::{
    link::{self, Pty},
    ranger::{DriveError, Driver},
};

/// CPU time of this process, seconds.
fn cpu_s() -> f64 {
    let used = clock_gettime(ClockId::ProcessCPUTime);
    used.tv_sec as f64 + used.tv_nsec as f64 * 1e-9
}

#[tokio::test]
async fn a_driver_whose_line_closed_says_so_once_and_then_rests() {
    let pty = Pty::open(None).expect("a pty");
    let line = link::open(pty.path().to_str().expect("plain path")).expect("opens");
    let mut driver = Driver::new(line, HostConfig::new(link::BAUD, 1));
    let go_on = |_| ControlFlow::Continue(());
    driver.start(Command::Identify).expect("begins");
    let closing = tokio::spawn(async move {
        tokio::time::sleep(Duration::from_millis(50)).await;
        drop(pty);
    });
    let ended = driver.finish(go_on).await;
    assert_eq!(ended, Err(DriveError::Host(HostError::Hangup)));
    closing.await.expect("closes");

    let before = cpu_s();
    let more = tokio::time::timeout(Duration::from_secs(1), driver.finish(go_on)).await;
    assert!(more.is_err(), "nothing more happens on a closed line: {more:?}");
    let used = cpu_s() - before;
    assert!(used < 0.05, "{used} s of CPU in a second on a closed line");
}

#[test]
fn a_mock_rests_when_its_host_has_gone() {
    let folder = tempfile::tempdir().expect("a folder");
    let mock = crate::common::MockProcess::start(folder.path(), &["--realtime"]);
    let scan = ["scan", "--port", mock.port(), "--scene", "simple-room", "--pose", "fig9"];
    let few = ["--max-range", "3", "--to-deg", "9"];
    assert_eq!(crate::common::run(&[&scan[..], &few[..]].concat()).status.code(), Some(0));
    std::thread::sleep(Duration::from_millis(200));
    let before = crate::common::cpu_s(mock.id());
    std::thread::sleep(Duration::from_secs(2));
    let used = crate::common::cpu_s(mock.id()) - before;
    assert!(used < 0.1, "{used} s of CPU in two seconds without a host");
}
