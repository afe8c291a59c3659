//! Progress bars, shown only on a terminal.

use std::{fs, io::BufRead, path::Path, thread, time::Duration};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Size below which logs are read too quickly for a bar, bytes.
const LONG_LOG_BYTES: u64 = 16 << 20;

/// Bar over `total` items (a plural noun), shown after a second.
pub(super) fn bar(total: u64, items: &str) -> ProgressBar {
    show_later(styled(total, &format!("{{bar:40}} {{pos}}/{{len}} {items}, {{eta}} left")))
}

/// Spinner with a title and a message, for work of unknown length, shown after a second.
pub(super) fn spinner(title: &str) -> ProgressBar {
    show_later(
        ProgressBar::no_length()
            .with_style(style(&format!("{{spinner}} {title} {{msg}} {{elapsed}}"))),
    )
}

fn show_later(bar: ProgressBar) -> ProgressBar {
    bar.set_draw_target(ProgressDrawTarget::hidden());
    let shown = bar.clone();
    #[allow(clippy::disallowed_methods, reason = "only shows a bar")]
    thread::spawn(move || {
        thread::sleep(Duration::from_secs(1));
        if !shown.is_finished() {
            shown.set_draw_target(ProgressDrawTarget::stderr());
        }
    });
    bar
}

/// Wraps the reader of a long log with a bar.
pub(super) fn reading<R: BufRead>(log: &Path, reader: R) -> impl BufRead + use<R> {
    let bytes = fs::metadata(log).map_or(0, |file| file.len());
    let bar = match bytes >= LONG_LOG_BYTES {
        true => styled(bytes, "{bar:40} {bytes}/{total_bytes} read, {eta} left"),
        false => ProgressBar::hidden(),
    };
    bar.wrap_read(reader)
}

fn styled(total: u64, template: &str) -> ProgressBar {
    ProgressBar::new(total).with_style(style(template))
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
