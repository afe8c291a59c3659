//! The link's state machine against simulated time.

use super::*;
use proptest::prelude::*;

const BACK_OFF: BackOff = BackOff { min: Duration::from_millis(200), max: Duration::from_secs(5) };

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// A machine brought to `Ready` at time 0.
fn ready() -> LinkMachine {
    let mut machine = LinkMachine::new(BACK_OFF, ms(0));
    for (step, input) in [
        (Step::Open, Input::Opened),
        (Step::Identify, Input::Identified),
        (Step::Home, Input::Homed),
    ] {
        assert_eq!(machine.poll(ms(0)), step);
        machine.handle(ms(0), input);
    }
    assert_eq!(machine.poll(ms(0)), Step::Serve);
    machine
}

#[test]
fn waits_double_up_to_the_bound_and_begin_anew_after_proper_use() {
    let mut machine = LinkMachine::new(BACK_OFF, ms(0));
    let mut now = ms(0);
    let mut waits = Vec::new();
    for _ in 0..8 {
        assert_eq!(machine.poll(now), Step::Open);
        machine.handle(now, Input::Failed(Trouble::Absent));
        let Step::Wait(until) = machine.poll(now) else { panic!("{:?}", machine.state()) };
        waits.push((until - now).as_millis());
        now = until;
    }
    assert_eq!(waits, [200, 400, 800, 1600, 3200, 5000, 5000, 5000]);

    let mut machine = ready();
    machine.handle(ms(1), Input::ScanBegun);
    machine.handle(ms(2), Input::ScanEnded);
    machine.handle(ms(3), Input::Failed(Trouble::Lost));
    assert_eq!(machine.poll(ms(3)), Step::Wait(ms(203)));
}

#[test]
fn a_device_that_fails_again_as_soon_as_it_is_up_is_tried_less_and_less_often() {
    let mut machine = LinkMachine::new(BACK_OFF, ms(0));
    let mut now = ms(0);
    for _ in 0..6 {
        for input in [Input::Opened, Input::Identified, Input::Homed, Input::ScanBegun] {
            machine.poll(now);
            machine.handle(now, input);
        }
        machine.handle(now, Input::Failed(Trouble::Fault));
        let Step::Wait(until) = machine.poll(now) else { panic!("it waits") };
        now = until;
    }
    assert_eq!(now, ms(200 + 400 + 800 + 1600 + 3200 + 5000));
    // One that was up for longer than the longest wait is a new case.
    for input in [Input::Opened, Input::Identified, Input::Homed] {
        machine.poll(now);
        machine.handle(now, input);
    }
    let later = now + ms(5001);
    machine.handle(later, Input::Failed(Trouble::Lost));
    assert_eq!(machine.poll(later), Step::Wait(later + ms(200)));
}

#[test]
fn a_device_that_came_back_is_waited_for_as_if_it_had_never_been_away() {
    let mut machine = ready();
    let mut now = ms(0);
    let mut waits = Vec::new();
    // Pulled and plugged in again: gone for five tries, and soon up again.
    for _ in 0..3 {
        now += ms(1_000);
        machine.handle(now, Input::Failed(Trouble::Lost));
        for attempt in 0..5 {
            let Step::Wait(until) = machine.poll(now) else { panic!("it waits") };
            if attempt == 0 {
                waits.push((until - now).as_millis());
            }
            now = until;
            assert_eq!(machine.poll(now), Step::Open);
            machine.handle(now, Input::Failed(Trouble::Absent));
        }
        let Step::Wait(until) = machine.poll(now) else { panic!("it waits") };
        now = until;
        for input in [Input::Opened, Input::Identified, Input::Homed] {
            machine.poll(now);
            machine.handle(now, input);
        }
    }
    // Without a scan it has not proved itself: one that flaps is tried less and less often.
    assert_eq!(waits, [200, 400, 800]);
}

#[test]
fn a_long_absence_is_told_once_and_the_return_once() {
    let mut machine = ready();
    assert_eq!(machine.poll_transition(), Some(Transition { from: None, to: LinkState::Ready }));
    let mut told = Vec::new();
    let mut now = ms(10);
    machine.handle(now, Input::Failed(Trouble::Lost));
    for _ in 0..1000 {
        told.extend(machine.poll_transition());
        match machine.poll(now) {
            Step::Open => machine.handle(now, Input::Failed(Trouble::Absent)),
            Step::Wait(until) => now = until,
            other => panic!("{other:?}"),
        }
    }
    machine.poll(now + ms(5000));
    for input in [Input::Opened, Input::Identified, Input::Homed] {
        machine.handle(now, input);
    }
    told.extend(machine.poll_transition());
    let states: Vec<_> = told.iter().map(|transition| transition.to).collect();
    assert_eq!(
        states,
        [LinkState::Down(Trouble::Lost), LinkState::Down(Trouble::Absent), LinkState::Ready]
    );
    // Scan after scan is not told either.
    machine.handle(now, Input::ScanBegun);
    machine.handle(now, Input::ScanEnded);
    assert_eq!(machine.poll_transition(), None);
}

#[test]
fn a_restart_without_work_homes_again_before_the_next_scan() {
    let mut machine = ready();
    machine.handle(ms(5), Input::Restarted);
    assert_eq!(machine.poll(ms(5)), Step::Identify);
    machine.handle(ms(5), Input::ScanBegun);
    assert_eq!(machine.poll(ms(5)), Step::Identify, "no scan without homing");
    machine.handle(ms(6), Input::Identified);
    assert_eq!(machine.poll(ms(6)), Step::Home);
}

#[test]
fn after_an_emergency_stop_nothing_moves_until_it_is_started() {
    let mut machine = ready();
    machine.handle(ms(1), Input::EmergencyStop(true));
    machine.handle(ms(2), Input::Start);
    assert_eq!(machine.poll(ms(2)), Step::Rest, "it is still pressed");
    machine.handle(ms(3), Input::EmergencyStop(false));
    for input in
        [Input::PortChanged, Input::Restarted, Input::Failed(Trouble::Lost), Input::ScanBegun]
    {
        machine.handle(ms(4), input);
        assert_eq!(machine.state(), LinkState::AwaitingStart);
        assert_eq!(machine.poll(ms(3_600_000)), Step::Rest);
    }
    machine.handle(ms(5), Input::Start);
    assert_eq!(machine.poll(ms(5)), Step::Open);

    // The device's own emergency stop is no other.
    let mut machine = ready();
    machine.handle(ms(1), Input::DeviceStopped);
    assert_eq!(machine.poll(ms(3_600_000)), Step::Rest);
    machine.handle(ms(2), Input::Start);
    assert_eq!(machine.poll(ms(2)), Step::Open);
}

#[test]
fn where_it_may_resume_it_homes_after_the_emergency_stop() {
    let mut machine = ready();
    machine.set_resumes(true);
    machine.handle(ms(1), Input::ScanBegun);
    machine.handle(ms(2), Input::EmergencyStop(true));
    for input in [Input::ScanEnded, Input::Homed, Input::Failed(Trouble::Lost)] {
        machine.handle(ms(3), input);
        assert_eq!(machine.poll(ms(3_600_000)), Step::Rest);
    }
    machine.handle(ms(4), Input::EmergencyStop(false));
    assert_eq!(machine.poll(ms(4)), Step::Open);
}

fn input() -> impl Strategy<Value = Input> {
    use Trouble::{Absent, Busy, Fault, Forbidden, Lost, NotAnswering, WrongDevice, WrongFirmware};
    let trouble = prop::sample::select(vec![
        Absent,
        Busy,
        Forbidden,
        NotAnswering,
        WrongFirmware,
        WrongDevice,
        Lost,
        Fault,
    ]);
    prop_oneof![
        Just(Input::Opened),
        Just(Input::Identified),
        Just(Input::Homed),
        Just(Input::ScanBegun),
        Just(Input::ScanEnded),
        Just(Input::Restarted),
        trouble.prop_map(Input::Failed),
        any::<bool>().prop_map(Input::EmergencyStop),
        Just(Input::DeviceStopped),
        Just(Input::Start),
        Just(Input::PortChanged),
    ]
}

proptest! {
    /// Whatever happens in whatever order: scans run only on a connection that was homed,
    /// waits are bounded, and tries are never closer together than the least wait.
    #[test]
    fn no_motion_before_homing_and_no_spin(inputs in prop::collection::vec((input(), 0..2000_u64), 1..200)) {
        let mut machine = LinkMachine::new(BACK_OFF, ms(0));
        let (mut now, mut homed, mut failed_at) = (ms(0), false, None);
        for (input, wait_ms) in inputs {
            now += ms(wait_ms);
            let before = machine.poll(now);
            match before {
                Step::Open => {
                    homed = false;
                    if let Some(at) = failed_at.take() {
                        prop_assert!(now - at >= BACK_OFF.min);
                    }
                }
                Step::Serve => prop_assert!(homed, "{:?}", machine.state()),
                Step::Wait(until) => {
                    prop_assert!(until > now && until - now <= BACK_OFF.max);
                }
                _ => {}
            }
            match input {
                Input::Homed if before == Step::Home => homed = true,
                Input::Opened | Input::Restarted if before != Step::Serve => {}
                Input::Restarted => homed = false,
                _ => {}
            }
            let held =
                matches!(machine.state(), LinkState::EmergencyStop | LinkState::AwaitingStart);
            machine.handle(now, input);
            match input {
                Input::Failed(_) if !held => failed_at = Some(now),
                Input::EmergencyStop(_) | Input::DeviceStopped | Input::PortChanged => {
                    failed_at = None;
                }
                _ => {}
            }
        }
        machine.handle(now, Input::Shutdown);
        prop_assert_eq!(machine.poll(now), Step::End);
    }
}

#[test]
fn a_trouble_is_one_word_in_records() {
    let state = LinkState::Down(Trouble::NotAnswering);
    assert_eq!(serde_json::to_value(state).expect("a word"), "not_answering");
    assert_eq!(serde_json::to_value(LinkState::Ready).expect("a word"), LinkState::Ready.name());
}
