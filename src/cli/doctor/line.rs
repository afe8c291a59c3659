//! The line, judged by questions and their answers. Pure.

use std::time::Duration;

use firmware_protocol::host::LinkStats;

use super::report::{Cause, Check};

/// What came of some questions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Questions {
    /// How many.
    pub(super) asked: u32,
    /// The line's figures before the first, and when no further answer was to be expected.
    pub(super) before: LinkStats,
    pub(super) after: LinkStats,
    /// The longest time to an answer.
    pub(super) longest: Duration,
}

/// Tells damage, loss and latency apart: each sending of a question is answered.
pub(super) fn judge(questions: &Questions) -> Check {
    let Questions { asked, before, after, longest } = questions;
    let damage = |stats: &LinkStats| {
        stats.dropped.checksum + stats.dropped.stuffing + stats.dropped.too_long
    };
    let damaged = damage(after) - damage(before);
    let repeated = after.retries - before.retries;
    let sent = after.frames_sent - before.frames_sent;
    let lost = sent.saturating_sub(after.frames_received - before.frames_received);
    let longest_ms = longest.as_millis();
    if damaged == 0 && repeated <= 1 {
        let detail = format!("{asked} questions, each answered within {longest_ms} ms");
        return Check::ok("line", detail);
    }
    if damaged == 0 && lost == 0 {
        return Check::warning(
            "line",
            Cause::Latency,
            format!(
                "nothing was lost, but answers took up to {longest_ms} ms: of {asked} questions \
                 {repeated} were repeated before the answer came"
            ),
            "something on the way holds bytes back: a hub, a serial server on a network, an \
             adapter's latency timer, or a computer that is too busy; readings stay right, but \
             scans take longer",
        );
    }
    Check::warning(
        "line",
        Cause::Line,
        format!(
            "of {asked} questions {repeated} had to be repeated: {lost} of {sent} frames found no \
             answer, {damaged} came damaged"
        ),
        "the line loses or changes bytes: try another cable, away from the motor's, and no hub",
    )
}
