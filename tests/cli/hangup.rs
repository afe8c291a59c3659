//! A driver after its line has closed.

use std::{ops::ControlFlow, time::Duration};

use firmware_protocol::host::{Command, HostConfig, HostError};
use sonard::{
    link::{self, Pty},
    ranger::{DriveError, Driver},
};

#[tokio::test]
async fn closed_line_is_reported_once() {
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

    let more = tokio::time::timeout(Duration::from_secs(1), driver.finish(go_on)).await;
    assert!(more.is_err(), "nothing more happens on a closed line: {more:?}");
}
