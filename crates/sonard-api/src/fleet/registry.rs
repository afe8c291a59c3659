//! State of each robot of a fleet, updated by poll results. Pure: the caller passes the time.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use uuid::Uuid;

use super::{DaemonReport, Member, PollError, observe};
use crate::api::{Fleet, FleetPicture, FleetReport, FleetRobot, FleetScan, FleetState};

/// States of all robots, in the order of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Registry {
    robots: Vec<FleetRobot>,
    /// Monotonic time of the last report of each robot.
    reported_at: Vec<Option<Duration>>,
}

impl Registry {
    /// Creates a registry of robots that have not been polled yet.
    #[must_use]
    pub fn new<'a>(members: impl IntoIterator<Item = &'a Member>, now: Timestamp) -> Self {
        let robot = |member: &Member| FleetRobot {
            robot: member.robot.clone(),
            address: member.address(),
            page: member.page_url(),
            state: FleetState::NotPolled,
            since: now,
            last_report: None,
            last_report_age_s: None,
            problems: Vec::new(),
            report: None,
        };
        let robots: Vec<_> = members.into_iter().map(robot).collect();
        Self { reported_at: vec![None; robots.len()], robots }
    }

    /// Updates a robot with the result of a poll. `now` is the wall clock time, `at` a monotonic
    /// time. An unknown `number` has no effect.
    pub fn update(
        &mut self,
        number: usize,
        polled: Result<DaemonReport, PollError>,
        (now, at): (Timestamp, Duration),
    ) {
        let Some(robot) = self.robots.get_mut(number) else { return };
        let seen = observe(robot.robot.as_deref(), polled);
        if robot.state != seen.state {
            (robot.state, robot.since) = (seen.state, now);
        }
        robot.problems = seen.problems;
        if let Some(report) = seen.report {
            robot.last_report = Some(now);
            if let Some(reported_at) = self.reported_at.get_mut(number) {
                *reported_at = Some(at);
            }
            let before = robot.report.take().and_then(|report| report.last_scan);
            robot.report = Some(fleet_report(&report, before, now));
            // The first reported name becomes the expected one for further polls.
            robot.robot.get_or_insert(report.status.robot);
        }
        self.flag_duplicate_names();
    }

    /// Returns the last scan of a robot if its picture is missing.
    #[must_use]
    pub fn missing_picture(&self, number: usize) -> Option<Uuid> {
        let last = self.robots.get(number)?.report.as_ref()?.last_scan.as_ref()?;
        last.picture.is_none().then_some(last.scan)
    }

    /// Stores the picture of a scan, if it is still the robot's last one.
    pub fn set_picture(&mut self, number: usize, scan: Uuid, picture: FleetPicture) {
        let robot = self.robots.get_mut(number);
        let last = robot.and_then(|robot| robot.report.as_mut()?.last_scan.as_mut());
        if let Some(last) = last.filter(|last| last.scan == scan) {
            last.picture = Some(picture);
        }
    }

    /// Returns the state of the fleet at a monotonic time.
    #[must_use]
    pub fn fleet(&self, at: Duration) -> Fleet {
        let mut robots = self.robots.clone();
        for (robot, reported_at) in robots.iter_mut().zip(&self.reported_at) {
            robot.last_report_age_s =
                reported_at.map(|reported_at| at.saturating_sub(reported_at).as_secs_f64());
        }
        Fleet { robots }
    }

    /// Adds a problem to robots with duplicate names, which are ambiguous in logs and metrics.
    fn flag_duplicate_names(&mut self) {
        let names: Vec<_> = self.robots.iter().map(|robot| robot.robot.clone()).collect();
        for (number, robot) in self.robots.iter_mut().enumerate() {
            let Some(name) = &robot.robot else { continue };
            let namesakes = names.iter().filter(|other| other.as_ref() == Some(name)).count();
            let problem = format!("{namesakes} robots have the name {name}: set fleet.robot");
            robot.problems.retain(|why| !why.ends_with(": set fleet.robot"));
            if namesakes > 1
                && names.iter().position(|other| other.as_ref() == Some(name)) != Some(number)
            {
                robot.problems.push(problem);
            }
        }
    }
}

fn fleet_report(report: &DaemonReport, before: Option<FleetScan>, now: Timestamp) -> FleetReport {
    let (status, health) = (&report.status, &report.health);
    let age =
        status.last_reading_age_s.and_then(|age_s| SignedDuration::try_from_secs_f64(age_s).ok());
    let picture_of =
        |scan: Uuid| before.filter(|before| before.scan == scan).and_then(|before| before.picture);
    FleetReport {
        sonard: super::sanitize(&status.sonard),
        link: status.link.state,
        provenance: status.provenance,
        scan: status.scan.clone(),
        last_reading_age_s: status.last_reading_age_s,
        last_reading: age.and_then(|age| now.checked_sub(age).ok()),
        last_scan: health.fit.as_ref().map(|fit| FleetScan {
            scan: fit.scan,
            ended: fit.ended,
            agree_fraction: fit.agree_fraction,
            median_abs_residual_m: fit.median_abs_residual_m,
            missing: fit.missing,
            picture: picture_of(fit.scan),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sonard_model::{acoustics::Sensor, geometry::Pose};

    use crate::api::{
        ClockReport, ConfigurationReport, LineTotals, LogStatus, Pending, ScanTotals,
        SensorFigures, SubscriberReport,
    };
    use serde_json::json;

    /// Report of a healthy robot with a last scan.
    fn sample_report(robot: &str, scan: Uuid) -> DaemonReport {
        let zero = Timestamp::UNIX_EPOCH;
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let status = json!({
            "robot": robot, "sonard": "0.1.0", "uptime_s": 1.0,
            "link": {"state": "ready", "since": zero, "port": "", "error": null, "failures": 0,
                     "retry_in_s": null},
            "device": null, "provenance": "mock", "last_reading_age_s": 2.0, "scan": null,
            "scanning": {"mode": "on-request", "every_s": 1.0, "paused": false, "requested": 0,
                         "next_in_s": null},
            "plan": {"from_deg": 0.0, "to_deg": 9.0, "step_deg": 0.9, "pings_per_stop": 1},
            "pose": {"x_m": 0.0, "y_m": 0.0, "heading_deg": 0.0}, "scene": null,
            "air": {"temperature_c": 20.0, "humidity_percent": 50.0, "pressure_kpa": 101.3,
                    "sound_speed_m_s": 343.0, "source": "configuration", "age_s": null,
                    "stale": false, "error": null},
            "sensor": SensorFigures::from_sensor(&sensor), "pending": Pending::default(),
            "log": LogStatus::default(), "subscribers": SubscriberReport::default(),
            "configuration": ConfigurationReport::default(), "simulation": null,
        });
        let fit = json!({"scan": scan, "ended": zero, "both_echo": 3, "agree_fraction": 1.0,
                         "median_abs_residual_m": 0.001, "median_residual_m": 0.0, "missing": 2});
        let health = json!({
            "healthy": true, "reasons": [], "line": LineTotals::default(),
            "scans": ScanTotals::default(), "clock": ClockReport::default(), "fit": fit,
            "reading_lateness_s": null,
        });
        DaemonReport {
            status: serde_json::from_value(status).expect("a status"),
            health: serde_json::from_value(health).expect("a health"),
        }
    }

    const PICTURE: FleetPicture = FleetPicture {
        pose: Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
        points_m: Vec::new(),
        walls_m: Vec::new(),
    };

    fn registry() -> Registry {
        let members = ["kiwi=/a", "/b"].map(|text| Member::parse(text).expect("a place"));
        Registry::new(&members, Timestamp::UNIX_EPOCH)
    }

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a time")
    }

    /// Wall clock and monotonic time.
    fn now(second: u64) -> (Timestamp, Duration) {
        (at(second.cast_signed()), Duration::from_secs(second))
    }

    fn state(registry: &Registry, number: usize) -> (FleetState, Timestamp) {
        let robot = &registry.fleet(Duration::ZERO).robots[number];
        (robot.state, robot.since)
    }

    #[test]
    fn outage_starts_at_first_failure() {
        let mut registry = registry();
        let gone = || Err(PollError::NoResponse("no response".into()));
        registry.update(0, gone(), now(2));
        registry.update(0, gone(), now(4));
        assert_eq!(state(&registry, 0), (FleetState::NoResponse, at(2)));
        assert_eq!(state(&registry, 1), (FleetState::NotPolled, at(0)));
        registry.update(0, Err(PollError::Rejected("no".into())), now(6));
        assert_eq!(state(&registry, 0), (FleetState::Rejected, at(6)));
        registry.update(7, gone(), now(8));
        registry.set_picture(7, Uuid::nil(), PICTURE);
        assert_eq!(registry.fleet(Duration::ZERO).robots.len(), 2);
    }

    #[test]
    fn first_name_becomes_expected() {
        let (mut registry, scan) = (registry(), Uuid::from_u128(1));
        registry.update(1, Ok(sample_report("mango", scan)), now(10));
        let mango = registry.fleet(Duration::ZERO).robots[1].clone();
        assert_eq!((mango.state, mango.robot.as_deref()), (FleetState::Healthy, Some("mango")));
        let report = mango.report.expect("a report");
        assert_eq!((report.last_reading, report.last_reading_age_s), (Some(at(8)), Some(2.0)));
        assert_eq!(mango.problems, ["2 beams missing in the last scan"]);
        registry.update(1, Ok(sample_report("papaya", scan)), now(12));
        let mango = registry.fleet(Duration::ZERO).robots[1].clone();
        assert_eq!((mango.state, mango.since), (FleetState::OtherRobot, at(12)));
        assert_eq!((mango.robot.as_deref(), mango.last_report), (Some("mango"), Some(at(10))));
        assert_eq!(mango.report, Some(report));
        registry.update(1, Ok(sample_report("a/b", scan)), now(14));
        assert_eq!(state(&registry, 1), (FleetState::InvalidResponse, at(14)));
    }

    #[test]
    fn age_ignores_wall_clock_steps() {
        let (mut registry, scan) = (registry(), Uuid::from_u128(1));
        let age_s = |registry: &Registry, at| {
            registry.fleet(Duration::from_secs(at)).robots[0].last_report_age_s
        };
        assert_eq!(age_s(&registry, 5), None);
        registry.update(
            0,
            Ok(sample_report("kiwi", scan)),
            (at(1_800_000_000), Duration::from_secs(10)),
        );
        registry.update(
            0,
            Err(PollError::NoResponse("no response".into())),
            (at(5), Duration::from_secs(12)),
        );
        assert_eq!(age_s(&registry, 17), Some(7.0));
        assert_eq!(age_s(&registry, 0), Some(0.0));
    }

    #[test]
    fn picture_belongs_to_its_scan() {
        let (mut registry, scan, next) = (registry(), Uuid::from_u128(1), Uuid::from_u128(2));
        registry.update(0, Ok(sample_report("kiwi", scan)), now(1));
        assert_eq!(registry.missing_picture(0), Some(scan));
        registry.set_picture(0, next, PICTURE);
        assert_eq!(registry.missing_picture(0), Some(scan), "that was another scan");
        registry.set_picture(0, scan, PICTURE);
        registry.update(0, Ok(sample_report("kiwi", scan)), now(3));
        assert_eq!(registry.missing_picture(0), None);
        registry.update(0, Ok(sample_report("kiwi", next)), now(5));
        assert_eq!(registry.missing_picture(0), Some(next));
    }

    #[test]
    fn duplicate_names_are_flagged_once() {
        let (mut registry, scan) = (registry(), Uuid::from_u128(1));
        registry.update(1, Ok(sample_report("kiwi", scan)), now(1));
        registry.update(0, Ok(sample_report("kiwi", scan)), now(1));
        registry.update(0, Ok(sample_report("kiwi", scan)), now(3));
        let wrong: Vec<_> = registry
            .fleet(Duration::ZERO)
            .robots
            .iter()
            .map(|robot| robot.problems.len())
            .collect();
        assert_eq!(wrong, [1, 2]);
        assert_eq!(
            registry.fleet(Duration::ZERO).robots[1].problems[1],
            "2 robots have the name kiwi: set fleet.robot"
        );
    }

    #[test]
    fn largest_fleet_fits_size_limit() {
        let members: Vec<_> = (0..crate::fleet::MAX_MEMBERS)
            .map(|i| Member::parse(&format!("{i:0>64}={}:1", "h".repeat(60))).expect("a place"))
            .collect();
        let mut registry = Registry::new(&members, at(0));
        for (number, member) in members.iter().enumerate() {
            let mut report = sample_report(member.robot.as_deref().expect("a name"), Uuid::nil());
            report.status.sonard = "\u{1F916}".repeat(10_000);
            report.health.reasons = vec!["\u{1F916}\"\\".repeat(10_000); 100];
            report.health.healthy = false;
            registry.update(number, Ok(report), now(1));
        }
        let bytes = serde_json::to_vec(&registry.fleet(Duration::ZERO)).expect("JSON").len();
        assert!(bytes < 100_000, "{bytes} bytes without pictures");
    }
}
