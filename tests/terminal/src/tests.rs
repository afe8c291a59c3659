//! Prompts and progress bars at a terminal.

use rexpect::{
    process::WaitStatus,
    reader::Options,
    session::{PtySession, spawn_with_options},
};

use sonard_test_support::{collection::Case, program, sonard};

/// A user at a terminal of their own, in which a collection runs.
struct Person(PtySession);

impl Person {
    fn starts(case: &Case) -> Self {
        let arguments = case.arguments(&[]);
        let mut command = sonard(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        command.env("TERM", "xterm");
        let options = Options::new().timeout_ms(Some(60_000)).strip_ansi_escape_codes(true);
        Self(spawn_with_options(command, options).expect("a terminal"))
    }

    /// Waits for a question and answers with a line.
    fn answers(&mut self, question: &str, line: &str) {
        self.0.exp_string(question).expect(question);
        self.0.send_line(line).expect("it listens");
    }

    /// Waits for a question and presses Ctrl-C; returns the output after that and the exit code.
    fn interrupts_at(mut self, question: &str) -> (String, i32) {
        self.0.exp_string(question).expect(question);
        self.0.send_control('c').expect("it listens");
        self.waits()
    }

    /// Waits for the end; returns the output until then and the exit code.
    fn waits(mut self) -> (String, i32) {
        let printed = self.0.exp_eof().expect("it ends");
        match self.0.process().wait().expect("it ended") {
            WaitStatus::Exited(_, code) => (printed, code),
            other => panic!("{other:?}: {printed}"),
        }
    }
}

#[test]
fn at_a_terminal_enter_goes_on_and_an_interrupt_can_be_gone_on_from() {
    let case = Case::new(
        "[poses]\nlist = [\"fig9\", \"fig7\"]\nconfirm = true\n\
         [ask]\nat_start = [\"operator\"]\nat_pose = [\"door\"]\n",
    );
    let mut ada = Person::starts(&case);
    ada.answers("operator:", "Ada");
    ada.answers("put the ranger at fig9, pose 1, and press Enter:", "");
    ada.answers("door:", "open");
    let (printed, code) = ada.interrupts_at("put the ranger at fig7");
    assert!(
        code == 1 && printed.contains("1 of 2 scans") && printed.contains("stopped"),
        "{printed}"
    );
    assert!(!printed.contains(" beams"), "a bar was drawn over the question: {printed:?}");
    assert_eq!(case.files("in-progress"), Vec::<String>::new());
    assert_eq!(case.manifest()["complete"], false);

    let mut bob = Person::starts(&case);
    bob.answers("operator:", "Bob");
    // The first pose is complete and not requested again.
    bob.answers("put the ranger at", "");
    bob.answers("pose 2, fig7: door:", "shut");
    let (printed, code) = bob.waits();
    assert!(code == 0 && printed.contains("2 of 2 scans"), "{printed}");
    case.assert_each_scan_once(2, 1, 25);
    for (name, operator, door) in
        [("p001-r01.jsonl", "Ada", "open"), ("p002-r01.jsonl", "Bob", "shut")]
    {
        let log = case.scan(name);
        let of = &log.of_type("session").next().expect("a session")["collection"]["conditions"];
        assert_eq!((&of["operator"], &of["door"]), (&operator.into(), &door.into()));
    }
}

#[test]
fn poses_typed_at_a_terminal_are_kept_over_an_interrupt() {
    let case = Case::new("[poses]\nprompt = true\n");
    let mut person = Person::starts(&case);
    person.answers("pose 1 (", "5,5,0");
    person.answers("pose 1 (", "fig9");
    let (printed, code) = person.interrupts_at("pose 2 (");
    assert!(code == 1 && printed.contains("1 of 1 scans"), "{printed}");

    let mut person = Person::starts(&case);
    person.answers("pose 2 (", "0.5,0.3,90");
    person.answers("pose 3 (", "");
    assert_eq!(person.waits().1, 0);
    case.assert_each_scan_once(2, 1, 25);
}

#[test]
fn an_exploration_shows_its_progress() {
    let mut command = std::process::Command::new(program("sonard-papers"));
    command.args([
        "explore",
        "--scene",
        "corridor",
        "--pose",
        "beside-wall",
        "--odometry-noise",
        "0.005",
    ]);
    command.env("TERM", "xterm");
    let options = Options::new().timeout_ms(Some(60_000)).strip_ansi_escape_codes(true);
    let mut terminal = spawn_with_options(command, options).expect("a terminal");
    terminal.exp_regex("[0-9]+ stops, [0-9]+ m driven").expect("progress");
    terminal.exp_string("laser shots").expect("the result");
}
