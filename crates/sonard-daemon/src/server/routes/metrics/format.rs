//! Exposition formats, with content negotiation. Pure.

use std::fmt::Write as _;

/// Exposition format of metrics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExpositionFormat {
    /// OpenMetrics text format 1.0.0.
    OpenMetrics,
    /// Prometheus text format 0.0.4.
    Text,
}

/// Media range of an `Accept` header.
#[derive(Debug, PartialEq)]
struct MediaRange<'a> {
    kind: &'a str,
    version: Option<&'a str>,
    quality: f64,
}

impl ExpositionFormat {
    /// Selects the format that an `Accept` header prefers (RFC 9110, section 12.5.1). OpenMetrics
    /// is preferred among equals, and if the header names neither.
    pub(super) fn negotiate(accept: &str) -> Self {
        let ranges: Vec<MediaRange> =
            split_quoted(accept, ',').into_iter().filter_map(MediaRange::parse).collect();
        let [open_metrics, text] =
            [Self::OpenMetrics, Self::Text].map(|format| format.quality(&ranges));
        let is_rejected = open_metrics == Some(0.0) && text != Some(0.0);
        if is_rejected || text.unwrap_or(0.0) > open_metrics.unwrap_or(0.0) {
            Self::Text
        } else {
            Self::OpenMetrics
        }
    }

    /// Value of the `Content-Type` header.
    pub(super) const fn media_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Text => "text/plain; version=0.0.4; charset=utf-8",
        }
    }

    /// Converts metrics from OpenMetrics to this format.
    pub(super) fn render(self, open_metrics: String) -> String {
        match self {
            Self::OpenMetrics => open_metrics,
            Self::Text => to_text(&open_metrics),
        }
    }

    /// Returns the quality of the most specific matching range; `None` without a match.
    fn quality(self, ranges: &[MediaRange]) -> Option<f64> {
        let (kind, versions): (_, &[&str]) = match self {
            Self::OpenMetrics => ("application/openmetrics-text", &["1.0.0", "0.0.1"]),
            Self::Text => ("text/plain", &["0.0.4"]),
        };
        let specificity = |range: &MediaRange| {
            let (group, _) = kind.split_once('/')?;
            match range.version {
                Some(version) if range.kind.eq_ignore_ascii_case(kind) => {
                    versions.iter().rev().position(|known| *known == version).map(|place| 3 + place)
                }
                Some(_) => None,
                None if range.kind.eq_ignore_ascii_case(kind) => Some(2),
                None if range
                    .kind
                    .strip_suffix("/*")
                    .is_some_and(|g| g.eq_ignore_ascii_case(group)) =>
                {
                    Some(1)
                }
                None if range.kind == "*/*" => Some(0),
                None => None,
            }
        };
        let matching = ranges.iter().filter_map(|range| Some((specificity(range)?, range.quality)));
        // Among equally specific ranges the highest quality counts.
        matching.max_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))).map(|(_, quality)| quality)
    }
}

impl<'a> MediaRange<'a> {
    /// Parses a media range; `None` if it is malformed.
    fn parse(text: &'a str) -> Option<Self> {
        let mut parts = split_quoted(text, ';').into_iter().map(str::trim);
        let kind = parts.next().filter(|kind| kind.contains('/'))?;
        let mut range = Self { kind, version: None, quality: 1.0 };
        for part in parts.filter(|part| !part.is_empty()) {
            let (name, value) = part.split_once('=')?;
            let value = value.trim().trim_matches('"');
            match name.trim() {
                "q" | "Q" => {
                    let quality = value.parse().ok()?;
                    range.quality = Some(quality).filter(|q| (0.0..=1.0).contains(q))?;
                }
                name if name.eq_ignore_ascii_case("version") => range.version = Some(value),
                // Character set and escaping are irrelevant, because all output is ASCII.
                _ => {}
            }
        }
        Some(range)
    }
}

/// Splits a header at separators outside quotes.
fn split_quoted(text: &str, separator: char) -> Vec<&str> {
    let mut is_quoted = false;
    text.split(move |c| {
        is_quoted ^= c == '"';
        c == separator && !is_quoted
    })
    .collect()
}

/// Converts OpenMetrics to Prometheus text format 0.0.4: each sample name has its own type, an info
/// is a gauge, and there is no end mark.
fn to_text(open_metrics: &str) -> String {
    let mut text = String::with_capacity(open_metrics.len());
    // HELP precedes TYPE, on which the sample name depends.
    let mut help: Option<(&str, &str)> = None;
    for line in open_metrics.lines() {
        if let Some((name, about)) =
            line.strip_prefix("# HELP ").and_then(|rest| rest.split_once(' '))
        {
            help = Some((name, about));
        } else if let Some((name, kind)) =
            line.strip_prefix("# TYPE ").and_then(|rest| rest.split_once(' '))
        {
            let (suffix, kind) = match kind {
                "counter" => ("_total", kind),
                "info" => ("_info", "gauge"),
                "unknown" => ("", "untyped"),
                _ => ("", kind),
            };
            if let Some((_, about)) = help.take().filter(|(helped, _)| *helped == name) {
                // Unlike in OpenMetrics, quotes are not escaped.
                let about = about.replace("\\\"", "\"");
                let _ = writeln!(text, "# HELP {name}{suffix} {about}");
            }
            let _ = writeln!(text, "# TYPE {name}{suffix} {kind}");
        } else if !line.starts_with('#') && !line.is_empty() {
            text.push_str(line);
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn negotiates_by_accept() {
        for (accept, format) in [
            ("", ExpositionFormat::OpenMetrics),
            ("*/*", ExpositionFormat::OpenMetrics),
            ("application/json", ExpositionFormat::OpenMetrics),
            ("text/plain", ExpositionFormat::Text),
            ("text/plain;version=0.0.4", ExpositionFormat::Text),
            ("TEXT/PLAIN; Version=\"0.0.4\" ; charset=utf-8", ExpositionFormat::Text),
            ("text/*", ExpositionFormat::Text),
            ("text/plain;version=1.0.0;escaping=allow-utf-8", ExpositionFormat::OpenMetrics),
            ("application/openmetrics-text", ExpositionFormat::OpenMetrics),
            // Prometheus 2 and 3.
            (
                "application/openmetrics-text;version=1.0.0;q=0.5,application/openmetrics-text;\
                 version=0.0.1;q=0.4,text/plain;version=0.0.4;q=0.3,*/*;q=0.2",
                ExpositionFormat::OpenMetrics,
            ),
            (
                "application/openmetrics-text;version=1.0.0;escaping=allow-utf-8;q=0.5,text/plain;\
                 version=1.0.0;escaping=allow-utf-8;q=0.4,text/plain;version=0.0.4;q=0.3,*/*;q=0.2",
                ExpositionFormat::OpenMetrics,
            ),
            // Telegraf and VictoriaMetrics.
            ("text/plain;version=0.0.4;q=1,*/*;q=0.1", ExpositionFormat::Text),
            (
                "text/plain;version=0.0.4, application/openmetrics-text;q=0.9",
                ExpositionFormat::Text,
            ),
            ("application/openmetrics-text;q=0.2, text/plain;q=0.7", ExpositionFormat::Text),
            ("application/openmetrics-text;q=0", ExpositionFormat::Text),
            ("application/openmetrics-text;q=0, */*", ExpositionFormat::Text),
            ("text/plain;q=0, */*", ExpositionFormat::OpenMetrics),
            (
                "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8",
                ExpositionFormat::OpenMetrics,
            ),
            // Malformed elements are ignored.
            ("text/plain;q=2", ExpositionFormat::OpenMetrics),
            ("text/plain;q=NaN", ExpositionFormat::OpenMetrics),
            ("text/plain;q, ;;, ,text", ExpositionFormat::OpenMetrics),
            ("foo/bar;x=\"a,text/plain\"", ExpositionFormat::OpenMetrics),
        ] {
            assert_eq!(ExpositionFormat::negotiate(accept), format, "{accept}");
        }
    }

    #[test]
    fn converts_to_text_format() {
        let open_metrics = "# HELP sonard_robot Which \\\"robot\\\".\n# TYPE sonard_robot info\n\
                            sonard_robot_info{robot=\"kiwi\"} 1\n# HELP sonard_beams Beams.\n\
                            # TYPE sonard_beams counter\nsonard_beams_total 7\n# HELP sonard_up Up.\n\
                            # TYPE sonard_up gauge\n# UNIT sonard_up seconds\nsonard_up 1.5\n# EOF\n";
        let text = "# HELP sonard_robot_info Which \"robot\".\n# TYPE sonard_robot_info gauge\n\
                    sonard_robot_info{robot=\"kiwi\"} 1\n# HELP sonard_beams_total Beams.\n\
                    # TYPE sonard_beams_total counter\nsonard_beams_total 7\n\
                    # HELP sonard_up Up.\n# TYPE sonard_up gauge\nsonard_up 1.5\n";
        assert_eq!(ExpositionFormat::Text.render(open_metrics.to_owned()), text);
        assert_eq!(ExpositionFormat::OpenMetrics.render(open_metrics.to_owned()), open_metrics);
    }

    proptest! {
        #[test]
        fn any_header_is_accepted(accept in "[ -~]{0,80}|(text/plain|[*]/[*]|;q=|0[.]5|,|\"){0,20}") {
            ExpositionFormat::negotiate(&accept);
        }
    }
}
