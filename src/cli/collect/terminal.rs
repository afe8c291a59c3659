//! Whoever sits at the terminal, or the pipe in their place.

use std::io::{BufRead as _, Write as _};

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};

/// Standard input, line by line; nothing is read of it before something is asked.
#[derive(Debug, Default)]
pub(super) struct Terminal {
    lines: Option<UnboundedReceiver<String>>,
}

impl Terminal {
    /// Asks, and waits for a line; `None` when there is nobody to answer.
    pub(super) async fn ask(&mut self, question: &str) -> Option<String> {
        let mut stderr = anstream::stderr();
        // A question that can't be shown is answered or not all the same.
        drop(write!(stderr, "{question} ").and_then(|()| stderr.flush()));
        let lines = self.lines.get_or_insert_with(listen);
        lines.recv().await.map(|line| line.trim().to_owned())
    }
}

/// A thread of its own: it ends with the process, however long a line takes.
fn listen() -> UnboundedReceiver<String> {
    let (sender, lines) = unbounded_channel();
    #[allow(clippy::disallowed_methods, reason = "it only reads keys")]
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    lines
}
