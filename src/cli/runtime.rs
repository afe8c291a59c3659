//! The async runtime of the verbs that talk to a device.

use tokio::{
    runtime::{Builder, Runtime},
    signal::unix::{SignalKind, signal},
};

use super::Failure;

pub(super) fn new() -> Result<Runtime, Failure> {
    Builder::new_multi_thread().worker_threads(2).enable_all().build().map_err(|error| {
        Failure::device(format!("cannot start: {error}"), "free some threads or memory")
    })
}

/// Ready at the first interrupt or request to terminate.
pub(super) async fn interrupted() {
    let Ok(mut terminate) = signal(SignalKind::terminate()) else {
        return std::future::pending().await;
    };
    tokio::select! {
        interrupt = tokio::signal::ctrl_c() => drop(interrupt),
        _ = terminate.recv() => {}
    }
}
