//! Generates the documented configuration file from the definition of the keys.

use std::fmt::Write as _;

use super::schema::{ConfigForm, Key};

const WIDTH: usize = 98;

/// Returns the configuration file with every key and its documentation; for `sonard run` the text
/// of `config/sonard.toml`.
#[must_use]
pub fn document<K: ConfigForm>() -> String {
    let mut text = K::HEAD.to_owned();
    for section in K::sections() {
        text += "\n";
        comment(&mut text, &section.about);
        // Writing to a `String` can't fail.
        let _ = writeln!(text, "[{}]", section.name);
        for key in &section.keys {
            write_key(&mut text, key);
        }
    }
    text
}

fn write_key(text: &mut String, key: &Key) {
    comment(text, &format!("{} {}", key.about, key.kind.description()));
    let _ = match (&key.default, &key.example) {
        (Some(default), _) if key.is_soft_default => {
            writeln!(text, "# {} = {}", key.name, key.kind.toml(default))
        }
        (Some(default), _) => writeln!(text, "{} = {}", key.name, key.kind.toml(default)),
        (None, Some(example)) => {
            writeln!(text, "# {} = {}", key.name, key.kind.toml(example))
        }
        (None, None) => writeln!(text, "# {} =", key.name),
    };
}

fn comment(text: &mut String, about: &str) {
    for line in textwrap::wrap(about, WIDTH) {
        let _ = writeln!(text, "# {line}");
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{ConfigLayers, Keys, ValueKind, sections},
        *,
    };

    const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/sonard.toml");
    const SHIPPED: &str = include_str!("../../../../config/sonard.toml");

    #[test]
    fn shipped_file_is_up_to_date() {
        let fresh = document::<Keys>();
        if std::env::var_os("SONARD_TEST_WRITE").is_some() {
            std::fs::write(PATH, &fresh).expect("config/sonard.toml is writable");
        }
        assert!(
            SHIPPED == fresh,
            "config/sonard.toml is out of date; regenerate it with `SONARD_TEST_WRITE=1 cargo test -p sonard-api document`"
        );
    }

    #[test]
    fn shipped_file_equals_defaults() {
        let read = |text: &str| {
            ConfigLayers::new().with_file("sonard.toml", text).and_then(ConfigLayers::into_keys)
        };
        assert_eq!(read(SHIPPED), Ok(Keys::default()));
        // Comments of the form `key = value` are turned into settings.
        let sets = |line: &str| line.split_once(" = ").is_some_and(|(key, _)| !key.contains(' '));
        let opened: Vec<&str> = SHIPPED
            .lines()
            .map(|line| line.strip_prefix("# ").filter(|rest| sets(rest)).unwrap_or(line))
            .collect();
        let opened = read(&opened.join("\n")).expect("examples are valid");
        assert_eq!(opened.server.listen.as_deref(), Some("127.0.0.1:8765"));
        assert_eq!(opened.gpio.reset_pin, Some(17));
    }

    #[test]
    fn shipped_file_omits_soft_defaults() {
        let read = ConfigLayers::<Keys>::new().with_file("sonard.toml", SHIPPED).expect("valid");
        let mut yielding = Vec::new();
        for section in sections() {
            for key in section.keys.iter().filter(|key| key.is_soft_default) {
                yielding.push(format!("{}.{}", section.name, key.name));
                assert_eq!(read.origin(&section.name, &key.name), None, "{}", key.name);
            }
        }
        assert_eq!(
            yielding,
            ["scanning.mode", "model.sensor", "log.folder", "server.socket", "fleet.robot"]
        );
    }

    #[test]
    fn every_key_is_documented() {
        for section in sections() {
            assert!(!section.about.is_empty() && !section.keys.is_empty(), "{}", section.name);
            for key in &section.keys {
                assert!(key.about.ends_with('.'), "{}.{}: {}", section.name, key.name, key.about);
                if let ValueKind::Number { min, max } | ValueKind::Whole { min, max } = key.kind {
                    assert!(min > f64::MIN && max < f64::MAX, "{}.{}", section.name, key.name);
                }
                assert!(key.default.is_some() || key.example.is_some(), "{}", key.name);
            }
        }
    }
}
