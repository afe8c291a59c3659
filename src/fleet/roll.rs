//! What is known of each robot, kept from answer to answer. Pure: times are told.

use jiff::{SignedDuration, Timestamp};
use uuid::Uuid;

use super::{Member, Told, Unheard, judge};
use crate::api::{Fleet, FleetPicture, FleetReport, FleetRobot, FleetScan, FleetState};

/// The robots, in the order of the configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct Roll {
    robots: Vec<FleetRobot>,
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
            wrong: Vec::new(),
            report: None,
        };
        Self { robots: members.into_iter().map(robot).collect() }
    }

    /// Takes in an answer, or that there was none. A number that there is not changes nothing.
    pub fn take(&mut self, number: usize, answer: Result<Told, Unheard>, now: Timestamp) {
        let Some(robot) = self.robots.get_mut(number) else { return };
        let seen = judge(robot.robot.as_deref(), answer);
        if robot.state != seen.state {
            (robot.state, robot.since) = (seen.state, now);
        }
        robot.wrong = seen.wrong;
        if let Some(told) = seen.told {
            robot.heard = Some(now);
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

    /// All that is known.
    #[must_use]
    pub fn fleet(&self) -> Fleet {
        Fleet { robots: self.robots.clone() }
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

    fn roll() -> Roll {
        let members = ["kiwi=/a", "/b"].map(|text| Member::parse(text).expect("a place"));
        Roll::new(&members, Timestamp::UNIX_EPOCH)
    }

    fn at(second: i64) -> Timestamp {
        Timestamp::from_second(second).expect("a time")
    }

    fn state(roll: &Roll, number: usize) -> (FleetState, Timestamp) {
        let robot = &roll.fleet().robots[number];
        (robot.state, robot.since)
    }

    #[test]
    fn silence_counts_from_its_first_answer_on_and_touches_no_other() {
        let mut roll = roll();
        let gone = || Err(Unheard::Silent("nobody".into()));
        roll.take(0, gone(), at(2));
        roll.take(0, gone(), at(4));
        assert_eq!(state(&roll, 0), (FleetState::Silent, at(2)));
        assert_eq!(state(&roll, 1), (FleetState::Unasked, at(0)));
        roll.take(0, Err(Unheard::Refusing("no".into())), at(6));
        assert_eq!(state(&roll, 0), (FleetState::Refusing, at(6)));
        roll.take(7, gone(), at(8));
        roll.show(
            7,
            Uuid::nil(),
            FleetPicture {
                pose: crate::geometry::Pose { x_m: 0.0, y_m: 0.0, heading_deg: 0.0 },
                points_m: Vec::new(),
                walls_m: Vec::new(),
            },
        );
        assert_eq!(roll.fleet().robots.len(), 2);
    }
}
