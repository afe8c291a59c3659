//! Times as loggers write them: with and without a zone, a date, or a start.

use jiff::{
    SignedDuration, Timestamp, civil,
    fmt::strtime,
    tz::{Offset, TimeZone},
};

use crate::{Field, ImportError, Mapping};

/// Times before 2000-01-01 count from the start of a board, seconds since 1970.
pub(crate) const MIN_CLOCK_S: f64 = 946_684_800.0;
/// Counters of 32 bits begin again at this.
const WRAP: f64 = 4_294_967_296.0;
/// A time of day that is earlier by more than this is one of the next day.
const DAY_JUMP: SignedDuration = SignedDuration::from_hours(12);

/// Assumptions that were made about the times of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Assumed {
    /// Times without a zone.
    pub(crate) without_zone: u64,
    /// Times of day without a date.
    pub(crate) without_date: u64,
    /// Counts from the start of a board.
    pub(crate) from_start: u64,
    /// Wraps of such a counter at 2^32, and its restarts from zero.
    pub(crate) wraps: u64,
    pub(crate) restarts: u64,
    /// Numbers that may be seconds, milliseconds or anything else.
    pub(crate) without_unit: u64,
}

/// Reads the times of a file in their order.
#[derive(Debug)]
pub(crate) struct Times<'a> {
    mapping: &'a Mapping,
    zone: TimeZone,
    /// Time of the first reading where the file does not say it.
    started: Timestamp,
    pub(crate) assumed: Assumed,
    last_clock: Option<civil::DateTime>,
    /// Counter at the first reading and at the last one, and what restarts have added, seconds.
    first_s: Option<f64>,
    last_s: f64,
    added_s: f64,
}

/// Why a text is no time.
type Refusal = (String, String);

impl<'a> Times<'a> {
    /// # Errors
    /// An offset from UTC that is none.
    pub(crate) fn new(mapping: &'a Mapping, started: Timestamp) -> Result<Self, ImportError> {
        let zone = match &mapping.utc_offset {
            Some(text) => TimeZone::fixed(offset(text)?),
            None => TimeZone::UTC,
        };
        Ok(Self {
            mapping,
            zone,
            started: mapping.started.unwrap_or(started),
            assumed: Assumed::default(),
            last_clock: None,
            first_s: None,
            last_s: 0.0,
            added_s: 0.0,
        })
    }

    /// A time that is written as text; `None` of a number without a unit.
    pub(crate) fn text(&mut self, cell: &str) -> Result<Option<Timestamp>, Refusal> {
        if let Some(format) = &self.mapping.time_format {
            return self.by_format(format, cell).map(Some);
        }
        if let Ok(time) = cell.parse::<Timestamp>() {
            return Ok(Some(time));
        }
        if let Ok(number) = cell.parse::<f64>() {
            return Ok(self.plain_number(number));
        }
        let cell = with_point(cell);
        let civil = cell.parse::<civil::DateTime>().ok();
        let civil = civil.or_else(|| {
            CIVIL.iter().find_map(|format| civil::DateTime::strptime(format, &cell).ok())
        });
        match (civil, cell.parse::<civil::Time>()) {
            (Some(civil), _) => self.local(civil).map(Some),
            (None, Ok(time)) => self.of_day(time).map(Some),
            (None, Err(_)) => Err((
                format!("`{}` is no time", cell.chars().take(40).collect::<String>()),
                advice(&cell),
            )),
        }
    }

    /// A number of a unit; `seconds` is the number in seconds.
    pub(crate) fn number(
        &mut self,
        field: Option<Field>,
        seconds: f64,
    ) -> Result<Timestamp, Refusal> {
        let nanoseconds = if seconds.abs() >= MIN_CLOCK_S {
            // As many digits as a number of this size has.
            1000 * (seconds * 1e6).round() as i128
        } else {
            let since_s = self.since_start(field, seconds);
            self.started.as_nanosecond().saturating_add(1000 * (since_s * 1e6).round() as i128)
        };
        Timestamp::from_nanosecond(nanoseconds).map_err(|error| {
            (error.to_string(), "times count from 1970: is the unit right?".to_owned())
        })
    }

    /// Seconds since the first reading of a counter that begins with a board.
    fn since_start(&mut self, field: Option<Field>, seconds: f64) -> f64 {
        self.assumed.from_start += 1;
        let unit_s = match field.and_then(Field::unit) {
            Some("ms") => 1e-3,
            Some("us") => 1e-6,
            _ => 0.0,
        };
        let first_s = *self.first_s.get_or_insert(seconds);
        if seconds + self.added_s < self.last_s {
            let back_s = self.last_s - self.added_s - seconds;
            if unit_s > 0.0 && back_s > 0.5 * WRAP * unit_s {
                self.assumed.wraps += 1;
                self.added_s += WRAP * unit_s;
            } else if back_s > RESTART_S {
                self.assumed.restarts += 1;
                self.added_s += back_s;
            }
        }
        let now_s = seconds + self.added_s;
        self.last_s = self.last_s.max(now_s);
        now_s - first_s
    }

    /// A number whose size alone shows its unit, if it does: of the years 2001 to 2286.
    fn plain_number(&mut self, number: f64) -> Option<Timestamp> {
        let unit_s =
            [1.0, 1e-3, 1e-6, 1e-9].into_iter().find(|unit| (1e9..1e10).contains(&(number * unit)));
        let time = unit_s.and_then(|unit_s| {
            let nanoseconds = if unit_s < 1e-8 { number } else { number * unit_s * 1e9 };
            Timestamp::from_nanosecond(nanoseconds as i128).ok()
        });
        self.assumed.without_unit += u64::from(time.is_none());
        time
    }

    fn by_format(&mut self, format: &str, cell: &str) -> Result<Timestamp, Refusal> {
        let refuse = |error: jiff::Error| {
            (
                error.to_string(),
                "--time-format has the signs of strftime: '%d/%m/%Y %H:%M:%S%.f'".to_owned(),
            )
        };
        let read = strtime::parse(format, cell).map_err(refuse)?;
        if read.offset().is_some()
            && let Ok(time) = read.to_timestamp()
        {
            return Ok(time);
        }
        match (read.to_datetime(), read.to_time()) {
            (Ok(civil), _) => self.local(civil),
            (Err(_), Ok(time)) => self.of_day(time),
            (Err(error), Err(_)) => Err(refuse(error)),
        }
    }

    fn local(&mut self, civil: civil::DateTime) -> Result<Timestamp, Refusal> {
        self.assumed.without_zone += 1;
        let zoned = civil.to_zoned(self.zone.clone());
        zoned
            .map(|zoned| zoned.timestamp())
            .map_err(|error| (error.to_string(), "correct that time".to_owned()))
    }

    /// A time of day, on the day of the start or later.
    fn of_day(&mut self, time: civil::Time) -> Result<Timestamp, Refusal> {
        self.assumed.without_date += 1;
        let day = match self.last_clock {
            Some(last) => last.date(),
            None => self.started.to_zoned(self.zone.clone()).date(),
        };
        let mut civil = day.to_datetime(time);
        if let Some(last) = self.last_clock
            && last.duration_since(civil) > DAY_JUMP
        {
            civil = civil.checked_add(SignedDuration::from_hours(24)).unwrap_or(civil);
        }
        self.last_clock = Some(civil);
        self.local(civil)
    }

    /// Assumptions that were made, a line each.
    pub(crate) fn notes(&self) -> Vec<String> {
        let Assumed { without_zone, without_date, from_start, wraps, restarts, without_unit } =
            self.assumed;
        let mut notes = Vec::new();
        if without_date > 0 {
            let day = self.started.to_zoned(self.zone.clone()).date();
            let source = if self.mapping.started.is_some() {
                "as --started says"
            } else {
                "the file's date"
            };
            notes.push(format!(
                "times have no date: the first is of {day}, {source}; --started TIME gives another"
            ));
        }
        if without_zone > 0 && self.mapping.utc_offset.is_none() {
            notes.push(
                "times have no zone: taken as UTC; --utc-offset +01:00 gives another".to_owned(),
            );
        }
        if from_start > 0 {
            let source =
                if self.mapping.started.is_some() { "--started" } else { "the file's date" };
            let wraps = match wraps {
                0 => String::new(),
                count => format!("; the counter wraps at 2^32 {count} times"),
            };
            let restarts = match restarts {
                0 => String::new(),
                count => format!("; it restarts {count} times, and the time between is not known"),
            };
            notes.push(format!(
                "times count from the start of the board (or a simulation), not from 1970: the first is taken as {} ({source}){wraps}{restarts}; \
                 --started TIME gives another",
                self.started
            ));
        }
        if without_unit > 0 {
            notes.push(format!(
                "{without_unit} times have no unit and are left out: name the column time_s, time_ms or time_us with --columns"
            ));
        }
        notes
    }
}

/// A counter that falls back by less than this is merely out of order, seconds.
const RESTART_S: f64 = 0.5;

/// Forms of local times that mean one thing only.
const CIVIL: [&str; 10] = [
    "%d.%m.%Y %H:%M:%S%.f",
    "%d.%m.%Y %H:%M",
    "%d.%m.%Y, %H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%Y.%m.%d %H:%M:%S%.f",
    "%Y-%m-%d %H:%M",
    "%Y-%m-%d_%H-%M-%S",
    "%d-%b-%Y %H:%M:%S%.f",
    "%d %b %Y %H:%M:%S%.f",
    "%a %b %e %H:%M:%S %Y",
];

/// With a point before the fraction of seconds.
fn with_point(cell: &str) -> String {
    match cell.rsplit_once(',') {
        Some((whole, fraction))
            if whole.ends_with(|c: char| c.is_ascii_digit())
                && !fraction.is_empty()
                && fraction.bytes().all(|byte| byte.is_ascii_digit()) =>
        {
            format!("{whole}.{fraction}")
        }
        _ => cell.to_owned(),
    }
}

/// The way in for a time that may mean several.
fn advice(cell: &str) -> String {
    if cell.contains('/') {
        let clock = match (cell.to_uppercase().ends_with('M'), cell.matches(':').count()) {
            (true, 2..) => " %I:%M:%S%.f %p",
            (true, _) => " %I:%M %p",
            (false, 2..) => " %H:%M:%S%.f",
            (false, 1) => " %H:%M",
            (false, _) => "",
        };
        let year = if cell.split(['/', ' ']).nth(2).is_some_and(|year| year.len() == 4) {
            "%Y"
        } else {
            "%y"
        };
        return format!(
            "choose: --time-format '%d/%m/{year}{clock}' for the day, --time-format '%m/%d/{year}{clock}' for \
             the month"
        );
    }
    "write it as in 2026-01-31T12:00:00Z, give its form with --time-format '%d.%m.%Y %H:%M:%S', or name a column time_s \
     for seconds"
        .to_owned()
}

/// `+01:00`, `-0330`, `Z`, or hours.
fn offset(text: &str) -> Result<Offset, ImportError> {
    let refuse = || {
        ImportError::mapping(
            format!("`{text}` is no offset from UTC"),
            "write it as in --utc-offset +01:00",
        )
    };
    let plain: String = text.trim().chars().filter(|c| *c != ':').collect();
    if matches!(plain.as_str(), "Z" | "z" | "UTC") {
        return Ok(Offset::UTC);
    }
    let (sign, digits) = match plain.split_at_checked(1) {
        Some(("-", digits)) => (-1, digits),
        Some(("+", digits)) => (1, digits),
        _ => (1, plain.as_str()),
    };
    if digits.is_empty() || digits.len() > 4 || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(refuse());
    }
    let number: i32 = digits.parse().map_err(|_| refuse())?;
    let (hours, minutes) =
        if digits.len() > 2 { (number / 100, number % 100) } else { (number, 0) };
    Offset::from_seconds(sign * (hours * 3600 + minutes * 60)).map_err(|_| refuse())
}

#[cfg(test)]
mod tests {
    use super::*;

    const STARTED: &str = "2026-11-27T08:00:00Z";

    fn read(mapping: &Mapping, cells: &[&str]) -> (Vec<String>, String) {
        let mut times = Times::new(mapping, STARTED.parse().expect("a time")).expect("an offset");
        let read = cells.iter().map(|cell| match times.text(cell) {
            Ok(Some(time)) => time.to_string(),
            Ok(None) => "-".to_owned(),
            Err((what, help)) => format!("{what}; {help}"),
        });
        let read = read.collect();
        (read, times.notes().join("\n"))
    }

    #[test]
    fn local_times_are_read_and_the_zone_named() {
        let plain = Mapping::default();
        for (cell, time) in [
            ("2026-01-31T12:00:00Z", "2026-01-31T12:00:00Z"),
            ("2026-01-31T12:00:00+01:00", "2026-01-31T11:00:00Z"),
            ("2026-01-31 12:00:00", "2026-01-31T12:00:00Z"),
            ("2026-01-31T12:00:00.25", "2026-01-31T12:00:00.25Z"),
            ("2026-01-31 12:00:00,250", "2026-01-31T12:00:00.25Z"),
            ("31.01.2026 12:00:00", "2026-01-31T12:00:00Z"),
            ("2026/01/31 12:00:00.5", "2026-01-31T12:00:00.5Z"),
            ("31-Jan-2026 12:00:00", "2026-01-31T12:00:00Z"),
            ("1700000000.5", "2023-11-14T22:13:20.5Z"),
            ("1700000000500", "2023-11-14T22:13:20.5Z"),
        ] {
            let (read, notes) = read(&plain, &[cell]);
            assert_eq!(read, [time], "{cell}");
            let has_zone = cell.contains(['Z', '+']) || cell.starts_with("17");
            assert_eq!(notes.contains("taken as UTC"), !has_zone, "{cell}: {notes}");
        }
        let offset = Mapping { utc_offset: Some("+01:00".to_owned()), ..Mapping::default() };
        let (read, notes) = read(&offset, &["2026-01-31 12:00:00"]);
        assert_eq!((read, notes), (vec!["2026-01-31T11:00:00Z".to_owned()], String::new()));
    }

    #[test]
    fn times_of_day_are_of_the_start_and_the_days_after() {
        let (read, notes) = read(&Mapping::default(), &["23:59:58.5", "23:59:59", "00:00:01"]);
        let expected = ["2026-11-27T23:59:58.5Z", "2026-11-27T23:59:59Z", "2026-11-28T00:00:01Z"];
        assert_eq!(read, expected);
        assert!(
            notes.contains("no date")
                && notes.contains("2026-11-27")
                && notes.contains("--started"),
            "{notes}"
        );
    }

    #[test]
    fn dates_that_may_mean_two_are_asked_about_and_the_answer_reads_them() {
        for (cell, day_first) in [
            ("01/02/2026 12:00:00", "2026-02-01T12:00:00Z"),
            ("01/02/26 12:00", "2026-02-01T12:00:00Z"),
            ("01/02/2026 01:30:00 PM", "2026-02-01T13:30:00Z"),
        ] {
            let (said, _) = read(&Mapping::default(), &[cell]);
            let formats: Vec<&str> = said[0].split('\'').skip(1).step_by(2).collect();
            let [first, second] = formats[..] else { panic!("{said:?}") };
            let by = |format: &str| Mapping {
                time_format: Some(format.to_owned()),
                ..Mapping::default()
            };
            assert_eq!(read(&by(first), &[cell]).0, [day_first], "{cell}");
            assert_ne!(read(&by(second), &[cell]).0, [day_first], "{cell}");
        }
    }

    #[test]
    fn counters_of_boards_count_from_the_start_and_wrap() {
        let mapping = Mapping::default();
        let mut times = Times::new(&mapping, STARTED.parse().expect("a time")).expect("an offset");
        let field = Field::named("time_ms");
        let read = [4_294_967_000.0, 4_294_967_200.0, 104.0, 304.0, 100_304.0, 4.0, 1004.0];
        let read =
            read.map(|ms| times.number(field, ms * 1e-3).expect("in range").as_millisecond());
        let since: Vec<i64> = read.iter().map(|ms| ms - read[0]).collect();
        assert_eq!(since, [0, 200, 400, 600, 100_600, 100_600, 101_600]);
        assert_eq!((times.assumed.wraps, times.assumed.restarts), (1, 1));
        let notes = times.notes().join("\n");
        assert!(
            notes.contains("from the start of the board") && notes.contains("wraps"),
            "{notes}"
        );
    }

    #[test]
    fn numbers_without_unit_are_left_out_and_counted() {
        let (read, notes) = read(&Mapping::default(), &["1350", "1400"]);
        assert_eq!(read, ["-", "-"]);
        assert!(notes.contains("2 times have no unit"), "{notes}");
    }
}
