//! Weather files of EnergyPlus (.epw): measured or typical sun and sky of a place, hour by hour.

use crate::points::table::{BadTable, fields};
use crate::sun::moment::{Moment, days_since_1970};
use crate::sun::perez::Irradiance;
use crate::sun::position::Place;

/// A weather file in EnergyPlus format (.epw).
#[derive(Clone, Debug, PartialEq)]
pub struct Weather {
    /// Name of the place: city, region and country.
    pub name: String,
    /// Latitude, longitude and elevation of the station.
    pub place: Place,
    /// Hours that the clocks of the file are ahead of UTC, without summer time.
    pub zone: f64,
    /// Records of the weather, in the order of the file.
    pub records: Vec<Record>,
    /// Number of records whose direct or diffuse irradiance is missing, and counts as 0.
    pub incomplete: usize,
}

/// Means over a step of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Beginning of the step, on clocks without summer time. Years of a typical year differ from month to month.
    pub begin: Moment,
    /// Length of the step in hours.
    pub hours: f64,
    /// Irradiance; 0 where the file has none.
    pub irradiance: Irradiance,
}

/// Why a text is no weather file.
pub type BadWeather = BadTable;

/// Fields of a line of data that are read: direct normal and diffuse horizontal irradiance.
const DIRECT: usize = 14;
const DIFFUSE: usize = 15;
/// Separator of fields.
const COMMA: Option<char> = Some(',');
/// From this value on, an irradiance is a mark for one that is missing.
const MISSING: f64 = 9999.0;

impl Weather {
    /// Reads a file. Irradiance that is missing counts as 0.
    ///
    /// # Errors
    /// [`BadWeather`] names the first line that is not as it should be. The records must fill the periods that the file
    /// itself declares in its line DATA PERIODS: one that was cut short is refused.
    pub fn read(text: &str) -> Result<Self, BadWeather> {
        let mut lines = text
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line));
        let bad = |line, reason: String| BadWeather { line, reason };
        let (_, first) = lines.next().unwrap_or((1, ""));
        let found = fields(first.trim_start_matches('\u{feff}'), COMMA);
        if !found[0].eq_ignore_ascii_case("LOCATION") || found.len() < 10 {
            let reason = "found no LOCATION with ten fields, as the first line of an .epw file has";
            return Err(bad(1, reason.into()));
        }
        let number = |line, what: &str, text: &str| {
            let number = text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
            number.ok_or_else(|| bad(line, format!("{what}: found {text:?}, wanted a number")))
        };
        let within = |what: &str, text: &str, most: f64| match number(1, what, text) {
            Ok(found) if found.abs() > most => {
                let reason = format!("{what}: found {found}, wanted -{most} to {most}");
                Err(bad(1, reason))
            }
            found => found,
        };
        let place = Place {
            latitude: within("latitude", found[6], 90.0)?,
            longitude: within("longitude", found[7], 180.0)?,
            height: number(1, "elevation", found[9])?,
        };
        let zone = within("time zone", found[8], 15.0)?;
        let name = [found[1], found[2], found[3]];
        let name: Vec<&str> = name
            .into_iter()
            .filter(|name| !["", "-"].contains(name))
            .collect();
        let mut weather = Self {
            name: name.join(", "),
            place,
            zone,
            records: Vec::new(),
            incomplete: 0,
        };
        let mut periods = None;
        for (line, text) in lines {
            let fields = fields(text, COMMA);
            if fields[0].eq_ignore_ascii_case("DATA PERIODS") {
                let found = Periods::read(line, &fields).map_err(|reason| bad(line, reason))?;
                periods = Some(found);
            } else if let Some(periods) = periods.as_ref().filter(|_| !text.trim().is_empty()) {
                let number = |what: &str, text: &str| number(line, what, text);
                let record = Record::read(&fields, periods.per_hour, number);
                let (record, is_complete) = record.map_err(|error| bad(line, error.reason))?;
                weather.records.push(record);
                weather.incomplete += usize::from(!is_complete);
            }
        }
        if weather.records.is_empty() {
            let reason = "found no data behind a line DATA PERIODS";
            return Err(bad(text.lines().count().max(1), reason.into()));
        }
        let last_line = text.trim_end().lines().count();
        let filled = periods.map_or(Ok(()), |periods| periods.check(&weather.records));
        filled.map_err(|reason| bad(last_line, reason))?;
        Ok(weather)
    }
}

/// What a line DATA PERIODS declares.
struct Periods {
    line: usize,
    per_hour: u32,
    /// First and last day of each period.
    days: Vec<[Day; 2]>,
}

/// A day as `month/day`, or as `month/day/year` or `year/month/day` if its year counts.
#[derive(Clone, Copy, PartialEq)]
struct Day {
    month: u32,
    day: u32,
    year: Option<i32>,
}

impl Periods {
    /// Reads the fields of the line: the number of periods and of records an hour, then four fields for each period: name,
    /// day of the week, first and last day.
    fn read(line: usize, fields: &[&str]) -> Result<Self, String> {
        let whole = |index: usize| fields.get(index)?.trim().parse::<u32>().ok();
        let valid = |count: &u32| (1..=60).contains(count) && 60 % count == 0;
        let per_hour = whole(2).filter(valid);
        let per_hour = per_hour.ok_or("found no number of records per hour that divides 60")?;
        let number = whole(1).filter(|number| (1..=366).contains(number));
        let number = number.ok_or("found no number of periods")? as usize;
        let day = |field: usize| {
            let text = fields.get(field).copied().unwrap_or_default();
            Day::read(text).ok_or_else(|| {
                format!(
                    "field {}: found {text:?}, wanted a day as month/day",
                    field + 1
                )
            })
        };
        let period = |index: usize| Ok::<_, String>([day(4 * index + 5)?, day(4 * index + 6)?]);
        Ok(Self {
            line,
            per_hour,
            days: (0..number).map(period).collect::<Result<_, _>>()?,
        })
    }

    /// Checks that the records begin and end with the periods, and are as many.
    fn check(&self, records: &[Record]) -> Result<(), String> {
        let is_on = |day: Day, begin: &Moment| (day.month, day.day) == (begin.month, begin.day);
        let ([Some(first), Some(last)], Some([from, _]), Some([_, to])) = (
            [records.first(), records.last()],
            self.days.first(),
            self.days.last(),
        ) else {
            return Ok(());
        };
        let days = || self.days.iter().map(|[from, to]| from.days_to(to));
        let wanted = [0, 1].map(|leap| {
            let days: i64 = days().map(|days| days[leap]).sum();
            24 * i64::from(self.per_hour) * days
        });
        let found = records.len() as i64;
        if wanted.contains(&found) && is_on(*from, &first.begin) && is_on(*to, &last.begin) {
            return Ok(());
        }
        Err(format!(
            "found {found} records from {} to {}, but line {} declares {}/{} to {}/{}, which are {}: the file is not complete",
            first.begin, last.begin, self.line, from.month, from.day, to.month, to.day, wanted[0],
        ))
    }
}

impl Day {
    fn read(text: &str) -> Option<Self> {
        let mut numbers = text
            .split('/')
            .map(|number| number.trim().parse::<u32>().ok());
        let [first, second] = [numbers.next()??, numbers.next()??];
        let third = numbers.next();
        let (year, month, day) = match third {
            Some(day) if first > 31 => (Some(first), second, day?),
            Some(year) => (Some(year?), first, second),
            None => (None, first, second),
        };
        let year = year.map(i32::try_from).transpose().ok()?;
        // Without a year, the 29th of February exists.
        Moment::midnight(year.unwrap_or(2004), month, day)?;
        let is_end = numbers.next().is_none();
        is_end.then_some(Self { month, day, year })
    }

    /// Number of days to another one, which counts, too: least and most, as years have 365 or 366 days.
    fn days_to(&self, to: &Self) -> [i64; 2] {
        let place = |day: &Self| (day.month, day.day);
        let is_later = place(to) >= place(self);
        let number = |day: &Self, year: i32| days_since_1970(year, day.month, day.day);
        if let (Some(first), Some(last)) = (self.year, to.year) {
            return [number(to, last) - number(self, first) + 1; 2];
        }
        let [first, last] = [2001, if is_later { 2001 } else { 2002 }];
        let days = number(to, last) - number(self, first) + 1;
        let [is_before, is_after] = [place(self) < (3, 1), place(to) >= (3, 1)];
        let has_leap_day = match is_later {
            true => is_before && is_after,
            false => is_before || is_after,
        };
        [days, days + i64::from(has_leap_day)]
    }
}

impl Record {
    /// Reads the fields of a line, and returns whether it has irradiance.
    fn read(
        fields: &[&str],
        per_hour: u32,
        number: impl Fn(&str, &str) -> Result<f64, BadWeather>,
    ) -> Result<(Self, bool), BadWeather> {
        let bad = |reason: String| BadWeather { line: 0, reason };
        if fields.len() <= DIFFUSE {
            let found = fields.len();
            return Err(bad(format!(
                "found {found} fields, wanted at least {}",
                DIFFUSE + 1
            )));
        }
        let whole = |index: usize, what| {
            let found = number(what, fields[index])?;
            match found.fract() == 0.0 && (0.0..=9999.0).contains(&found) {
                true => Ok(found as u32),
                false => Err(bad(format!("{what}: found {found}, wanted a whole number"))),
            }
        };
        let (year, month, day) = (whole(0, "year")?, whole(1, "month")?, whole(2, "day")?);
        let (hour, minute) = (whole(3, "hour")?, whole(4, "minute")?);
        // Files for one record an hour have either 60 or 0 as its minute; the hour is that which ends.
        let is_end = minute == 0 || per_hour == 1;
        let minute = if is_end { 60 } else { minute };
        let step = 60 / per_hour;
        let midnight = Moment::midnight(year as i32, month, day);
        let begin = midnight.filter(|_| (1..=24).contains(&hour) && minute <= 60 && minute >= step);
        let Some(mut begin) = begin else {
            return Err(bad(format!(
                "found no such time: {year}-{month}-{day}, hour {hour}, minute {minute}"
            )));
        };
        begin.seconds = f64::from((hour - 1) * 3600 + (minute - step) * 60);
        let direct = number("direct normal irradiance", fields[DIRECT])?;
        let diffuse = number("diffuse horizontal irradiance", fields[DIFFUSE])?;
        let known = |found: f64| match found >= MISSING {
            true => 0.0,
            false => found.max(0.0),
        };
        let record = Self {
            begin,
            hours: f64::from(step) / 60.0,
            irradiance: Irradiance {
                direct_normal: known(direct),
                diffuse_horizontal: known(diffuse),
            },
        };
        Ok((record, direct.max(diffuse) < MISSING))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "LOCATION,Wien,-,AUT,Test,110350,48.25,16.37,1.0,200.0\n\
        DESIGN CONDITIONS,0\nTYPICAL/EXTREME PERIODS,0\nGROUND TEMPERATURES,0\n\
        HOLIDAYS/DAYLIGHT SAVINGS,Yes,0,0,0\nCOMMENTS 1,a\nCOMMENTS 2,b\n";

    fn line(start: &str, direct: &str, diffuse: &str) -> String {
        format!("{start},flags,1,2,3,4,5,6,7,8,{direct},{diffuse},0,0,0\n")
    }

    /// A file of whole days.
    fn days(periods: &str, days: &[[u32; 3]]) -> String {
        let mut text = format!("{HEAD}DATA PERIODS,{periods}\n");
        for [year, month, day] in days {
            for hour in 1..=24 {
                text += &line(&format!("{year},{month},{day},{hour},60"), "0", "0");
            }
        }
        text
    }

    fn dates(weather: &Weather) -> [String; 2] {
        let begins = weather
            .records
            .iter()
            .map(|record| record.begin.to_string());
        let begins: Vec<_> = begins.collect();
        [begins[0].clone(), begins[begins.len() - 1].clone()]
    }

    #[test]
    fn hours_end_at_their_number() {
        let text = days("1,1,Data,Sunday,2/28,2/29", &[[1999, 2, 28], [2004, 2, 29]]);
        let last = line("2004,2,29,24,60", "0", "0");
        let text = text.replace(&last, &line("2004,2,29,24,0", "812.5", "9999"));
        let weather = Weather::read(&text).expect("a file");
        assert_eq!((weather.name.as_str(), weather.zone), ("Wien, AUT", 1.0));
        assert_eq!(weather.place.height, 200.0);
        assert_eq!(
            dates(&weather),
            ["1999-02-28T00:00:00", "2004-02-29T23:00:00"]
        );
        let last = weather.records[47].irradiance;
        assert_eq!((last.direct_normal, last.diffuse_horizontal), (812.5, 0.0));
        assert_eq!(weather.incomplete, 1);
    }

    #[test]
    fn names_in_quotes_may_have_commas() {
        let text = days("1,1,Data,Sunday,2/28,2/28", &[[1999, 2, 28]]);
        let text = text.replace("Wien,-,", "\"Frankfurt, Main\", \"-\" ,");
        let weather = Weather::read(&format!("\u{feff}{text}")).expect("a file");
        assert_eq!(weather.name, "Frankfurt, Main, AUT");
        assert_eq!((weather.place.latitude, weather.zone), (48.25, 1.0));
    }

    #[test]
    fn quarters_of_an_hour() {
        let mut text = format!("{HEAD}DATA PERIODS,1,4,Data,Sunday,6/1,6/1\n");
        for hour in 1..=24 {
            for minute in [15, 30, 45, 60] {
                text += &line(&format!("2020,6,1,{hour},{minute}"), "1", "2");
            }
        }
        let weather = Weather::read(&text).expect("a file");
        assert_eq!(
            dates(&weather),
            ["2020-06-01T00:00:00", "2020-06-01T23:45:00"]
        );
        assert_eq!(weather.records[45].begin.to_string(), "2020-06-01T11:15:00");
        assert_eq!(weather.records[0].hours, 0.25);
    }

    #[test]
    fn records_must_fill_the_periods_that_are_declared() {
        let [feb, leap, march] = [[2001, 2, 28], [2004, 2, 29], [2001, 3, 1]];
        let [last, first] = [[2005, 12, 31], [2003, 1, 1]];
        for (periods, given, is_whole) in [
            ("1,1,Data,Sunday,2/28, 3/ 1", &[feb, march][..], true),
            ("1,1,Data,Sunday,2/28,3/1", &[feb, leap, march], true),
            (
                "1,1,Data,Sunday,2/28/2004,3/1/2004",
                &[feb, leap, march],
                true,
            ),
            ("1,1,Data,Sunday,2/28/2004,3/1/2004", &[feb, march], false),
            (
                "1,1,Data,Sunday,2004/ 2/28,2004/3/1",
                &[feb, leap, march],
                true,
            ),
            ("1,1,Data,Sunday,2004/2/28,2004/3/1", &[feb, march], false),
            ("1,1,\"a, b\",Sunday,2/28,2001/2/28", &[feb], true),
            ("1,1,Data,Sunday,2/28,2/28", &[feb], true),
            ("1,1,Data,Sunday,12/31,1/1", &[last, first], true),
            (
                "2,1,A,Sunday,1/1,1/1,B,Sunday,3/1,3/1",
                &[first, march],
                true,
            ),
            ("2,1,A,Sunday,1/1,1/1,B,Sunday,3/1,3/1", &[first], false),
            ("1,1,Data,Sunday,1/1,12/31", &[first, last], false),
            ("1,1,Data,Sunday,2/28,3/1", &[march, feb], false),
            ("1,2,Data,Sunday,2/28,3/1", &[feb, march], false),
        ] {
            let found = Weather::read(&days(periods, given));
            assert_eq!(found.is_ok(), is_whole, "{periods}, {given:?}: {found:?}");
        }
        let cut = days("1,1,Data,Sunday,2/28,3/1", &[feb, march]);
        let cut: String = cut
            .lines()
            .take(40)
            .map(|line| format!("{line}\n"))
            .collect();
        let error = Weather::read(&cut).unwrap_err();
        assert_eq!(error.line, 40);
        for part in [
            "32 records",
            "2001-03-01T07:00:00",
            "line 8",
            "2/28 to 3/1",
            "48",
        ] {
            assert!(error.reason.contains(part), "{error}");
        }
    }

    #[test]
    fn mistakes_name_their_line() {
        let periods = "DATA PERIODS,1,1,Data,Sunday,1/1,12/31\n";
        let good = line("1999,1,1,1,60", "0", "0");
        for (text, at, word) in [
            (String::new(), 1, "LOCATION"),
            ("place,1\n".into(), 1, "LOCATION"),
            (HEAD.replace("48.25", "north"), 1, "latitude"),
            (HEAD.replace("48.25", "110350"), 1, "-90 to 90"),
            (HEAD.replace(",1.0,", ",200.0,"), 1, "-15 to 15"),
            (HEAD.to_owned(), 7, "DATA PERIODS"),
            (format!("{HEAD}DATA PERIODS,1,7\n{good}"), 8, "60"),
            (format!("{HEAD}DATA PERIODS,0,1\n{good}"), 8, "periods"),
            (
                format!("{HEAD}DATA PERIODS,1,1,,,1/1\n{good}"),
                8,
                "field 7",
            ),
            (
                format!("{HEAD}DATA PERIODS,1,1,,,2/30,3/1\n{good}"),
                8,
                "2/30",
            ),
            (format!("{HEAD}{periods}{good}1999,1,1\n"), 10, "fields"),
            (
                format!("{HEAD}{periods}{}", line("1999,2,29,1,60", "0", "0")),
                9,
                "time",
            ),
            (
                format!("{HEAD}{periods}{}", line("1999,1,1,25,60", "0", "0")),
                9,
                "time",
            ),
            (
                format!("{HEAD}{periods}{}", line("1999,1,1,1,60", "sun", "0")),
                9,
                "direct",
            ),
        ] {
            let error = Weather::read(&text).unwrap_err();
            assert_eq!(error.line, at, "{error}");
            assert!(error.to_string().contains(word), "{error}");
        }
    }
}
