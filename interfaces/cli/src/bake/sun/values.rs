//! The values of sensors, in one list: columns, arrays, maps, colours, rasters, steps of time and means follow from it.

use std::borrow::Cow;

use antumbra_bake::{Receipt, SunValues};
use clap::ValueEnum;

use Shown::{Diffuse, Direct, Hours, SkyView, Total};

/// Value of sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shown {
    /// Hours of direct sun
    Hours,
    /// Sky view factor
    SkyView,
    /// Direct irradiation in kWh/m², with --epw
    Direct,
    /// Diffuse irradiation in kWh/m², with --epw
    Diffuse,
    /// Both together, with --epw
    Total,
}

impl Shown {
    /// Whether irradiance is needed.
    pub fn needs_weather(self) -> bool {
        matches!(self, Direct | Diffuse | Total)
    }

    /// Name and unit in files.
    pub fn name_and_unit(self) -> [&'static str; 2] {
        let row = ROWS.iter().find(|(shown, ..)| *shown == Some(self));
        row.map_or(["", ""], |(_, [name, unit, _], _)| [name, unit])
    }
}

/// A value of all sensors.
pub struct Value<'a> {
    /// Its choice of `--show`, if colours can show it.
    pub shown: Option<Shown>,
    /// Name and unit in files.
    pub name: &'static str,
    pub unit: &'static str,
    /// Name on maps.
    pub title: &'static str,
    /// A number for each sensor, NaN for one without a value.
    pub list: Cow<'a, [f64]>,
    /// Twelve numbers for each sensor, or none at all.
    pub by_month: &'a [f64],
    /// Value of a step of time, if it changes from step to step.
    pub of_step: fn(&Receipt) -> Option<f64>,
}

/// Unit of irradiation in files.
const ENERGY: &str = "kWh/m2";

/// Choice of `--show`, name, unit and title of a value, and its value of a step of time.
type Row = (
    Option<Shown>,
    [&'static str; 3],
    fn(&Receipt) -> Option<f64>,
);

/// All values in the order of columns, and last the total, which is no column.
const ROWS: [Row; 7] = [
    (Some(Hours), ["hours", "h", "Direct sun"], |step| {
        Some(step.hours)
    }),
    (Some(SkyView), ["sky_view", "", "Sky view factor"], |_| None),
    (None, ["sky_open", "", ""], |_| None),
    (
        Some(Direct),
        ["direct_kwh_m2", ENERGY, "Direct irradiation"],
        |step| Some(step.direct),
    ),
    (
        Some(Diffuse),
        ["diffuse_kwh_m2", ENERGY, "Diffuse irradiation"],
        |step| Some(step.diffuse),
    ),
    (None, ["reflected_kwh_m2", ENERGY, ""], |_| None),
    (
        Some(Total),
        ["total_kwh_m2", ENERGY, "Direct and diffuse irradiation"],
        |step| Some(step.direct + step.diffuse),
    ),
];

/// The values that are known: without irradiance, only what a clear sky decides.
pub fn list(values: &SunValues, reflected: Option<Vec<f64>>) -> Vec<Value<'_>> {
    let mut total = values.total();
    let pairs = total.iter_mut().zip(reflected.iter().flatten());
    pairs.for_each(|(total, reflected)| *total += reflected);
    let lists: [Cow<'_, [f64]>; 7] = [
        (&values.hours).into(),
        (&values.sky_view).into(),
        (&values.sky_open).into(),
        (&values.direct).into(),
        (&values.diffuse).into(),
        reflected.unwrap_or_default().into(),
        total.into(),
    ];
    let mut by_month: [&[f64]; 7] = [&[]; 7];
    (by_month[0], by_month[3]) = (&values.by_month, &values.direct_by_month);
    by_month[4] = &values.diffuse_by_month;
    let rows = ROWS.into_iter().zip(lists.into_iter().zip(by_month));
    let value = |((shown, [name, unit, title], of_step), (list, by_month)): (Row, _)| Value {
        shown,
        name,
        unit,
        title,
        list,
        by_month,
        of_step,
    };
    let is_known = |value: &Value<'_>| value.unit != ENERGY || !value.list.is_empty();
    rows.map(value).filter(is_known).collect()
}

impl Value<'_> {
    /// The unit, as maps write it.
    pub fn unit_on_maps(&self) -> &'static str {
        match self.unit {
            ENERGY => "kWh/m²",
            unit => unit,
        }
    }

    /// The numbers in single precision.
    pub fn singles(&self) -> Vec<f32> {
        self.list.iter().map(|&x| x as f32).collect()
    }

    /// Mean over the numbers that are not NaN, if there are any.
    pub fn mean(&self) -> Option<f64> {
        let known = || self.list.iter().filter(|value| !value.is_nan());
        let count = known().count();
        (count > 0).then(|| known().sum::<f64>() / count as f64)
    }
}
