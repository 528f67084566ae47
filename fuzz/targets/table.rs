//! Tables of points: refused with a line of the text, or finite points, as many as rows.
#![no_main]

use antumbra::LocalOrigin;
use antumbra_bake::Sensors;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match Sensors::from_table(text, &LocalOrigin::default()) {
        Ok(sensors) => {
            let rows = text.lines().filter(|line| !line.trim().is_empty()).count();
            assert!((1..=rows).contains(&sensors.points.len()));
            assert!([0, sensors.points.len()].contains(&sensors.normals.len()));
            assert!(sensors.points.as_flattened().iter().all(|x| !x.is_nan()));
        }
        Err(bad) => {
            assert!((1..=text.lines().count().max(1)).contains(&bad.line) && !bad.reason.is_empty())
        }
    }
});
