//! Width of help texts, and examples that can be pasted at any width.

use std::{env, io::Write as _, process};

use textwrap::core::display_width;

use super::terminal;

/// Widest help text, columns; also the width without a terminal.
const MAX_COLUMNS: usize = 100;

/// Width of help texts on this terminal, columns.
pub(super) fn columns() -> usize {
    let terminal = terminal::any_columns().map(usize::from);
    let variable = || env::var("COLUMNS").ok()?.parse().ok();
    terminal.or_else(variable).unwrap_or(MAX_COLUMNS).min(MAX_COLUMNS)
}

/// Space within an example, at which clap does not break lines; [`print_and_exit`] restores it.
const NO_BREAK_SPACE: &str = "\u{a0}";

/// Prints a help text or an error of the command line, and ends the process.
pub(super) fn print_and_exit(error: &clap::Error) -> ! {
    use clap::error::ErrorKind::{
        DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand as DisplayHelpOnMissing,
    };
    if !matches!(error.kind(), DisplayHelp | DisplayHelpOnMissing) {
        error.exit();
    }
    let text = error.render().ansi().to_string().replace(NO_BREAK_SPACE, " ");
    // A closed reader is ignored.
    drop(match error.use_stderr() {
        true => write!(anstream::stderr(), "{text}"),
        false => write!(anstream::stdout(), "{text}"),
    });
    process::exit(error.exit_code())
}

/// Breaks the commands of the sections `Examples:` at the given width, with a backslash at the end
/// of each broken line, so that they run as pasted. 0 is unlimited, for texts that another program
/// breaks.
pub(super) fn break_examples(text: &str, columns: usize) -> String {
    let (mut broken, mut is_example) = (Vec::new(), false);
    let joined = text.replace("\\\n", "");
    for line in joined.lines() {
        is_example = match line {
            "Examples:" => true,
            // An empty line separates groups of examples.
            line => is_example && (line.is_empty() || line.starts_with("  ")),
        };
        match line.strip_prefix("  ") {
            Some(command) if is_example => {
                let mut lines = Vec::new();
                break_command(command, columns, &mut lines);
                broken.extend(lines.into_iter().map(|line| match columns {
                    0 => line,
                    _ => line.replace(' ', NO_BREAK_SPACE),
                }));
            }
            _ => broken.push(line.to_owned()),
        }
    }
    broken.join("\n")
}

const INDENT: &str = "  ";
const CONTINUATION: &str = "      ";

fn break_command(line: &str, columns: usize, broken: &mut Vec<String>) {
    let words = words(line);
    let fits = |line: &str| columns == 0 || INDENT.len() + display_width(line) <= columns;
    let line = words.join(" ");
    if fits(&line) {
        broken.push(format!("{INDENT}{line}"));
        return;
    }
    let comment = words.iter().position(|word| word.starts_with('#')).unwrap_or(words.len());
    let (command, comment) = words.split_at(comment);
    if let Some(text) = comment.join(" ").strip_prefix("# ") {
        let room = columns.saturating_sub(INDENT.len() + 2).max(10);
        broken.extend(textwrap::wrap(text, room).iter().map(|part| format!("{INDENT}# {part}")));
    }
    let mut current = INDENT.to_owned();
    let mut is_first = true;
    for (place, word) in command.iter().enumerate() {
        // Every line but the last one ends in a backslash.
        let ending = if place + 1 == command.len() { 0 } else { 2 };
        let width = display_width(&current) + 1 + display_width(word) + ending;
        if !is_first && width > columns {
            broken.push(format!("{current} \\"));
            CONTINUATION.clone_into(&mut current);
            is_first = true;
        }
        if !is_first {
            current.push(' ');
        }
        current.push_str(word);
        is_first = false;
    }
    broken.push(current);
}

/// Splits a command at spaces outside quotes; a comment's words are separate, too.
fn words(command: &str) -> Vec<&str> {
    let (mut words, mut start, mut quote) = (Vec::new(), 0, None);
    for (at, character) in command.char_indices() {
        match (character, quote) {
            ('\'' | '"', None) => quote = Some(character),
            (character, Some(open)) if character == open => quote = None,
            (' ', None) => {
                words.push(&command[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    words.push(&command[start..]);
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joins continued lines as a shell does.
    fn pasted(text: &str) -> String {
        text.replace("\\\n", " ").split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn broken_commands_run_as_pasted() {
        let text = "Examples:\n  curl -H 'Content-Type: application/json' http://localhost/v1/start\n  \
                    sonard a | sonard plot - -o a.svg   # two programs\n\nFields of --json: one two \
                    three four five six.";
        for columns in [30, 45, 60, 100, 0] {
            let broken = break_examples(text, columns).replace(NO_BREAK_SPACE, " ");
            assert!(broken.contains("'Content-Type: application/json'"), "{columns}: {broken}");
            for line in broken.lines().take_while(|line| !line.starts_with("Fields")) {
                let longest = line.trim().trim_end_matches('\\').len();
                let word = words(line).iter().map(|word| word.len()).max().unwrap_or_default();
                assert!(columns == 0 || line.len() <= columns.max(word + 8), "{columns}: {line:?}");
                assert!(longest > 0 || line.is_empty());
            }
            let without_comment = pasted(&broken).replace("# two programs", "");
            let expected = pasted(text).replace("# two programs", "");
            assert_eq!(pasted(&without_comment), pasted(&expected), "{columns}");
        }
    }

    #[test]
    fn continued_lines_are_joined_first() {
        let text = "Examples:\n  sonard run --mock \\\n      --set a=b";
        let whole = break_examples(text, 100).replace(NO_BREAK_SPACE, " ");
        assert_eq!(whole, "Examples:\n  sonard run --mock --set a=b");
        let broken = break_examples(text, 22);
        let examples = broken.lines().skip(1);
        assert!(!examples.into_iter().any(|line| line.contains(' ')), "{broken}");
        assert_eq!(
            broken.replace(NO_BREAK_SPACE, " "),
            "Examples:\n  sonard run --mock \\\n      --set a=b"
        );
    }
}
