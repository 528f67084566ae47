//! When and where the sun shines for `sun`: place, clocks, steps of time.

use std::path::Path;

use antumbra_bake::{
    Clock, Error, Moment, Orientation, Place, Refraction, Sunlight, TimeStep, UpAxis, Weather,
    sun_positions,
};

use crate::args::SunArgs;
use crate::exit::{Failure, say};
use crate::input;

/// Reads a weather file, and warns of records without irradiance.
pub fn read_weather(path: &Path) -> Result<Weather, Failure> {
    let name = path.display();
    let weather = Weather::read(&input::text(path)?);
    let weather =
        weather.map_err(|bad| Failure::Data(format!("{name}:{}: {}", bad.line, bad.reason)))?;
    if weather.incomplete > 0 {
        say(format_args!(
            "warning: {name}: {} of {} records have no irradiance, which counts as 0",
            weather.incomplete,
            weather.records.len()
        ));
    }
    Ok(weather)
}

/// The beginning of a year.
fn midnight(year: i32) -> Moment {
    Moment {
        year,
        month: 1,
        day: 1,
        seconds: 0.0,
    }
}

/// Hours that clocks may differ from the sun. Kashgar in the west of China is the farthest, with 2.9.
const MOST_APART: f64 = 3.0;

/// The place and its clocks.
pub struct When {
    pub place: Place,
    pub clock: Clock,
    /// Hours ahead of UTC at the beginning.
    pub zone: f64,
}

impl When {
    /// The place and clocks of the command line, or of the weather.
    pub fn new(args: &SunArgs, weather: Option<&Weather>) -> Result<Self, Failure> {
        let mut place = weather.map(|weather| weather.place).unwrap_or_default();
        if let (Some(latitude), Some(longitude)) = (args.lat, args.lon) {
            (place.latitude, place.longitude) = (latitude, longitude);
        }
        place.height = args.altitude.unwrap_or(place.height);
        // Refuses places that are not on the earth, before anything is read.
        sun_positions(&place, Refraction::default(), &[]).map_err(Failure::usage)?;
        let by_longitude = (place.longitude / 15.0).round();
        let clock = match (&args.times.timezone, weather) {
            (Some(Clock::Zone(_)), Some(_)) => {
                let reason =
                    "--timezone: weather has clocks without summer time; give hours ahead of UTC";
                return Err(Failure::Usage(reason.into()));
            }
            (Some(clock), _) => clock.clone(),
            (None, Some(weather)) => Clock::Fixed(weather.zone),
            (None, None) => Clock::Fixed(by_longitude),
        };
        // Of a time zone, in winter.
        let january = midnight(args.from.map_or(args.year, |from| from.year));
        let zone = clock.hours_ahead(clock.unix(&january));
        let when = Self { place, clock, zone };
        when.warn_of_clocks();
        Ok(when)
    }

    /// Warns of clocks that are far from the sun: the time zone or the longitude is probably of another place.
    fn warn_of_clocks(&self) {
        let Self { place, zone, .. } = self;
        let apart = zone - place.longitude / 15.0;
        // Some islands are a whole day ahead.
        let apart = apart - 24.0 * (apart / 24.0).round();
        if apart.abs() > MOST_APART {
            say(format_args!(
                "warning: UTC{zone:+} and the longitude {} are {:.1} hours apart: the sun stands highest at {:.1} o'clock",
                place.longitude,
                apart.abs(),
                12.0 + apart,
            ));
        }
    }

    /// The steps of time that the command line chooses.
    pub fn steps(
        &self,
        args: &SunArgs,
        weather: Option<&Weather>,
    ) -> Result<Vec<TimeStep>, Failure> {
        let seconds = 60.0 * args.step;
        let times = &args.times;
        if !times.at.is_empty() {
            let steps = times.at.iter();
            let steps = steps.map(|&at| TimeStep::around(at, &self.clock, seconds));
            return Ok(steps.collect());
        }
        let period = args.from.zip(args.to).map(|(from, to)| [from, to]);
        let mut steps = match weather {
            Some(weather) => weather.steps(self.zone, period),
            None => {
                let year = [args.year, args.year + 1].map(midnight);
                let steps = TimeStep::regular(period.unwrap_or(year), &self.clock, seconds);
                steps.map_err(|error| match error {
                    Error::NoTime => Failure::Usage("--to must lie behind --from".into()),
                    _ => Failure::Usage(format!("--step: {error}")),
                })?
            }
        };
        steps.retain(|step| times.counts(step.hour(), step.begin.month));
        if steps.is_empty() {
            let reason = "--hours, --months: no step of time is left";
            return Err(Failure::Usage(reason.into()));
        }
        Ok(steps)
    }

    /// Sun and sky in these steps of time.
    pub fn sunlight(
        &self,
        args: &SunArgs,
        steps: Vec<TimeStep>,
        up: UpAxis,
    ) -> Result<Sunlight, Failure> {
        let patches = args.sky.patches().map_err(Failure::usage)?;
        let orientation = Orientation::new(up, args.places.north).map_err(Failure::usage)?;
        let is_measured = args.epw.is_some();
        let sunlight = Sunlight::new(&self.place, steps, is_measured, patches, orientation);
        let sunlight = sunlight.and_then(|sunlight| match args.min_elevation > 0.0 {
            true => sunlight.above(args.min_elevation),
            false => Ok(sunlight),
        });
        sunlight.map_err(Failure::usage)
    }
}
