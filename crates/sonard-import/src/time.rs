//! Parsing of times as loggers write them: with or without time zone, date, or a known start.

use jiff::{
    SignedDuration, Timestamp, civil,
    fmt::{rfc2822, strtime},
    tz::{Offset, TimeZone},
};

use crate::{Field, ImportError, Mapping};

/// Seconds since 1970 below which a time counts from the start of a board: 2000-01-01.
pub(crate) const MIN_CLOCK_S: f64 = 946_684_800.0;
/// Modulus of 32-bit counters.
const WRAP: f64 = 4_294_967_296.0;
/// Minimum backward step of a time of day that means the next day.
const DAY_JUMP: SignedDuration = SignedDuration::from_hours(12);

/// Counts of assumptions made about the times of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct TimeAssumptions {
    /// Times without a time zone.
    pub(crate) without_zone: u64,
    /// Times of day without a date.
    pub(crate) without_date: u64,
    /// Times counted from the start of a board.
    pub(crate) from_start: u64,
    /// Wraps of such a counter at 2^32, and restarts from zero.
    pub(crate) wraps: u64,
    pub(crate) restarts: u64,
    /// Numbers without a unit: seconds, milliseconds or anything else.
    pub(crate) without_unit: u64,
}

/// Parser of the times of a file, in their order.
#[derive(Debug)]
pub(crate) struct TimeReader<'a> {
    mapping: &'a Mapping,
    zone: TimeZone,
    /// Time of the first reading, for files without absolute times.
    started: Timestamp,
    pub(crate) assumed: TimeAssumptions,
    last_clock: Option<civil::DateTime>,
    /// First and last counter value, and the offset added for wraps and restarts, seconds.
    first_s: Option<f64>,
    last_s: f64,
    added_s: f64,
}

/// Description of an invalid time, and advice for the user.
type InvalidTime = (String, String);

impl<'a> TimeReader<'a> {
    /// # Errors
    /// Returns an error for an invalid UTC offset.
    pub(crate) fn new(mapping: &'a Mapping, started: Timestamp) -> Result<Self, ImportError> {
        let zone = match &mapping.utc_offset {
            Some(text) => TimeZone::fixed(parse_utc_offset(text)?),
            None => TimeZone::UTC,
        };
        Ok(Self {
            mapping,
            zone,
            started: mapping.started.unwrap_or(started),
            assumed: TimeAssumptions::default(),
            last_clock: None,
            first_s: None,
            last_s: 0.0,
            added_s: 0.0,
        })
    }

    /// Parses a time written as text; `None` for a number without a unit.
    pub(crate) fn parse_text(&mut self, cell: &str) -> Result<Option<Timestamp>, InvalidTime> {
        if let Some(format) = &self.mapping.time_format {
            return self.parse_format(format, cell).map(Some);
        }
        if let Some(time) = zoned(cell) {
            return Ok(Some(time));
        }
        if let Ok(number) = cell.parse::<f64>() {
            return Ok(self.plain_number(number));
        }
        let cell = with_point(cell);
        let civil = cell.parse::<civil::DateTime>().ok();
        let civil = civil.or_else(|| {
            let mut formats = CIVIL.iter();
            // `%Y` also matches two digits, as a year of the first century.
            formats.find_map(|format| {
                let civil = civil::DateTime::strptime(format, &cell).ok();
                civil.filter(|civil| civil.year() >= MIN_YEAR)
            })
        });
        let time = cell.parse::<civil::Time>().ok();
        let time = time
            .or_else(|| OF_DAY.iter().find_map(|format| civil::Time::strptime(format, &cell).ok()));
        match (civil, time) {
            (Some(civil), _) => self.local(civil).map(Some),
            (None, Some(time)) => self.of_day(time).map(Some),
            (None, None) => Err((
                format!("`{}` is not a time", cell.chars().take(40).collect::<String>()),
                format_advice(&cell),
            )),
        }
    }

    /// Converts a number, scaled to seconds; `field` is the field of the mapping that gives the
    /// unit.
    pub(crate) fn number(
        &mut self,
        field: Option<Field>,
        seconds: f64,
    ) -> Result<Timestamp, InvalidTime> {
        let nanoseconds = if seconds.abs() >= MIN_CLOCK_S {
            to_nanoseconds(seconds)
        } else {
            let since_s = self.since_start(field, seconds);
            self.started.as_nanosecond().saturating_add(to_nanoseconds(since_s))
        };
        Timestamp::from_nanosecond(nanoseconds).map_err(|_| {
            let field = field.map_or("time_s", Field::name);
            let what = format!("{seconds:.0} s since 1970 is beyond the year 9999");
            (
                what,
                format!(
                    "map the column in its unit, such as time_ms or time_us instead of {field}"
                ),
            )
        })
    }

    /// Returns the seconds since the first value of a counter that starts with a board.
    fn since_start(&mut self, field: Option<Field>, seconds: f64) -> f64 {
        self.assumed.from_start += 1;
        let unit_s = match field.and_then(Field::unit) {
            Some("ms") => 1e-3,
            Some("us") => 1e-6,
            _ => 0.0,
        };
        let first_s = *self.first_s.get_or_insert_with(|| {
            self.last_s = seconds;
            seconds
        });
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

    /// Converts a number whose magnitude reveals its unit: times in the years 2001 to 2286.
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

    fn parse_format(&mut self, format: &str, cell: &str) -> Result<Timestamp, InvalidTime> {
        let invalid = |error: jiff::Error| {
            (
                error.to_string(),
                "--time-format takes strftime specifiers: '%d/%m/%Y %H:%M:%S%.f'".to_owned(),
            )
        };
        let read = strtime::parse(format, cell).map_err(invalid)?;
        if read.offset().is_some()
            && let Ok(time) = read.to_timestamp()
        {
            return Ok(time);
        }
        match (read.to_datetime(), read.to_time()) {
            (Ok(civil), _) => self.local(civil),
            (Err(_), Ok(time)) => self.of_day(time),
            (Err(error), Err(_)) => Err(invalid(error)),
        }
    }

    fn local(&mut self, civil: civil::DateTime) -> Result<Timestamp, InvalidTime> {
        self.assumed.without_zone += 1;
        let zoned = civil.to_zoned(self.zone.clone());
        zoned
            .map(|zoned| zoned.timestamp())
            .map_err(|error| (error.to_string(), "correct that time".to_owned()))
    }

    /// Converts a time of day, on the first day or a later one.
    fn of_day(&mut self, time: civil::Time) -> Result<Timestamp, InvalidTime> {
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

    /// Returns one line for each assumption.
    pub(crate) fn notes(&self) -> Vec<String> {
        let TimeAssumptions {
            without_zone,
            without_date,
            from_start,
            wraps,
            restarts,
            without_unit,
        } = self.assumed;
        let mut notes = Vec::new();
        if without_date > 0 {
            let day = self.started.to_zoned(self.zone.clone()).date();
            let source =
                if self.mapping.started.is_some() { "--started" } else { "the file's date" };
            notes.push(format!(
                "times have no date: first day taken as {day} ({source}); change it with --started TIME"
            ));
        }
        if without_zone > 0 && self.mapping.utc_offset.is_none() {
            notes.push(
                "times have no time zone: taken as UTC; change it with --utc-offset +01:00"
                    .to_owned(),
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
                count => format!("; {count} restarts of unknown duration"),
            };
            notes.push(format!(
                "times count from the start of the board (or a simulation), not from 1970: first time taken as {} ({source}){wraps}{restarts}; \
                                 change it with --started TIME",
                self.started
            ));
        }
        if without_unit > 0 {
            notes.push(format!(
                "{without_unit} times without unit skipped: map the column as time_s, time_ms or time_us with --columns"
            ));
        }
        notes
    }
}

/// Backward step below which a counter is out of order instead of restarted.
const RESTART_S: f64 = 0.5;

/// Unambiguous formats of local times.
const CIVIL: [&str; 13] = [
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
    "%d.%m.%y %H:%M:%S%.f",
    "%d.%m.%y %H:%M",
    "%Y-%m-%d %I:%M:%S%.f %p",
];

/// Formats of times of day, besides ISO 8601.
const OF_DAY: [&str; 2] = ["%I:%M:%S%.f %p", "%I:%M %p"];

/// Earliest year of a reading.
const MIN_YEAR: i16 = 1970;

/// Nanoseconds of a time or duration, seconds, to a microsecond: the precision of a floating-point
/// number of today's time. Values out of range saturate.
fn to_nanoseconds(seconds: f64) -> i128 {
    ((seconds * 1e6).round() as i128).saturating_mul(1000)
}

/// Parses a time with its zone: ISO 8601, also with a blank before the zone, or RFC 2822.
fn zoned(cell: &str) -> Option<Timestamp> {
    let utc = ["UTC", "GMT"].iter().find_map(|zone| cell.strip_suffix(zone));
    let utc = utc.map(|local| format!("{}Z", local.trim_end()));
    let spaced = cell.rsplit_once(' ').filter(|(_, zone)| zone.starts_with(['+', '-']));
    let spaced = spaced.map(|(local, zone)| format!("{local}{zone}"));
    let forms = [Some(cell.to_owned()), utc, spaced];
    let time = forms.into_iter().flatten().find_map(|form| form.parse().ok());
    time.or_else(|| rfc2822::parse(cell).ok().map(|zoned| zoned.timestamp()))
}

/// Replaces a decimal comma of the seconds by a point.
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

/// Returns advice for a time that is ambiguous or not recognized.
fn format_advice(cell: &str) -> String {
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
            "choose: --time-format '%d/%m/{year}{clock}' (day first) or --time-format '%m/%d/{year}{clock}' (month first)"
        );
    }
    "write it as 2026-01-31T12:00:00Z, give its format with --time-format '%d.%m.%Y %H:%M:%S', or map a column of \
         seconds as time_s"
        .to_owned()
}

/// Parses `+01:00`, `-0330`, `Z`, or hours.
fn parse_utc_offset(text: &str) -> Result<Offset, ImportError> {
    let invalid = || {
        ImportError::mapping(
            format!("`{text}` is not a UTC offset"),
            "write it as --utc-offset +01:00",
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
        return Err(invalid());
    }
    let number: i32 = digits.parse().map_err(|_| invalid())?;
    let (hours, minutes) =
        if digits.len() > 2 { (number / 100, number % 100) } else { (number, 0) };
    Offset::from_seconds(sign * (hours * 3600 + minutes * 60)).map_err(|_| invalid())
}

#[cfg(test)]
mod tests {
    use super::*;

    const STARTED: &str = "2026-11-27T08:00:00Z";

    fn read(mapping: &Mapping, cells: &[&str]) -> (Vec<String>, String) {
        let mut times =
            TimeReader::new(mapping, STARTED.parse().expect("a time")).expect("an offset");
        let read = cells.iter().map(|cell| match times.parse_text(cell) {
            Ok(Some(time)) => time.to_string(),
            Ok(None) => "-".to_owned(),
            Err((what, help)) => format!("{what}; {help}"),
        });
        let read = read.collect();
        (read, times.notes().join("\n"))
    }

    #[test]
    fn numbers_beyond_the_calendar_are_rejected() {
        let mapping = Mapping::default();
        let mut times =
            TimeReader::new(&mapping, STARTED.parse().expect("a time")).expect("an offset");
        for seconds in [1e12, 1.7e75, -1.7e75, f64::MAX, f64::INFINITY] {
            let (what, _) = times.number(None, seconds).expect_err("beyond the year 9999");
            assert!(what.contains("9999"), "{what}");
        }
    }

    #[test]
    fn reads_local_times() {
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
            ("31.1.26 12:00:00", "2026-01-31T12:00:00Z"),
            ("2026-01-31 02:30:00 PM", "2026-01-31T14:30:00Z"),
            ("2026-01-31 12:00:00 UTC", "2026-01-31T12:00:00Z"),
            ("2026-01-31 12:00:00.5 +01:00", "2026-01-31T11:00:00.5Z"),
            ("Sat, 31 Jan 2026 12:00:00 GMT", "2026-01-31T12:00:00Z"),
            ("1700000000.5", "2023-11-14T22:13:20.5Z"),
            ("1700000000500", "2023-11-14T22:13:20.5Z"),
        ] {
            let (read, notes) = read(&plain, &[cell]);
            assert_eq!(read, [time], "{cell}");
            let has_zone = cell.contains(['Z', '+', 'T']) && cell != "2026-01-31T12:00:00.25";
            let has_zone = has_zone || cell.starts_with("17");
            assert_eq!(notes.contains("taken as UTC"), !has_zone, "{cell}: {notes}");
        }
        let offset = Mapping { utc_offset: Some("+01:00".to_owned()), ..Mapping::default() };
        let (read, notes) = read(&offset, &["2026-01-31 12:00:00"]);
        assert_eq!((read, notes), (vec!["2026-01-31T11:00:00Z".to_owned()], String::new()));
    }

    #[test]
    fn reads_times_of_day() {
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
    fn rejects_ambiguous_dates() {
        for (cell, day_first) in [
            ("01/02/2026 12:00:00", "2026-02-01T12:00:00Z"),
            ("01/02/26 12:00", "2026-02-01T12:00:00Z"),
            ("01/02/2026 01:30:00 PM", "2026-02-01T13:30:00Z"),
        ] {
            let (message, _) = read(&Mapping::default(), &[cell]);
            let formats: Vec<&str> = message[0].split('\'').skip(1).step_by(2).collect();
            let [first, second] = formats[..] else { panic!("{message:?}") };
            let by = |format: &str| Mapping {
                time_format: Some(format.to_owned()),
                ..Mapping::default()
            };
            assert_eq!(read(&by(first), &[cell]).0, [day_first], "{cell}");
            assert_ne!(read(&by(second), &[cell]).0, [day_first], "{cell}");
        }
    }

    #[test]
    fn counters_wrap_and_restart() {
        let mapping = Mapping::default();
        let mut times =
            TimeReader::new(&mapping, STARTED.parse().expect("a time")).expect("an offset");
        let field = Field::from_name("time_ms");
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
    fn skips_numbers_without_unit() {
        let (read, notes) = read(&Mapping::default(), &["1350", "1400"]);
        assert_eq!(read, ["-", "-"]);
        assert!(notes.contains("2 times without unit"), "{notes}");
    }
}
