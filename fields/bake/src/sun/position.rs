//! Position of the sun in the sky.

use solar_positioning::time::JulianDate;
use solar_positioning::{Location, RefractionCorrection, SolarPositions, delta_t};

use crate::Error;

/// A place on the earth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// Latitude in degrees, north positive: -90 to 90.
    pub latitude: f64,
    /// Longitude in degrees, east positive: -180 to 180.
    pub longitude: f64,
    /// Height above the sea in metres.
    pub height: f64,
}

/// Whether the air lifts the sun.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Refraction {
    /// Geometric position, as if there was no air.
    None,
    /// Apparent position at the sea: 1013.25 hPa and 15 °C.
    #[default]
    Standard,
    /// Apparent position in this air.
    Air {
        /// Pressure in hPa, above 0.
        pressure: f64,
        /// Temperature in °C, above -273.15.
        temperature: f64,
    },
}

/// Place of the sun in the sky.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SunPosition {
    /// Angle from north through east, 0 to 360 degrees.
    pub azimuth: f64,
    /// Angle of the sun's centre above the horizon, -90 to 90 degrees.
    pub elevation: f64,
}

/// Julian date of 1970-01-01T00:00:00Z.
const UNIX_EPOCH: f64 = 2_440_587.5;
/// Seconds of a day.
const DAY: f64 = 86_400.0;

/// Positions of the sun as seen from a place, for each time.
///
/// Times are Unix times: seconds since 1970-01-01T00:00:00Z, without leap seconds ([`Moment`](crate::Moment) makes them of
/// dates and time zones). UTC is taken for UT1, from which it differs by less than a second.
///
/// Computed by the solar position algorithm of NREL (Reda and Andreas 2004, "Solar position algorithm for solar radiation
/// applications"), good to 0.0003 degrees from the year -2000 to 6000. The difference of earth time to UT1 is estimated after
/// Espenak and Meeus. Positions have the same bits on every machine.
///
/// # Errors
/// [`Error::Range`] if the place, the air or a time is outside its range.
pub fn sun_positions(
    place: &Place,
    refraction: Refraction,
    times: &[f64],
) -> Result<Vec<SunPosition>, Error> {
    let location = Location {
        latitude: within("latitude", place.latitude, 90.0, "-90 to 90 degrees")?,
        longitude: within("longitude", place.longitude, 180.0, "-180 to 180 degrees")?,
    };
    let height = within("height", place.height, 1e5, "-100000 to 100000 metres")?;
    let refraction = match refraction {
        Refraction::None => None,
        Refraction::Standard => Some(RefractionCorrection::standard()),
        Refraction::Air {
            pressure,
            temperature,
        } => {
            let air = RefractionCorrection::new(pressure, temperature);
            Some(air.map_err(|_| Error::Range {
                what: "pressure",
                found: pressure,
                wanted: "above 0 hPa, and a temperature above -273.15 °C",
            })?)
        }
    };
    let position = |&time: &f64| {
        let bad = || Error::Range {
            what: "time",
            found: time,
            wanted: "seconds since 1970 in the years -2000 to 6000",
        };
        let year = 1970.0 + time / (365.2425 * DAY);
        let delta_t = delta_t::estimate(year).map_err(|_| bad())?;
        let julian = JulianDate::new(UNIX_EPOCH + time / DAY, delta_t).map_err(|_| bad())?;
        let found = SolarPositions::new().at_from_julian(julian, location, height, refraction);
        let found = found.map_err(|_| bad())?;
        Ok(SunPosition {
            azimuth: found.azimuth(),
            elevation: found.elevation_angle(),
        })
    };
    times.iter().map(position).collect()
}

fn within(what: &'static str, found: f64, most: f64, wanted: &'static str) -> Result<f64, Error> {
    Error::check_range(what, found, found.abs() <= most, wanted).map(|()| found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Moment;

    /// Unix time of a moment in UTC.
    fn utc(text: &str) -> f64 {
        text.parse::<Moment>().expect("a moment").unix(0.0)
    }

    /// The example of the report (Reda and Andreas 2003, NREL/TP-560-34302, table A5.1): Golden, Colorado.
    #[test]
    fn the_published_example() {
        let golden = Place {
            latitude: 39.742476,
            longitude: -105.1786,
            height: 1830.14,
        };
        let air = Refraction::Air {
            pressure: 820.0,
            temperature: 11.0,
        };
        let time = "2003-10-17T12:30:30".parse::<Moment>().expect("a moment");
        let found = sun_positions(&golden, air, &[time.unix(-7.0)]).expect("a position")[0];
        assert!(
            (90.0 - found.elevation - 50.11162).abs() < 1e-4,
            "{found:?}"
        );
        assert!((found.azimuth - 194.34024).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn years_of_366_days_and_ends_of_years() {
        // On the day of an equinox the sun is over the equator: at noon there, it is at the zenith.
        let equator = Place::default();
        for noon in [
            "2024-03-20T12:07:00",
            "2023-03-21T12:07:00",
            "2000-03-20T12:07:00",
        ] {
            let found = sun_positions(&equator, Refraction::None, &[utc(noon)]);
            let elevation = found.expect("a position")[0].elevation;
            assert!(elevation > 89.0, "{noon} {elevation}");
        }
        // One day more or less moves the sun by at most half a degree in declination.
        let place = Place {
            latitude: 52.0,
            ..equator
        };
        let days = ["2024-02-28T12:00", "2024-02-29T12:00", "2024-03-01T12:00"].map(utc);
        assert_eq!((days[1] - days[0], days[2] - days[1]), (86_400.0, 86_400.0));
        let found = sun_positions(&place, Refraction::None, &days).expect("positions");
        for pair in found.windows(2) {
            let rise = pair[1].elevation - pair[0].elevation;
            assert!(rise > 0.3 && rise < 0.5, "{rise}");
        }
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        let at = |place: &Place, time| sun_positions(place, Refraction::default(), &[time]);
        let here = Place::default();
        assert!(at(&here, 0.0).is_ok());
        for (latitude, longitude) in [(90.5, 0.0), (0.0, 181.0), (f64::NAN, 0.0)] {
            let place = Place {
                latitude,
                longitude,
                height: 0.0,
            };
            let error = at(&place, 0.0).unwrap_err();
            assert!(matches!(error, Error::Range { .. }), "{error}");
        }
        for time in [f64::NAN, f64::INFINITY, 1e12, -1e12] {
            assert!(at(&here, time).is_err(), "{time}");
        }
        let vacuum = Refraction::Air {
            pressure: -1.0,
            temperature: 0.0,
        };
        assert!(sun_positions(&here, vacuum, &[0.0]).is_err());
    }
}
