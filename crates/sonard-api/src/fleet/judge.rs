//! What an answer says of a robot. Pure.

use super::Told;

use crate::{api::FleetState, config::is_robot_name};

/// Most reasons that are told of a robot, and most characters of each: they are another's words.
const MOST_REASONS: usize = 3;
const MOST_CHARACTERS: usize = 120;

/// The reason why a daemon did not report, in words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unheard {
    /// Nobody answers, or not in time.
    Silent(String),
    /// It refuses.
    Refusing(String),
    /// It is no daemon of this version.
    Strange(String),
}

/// The observed state of a robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// How it is.
    pub state: FleetState,
    /// What is wrong, in words that are safe to show.
    pub wrong: Vec<String>,
    /// What it said, where it is the right one.
    pub told: Option<Told>,
}

/// What an answer says of the robot that is expected to give it.
#[must_use]
pub fn judge(expected: Option<&str>, answer: Result<Told, Unheard>) -> Seen {
    let without = |state, why: &str| Seen { state, wrong: vec![plain(why)], told: None };
    let told = match answer {
        Ok(told) => told,
        Err(Unheard::Silent(why)) => return without(FleetState::Silent, &why),
        Err(Unheard::Refusing(why)) => return without(FleetState::Refusing, &why),
        Err(Unheard::Strange(why)) => return without(FleetState::Strange, &why),
    };
    let robot = &told.status.robot;
    if !is_robot_name(robot) {
        return without(FleetState::Strange, &format!("its name is {robot:?}"));
    }
    if let Some(expected) = expected.filter(|expected| expected != robot) {
        let why = format!("{robot} answers in place of {expected}");
        return without(FleetState::OtherRobot, &why);
    }
    let (health, status) = (&told.health, &told.status);
    let missing = health.fit.as_ref().map_or(0, |fit| fit.missing);
    let lacks = (missing > 0).then(|| format!("{missing} beams of the last scan are missing"));
    let refused = status.configuration.error.as_ref();
    let refused = refused.map(|error| format!("the configuration was refused: {error}"));
    let wrong = health.reasons.iter().cloned().chain(lacks).chain(refused);
    Seen {
        state: if health.healthy { FleetState::Well } else { FleetState::NotWell },
        wrong: wrong.take(MOST_REASONS).map(|why| plain(&why)).collect(),
        told: Some(told),
    }
}

/// Another's words on one line, without what would steer a terminal, and not too many.
#[must_use]
pub fn plain(text: &str) -> String {
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let shown = text.chars().map(|letter| if is_plain(letter) { letter } else { '\u{fffd}' });
    let mut shown: String = shown.take(MOST_CHARACTERS + 1).collect();
    if shown.chars().count() > MOST_CHARACTERS {
        shown = shown.chars().take(MOST_CHARACTERS - 1).collect();
        shown.push('\u{2026}');
    }
    shown
}

/// Neither control characters nor those that turn the direction of writing.
fn is_plain(letter: char) -> bool {
    !letter.is_control()
        && !matches!(letter, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn others_words_steer_no_terminal_and_are_short() {
        assert_eq!(plain("a\x1b[2Jb\n c"), "a\u{fffd}[2Jb c");
        assert_eq!(plain("x\u{202e}y"), "x\u{fffd}y");
        let long = plain(&"<html>".repeat(1000));
        assert_eq!(long.chars().count(), MOST_CHARACTERS);
    }

    #[test]
    fn who_does_not_answer_is_told_by_why() {
        for (answer, state) in [
            (Unheard::Silent("gone".into()), FleetState::Silent),
            (Unheard::Refusing("no".into()), FleetState::Refusing),
            (Unheard::Strange("html".into()), FleetState::Strange),
        ] {
            let seen = judge(Some("kiwi"), Err(answer));
            assert_eq!((seen.state, seen.wrong.len(), seen.told), (state, 1, None));
        }
    }
}
