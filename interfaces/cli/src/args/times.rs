//! Flags that choose times: clocks, hours of the day, months, single moments.

use antumbra_bake::{Clock, Moment};
use clap::Args;

use super::heading;

/// Flags that choose times of a period.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::SUN)]
pub struct TimeArgs {
    /// Time zone: a name, or hours ahead of UTC
    ///
    /// A name of the IANA database, such as Europe/Vienna, has summer time; hours have none. If absent: the zone of a weather
    /// file, or else the longitude over 15, rounded.
    #[arg(long, value_name = "ZONE", allow_negative_numbers = true, value_parser = clock)]
    pub timezone: Option<Clock>,
    /// Only hours of the day, as 9-17
    ///
    /// Steps whose middle is from the first to the second hour, on the clocks of the time zone. 22-4 runs over midnight.
    #[arg(long, value_name = "FROM-TO", value_parser = hours)]
    pub hours: Option<[f64; 2]>,
    /// Only months or a season, as 6-8 or winter
    ///
    /// 11-2 runs over the end of the year. Seasons are meteorological: north of the equator spring is 3-5, summer 6-8, autumn 9-11 and
    /// winter 12-2, south of it each is half a year later.
    #[arg(long, value_name = "MONTHS", value_parser = months)]
    pub months: Option<Months>,
    /// A single moment, as 2025-03-21T12:00
    ///
    /// May be given several times. Each is a step of --step minutes around it.
    #[arg(long, value_name = "TIME", conflicts_with_all = ["from", "epw", "hours", "months", "year"])]
    pub at: Vec<Moment>,
}

impl TimeArgs {
    /// Whether a step of time at this hour of the day in this month counts at a latitude.
    pub fn counts(&self, hour: f64, month: u32, latitude: f64) -> bool {
        let is_in = |hours: [f64; 2], x: f64| match hours[0] <= hours[1] {
            true => hours[0] <= x && x < hours[1],
            false => x >= hours[0] || x < hours[1],
        };
        let is_hour = self.hours.is_none_or(|hours| is_in(hours, hour));
        let months = self.months.map(|months| months.at(latitude));
        let is_month = months.is_none_or(|[first, last]| match first <= last {
            true => (first..=last).contains(&month),
            false => month >= first || month <= last,
        });
        is_hour && is_month
    }
}

/// First and last month of a part of the year.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Months {
    range: [u32; 2],
    /// Whether the range is a season of the northern hemisphere.
    is_season: bool,
}

impl Months {
    /// The months at a latitude.
    pub fn at(self, latitude: f64) -> [u32; 2] {
        match self.is_season && latitude < 0.0 {
            true => self.range.map(|month| (month + 5) % 12 + 1),
            false => self.range,
        }
    }
}

fn clock(text: &str) -> Result<Clock, String> {
    if let Ok(hours) = text.parse::<f64>() {
        return match hours.abs() <= 26.0 {
            true => Ok(Clock::Fixed(hours)),
            false => Err("it must be from -26 to 26".into()),
        };
    }
    Clock::named(text).ok_or_else(|| "it is no name of a time zone, such as Europe/Vienna".into())
}

fn hours(text: &str) -> Result<[f64; 2], String> {
    let hour = |text: &str| {
        let (hours, minutes) = text.trim().split_once(':').unwrap_or((text.trim(), "0"));
        let [hours, minutes] = [hours, minutes].map(|x| x.parse::<u32>().ok());
        let hour = f64::from(hours?) + f64::from(minutes?) / 60.0;
        (hour <= 24.0 && minutes? < 60).then_some(hour)
    };
    let ends = text
        .split_once('-')
        .map(|(from, to)| [hour(from), hour(to)]);
    match ends {
        Some([Some(from), Some(to)]) if from != to => Ok([from, to]),
        _ => Err("wanted two hours from 0 to 24, such as 9-17 or 8:30-12".into()),
    }
}

fn months(text: &str) -> Result<Months, String> {
    let season = match text.to_ascii_lowercase().as_str() {
        "spring" => Some([3, 5]),
        "summer" => Some([6, 8]),
        "autumn" | "fall" => Some([9, 11]),
        "winter" => Some([12, 2]),
        _ => None,
    };
    if let Some(range) = season {
        let is_season = true;
        return Ok(Months { range, is_season });
    }
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let month = |text: &str| {
        let month = text.trim().parse::<u32>().ok();
        month.filter(|month| (1..=12).contains(month))
    };
    match (month(first), month(last)) {
        (Some(first), Some(last)) => Ok(Months {
            range: [first, last],
            is_season: false,
        }),
        _ => Err("wanted months from 1 to 12, such as 6 or 6-8, or a season".into()),
    }
}
