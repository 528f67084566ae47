//! When and where the sun shines for `sun`: place, clocks, steps of time.

use std::path::Path;

use antumbra_bake::{
    Clock, Error, Moment, Orientation, Place, Refraction, Sunlight, TimeStep, UpAxis, Weather,
    sun_positions,
};
use antumbra_raster::Site;

use super::SunArgs;
use crate::bake::map;
use crate::bake::raster::is_raster;
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

/// Refuses flags that leave the place open, before anything is read.
pub fn check(args: &SunArgs) -> Result<(), Failure> {
    let is_given = args.lat.is_some() || args.epw.is_some();
    let may_say = is_raster(&args.scene) || !args.terrain.is_empty();
    match is_given || args.raster.crs.is_some() || may_say {
        true => Ok(()),
        false => Err(no_place()),
    }
}

fn no_place() -> Failure {
    let reason = "the sun needs a place: give --lat and --lon, or --crs if coordinates are those of a map, or --epw";
    Failure::Usage(reason.into())
}

/// Kilometres that a place of the command line or of the weather may be from the scene.
const MOST_FAR: f64 = 50.0;

/// Warns of a place that is not where the coordinate system says that the scene is.
fn warn_of_far(site: &Site, what: &str, place: Option<(f64, f64)>) {
    let Some((latitude, longitude)) = place else {
        return;
    };
    let apart = site.kilometres(latitude, longitude);
    if apart > MOST_FAR {
        say(format_args!(
            "warning: {what} {}, {apart:.0} km from the scene, which is at {} by its coordinate system",
            map::place(latitude, longitude),
            map::place(site.latitude, site.longitude)
        ));
    }
}

/// The place and its clocks.
pub struct When {
    pub place: Place,
    pub clock: Clock,
    /// Hours ahead of UTC at the beginning.
    pub zone: f64,
    /// Least and most hours ahead of UTC, which summer time changes.
    pub zones: [f64; 2],
}

impl When {
    /// Place, clocks, sun and sky of a scene that is here on the earth, if that is known.
    pub fn at(
        args: &SunArgs,
        weather: Option<&Weather>,
        site: Option<Site>,
        up: UpAxis,
    ) -> Result<(Self, Sunlight), Failure> {
        let when = Self::new(args, weather, site)?;
        let steps = when.steps(args, weather)?;
        let sunlight = when.sunlight(args, steps, up)?;
        Ok((when, sunlight))
    }

    /// The place and clocks of the command line, or else of the coordinate system, or else of the weather.
    fn new(args: &SunArgs, weather: Option<&Weather>, site: Option<Site>) -> Result<Self, Failure> {
        let mut place = weather.map(|weather| weather.place).unwrap_or_default();
        let asked = args.lat.zip(args.lon);
        let by_system = site.map(|site| (site.latitude, site.longitude));
        match asked.or(by_system) {
            Some(found) => (place.latitude, place.longitude) = found,
            None if weather.is_some() => {}
            None => return Err(no_place()),
        }
        if let Some(site) = site {
            let station = weather.map(|weather| weather.place);
            let station = station.map(|place| (place.latitude, place.longitude));
            warn_of_far(&site, "--lat and --lon are", asked);
            warn_of_far(&site, "the weather is of", station);
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
        let begin = args.from.unwrap_or(midnight(args.year));
        let end = args.to.unwrap_or(midnight(args.year + 1));
        let moments = args.times.at.first().zip(args.times.at.last());
        let (begin, end) = moments.map_or((begin, end), |(first, last)| (*first, *last));
        let ends = [begin, end].map(|moment| clock.unix(&moment));
        // Clocks change twice a year.
        let times = (0..=12).map(|i| ends[0] + f64::from(i) / 12.0 * (ends[1] - ends[0]));
        let zones: Vec<f64> = times.map(|time| clock.hours_ahead(time)).collect();
        let zones = [f64::min, f64::max].map(|pick| zones.iter().copied().fold(zones[0], pick));
        let zone = clock.hours_ahead(ends[0]);
        let when = Self {
            place,
            clock,
            zone,
            zones,
        };
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
                "warning: UTC{zone:+} and the longitude {:.2} are {:.1} hours apart: the sun stands highest at {:.1} o'clock",
                place.longitude,
                apart.abs(),
                12.0 + apart,
            ));
        }
    }

    /// The steps of time that the command line chooses.
    fn steps(&self, args: &SunArgs, weather: Option<&Weather>) -> Result<Vec<TimeStep>, Failure> {
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
        steps.retain(|step| times.counts(step.hour(), step.begin.month, self.place.latitude));
        if steps.is_empty() {
            return Err(Failure::usage("--hours, --months: no step of time is left"));
        }
        Ok(steps)
    }

    /// Sun and sky in these steps of time.
    fn sunlight(
        &self,
        args: &SunArgs,
        steps: Vec<TimeStep>,
        up: UpAxis,
    ) -> Result<Sunlight, Failure> {
        let patches = args.sky.patches().map_err(Failure::usage)?;
        let orientation =
            Orientation::new(up, args.places.north.degrees()).map_err(Failure::usage)?;
        let is_measured = args.epw.is_some();
        let sunlight = Sunlight::new(&self.place, steps, is_measured, patches, orientation);
        let sunlight = sunlight.and_then(|sunlight| match args.min_elevation > 0.0 {
            true => sunlight.above(args.min_elevation),
            false => Ok(sunlight),
        });
        sunlight.map_err(Failure::usage)
    }
}
