//! Description of a failure for the terminal: message, affected text, advice.

use std::{fmt, ops::Range};

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use clap::builder::styling::{AnsiColor, Style};

/// Widest excerpt of a file, columns; longer lines are shown in part.
const MAX_EXCERPT_COLUMNS: usize = 140;

const ERROR: Style = AnsiColor::BrightRed.on_default().bold();
const HELP: Style = AnsiColor::BrightCyan.on_default().bold();

/// Description of a failure. `Display` writes the message alone, without help and excerpt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    message: String,
    help: String,
    excerpt: Option<Excerpt>,
}

/// Text of a file with the place of a failure.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Excerpt {
    text: String,
    place: Range<usize>,
    label: String,
}

impl Diagnostic {
    /// Creates a description from a message and advice, which may be empty.
    pub(super) fn new(message: impl fmt::Display, help: impl fmt::Display) -> Self {
        Self { message: message.to_string(), help: help.to_string(), excerpt: None }
    }

    /// Adds the text of a file, of which the lines around `place` (bytes) are shown, with a label.
    pub(super) fn with_excerpt(self, text: String, place: Range<usize>, label: String) -> Self {
        Self { excerpt: Some(Excerpt { text, place, label }), ..self }
    }

    /// Advice for the user; may be empty.
    #[must_use]
    pub fn help(&self) -> &str {
        &self.help
    }

    /// Formats message, affected lines and advice for a terminal, with ANSI colours. No line is
    /// wrapped, so that suggested options can be copied.
    pub(super) fn render(&self) -> String {
        let mut text = match &self.excerpt {
            None => format!("{ERROR}error{ERROR:#}: {}", self.message),
            Some(Excerpt { text, place, label }) => {
                let place = AnnotationKind::Primary.span(place.clone()).label(label);
                let snippet = Snippet::source(text).annotation(place);
                let renderer = Renderer::styled().term_width(MAX_EXCERPT_COLUMNS);
                renderer.render(&[Level::ERROR.primary_title(&*self.message).element(snippet)])
            }
        };
        if !self.help.is_empty() {
            let help = self.help.replace('\n', "\n        ");
            text.push_str(&format!("\n  {HELP}help{HELP:#}: {help}"));
        }
        text
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

#[cfg(test)]
mod tests {
    use anstream::adapter::strip_str;

    use super::*;

    #[test]
    fn excerpt_has_the_place_of_the_failure() {
        let text = "{\n  \"walls\": [1]\n}\n".to_owned();
        let diagnostic = Diagnostic::new("room.json:2:13: not a wall", "give two points");
        let place = text.find('1').expect("there");
        let shown = diagnostic.with_excerpt(text, place..place + 1, "walls[0]".to_owned()).render();
        let shown = strip_str(&shown).to_string();
        assert!(shown.starts_with("error: room.json:2:13: not a wall\n"), "{shown}");
        let lines: Vec<_> = shown.lines().map(str::trim_end).collect();
        let excerpt = lines.iter().position(|line| line.ends_with("\"walls\": [1]"));
        let below = lines[excerpt.expect("the line") + 1];
        assert!(below.ends_with("^ walls[0]"), "{shown}");
        assert_eq!(lines.last(), Some(&"  help: give two points"), "{shown}");
    }

    #[test]
    fn long_advice_is_not_wrapped() {
        let help = "give --out ".repeat(30);
        let shown = Diagnostic::new("no folder", &help).render();
        assert_eq!(strip_str(&shown).to_string(), format!("error: no folder\n  help: {help}"));
    }
}
