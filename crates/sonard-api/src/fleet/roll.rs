//! What is known of each robot, kept from answer to answer. Pure: times are told.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use uuid::Uuid;

use super::{Member, Told, Unheard, judge};
use crate::api::{Fleet, FleetPicture, FleetReport, FleetRobot, FleetScan, FleetState};

/// The robots, in the order of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Roll {
    robots: Vec<FleetRobot>,
    /// When each was heard last, on a clock that is never set.
    heard_at: Vec<Option<Duration>>,
}

impl Roll {
    /// Robots of which nothing is known yet.
    #[must_use]
    pub fn new<'a>(members: impl IntoIterator<Item = &'a Member>, now: Timestamp) -> Self {
        let robot = |member: &Member| FleetRobot {
            robot: member.robot.clone(),
            address: member.address(),
            page: member.page(),
            state: FleetState::Unasked,
            since: now,
            heard: None,
            heard_s: None,
            wrong: Vec::new(),
            report: None,
        };
        let robots: Vec<_> = members.into_iter().map(robot).collect();
        Self { heard_at: vec![None; robots.len()], robots }
    }

    /// Takes in an answer, or that there was none, at a time by the wall clock and by one that is
    /// never set. A number that there is not changes nothing.
    pub fn take(
        &mut self,
        number: usize,
        answer: Result<Told, Unheard>,
        (now, at): (Timestamp, Duration),
    ) {
        let Some(robot) = self.robots.get_mut(number) else { return };
        let seen = judge(robot.robot.as_deref(), answer);
        if robot.state != seen.state {
            (robot.state, robot.since) = (seen.state, now);
        }
        robot.wrong = seen.wrong;
        if let Some(told) = seen.told {
            robot.heard = Some(now);
            if let Some(heard_at) = self.heard_at.get_mut(number) {
                *heard_at = Some(at);
            }
            let before = robot.report.take().and_then(|report| report.last_scan);
            robot.report = Some(report(&told, before, now));
            // Whoever answers there from now on is this one, or another robot.
            robot.robot.get_or_insert(told.status.robot);
        }
        self.tell_of_namesakes();
    }

    /// The scan of which there is no picture yet.
    #[must_use]
    pub fn lacks_picture(&self, number: usize) -> Option<Uuid> {
        let last = self.robots.get(number)?.report.as_ref()?.last_scan.as_ref()?;
        last.picture.is_none().then_some(last.scan)
    }

    /// Takes in how a scan looks, if it is the last one still.
    pub fn show(&mut self, number: usize, scan: Uuid, picture: FleetPicture) {
        let robot = self.robots.get_mut(number);
        let last = robot.and_then(|robot| robot.report.as_mut()?.last_scan.as_mut());
        if let Some(last) = last.filter(|last| last.scan == scan) {
            last.picture = Some(picture);
        }
    }

    /// All that is known at a time by the clock that is never set.
    #[must_use]
    pub fn fleet(&self, at: Duration) -> Fleet {
        let mut robots = self.robots.clone();
        for (robot, heard_at) in robots.iter_mut().zip(&self.heard_at) {
            robot.heard_s = heard_at.map(|heard_at| at.saturating_sub(heard_at).as_secs_f64());
        }
        Fleet { robots }
    }

    /// Two of one name can't be told apart in logs and figures.
    fn tell_of_namesakes(&mut self) {
        let names: Vec<_> = self.robots.iter().map(|robot| robot.robot.clone()).collect();
        for (number, robot) in self.robots.iter_mut().enumerate() {
            let Some(name) = &robot.robot else { continue };
            let namesakes = names.iter().filter(|other| other.as_ref() == Some(name)).count();
            let told = format!("{namesakes} robots are called {name}: set fleet.robot");
            robot.wrong.retain(|why| !why.ends_with(": set fleet.robot"));
            if namesakes > 1
                && names.iter().position(|one| one.as_ref() == Some(name)) != Some(number)
            {
                robot.wrong.push(told);
            }
        }
    }
}

fn report(told: &Told, before: Option<FleetScan>, now: Timestamp) -> FleetReport {
    let (status, health) = (&told.status, &told.health);
    let age =
        status.last_reading_age_s.and_then(|age_s| SignedDuration::try_from_secs_f64(age_s).ok());
    let picture_of =
        |scan: Uuid| before.filter(|before| before.scan == scan).and_then(|before| before.picture);
    FleetReport {
        sonard: super::plain(&status.sonard),
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

    /// What a robot that is well says, with a last scan.
    fn told(robot: &str, scan: Uuid) -> Told {
        let zero = Timestamp::UNIX_EPOCH;
        let sensor = Sensor::preset("senscomp-6500").expect("a preset");
        let status = json!({
            "robot": robot, "sonard": "0.1.0", "uptime_s": 1.0,
            "link": {"state": "ready", "since": zero, "port": "", "trouble": null, "failures": 0,
                     "retry_in_s": null},
            "device": null, "provenance": "mock", "last_reading_age_s": 2.0, "scan": null,
            "scanning": {"mode": "on-request", "every_s": 1.0, "paused": false, "requested": 0,
                         "next_in_s": null},
            "plan": {"from_deg": 0.0, "to_deg": 9.0, "step_deg": 0.9, "pings_per_stop": 1},
            "pose": {"x_m": 0.0, "y_m": 0.0, "heading_deg": 0.0}, "scene": null,
            "air": {"temperature_c": 20.0, "humidity_percent": 50.0, "pressure_kpa": 101.3,
                    "sound_speed_m_s": 343.0, "source": "configuration", "age_s": null,
                    "stale": false, "error": null},
            "sensor": SensorFigures::of(&sensor), "pending": Pending::default(),
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
        Told {
            status: serde_json::from_value(status).expect("a status"),
            health: serde_json::from_value(health).expect("a health"),
        }
    }

    const PICTURE: FleetPicture = FleetPicture {
        pose: Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
        points_m: Vec::new(),
        walls_m: Vec::new(),
    };

    fn roll() -> Roll {
        let members = ["kiwi=/a", "/b"].map(|text| Member::parse(text).expect("a place"));
        Roll::new(&members, Timestamp::UNIX_EPOCH)
    }

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a time")
    }

    /// A time by both clocks.
    fn now(second: u64) -> (Timestamp, Duration) {
        (at(second.cast_signed()), Duration::from_secs(second))
    }

    fn state(roll: &Roll, number: usize) -> (FleetState, Timestamp) {
        let robot = &roll.fleet(Duration::ZERO).robots[number];
        (robot.state, robot.since)
    }

    #[test]
    fn silence_counts_from_its_first_answer_on_and_touches_no_other() {
        let mut roll = roll();
        let gone = || Err(Unheard::Silent("nobody".into()));
        roll.take(0, gone(), now(2));
        roll.take(0, gone(), now(4));
        assert_eq!(state(&roll, 0), (FleetState::Silent, at(2)));
        assert_eq!(state(&roll, 1), (FleetState::Unasked, at(0)));
        roll.take(0, Err(Unheard::Refusing("no".into())), now(6));
        assert_eq!(state(&roll, 0), (FleetState::Refusing, at(6)));
        roll.take(7, gone(), now(8));
        roll.show(7, Uuid::nil(), PICTURE);
        assert_eq!(roll.fleet(Duration::ZERO).robots.len(), 2);
    }

    #[test]
    fn who_answered_first_is_who_is_expected_and_what_it_said_stays_while_another_answers() {
        let (mut roll, scan) = (roll(), Uuid::from_u128(1));
        roll.take(1, Ok(told("mango", scan)), now(10));
        let mango = roll.fleet(Duration::ZERO).robots[1].clone();
        assert_eq!((mango.state, mango.robot.as_deref()), (FleetState::Well, Some("mango")));
        let report = mango.report.expect("it was heard");
        assert_eq!((report.last_reading, report.last_reading_age_s), (Some(at(8)), Some(2.0)));
        assert_eq!(mango.wrong, ["2 beams of the last scan are missing"]);
        roll.take(1, Ok(told("papaya", scan)), now(12));
        let mango = roll.fleet(Duration::ZERO).robots[1].clone();
        assert_eq!((mango.state, mango.since), (FleetState::OtherRobot, at(12)));
        assert_eq!((mango.robot.as_deref(), mango.heard), (Some("mango"), Some(at(10))));
        assert_eq!(mango.report, Some(report));
        roll.take(1, Ok(told("a/b", scan)), now(14));
        assert_eq!(state(&roll, 1), (FleetState::Strange, at(14)));
    }

    #[test]
    fn age_does_not_follow_a_clock_that_is_set() {
        let (mut roll, scan) = (roll(), Uuid::from_u128(1));
        let age_s = |roll: &Roll, at| roll.fleet(Duration::from_secs(at)).robots[0].heard_s;
        assert_eq!(age_s(&roll, 5), None);
        roll.take(0, Ok(told("kiwi", scan)), (at(1_800_000_000), Duration::from_secs(10)));
        roll.take(0, Err(Unheard::Silent("nobody".into())), (at(5), Duration::from_secs(12)));
        assert_eq!(age_s(&roll, 17), Some(7.0));
        assert_eq!(age_s(&roll, 0), Some(0.0));
    }

    #[test]
    fn a_picture_is_of_its_scan_and_goes_with_it() {
        let (mut roll, scan, next) = (roll(), Uuid::from_u128(1), Uuid::from_u128(2));
        roll.take(0, Ok(told("kiwi", scan)), now(1));
        assert_eq!(roll.lacks_picture(0), Some(scan));
        roll.show(0, next, PICTURE);
        assert_eq!(roll.lacks_picture(0), Some(scan), "that was another scan");
        roll.show(0, scan, PICTURE);
        roll.take(0, Ok(told("kiwi", scan)), now(3));
        assert_eq!(roll.lacks_picture(0), None);
        roll.take(0, Ok(told("kiwi", next)), now(5));
        assert_eq!(roll.lacks_picture(0), Some(next));
    }

    #[test]
    fn namesakes_are_told_once_and_no_longer_when_one_has_another_name() {
        let (mut roll, scan) = (roll(), Uuid::from_u128(1));
        roll.take(1, Ok(told("kiwi", scan)), now(1));
        roll.take(0, Ok(told("kiwi", scan)), now(1));
        roll.take(0, Ok(told("kiwi", scan)), now(3));
        let wrong: Vec<_> =
            roll.fleet(Duration::ZERO).robots.iter().map(|one| one.wrong.len()).collect();
        assert_eq!(wrong, [1, 2]);
        assert_eq!(
            roll.fleet(Duration::ZERO).robots[1].wrong[1],
            "2 robots are called kiwi: set fleet.robot"
        );
    }

    #[test]
    fn the_largest_fleet_with_all_that_can_be_wrong_is_within_its_bytes() {
        let members: Vec<_> = (0..crate::fleet::MOST_MEMBERS)
            .map(|i| Member::parse(&format!("{i:0>64}={}:1", "h".repeat(60))).expect("a place"))
            .collect();
        let mut roll = Roll::new(&members, at(0));
        for (number, member) in members.iter().enumerate() {
            let mut told = told(member.robot.as_deref().expect("a name"), Uuid::nil());
            told.status.sonard = "\u{1F916}".repeat(10_000);
            told.health.reasons = vec!["\u{1F916}\"\\".repeat(10_000); 100];
            told.health.healthy = false;
            roll.take(number, Ok(told), now(1));
        }
        let bytes = serde_json::to_vec(&roll.fleet(Duration::ZERO)).expect("JSON").len();
        assert!(bytes < 100_000, "{bytes} bytes without pictures");
    }
}
