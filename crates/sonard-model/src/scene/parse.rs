//! Parser of scene files, with the position of each fault.

use super::{
    Scene, SceneError, SceneProblem,
    check::checked,
    error::{floor_char_boundary, line_and_column},
    file::SceneFile,
    locate::{JsonPath, LocatedDocument, MemberPart},
    prescan::is_unambiguous,
};

/// Byte order mark that some editors prepend.
const BYTE_ORDER_MARK: char = '\u{feff}';

pub(super) fn scene_from_json(text: &str) -> Result<Scene, SceneError> {
    let Some(after_mark) = text.strip_prefix(BYTE_ORDER_MARK) else { return read(text, text) };
    let mark = BYTE_ORDER_MARK.len_utf8();
    read(after_mark, text).map_err(|error| SceneError {
        span: error.span.start + mark..error.span.end + mark,
        ..error
    })
}

/// Parses a scene from JSON; `whole` is kept as its source text.
fn read(text: &str, whole: &str) -> Result<Scene, SceneError> {
    // The syntax tree takes thirty times the memory of the text: it is built only to locate a
    // fault.
    let at = |path: &JsonPath, part: MemberPart| {
        LocatedDocument::new(text).map_or(0..text.len(), |located| located.find(path, part))
    };
    let is_unambiguous = is_unambiguous(text).map_err(|error| syntax_error(text, &error))?;
    if !is_unambiguous && let Some(located) = LocatedDocument::new(text) {
        reject_ambiguous(text, &located)?;
    }
    let mut json = serde_json::Deserializer::from_str(text);
    let file = serde_path_to_error::deserialize(&mut json).or_else(|error| {
        // For an array with too many elements, serde reports their number only from a parsed value.
        let value = || serde_json::from_str::<serde_json::Value>(text).ok();
        let is_vague = without_place(error.inner()) == "trailing characters";
        match is_vague.then(value).flatten() {
            Some(value) => serde_path_to_error::deserialize(value),
            None => Err(error),
        }
    });
    let file: SceneFile = file.map_err(|error| {
        let path = JsonPath::from(error.path());
        let problem = shape_problem(error.inner());
        let part = match problem {
            SceneProblem::UnknownField { .. } => MemberPart::Key,
            _ => MemberPart::Value,
        };
        SceneError::new(text, at(&path, part), &path, problem)
    })?;
    checked(file, whole).map_err(|fault| {
        SceneError::new(text, at(&fault.path, fault.part), &fault.path, fault.problem)
    })
}

/// Rejects documents that the parser accepts but a reader would misunderstand.
fn reject_ambiguous(text: &str, located: &LocatedDocument<'_>) -> Result<(), SceneError> {
    if let Some((path, span)) = located.duplicate_key() {
        let name = path.last_key().unwrap_or_default().to_owned();
        return Err(SceneError::new(text, span, &path, SceneProblem::DuplicateKey(name)));
    }
    if let Some((path, span)) = located.array_for_object() {
        let problem =
            SceneProblem::Type("found an array where an object { ... } belongs".to_owned());
        return Err(SceneError::new(text, span, &path, problem));
    }
    Ok(())
}

/// Converts a syntax error. An unclosed bracket is reported where it opens, not at the end of the
/// text.
fn syntax_error(text: &str, error: &serde_json::Error) -> SceneError {
    if error.is_eof()
        && let Some((offset, open)) = innermost_open_bracket(text)
    {
        let span = offset..offset + 1;
        return SceneError::new(text, span, &"", SceneProblem::Unclosed(open));
    }
    let offset = offset_of(text, error.line(), error.column());
    let end = text[offset..].chars().next().map_or(offset, |found| offset + found.len_utf8());
    let mut message = without_place(error);
    if message.starts_with("expected `,`")
        && let Some((opens, open)) = innermost_open_bracket(&text[..offset])
    {
        // The unclosed bracket is often many lines before the error.
        let (line, column) = line_and_column(text, opens);
        message.push_str(&format!(" (the `{open}` at {line}:{column} is still open)"));
    }
    SceneError::new(text, offset..end, &"", SceneProblem::Syntax(message))
}

/// Byte offset of a line and column of serde_json: columns in bytes, from 1.
fn offset_of(text: &str, line: usize, column: usize) -> usize {
    let line_start = match line {
        0 | 1 => 0,
        _ => text.match_indices('\n').nth(line - 2).map_or(text.len(), |(newline, _)| newline + 1),
    };
    floor_char_boundary(text, line_start + column.saturating_sub(1))
}

/// Last unmatched bracket of a truncated text, if the text does not end within a string.
fn innermost_open_bracket(text: &str) -> Option<(usize, char)> {
    let mut open = Vec::new();
    let mut in_string = false;
    let mut escaped = false;
    for (offset, found) in text.char_indices() {
        match found {
            _ if escaped => escaped = false,
            '\\' if in_string => escaped = true,
            '"' => in_string = !in_string,
            '[' | '{' if !in_string => open.push((offset, found)),
            ']' | '}' if !in_string => drop(open.pop()),
            _ => {}
        }
    }
    open.pop().filter(|_| !in_string)
}

/// Serde's message without the position, which is reported separately.
fn without_place(error: &serde_json::Error) -> String {
    let message = error.to_string();
    message.rsplit_once(" at line ").map_or(message.clone(), |(message, _)| message.to_owned())
}

/// Converts a message of serde's derived code into a specific problem.
fn shape_problem(error: &serde_json::Error) -> SceneProblem {
    let message = without_place(error);
    let quoted = || message.split('`').skip(1).step_by(2).map(str::to_owned);
    if message.starts_with("unknown field `") {
        let field = quoted().next().unwrap_or_default();
        return SceneProblem::UnknownField { field, known: quoted().skip(1).collect() };
    }
    if message.starts_with("missing field `") {
        return SceneProblem::MissingField(quoted().next().unwrap_or_default());
    }
    let message = message
        .replace("expected f64", "expected a number")
        .replace("fewer elements in array", "fewer of them")
        .replace("a sequence", "an array [ ... ]")
        .replace("a map", "an object { ... }");
    SceneProblem::Type(match message.strip_prefix("invalid type: ") {
        Some(found) => format!("found {found}"),
        None => message,
    })
}
