//! Questions to the operator on standard error, with answers from standard input.

use std::io::{BufRead as _, Write as _};

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};

/// Standard input by lines; nothing is read before the first question.
#[derive(Debug, Default)]
pub(super) struct Terminal {
    lines: Option<UnboundedReceiver<String>>,
}

impl Terminal {
    /// Prints a question and waits for a line; `None` at the end of input.
    pub(super) async fn prompt(&mut self, question: &str) -> Option<String> {
        let mut stderr = anstream::stderr();
        // A question that can't be printed may still be answered.
        drop(write!(stderr, "{question} ").and_then(|()| stderr.flush()));
        let lines = self.lines.get_or_insert_with(spawn_reader);
        lines.recv().await.map(|line| line.trim().to_owned())
    }
}

/// Reads lines on a separate thread, which ends with the process even while a read blocks.
fn spawn_reader() -> UnboundedReceiver<String> {
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
