//! Annotation of readings with verdict and viewpoint.

use sonard_api::Annotations;

/// Appends the fields of `beside` to a reading's line, a JSON object with or without a newline.
#[must_use]
pub fn annotated_line(line: &[u8], beside: &Annotations) -> Vec<u8> {
    let (object, newline) = match line.strip_suffix(b"\n") {
        Some(object) => (object, &b"\n"[..]),
        None => (line, &b""[..]),
    };
    let Some((open, fields)) = object.strip_suffix(b"}").zip(serde_json::to_vec(beside).ok())
    else {
        return line.to_vec();
    };
    // The fields of the second object replace the closing brace of the first one.
    [open, b",", fields.get(1..).unwrap_or_default(), newline].concat()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use sonard_model::geometry::Pose;
    use sonard_records::{Record, ScanView, Session, decode_line};

    const LOG: &str = include_str!("../../../tests/fixtures/small.jsonl");

    fn view() -> ScanView {
        let records = LOG.lines().map(|line| decode_line(line.as_bytes()).expect("a record"));
        ScanView::from_records(records).remove(0)
    }

    #[test]
    fn adds_verdict_and_viewpoint_only() {
        let view = view();
        let (mut verdicts, robot) = (Vec::new(), view.pose().expect("a pose"));
        for line in LOG.lines() {
            let Ok(Record::Ping(ping)) = decode_line(line.as_bytes()) else { continue };
            let beside = Annotations::for_ping(&ping, Some(&view));
            let judged = annotated_line(format!("{line}\n").as_bytes(), &beside);
            assert!(judged.ends_with(b"}\n"));
            assert!(!annotated_line(line.as_bytes(), &beside).ends_with(b"\n"));
            let mut judged: serde_json::Value = serde_json::from_slice(&judged).expect("JSON");
            let fields = judged.as_object_mut().expect("an object");
            let verdict = fields.remove("verdict").expect("a verdict");
            verdicts.push(verdict.as_str().expect("a word").to_owned());
            let viewpoint = fields.remove("viewpoint").expect("a viewpoint");
            assert_eq!(viewpoint["x_m"], robot.x_m);
            assert_eq!(viewpoint["direction_deg"], (robot.heading_deg + ping.azimuth_deg) % 360.0);
            let before: serde_json::Value = serde_json::from_str(line).expect("JSON");
            assert_eq!(judged, before);
        }
        let expected =
            ["direct", "multiple", "edge", "min_range", "no_echo", "unexplained", "link_lost"];
        assert_eq!(verdicts, expected);
    }

    #[test]
    fn viewpoint_follows_the_mounting() {
        let mut view = view();
        let mut session = Session::clone(view.session.as_deref().expect("a session"));
        session.sensor.mounting.ahead_m = 0.1;
        view.session = Some(Arc::new(session));
        let robot = Pose { x_m: 1.0, y_m: 2.0, heading_deg: 90.0 };
        let mut ping = view.pings[0].clone();
        (ping.pose, ping.azimuth_deg) = (Some(robot), 0.0);
        let viewpoint = Annotations::for_ping(&ping, Some(&view)).viewpoint.expect("a viewpoint");
        let error_m = (viewpoint.x_m - 1.0).hypot(viewpoint.y_m - 2.1);
        assert!(error_m < 1e-12, "{viewpoint:?}");

        ping.ranger = Some("s0".into());
        assert_eq!(
            Annotations::for_ping(&ping, Some(&view)).viewpoint,
            None,
            "a ranger that the array lacks"
        );
        let ping = view.pings[0].clone();
        assert_eq!(Annotations::for_ping(&ping, None).viewpoint, None);
        view.start = None;
        assert_eq!(
            Annotations::for_ping(&ping, Some(&view)).viewpoint,
            None,
            "a scan without a pose"
        );
        view.scan = uuid::Uuid::from_u128(7);
        assert_eq!(Annotations::for_ping(&ping, Some(&view)).viewpoint, None, "another scan");
    }
}
