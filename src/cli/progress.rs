//! Progress bars of long work; a terminal shows them, a file or pipe does not.

use std::{fs, io::BufRead, path::Path, thread, time::Duration};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Logs shorter than this are read before a bar could be seen, bytes.
const LONG_LOG_BYTES: u64 = 16 << 20;

/// Of so many `things` (a word in the plural); drawn from the first second on.
pub(super) fn bar(of: u64, things: &str) -> ProgressBar {
    later(styled(of, &format!("{{bar:40}} {{pos}}/{{len}} {things}, {{eta}} left")))
}

/// Of `things` nobody knows how many of there will be, and a message; drawn from the first second on.
pub(super) fn spinner(things: &str) -> ProgressBar {
    later(
        ProgressBar::no_length()
            .with_style(style(&format!("{{spinner}} {{pos}} {things}, {{msg}}, {{elapsed}}"))),
    )
}

fn later(bar: ProgressBar) -> ProgressBar {
    bar.set_draw_target(ProgressDrawTarget::hidden());
    let shown = bar.clone();
    #[allow(clippy::disallowed_methods, reason = "it only shows a bar")]
    thread::spawn(move || {
        thread::sleep(Duration::from_secs(1));
        if !shown.is_finished() {
            shown.set_draw_target(ProgressDrawTarget::stderr());
        }
    });
    bar
}

/// A reader of a log that shows how much of it has been read.
pub(super) fn reading<R: BufRead>(log: &Path, reader: R) -> impl BufRead + use<R> {
    let bytes = fs::metadata(log).map_or(0, |file| file.len());
    let bar = match bytes >= LONG_LOG_BYTES {
        true => styled(bytes, "{bar:40} {bytes}/{total_bytes} read, {eta} left"),
        false => ProgressBar::hidden(),
    };
    bar.wrap_read(reader)
}

fn styled(of: u64, template: &str) -> ProgressBar {
    ProgressBar::new(of).with_style(style(template))
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
