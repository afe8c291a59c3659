//! Signals that ask a program to end.

use tokio::{
    signal::unix::{SignalKind, signal},
    sync::watch,
};

/// Remembers an interrupt or a request to terminate, whenever it comes.
#[derive(Debug, Clone)]
pub struct Interrupts(watch::Receiver<bool>);

impl Interrupts {
    /// Begins to listen. The first signal is remembered; a second one ends the program at once,
    /// for whoever can't wait until a device has been stopped in an orderly way.
    #[must_use]
    pub fn listen() -> Self {
        let (sender, receiver) = watch::channel(false);
        tokio::spawn(async move {
            wait_for_signal().await;
            // Nobody left to tell is no failure.
            let _ = sender.send(true);
            wait_for_signal().await;
            eprintln!("interrupted again: left at once; a sweep ends with its lease");
            std::process::exit(1);
        });
        Self(receiver)
    }

    /// Ready once there was a signal.
    pub async fn wait(mut self) {
        if self.0.wait_for(|&interrupted| interrupted).await.is_err() {
            std::future::pending::<()>().await;
        }
    }

    /// The same, with the words for a log.
    pub async fn reason(self) -> String {
        self.wait().await;
        "stopped on request".into()
    }

    /// Whether there was one.
    #[must_use]
    pub fn happened(&self) -> bool {
        *self.0.borrow()
    }
}

async fn wait_for_signal() {
    let Ok(mut terminate) = signal(SignalKind::terminate()) else {
        return std::future::pending().await;
    };
    tokio::select! {
        interrupt = tokio::signal::ctrl_c() => drop(interrupt),
        _ = terminate.recv() => {}
    }
}
