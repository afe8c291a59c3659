//! Errors in a scene file, with their positions.

use super::*;

/// Replaces `part` of the good scene by `bad` and expects an error with the text `points_at` as its
/// span. Path and message start with `expect`; the help contains `help`.
#[track_caller]
fn check(part: &str, bad: &str, points_at: &str, expect: &str, help: &str) {
    assert_eq!(GOOD.matches(part).count(), 1, "`{part}` must occur once");
    let text = GOOD.replace(part, bad);
    let error = Scene::from_json(&text).expect_err(expect);
    assert_eq!(&text[error.span.clone()], points_at, "{error}");
    let place = format!("{}:{}: ", error.line, error.column);
    let (line, column) = (error.line - 1, error.column - 1);
    let from_there: String =
        text.lines().nth(line).into_iter().flat_map(|l| l.chars().skip(column)).collect();
    let first_line = points_at.lines().next().unwrap_or_default();
    assert!(from_there.starts_with(first_line), "{error}");
    let message = error.to_string();
    let shown = message.strip_prefix(&place).expect("line and column come first");
    assert!(shown.starts_with(expect), "got `{shown}`, expected `{expect}`");
    assert!(error.help().contains(help), "help `{}` lacks `{help}`", error.help());
}

#[test]
fn positions_count_characters() {
    let error =
        Scene::from_json("{\n  \"name\": \"\u{e9}\u{e9}\", \"nam\": 3}").expect_err("no field");
    assert_eq!((error.line, error.column, error.path.as_str()), (2, 17, "nam"));
}

#[test]
#[rustfmt::skip]
fn syntax_errors_have_positions() {
    check(r#"[4, 0], "material""#, r#"[4, 0, "material""#, ":", "this is not JSON: expected `,` or `]`", "brackets");
    check("0.5}}\n}", "0.5", "{", "this `{` is never closed", "`}`");
    check("[0, 0]]", "[0, 0]", ":", "this is not JSON: expected `,` or `]` (the `[` at 6:32 is still open)", "brackets");
    check(r#"[0, 0], "to""#, r#"[NaN, 0], "to""#, "N", "this is not JSON: expected value", "no NaN");
    check(r#"[0, 0], "to""#, r#"[1e999, 0], "to""#, "9", "this is not JSON: number out of range", "finite");
    check(r#""t","#, r#""t", // comment"#, "/", "this is not JSON: key must be a string", "");
    let deep = GOOD.replace("\"t\"", &"[".repeat(100_000));
    let error = Scene::from_json(&deep).expect_err("too deep");
    assert!(error.message().contains("recursion limit"), "{error}");
    let empty = Scene::from_json("").expect_err("empty");
    assert_eq!((empty.line, empty.column), (1, 1));
}

/// The text is cut off: the error names the open bracket, independent of the contents of strings.
#[test]
fn strings_hide_brackets() {
    for name in [r#"a\"b"#, r#"a\"]b"#, r#"\\"#, "[[", r#"\"{\""#] {
        let text = format!("{{\"name\": \"{name}\", \"walls\": [{{\"id\": \"]\"}}, ");
        let error = Scene::from_json(&text).expect_err("cut off");
        assert_eq!(&text[error.span.clone()], "[", "{name}: {error}");
        assert!(error.to_string().contains("this `[` is never closed"), "{name}: {error}");
        assert_eq!(error.span.start, text.find("[{\"id").expect("there"), "{name}");
    }
}

#[test]
#[rustfmt::skip]
fn structure_errors_are_named() {
    check(r#""floor_z_m""#, r#""flor_z_m""#, r#""flor_z_m""#, "flor_z_m: unknown field `flor_z_m`", "did you mean `floor_z_m`?");
    check(r#""closed""#, r#""close""#, r#""close""#, "walls[2].close: unknown field `close`", "did you mean `closed`?");
    check("0.9", r#""0.9""#, r#""0.9""#, "materials.board.reflectance: found string \"0.9\", expected a number", "quotes");
    check("true", "1", "1", "walls[2].closed: found integer `1`, expected a boolean", "");
    check(r#""center": [3, 2], "#, "", r#"{"id": "leg", "radius_m": 0.1, "material": "board"}"#, "cylinders[0]: the field `center` is missing", "\"center\"");
    check(r#"[4, 0], "m"#, r#"[4, 0, 1], "m"#, "[4, 0, 1]", "walls[0].to: invalid length 3, expected", "");
    check(r#"[4, 0], "m"#, r#"[4], "m"#, "[4]", "walls[0].to: invalid length 1, expected", "");
    check(r#"{"x_m": 3.5, "y_m": 0.5}"#, "[3.5, 0.5, 0]", "[3.5, 0.5, 0]", "poses.desk: found an array where an object", "");
    check(r#"{"reflectance": 0.9}"#, "[0.9, 0.1]", "[0.9, 0.1]", "materials.board: found an array", "");
    check(r#""desk""#, r#""door""#, r#""door""#, "poses.door: `door` is given twice", "one of the two");
    let array = Scene::from_json("[1]").expect_err("an array");
    assert!(array.to_string().starts_with("1:1: found an array"), "{array}");
}

#[test]
#[rustfmt::skip]
fn rules_are_enforced() {
    check(r#""leg""#, r#""south""#, r#""south""#, "cylinders[0].id: the id `south` is already the name of walls[0]", "unique");
    check(r#""leg""#, r#""rest.1""#, r#""rest.1""#, "cylinders[0].id: the id `rest.1` is already the name of walls[1]", "");
    check(r#""leg""#, r#"" ""#, r#"" ""#, "cylinders[0].id: this name is empty", "");
    check(r#"0.1, "material": "board""#, r#"0.1, "material": "bord""#, r#""bord""#, "cylinders[0].material: there is no material `bord`", "did you mean `board`?");
    check(r#""to": [4, 0]"#, r#""to": [0, 0]"#, "[0, 0]", "walls[0].to: this wall has no length", "0.1 mm");
    check("[2, 1], [2, 2]]", "[2, 1], [2, 1]]", "[2, 1]", "walls[2].polyline[2]: this wall has no length", "");
    check("[2, 1], [2, 2]]", "[2, 1], [1, 1]]", "[1, 1]", "walls[2].polyline[2]: this wall has no length", "does not repeat");
    check("[[1, 1], [2, 1], [2, 2]]", "[[1, 1], [2, 1]]", "[[1, 1], [2, 1]]", "walls[2].polyline: 2 points are too few", "3");
    check(r#""to": [4, 0], "#, "", r#"{"id": "south", "from": [0, 0], "material": "board"}"#, "walls[0]: the field `to` is missing", "");
    check(r#""to": [4, 0], "#, r#""to": [4, 0], "closed": true, "#, "true", "walls[0].closed: only a polyline", "");
    check(r#""from": [0, 0], "to": [4, 0], "#, "", r#"{"id": "south", "material": "board"}"#, "walls[0]: this wall has neither", "\"polyline\"");
    check("[4, 3]", "[4, 3000]", "3000", "walls[1].polyline[1][1]: 3000 m is out of bounds", "millimetres");
    check("0.1", "-0.1", "-0.1", "cylinders[0].radius_m: a radius of -0.1 m", "greater than 0");
    check("0.9", "1.2", "1.2", "materials.board.reflectance: reflectance is 1.2", "0 to 1");
    check(r#""ceiling_z_m": 2.5"#, r#""ceiling_material": "board""#, r#""board""#, "ceiling_material: the scene has no ceiling_z_m", "give its height as `ceiling_z_m`");
    check(r#""floor_z_m": 0"#, r#""floor_z_m": 0, "floor_material": "bord""#, r#""bord""#, "floor_material: there is no material `bord`", "did you mean `board`?");
    check(r#""ceiling_z_m": 2.5"#, r#""ceiling_z_m": -1"#, "-1", "ceiling_z_m: ceiling_z_m (-1 m) is not above floor_z_m (0 m)", "");
    check("[0, 1]", "[1, 0]", "[1, 0]", "walls[2].z_m: the upper height (0 m) is not above", "lower height first");
    check(r#""desk""#, r#""a,b""#, r#""a,b""#, "poses.a,b: the pose name", "comma");
    check(r#"{"x_m": 3.5, "y_m": 0.5}"#, r#"{"x_m": 4.5, "y_m": 0.5}"#, r#"{"x_m": 4.5, "y_m": 0.5}"#, "poses.desk: the pose (4.5, 0.5) m is outside the room", "x 0 to 4 m and y 0 to 3 m");
    check(r#""heading_deg": 90"#, r#""heading_deg": 900"#, "900", "poses.door.heading_deg: a heading of 900", "360");
}

#[test]
fn byte_order_mark_is_accepted() {
    let marked = format!("\u{feff}{GOOD}");
    assert_eq!(Scene::from_json(&marked).expect("with a mark").walls, good().walls);
    let wrong = marked.replace("\"closed\"", "\"close\"");
    let error = Scene::from_json(&wrong).expect_err("a wrong field");
    assert_eq!(&wrong[error.span.clone()], "\"close\"");
}

#[test]
fn messages_are_sanitized() {
    for (name, text) in [
        ("an id", GOOD.replace("\"leg\"", r#""\u001b[2Jleg""#)),
        ("a pose", GOOD.replace("\"desk\"", r#""de\u0007sk""#)),
        ("a material", GOOD.replace("\"board\"", r#""bo\nard""#)),
        ("a field", GOOD.replace("\"closed\"", r#""clo\u001bsed""#)),
        ("a long field", GOOD.replace("closed", &"x".repeat(1 << 20))),
        (
            "a long material",
            GOOD.replacen(
                "\"material\": \"board\"",
                &format!("\"material\": \"{}\"", "y".repeat(1 << 20)),
                1,
            ),
        ),
        ("a long value", GOOD.replace("true", &format!("\"{}\"", "z".repeat(1 << 20)))),
        ("a long key twice", {
            let key = "k".repeat(1 << 20);
            format!(r#"{{"{key}": 1, "{key}": 1}}"#)
        }),
    ] {
        let error = Scene::from_json(&text).expect_err(name);
        for text in [error.to_string(), error.help()] {
            assert!(text.len() < 4000, "{name}: {} characters", text.len());
            assert!(!text.contains(char::is_control), "{name}: {text:?}");
        }
    }
}
