//! Progress bars on standard error, hidden unless it is a terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// Bar of a known number of `things`, a plural.
pub(crate) fn bar(count: u64, things: &str) -> ProgressBar {
    let style = format!("{{bar:40}} {{pos}}/{{len}} {things}, {{eta}} left");
    ProgressBar::new(count).with_style(styled(&style))
}

/// Spinner with the number of `things`, a plural, and a message.
pub(crate) fn spinner(things: &str) -> ProgressBar {
    let style = format!("{{spinner}} {{pos}} {things}, {{msg}}, {{elapsed}}");
    ProgressBar::no_length().with_style(styled(&style))
}

fn styled(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
