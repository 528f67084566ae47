//! Weather files: refused with a line of the text, or records whose light is a number from 0 on.
#![no_main]

use antumbra_bake::Weather;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match Weather::read(text) {
        Ok(weather) => {
            assert!(!weather.records.is_empty() && weather.incomplete <= weather.records.len());
            for record in &weather.records {
                let light = record.irradiance;
                assert!(light.direct_normal >= 0.0 && light.diffuse_horizontal >= 0.0);
                assert!(record.hours > 0.0 && record.hours <= 1.0);
            }
            let steps = weather.steps(weather.zone, None);
            assert_eq!(steps.len(), weather.records.len());
        }
        Err(bad) => {
            assert!((1..=text.lines().count().max(1)).contains(&bad.line) && !bad.reason.is_empty())
        }
    }
});
