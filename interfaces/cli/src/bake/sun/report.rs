//! What `sun` says at the end: what was found, what is covered, and what is probably wrong with the model.

use antumbra_bake::{Orientation, Sensors, SunFound, Surface};
use antumbra_lab::count;

use super::Baked;
use crate::bake::ground::Ground;
use crate::exit::{say, tell};

/// Share of facades that see nothing, above which something is wrong with the model.
const DARK: f64 = 0.05;

impl Baked<'_> {
    /// Says what was found, with means of hours, sky view, direct and diffuse irradiation.
    pub fn tell(&self, found: &SunFound, [hours, view, direct, diffuse]: [Option<f64>; 4]) {
        let (args, sunlight, place) = (self.args, self.sunlight, &self.when.place);
        let zones = match self.when.zones {
            [winter, summer] if winter < summer => format!("UTC{winter:+} and {summer:+}"),
            [zone, _] => format!("UTC{zone:+}"),
        };
        tell(format_args!(
            "{} sensors, {} suns of {} steps at {:.4}, {:.4} and {zones}, {} patches",
            count(self.number() as u64),
            count(sunlight.suns.times.len() as u64),
            count(sunlight.steps() as u64),
            place.latitude,
            place.longitude,
            sunlight.patches.len(),
        ));
        if args.en17037 && args.min_elevation == 0.0 {
            tell(format_args!(
                "EN 17037: suns count from 0 degrees above the horizon; --min-elevation gives the angle of a country, such as 11 in Germany"
            ));
        }
        if let (Some(hours), Some(view)) = (hours, view) {
            tell(format_args!(
                "mean: {hours:.1} hours of direct sun, sky view factor {view:.3}"
            ));
        }
        if let (Some(direct), Some(diffuse)) = (direct, diffuse) {
            tell(format_args!(
                "mean: {direct:.1} kWh/m² from the sun, {diffuse:.1} from the sky"
            ));
        }
        let values = &found.values;
        let without = values.hours.iter().filter(|x| x.is_nan()).count();
        if without > 0 {
            tell(format_args!(
                "{} sensors without a normal have the value NaN",
                count(without as u64)
            ));
        }
        self.tell_dark(&values.sky_open);
        if let (Some((ground, _)), true) = (self.mesh, args.places.sensors.is_some()) {
            let plan = &sunlight.orientation;
            warn_inside(ground, self.sensors, &values.sky_open, plan);
        }
    }

    /// Says what is covered, and warns of sensors that see nothing of the sky although nobody would expect it.
    fn tell_dark(&self, sky_open: &[f64]) {
        let sensors = self.sensors;
        if !sensors.covered.is_empty() {
            tell(format_args!(
                "{} places more are covered: inside of bodies, or without sky close below a surface",
                count(sensors.covered.len() as u64),
            ));
        }
        let is_dark = |index: &usize| sky_open[*index] == 0.0;
        let dark: Vec<usize> = (0..sensors.points.len()).filter(is_dark).collect();
        let kinds = sensors.label("surface");
        if let (Some(kinds), Some(_)) = (kinds, self.args.places.placement.surfaces) {
            let is_facade = |kind: &String| kind == Surface::Facade.name();
            let facades = kinds.iter().filter(|kind| is_facade(kind)).count();
            let closed = dark
                .iter()
                .filter(|&&index| is_facade(&kinds[index]))
                .count();
            if closed as f64 > DARK * facades as f64 {
                say(format_args!(
                    "warning: {closed} of {facades} sensors on facades see nothing of the sky: are walls inside of others, or turned the wrong way?",
                ));
            }
        }
    }
}

/// Warns of points of a table that are inside of bodies.
fn warn_inside(ground: &Ground, sensors: &Sensors, sky: &[f64], plan: &Orientation) {
    let mut dark = (0..sensors.points.len())
        .filter(|&index| sky[index] == 0.0)
        .peekable();
    if dark.peek().is_none() {
        return;
    }
    let inside = ground.inside(&sensors.points, dark, plan);
    if let Some(first) = inside.first() {
        say(format_args!(
            "warning: {} of {} points lie inside of bodies and see nothing of the sky; the first is point {}",
            count(inside.len() as u64),
            count(sensors.points.len() as u64),
            first + 1,
        ));
    }
}
