//! Dates and times of day, for those who have no library of dates.

use std::fmt;
use std::str::FromStr;

/// A date and a time of day in some time zone, by the Gregorian calendar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Year of the Gregorian calendar.
    pub year: i32,
    /// Month, 1 to 12.
    pub month: u32,
    /// Day of the month, from 1.
    pub day: u32,
    /// Seconds since midnight, 0 to 86 400.
    pub seconds: f64,
}

/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// Why a text is no [`Moment`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is no moment; write 2024-06-21T12:00, or 2024-06-21 for its midnight")]
pub struct BadMoment {
    text: String,
}

impl Moment {
    /// Midnight at the beginning of a day, if there is such a day.
    pub fn midnight(year: i32, month: u32, day: u32) -> Option<Self> {
        let exists = (1..=12).contains(&month) && (1..=days_of_month(year, month)).contains(&day);
        exists.then_some(Self {
            year,
            month,
            day,
            seconds: 0.0,
        })
    }

    /// Seconds since 1970-01-01T00:00:00Z, where clocks are `zone` hours ahead of UTC (negative west of Greenwich).
    pub fn unix(&self, zone: f64) -> f64 {
        days_since_1970(self.year, self.month, self.day) as f64 * DAY + self.seconds - zone * 3600.0
    }

    /// Day of the year, from 1.
    pub fn day_of_year(&self) -> u32 {
        let day = |month, day| days_since_1970(self.year, month, day);
        (day(self.month, self.day) - day(1, 1)) as u32 + 1
    }

    /// The moment of a Unix time on clocks that are `zone` hours ahead of UTC.
    pub fn at_unix(time: f64, zone: f64) -> Self {
        let local = time + zone * 3600.0;
        let days = (local / DAY).floor();
        let (year, month, day) = date(days as i64);
        Self {
            year,
            month,
            day,
            seconds: local - days * DAY,
        }
    }
}

/// Whether a year has 366 days.
pub fn is_leap_year(year: i32) -> bool {
    year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)
}

/// Days of a month, 28 to 31.
fn days_of_month(year: i32, month: u32) -> u32 {
    match month {
        2 if is_leap_year(year) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

/// Days from 1970-01-01 to a date. Years are counted from March, so that the odd day comes last in them.
pub(crate) fn days_since_1970(year: i32, month: u32, day: u32) -> i64 {
    let year = i64::from(year) - i64::from(month < 3);
    // Days before each month from March: 31 and 30 in turn make 153 in five months.
    let before = (153 * i64::from((month + 9) % 12) + 2) / 5;
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    365 * year + leap_days + before + i64::from(day) - 719_469
}

/// Date so many days after 1970-01-01. Dates beyond the range of years end at its ends.
fn date(days: i64) -> (i32, u32, u32) {
    let days = days.clamp(-1_100_000_000, 1_100_000_000) + 719_468;
    // Years from March of each 400 years, and days of them.
    let (era, day) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let year = 400 * era + year + i64::from(month >= 10);
    (year as i32, ((month + 2) % 12 + 1) as u32, day as u32)
}

impl FromStr for Moment {
    type Err = BadMoment;

    /// Reads `YYYY-MM-DD`, `YYYY-MM-DDTHH:MM` and `YYYY-MM-DDTHH:MM:SS`, where a space may stand for the T. The hour may be
    /// 24 at the end of a day.
    fn from_str(text: &str) -> Result<Self, BadMoment> {
        let bad = || BadMoment { text: text.into() };
        let (date, time) = match text.split_once(['T', ' ']) {
            Some((date, time)) => (date, Some(time)),
            None => (text, None),
        };
        let number = |text: &str| {
            let is_plain = text.len() <= 4 && text.bytes().all(|byte| byte.is_ascii_digit());
            is_plain.then(|| text.parse::<u32>().ok()).flatten()
        };
        let mut fields = date.split('-').map(number);
        let mut next = || fields.next().flatten().ok_or_else(bad);
        let (year, month, day) = (next()?, next()?, next()?);
        if fields.next().is_some() {
            return Err(bad());
        }
        let mut moment = Self::midnight(year as i32, month, day).ok_or_else(bad)?;
        let mut fields = time.unwrap_or("0:0").split(':').map(number);
        let mut next = || fields.next().unwrap_or(Some(0)).ok_or_else(bad);
        let (hour, minute, second) = (next()?, next()?, next()?);
        let seconds = hour * 3600 + minute * 60 + second;
        if fields.next().is_some() || minute > 59 || second > 59 || seconds > 86_400 {
            return Err(bad());
        }
        if time.is_some_and(|time| !time.contains(':')) {
            return Err(bad());
        }
        moment.seconds = f64::from(seconds);
        Ok(moment)
    }
}

impl fmt::Display for Moment {
    /// Writes `YYYY-MM-DDTHH:MM:SS`, with the seconds rounded down.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (year, month, day) = (self.year, self.month, self.day);
        let seconds = self.seconds as u32;
        let [hour, minute, second] = [seconds / 3600, seconds / 60 % 60, seconds % 60];
        write!(
            f,
            "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_run_without_a_gap_for_a_thousand_years() {
        let mut days = days_since_1970(1600, 1, 1);
        for year in 1600..2600 {
            for month in 1..=12 {
                for day in 1..=days_of_month(year, month) {
                    assert_eq!(days_since_1970(year, month, day), days);
                    assert_eq!(date(days), (year, month, day));
                    days += 1;
                }
            }
        }
        assert_eq!(days_since_1970(1970, 1, 1), 0);
        // Published Unix times: 2000-03-01 and the end of 32 bits.
        assert_eq!(days_since_1970(2000, 3, 1), 11_017);
        let last = Moment::at_unix(2_147_483_647.0, 0.0);
        assert_eq!(last.to_string(), "2038-01-19T03:14:07");
        assert_eq!(
            Moment::midnight(2024, 12, 31).map(|moment| moment.day_of_year()),
            Some(366)
        );
        assert!(is_leap_year(2000) && is_leap_year(2024));
        assert!(!is_leap_year(1900) && !is_leap_year(2023));
    }

    #[test]
    fn zones_move_the_clock() {
        let noon: Moment = "2024-06-21T12:00".parse().expect("a moment");
        assert_eq!(noon.unix(0.0) - noon.unix(2.0), 7200.0);
        assert_eq!(Moment::at_unix(noon.unix(5.5), 5.5), noon);
        let evening = Moment::at_unix(noon.unix(0.0), -13.0);
        assert_eq!(evening.to_string(), "2024-06-20T23:00:00");
    }

    #[test]
    fn texts_are_read_or_refused() {
        for (text, unix) in [
            ("1970-01-01", 0.0),
            ("1970-01-01T24:00", 86_400.0),
            ("1970-01-02 00:00:01", 86_401.0),
            ("2024-02-29", 1_709_164_800.0),
        ] {
            assert_eq!(
                text.parse::<Moment>().map(|moment| moment.unix(0.0)),
                Ok(unix),
                "{text}"
            );
        }
        for text in [
            "",
            "2023-02-29",
            "2024-13-01",
            "2024-00-10",
            "2024-01-01T25:00",
            "2024-01-01T",
            "2024-01-01T12",
            "2024-1-1-1",
            "2024-01-01T12:60",
            "2024-01-01T1:2:3:4",
            "+024-01-01",
        ] {
            assert!(text.parse::<Moment>().is_err(), "{text}");
        }
    }
}
