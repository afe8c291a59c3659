//! State machine of the link in simulated time.

use super::*;
use proptest::prelude::*;

const RETRY_BOUNDS: RetryBounds =
    RetryBounds { min: Duration::from_millis(200), max: Duration::from_secs(5) };

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

/// Creates a machine that is `Ready` at time 0.
fn ready() -> LinkMachine {
    let mut machine = LinkMachine::new(RETRY_BOUNDS, ms(0));
    for (step, input) in [
        (LinkStep::Open, LinkInput::Opened),
        (LinkStep::Identify, LinkInput::Identified),
        (LinkStep::Home, LinkInput::Homed),
    ] {
        assert_eq!(machine.poll(ms(0)), step);
        machine.handle(ms(0), input);
    }
    assert_eq!(machine.poll(ms(0)), LinkStep::Serve);
    machine
}

#[test]
fn wait_doubles_up_to_the_maximum() {
    let mut machine = LinkMachine::new(RETRY_BOUNDS, ms(0));
    let mut now = ms(0);
    let mut waits = Vec::new();
    for _ in 0..8 {
        assert_eq!(machine.poll(now), LinkStep::Open);
        machine.handle(now, LinkInput::Failed(Trouble::Absent));
        let LinkStep::Wait(until) = machine.poll(now) else { panic!("{:?}", machine.state()) };
        waits.push((until - now).as_millis());
        now = until;
    }
    assert_eq!(waits, [200, 400, 800, 1600, 3200, 5000, 5000, 5000]);

    let mut machine = ready();
    machine.handle(ms(1), LinkInput::ScanBegun);
    machine.handle(ms(2), LinkInput::ScanEnded);
    machine.handle(ms(3), LinkInput::Failed(Trouble::Lost));
    assert_eq!(machine.poll(ms(3)), LinkStep::Wait(ms(203)));
}

#[test]
fn wait_grows_if_the_device_relapses() {
    let mut machine = LinkMachine::new(RETRY_BOUNDS, ms(0));
    let mut now = ms(0);
    for _ in 0..6 {
        for input in
            [LinkInput::Opened, LinkInput::Identified, LinkInput::Homed, LinkInput::ScanBegun]
        {
            machine.poll(now);
            machine.handle(now, input);
        }
        machine.handle(now, LinkInput::Failed(Trouble::Fault));
        let LinkStep::Wait(until) = machine.poll(now) else { panic!("it waits") };
        now = until;
    }
    assert_eq!(now, ms(200 + 400 + 800 + 1600 + 3200 + 5000));
    // A device that was up for longer than the maximum wait starts again with the minimum.
    for input in [LinkInput::Opened, LinkInput::Identified, LinkInput::Homed] {
        machine.poll(now);
        machine.handle(now, input);
    }
    let later = now + ms(5001);
    machine.handle(later, LinkInput::Failed(Trouble::Lost));
    assert_eq!(machine.poll(later), LinkStep::Wait(later + ms(200)));
}

#[test]
fn absence_does_not_lengthen_waits() {
    let mut machine = ready();
    let mut now = ms(0);
    let mut waits = Vec::new();
    // Unplugged for five attempts, then up again.
    for _ in 0..3 {
        now += ms(1_000);
        machine.handle(now, LinkInput::Failed(Trouble::Lost));
        for attempt in 0..5 {
            let LinkStep::Wait(until) = machine.poll(now) else { panic!("it waits") };
            if attempt == 0 {
                waits.push((until - now).as_millis());
            }
            now = until;
            assert_eq!(machine.poll(now), LinkStep::Open);
            machine.handle(now, LinkInput::Failed(Trouble::Absent));
        }
        let LinkStep::Wait(until) = machine.poll(now) else { panic!("it waits") };
        now = until;
        for input in [LinkInput::Opened, LinkInput::Identified, LinkInput::Homed] {
            machine.poll(now);
            machine.handle(now, input);
        }
    }
    // Without a completed scan each loss counts: a flapping device is retried less often.
    assert_eq!(waits, [200, 400, 800]);
}

#[test]
fn absence_is_reported_once() {
    let mut machine = ready();
    assert_eq!(machine.poll_transition(), Some(Transition { from: None, to: LinkState::Ready }));
    let mut reported = Vec::new();
    let mut now = ms(10);
    machine.handle(now, LinkInput::Failed(Trouble::Lost));
    for _ in 0..1000 {
        reported.extend(machine.poll_transition());
        match machine.poll(now) {
            LinkStep::Open => machine.handle(now, LinkInput::Failed(Trouble::Absent)),
            LinkStep::Wait(until) => now = until,
            other => panic!("{other:?}"),
        }
    }
    machine.poll(now + ms(5000));
    for input in [LinkInput::Opened, LinkInput::Identified, LinkInput::Homed] {
        machine.handle(now, input);
    }
    reported.extend(machine.poll_transition());
    let states: Vec<_> = reported.iter().map(|transition| transition.to).collect();
    assert_eq!(
        states,
        [LinkState::Down(Trouble::Lost), LinkState::Down(Trouble::Absent), LinkState::Ready]
    );
    // Scans are no transition.
    machine.handle(now, LinkInput::ScanBegun);
    machine.handle(now, LinkInput::ScanEnded);
    assert_eq!(machine.poll_transition(), None);
}

#[test]
fn idle_restart_homes_again() {
    let mut machine = ready();
    machine.handle(ms(5), LinkInput::Restarted);
    assert_eq!(machine.poll(ms(5)), LinkStep::Identify);
    machine.handle(ms(5), LinkInput::ScanBegun);
    assert_eq!(machine.poll(ms(5)), LinkStep::Identify, "no scan without homing");
    machine.handle(ms(6), LinkInput::Identified);
    assert_eq!(machine.poll(ms(6)), LinkStep::Home);
}

#[test]
fn emergency_stop_requires_a_start() {
    let mut machine = ready();
    machine.handle(ms(1), LinkInput::EmergencyStop(true));
    machine.handle(ms(2), LinkInput::Start);
    assert_eq!(machine.poll(ms(2)), LinkStep::Rest, "it is still pressed");
    machine.handle(ms(3), LinkInput::EmergencyStop(false));
    for input in [
        LinkInput::PortChanged,
        LinkInput::Restarted,
        LinkInput::Failed(Trouble::Lost),
        LinkInput::ScanBegun,
    ] {
        machine.handle(ms(4), input);
        assert_eq!(machine.state(), LinkState::AwaitingStart);
        assert_eq!(machine.poll(ms(3_600_000)), LinkStep::Rest);
    }
    machine.handle(ms(5), LinkInput::Start);
    assert_eq!(machine.poll(ms(5)), LinkStep::Open);

    // The device's own emergency stop has the same effect.
    let mut machine = ready();
    machine.handle(ms(1), LinkInput::DeviceStopped);
    assert_eq!(machine.poll(ms(3_600_000)), LinkStep::Rest);
    machine.handle(ms(2), LinkInput::Start);
    assert_eq!(machine.poll(ms(2)), LinkStep::Open);
}

#[test]
fn emergency_stop_with_resume() {
    let mut machine = ready();
    machine.set_resumes(true);
    machine.handle(ms(1), LinkInput::ScanBegun);
    machine.handle(ms(2), LinkInput::EmergencyStop(true));
    for input in [LinkInput::ScanEnded, LinkInput::Homed, LinkInput::Failed(Trouble::Lost)] {
        machine.handle(ms(3), input);
        assert_eq!(machine.poll(ms(3_600_000)), LinkStep::Rest);
    }
    machine.handle(ms(4), LinkInput::EmergencyStop(false));
    assert_eq!(machine.poll(ms(4)), LinkStep::Open);
}

fn input() -> impl Strategy<Value = LinkInput> {
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
        Just(LinkInput::Opened),
        Just(LinkInput::Identified),
        Just(LinkInput::Homed),
        Just(LinkInput::ScanBegun),
        Just(LinkInput::ScanEnded),
        Just(LinkInput::Restarted),
        trouble.prop_map(LinkInput::Failed),
        any::<bool>().prop_map(LinkInput::EmergencyStop),
        Just(LinkInput::DeviceStopped),
        Just(LinkInput::Start),
        Just(LinkInput::PortChanged),
    ]
}

proptest! {
    /// For any sequence of inputs: scans run only on a homed connection, waits are bounded, and
    /// attempts are at least the minimum wait apart.
    #[test]
    fn no_motion_before_homing_and_no_spin(inputs in prop::collection::vec((input(), 0..2000_u64), 1..200)) {
        let mut machine = LinkMachine::new(RETRY_BOUNDS, ms(0));
        let (mut now, mut homed, mut failed_at) = (ms(0), false, None);
        for (input, wait_ms) in inputs {
            now += ms(wait_ms);
            let before = machine.poll(now);
            match before {
                LinkStep::Open => {
                    homed = false;
                    if let Some(at) = failed_at.take() {
                        prop_assert!(now - at >= RETRY_BOUNDS.min);
                    }
                }
                LinkStep::Serve => prop_assert!(homed, "{:?}", machine.state()),
                LinkStep::Wait(until) => {
                    prop_assert!(until > now && until - now <= RETRY_BOUNDS.max);
                }
                _ => {}
            }
            match input {
                LinkInput::Homed if before == LinkStep::Home => homed = true,
                LinkInput::Opened | LinkInput::Restarted if before != LinkStep::Serve => {}
                LinkInput::Restarted => homed = false,
                _ => {}
            }
            let is_stopped =
                matches!(machine.state(), LinkState::EmergencyStop | LinkState::AwaitingStart);
            machine.handle(now, input);
            match input {
                LinkInput::Failed(_) if !is_stopped => failed_at = Some(now),
                LinkInput::EmergencyStop(_) | LinkInput::DeviceStopped | LinkInput::PortChanged => {
                    failed_at = None;
                }
                _ => {}
            }
        }
        machine.handle(now, LinkInput::Shutdown);
        prop_assert_eq!(machine.poll(now), LinkStep::End);
    }
}

#[test]
fn states_serialize_as_words() {
    let state = LinkState::Down(Trouble::NotAnswering);
    assert_eq!(serde_json::to_value(state).expect("a word"), "not_answering");
    assert_eq!(serde_json::to_value(LinkState::Ready).expect("a word"), LinkState::Ready.name());
}
