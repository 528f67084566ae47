//! Weather files of EnergyPlus (.epw): measured or typical sun and sky of a place, hour by hour.

use crate::moment::Moment;
use crate::perez::Irradiance;
use crate::sun::Place;

/// A weather file.
#[derive(Clone, Debug, PartialEq)]
pub struct Weather {
    /// Name of the place: city, region and country.
    pub name: String,
    /// The place.
    pub place: Place,
    /// Hours that its clocks are ahead of UTC, without summer time.
    pub zone: f64,
    /// What was measured, in the order of the file.
    pub records: Vec<Record>,
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
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct BadWeather {
    /// Line of the file, from 1.
    pub line: usize,
    /// What is wrong with it.
    pub reason: String,
}

/// Fields of a line of data that are read: direct normal and diffuse horizontal irradiance.
const DIRECT: usize = 14;
const DIFFUSE: usize = 15;
/// From this value on, an irradiance is a mark for one that is missing.
const MISSING: f64 = 9999.0;

impl Weather {
    /// Reads a file. Values that are missing count as 0.
    ///
    /// # Errors
    /// [`BadWeather`] names the first line that is not as it should be.
    pub fn read(text: &str) -> Result<Self, BadWeather> {
        let mut lines = text
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line));
        let bad = |line, reason: String| BadWeather { line, reason };
        let (_, first) = lines.next().unwrap_or((1, ""));
        let fields: Vec<&str> = first
            .trim_start_matches('\u{feff}')
            .split(',')
            .map(str::trim)
            .collect();
        if !fields[0].eq_ignore_ascii_case("LOCATION") || fields.len() < 10 {
            let reason = "found no LOCATION with ten fields, as the first line of an .epw file has";
            return Err(bad(1, reason.into()));
        }
        let number = |line, what: &str, text: &str| {
            let number = text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
            number.ok_or_else(|| bad(line, format!("{what}: found {text:?}, wanted a number")))
        };
        let place = Place {
            latitude: number(1, "latitude", fields[6])?,
            longitude: number(1, "longitude", fields[7])?,
            height: number(1, "elevation", fields[9])?,
        };
        let zone = number(1, "time zone", fields[8])?;
        let name = [fields[1], fields[2], fields[3]];
        let name: Vec<&str> = name
            .into_iter()
            .filter(|name| !["", "-"].contains(name))
            .collect();
        let mut weather = Self {
            name: name.join(", "),
            place,
            zone,
            records: Vec::new(),
        };
        let mut per_hour = None;
        for (line, text) in lines {
            let fields: Vec<&str> = text.split(',').collect();
            if fields[0].trim().eq_ignore_ascii_case("DATA PERIODS") {
                let count = fields
                    .get(2)
                    .and_then(|text| text.trim().parse::<u32>().ok());
                let valid = count.filter(|count| (1..=60).contains(count) && 60 % count == 0);
                let reason = "found no number of records per hour that divides 60";
                per_hour = Some(valid.ok_or_else(|| bad(line, reason.into()))?);
            } else if let Some(per_hour) = per_hour.filter(|_| !text.trim().is_empty()) {
                let record = Record::read(&fields, per_hour, |what, text| number(line, what, text));
                weather
                    .records
                    .push(record.map_err(|error| bad(line, error.reason))?);
            }
        }
        if weather.records.is_empty() {
            let reason = "found no data behind a line DATA PERIODS";
            return Err(bad(text.lines().count().max(1), reason.into()));
        }
        Ok(weather)
    }
}

impl Record {
    fn read(
        fields: &[&str],
        per_hour: u32,
        number: impl Fn(&str, &str) -> Result<f64, BadWeather>,
    ) -> Result<Self, BadWeather> {
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
        let minute = if minute == 0 || per_hour == 1 {
            60
        } else {
            minute
        };
        let step = 60 / per_hour;
        let midnight = Moment::midnight(year as i32, month, day);
        let begin = midnight.filter(|_| (1..=24).contains(&hour) && minute <= 60 && minute >= step);
        let Some(mut begin) = begin else {
            return Err(bad(format!(
                "found no such time: {year}-{month}-{day}, hour {hour}, minute {minute}"
            )));
        };
        begin.seconds = f64::from((hour - 1) * 3600 + (minute - step) * 60);
        let irradiance = |index, what| {
            let found = number(what, fields[index])?;
            Ok(if found >= MISSING {
                0.0
            } else {
                found.max(0.0)
            })
        };
        Ok(Self {
            begin,
            hours: f64::from(step) / 60.0,
            irradiance: Irradiance {
                direct_normal: irradiance(DIRECT, "direct normal irradiance")?,
                diffuse_horizontal: irradiance(DIFFUSE, "diffuse horizontal irradiance")?,
            },
        })
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

    #[test]
    fn hours_end_at_their_number() {
        let data = [
            "DATA PERIODS,1,1,Data,Sunday,1/1,12/31\n".to_owned(),
            line("1999,1,1,1,60", "0", "0"),
            line("2004,2,29,24,0", "812.5", "9999"),
        ];
        let weather = Weather::read(&(HEAD.to_owned() + &data.concat())).expect("a file");
        assert_eq!((weather.name.as_str(), weather.zone), ("Wien, AUT", 1.0));
        assert_eq!(weather.place.height, 200.0);
        let begins: Vec<_> = weather
            .records
            .iter()
            .map(|record| record.begin.to_string())
            .collect();
        assert_eq!(begins, ["1999-01-01T00:00:00", "2004-02-29T23:00:00"]);
        let last = weather.records[1].irradiance;
        assert_eq!((last.direct_normal, last.diffuse_horizontal), (812.5, 0.0));
    }

    #[test]
    fn quarters_of_an_hour() {
        let data = [
            "DATA PERIODS,1,4,Data,Sunday,1/1,12/31\n".to_owned(),
            line("2020,6,1,12,15", "1", "2"),
            line("2020,6,1,12,60", "1", "2"),
        ];
        let weather = Weather::read(&(HEAD.to_owned() + &data.concat())).expect("a file");
        let begins: Vec<_> = weather
            .records
            .iter()
            .map(|record| record.begin.to_string())
            .collect();
        assert_eq!(begins, ["2020-06-01T11:00:00", "2020-06-01T11:45:00"]);
        assert_eq!(weather.records[0].hours, 0.25);
    }

    #[test]
    fn mistakes_name_their_line() {
        let periods = "DATA PERIODS,1,1,Data,Sunday,1/1,12/31\n";
        let good = line("1999,1,1,1,60", "0", "0");
        for (text, at, word) in [
            (String::new(), 1, "LOCATION"),
            ("place,1\n".into(), 1, "LOCATION"),
            (HEAD.replace("48.25", "north"), 1, "latitude"),
            (HEAD.to_owned(), 7, "DATA PERIODS"),
            (format!("{HEAD}DATA PERIODS,1,7\n{good}"), 8, "60"),
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
