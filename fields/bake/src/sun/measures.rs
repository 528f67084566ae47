//! Measures of offices: classes of sunlight, and light that the ground reflects.

use crate::{Error, Sunlight};

/// Class of exposure to sunlight by EN 17037:2018, table A.6: hours of possible sun on a day from 1 February to 21 March.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SunlightClass {
    /// Less than 1.5 hours.
    None,
    /// From 1.5 hours.
    Minimum,
    /// From 3 hours.
    Medium,
    /// From 4 hours.
    High,
}

impl SunlightClass {
    /// Class of a number of hours; `None` for NaN. Hours are compared with a tolerance of a thousandth of a second, for sums of steps.
    ///
    /// ```
    /// use antumbra_bake::SunlightClass;
    ///
    /// assert_eq!(SunlightClass::of_hours(1.4), SunlightClass::None);
    /// assert_eq!(SunlightClass::of_hours(3.0), SunlightClass::Medium);
    /// ```
    pub fn of_hours(hours: f64) -> Self {
        let classes = [(4.0, Self::High), (3.0, Self::Medium), (1.5, Self::Minimum)];
        let mut classes = classes.into_iter();
        let found = classes.find(|(least, _)| hours + 3e-7 >= *least);
        found.map_or(Self::None, |(_, class)| class)
    }

    /// Name in tables: `none`, `minimum`, `medium` or `high`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Minimum => "minimum",
            Self::Medium => "medium",
            Self::High => "high",
        }
    }
}

impl Sunlight {
    /// Without the suns that are lower than so many degrees above the horizon.
    ///
    /// # Errors
    /// [`Error::Range`] if the angle is not from 0 to 90.
    pub fn above(mut self, elevation: f64) -> Result<Self, Error> {
        let (is_in, wanted) = (
            (0.0..=90.0).contains(&elevation),
            "an angle from 0 to 90 degrees",
        );
        Error::check_range("elevation", elevation, is_in, wanted)?;
        let suns = &mut self.suns;
        let high: Vec<bool> = (suns.positions.iter())
            .map(|sun| sun.elevation >= elevation)
            .collect();
        fn keep<T>(list: &mut Vec<T>, high: &[bool]) {
            let mut high = high.iter();
            list.retain(|_| high.next().copied().unwrap_or_default());
        }
        keep(&mut suns.times, &high);
        keep(&mut suns.positions, &high);
        keep(&mut suns.hours, &high);
        keep(&mut suns.months, &high);
        keep(&mut suns.direct, &high);
        Ok(self)
    }

    /// Irradiation of open level ground over all steps in kWh/m²: `Σ (DNI sin(elevation) + DHI) Δt`.
    pub fn global_horizontal(&self) -> f64 {
        let step = |(step, sun): &(crate::TimeStep, crate::SunPosition)| {
            let light = &step.irradiance;
            let height = libm::sin(sun.elevation.max(0.0).to_radians());
            step.hours * (light.direct_normal * height + light.diffuse_horizontal) / 1000.0
        };
        self.timeline().iter().map(step).sum()
    }

    /// Irradiation that ground reflects to sensors in kWh/m²: `albedo · G · (1 - cos β) / 2`, with the irradiation `G` of open level
    /// ground and the tilt `β` of the sensor (Liu and Jordan 1963). The ground is open and reflects evenly: neither its shadows nor
    /// obstacles before the sensor count. Sensors without a direction have NaN, and those in free space are level.
    pub fn reflected(&self, albedo: f64, normals: &[[f32; 3]], sensors: usize) -> Vec<f64> {
        let global = self.global_horizontal();
        let value = |row: usize| {
            let normal = normals.get(row).copied();
            let up = crate::sun::sunlight::facing(normal, &self.orientation);
            up.map_or(f64::NAN, |[.., up]| albedo * global * 0.5 * (1.0 - up))
        };
        (0..sensors).map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Clock, Irradiance, Moment, Orientation, Place, SkyDivision, TimeStep, sun_positions,
    };

    #[test]
    fn classes_begin_at_their_hours() {
        use SunlightClass::{High, Medium, Minimum, None};
        for (hours, class) in [
            (0.0, None),
            (1.49, None),
            (1.5, Minimum),
            (0.1 * 15.0, Minimum),
            (2.99, Minimum),
            (3.0, Medium),
            (3.99, Medium),
            (4.0, High),
            (9.0, High),
            (f64::NAN, None),
        ] {
            assert_eq!(SunlightClass::of_hours(hours), class, "{hours}");
        }
    }

    #[test]
    fn ground_reflects_half_of_its_light_to_walls() {
        let place = Place {
            latitude: 48.0,
            longitude: 11.0,
            height: 0.0,
        };
        let noon: Moment = "2025-06-21T12:00".parse().expect("a moment");
        let mut step = TimeStep::around(noon, &Clock::Fixed(1.0), 3600.0);
        step.irradiance = Irradiance {
            direct_normal: 800.0,
            diffuse_horizontal: 100.0,
        };
        let patches = SkyDivision::Tregenza.patches().expect("patches");
        let plan = Orientation::default();
        let sun = Sunlight::new(&place, vec![step], true, patches, plan).expect("sunlight");
        let at = sun_positions(&place, crate::Refraction::Standard, &[step.middle]);
        let height = libm::sin(at.expect("a sun")[0].elevation.to_radians());
        let global = (800.0 * height + 100.0) / 1000.0;
        assert!((sun.global_horizontal() - global).abs() < 1e-12);
        let normals = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -2.0], [0.0; 3]];
        let found = sun.reflected(0.2, &normals, 4);
        assert!((found[0] - 0.1 * global).abs() < 1e-12);
        assert_eq!(found[1], 0.0);
        assert!((found[2] - 0.2 * global).abs() < 1e-12 && found[3].is_nan());
        assert_eq!(
            sun.clone().above(89.0).expect("an angle").suns.times.len(),
            0
        );
        assert_eq!(
            sun.clone().above(10.0).expect("an angle").suns.times.len(),
            1
        );
        assert!(sun.above(-1.0).is_err());
    }
}
