//! Check of the serial line from request statistics. Pure.

use std::time::Duration;

use firmware_protocol::host::LinkStats;

use super::report::{Cause, Check};

/// Statistics of a number of requests.
#[derive(Debug, Clone, Copy)]
pub(super) struct RequestStats {
    pub(super) requests: u32,
    /// Link statistics before the first request and after the last possible reply.
    pub(super) before: LinkStats,
    pub(super) after: LinkStats,
    /// Longest time to a reply.
    pub(super) longest: Duration,
}

/// Distinguishes damage, loss and latency; each transmission of a request has a reply.
pub(super) fn check_line(stats: &RequestStats) -> Check {
    let RequestStats { requests, before, after, longest } = stats;
    let damage = |stats: &LinkStats| {
        stats.dropped.checksum + stats.dropped.stuffing + stats.dropped.too_long
    };
    let damaged = damage(after) - damage(before);
    let repeated = after.retries - before.retries;
    let sent = after.frames_sent - before.frames_sent;
    let lost = sent.saturating_sub(after.frames_received - before.frames_received);
    let longest_ms = longest.as_millis();
    if damaged == 0 && repeated <= 1 {
        let detail = format!("{requests} requests, max latency {longest_ms} ms");
        return Check::ok("line", detail);
    }
    if damaged == 0 && lost == 0 {
        return Check::warning(
            "line",
            Cause::Latency,
            format!(
                "no loss, but replies took up to {longest_ms} ms: of {requests} requests \
                 {repeated} were repeated before the reply arrived"
            ),
            "a component delays bytes: a hub, a serial server on a network, an \
             adapter's latency timer, or a busy computer; readings stay correct, but \
             scans take longer",
        );
    }
    Check::warning(
        "line",
        Cause::Line,
        format!(
            "of {requests} requests {repeated} were repeated: {lost} of {sent} frames had no \
             reply, {damaged} were damaged"
        ),
        "the line loses or corrupts bytes: try another cable, away from the motor's, and no hub",
    )
}
