//! A day of sun on the page: hours of points against the bake, frames, and what is refused.

use std::sync::atomic::{AtomicBool, Ordering};

use antumbra_bake::sun_hours;
use antumbra_render::World;
use antumbra_view::{Server, Sun, SunDay};

use crate::page::{Viewer, ask, parts};
use crate::support::{options, scene};

/// Suns from east over south to west, every twenty minutes between 6 and 18 o'clock, and none by night.
fn day() -> SunDay {
    let step = 1.0 / 3.0;
    let sun = |index: u32| {
        let hour = (f64::from(index) + 0.5) * step;
        let turn = std::f64::consts::PI * (hour - 6.0) / 12.0;
        let direction = [turn.cos(), -0.6 * turn.sin(), 0.8 * turn.sin()];
        Sun {
            hour,
            azimuth: 90.0 + 180.0 * (hour - 6.0) / 12.0,
            elevation: direction[2].asin().to_degrees(),
            direction: direction.map(|x| x as f32),
        }
    };
    SunDay {
        caption: "a day".into(),
        suns: (0..72).map(sun).collect(),
        up: [0.0, 0.0, 1.0],
        step,
    }
}

fn json(body: &[u8]) -> serde_json::Value {
    serde_json::from_slice(body).expect("JSON")
}

#[test]
fn points_have_the_hours_of_the_bake_and_shadows_follow_the_time() {
    let server = Server::bind(0, "town").expect("a server").with_sun(day());
    let (port, path) = parts(&server.address());
    let host = format!("127.0.0.1:{port}");
    let scene = scene([64, 48]);
    let world = World::new(&scene).expect("a valid scene");
    let bvh = world.bvh(antumbra::recipe::Engine::default());
    let done = AtomicBool::new(false);
    let look = || {
        let get = |name: &str| ask(port, "GET", &format!("{path}{name}"), &host, "");
        let wish = |body: &str| ask(port, "POST", &format!("{path}wish"), &host, body);
        let mut viewer = Viewer::open(port, &path);
        viewer.until(|status| status["phase"] == "finished" && status["mode"] == "hours");
        let found = json(&get("sun").2);
        assert_eq!(found["suns"].as_array().map(Vec::len), Some(72));
        assert_eq!(
            (&found["caption"], &found["longest"]),
            (&"a day".into(), &12.0.into())
        );

        let suns = day().suns;
        let directions: Vec<[f32; 3]> = suns.iter().map(|sun| sun.direction).collect();
        let weights = vec![1.0 / 3.0; suns.len()];
        let (mut points, mut shaded) = (0, 0);
        for index in 0..30 {
            let (x, y) = (
                (index % 6) as f64 / 6.0 + 0.05,
                (index / 6) as f64 / 5.0 + 0.1,
            );
            let found = json(&get(&format!("point?x={x}&y={y}")).2);
            if found.is_null() {
                continue;
            }
            let numbers = |name: &str| {
                let list = found[name].as_array().expect("a list");
                let list: Vec<f32> = list
                    .iter()
                    .map(|x| x.as_f64().expect("a number") as f32)
                    .collect();
                <[f32; 3]>::try_from(list).expect("three")
            };
            let (point, normal) = (numbers("point"), numbers("normal"));
            let baked =
                sun_hours(&bvh, &[point], &[normal], &directions, &weights, &()).expect("hours");
            let hours = found["hours"].as_f64().expect("hours");
            assert!((hours - baked[0]).abs() < 1e-6, "{found}: {baked:?}");
            points += 1;
            shaded += usize::from(hours < 11.0);
        }
        assert!(
            points > 10 && shaded > 3,
            "{points} points, {shaded} of them shaded"
        );

        let picture = || get("picture.exr").2;
        let hours = picture();
        let mut last = hours.clone();
        for hour in [8, 16, 2] {
            wish(&format!("{{\"hour\": {hour}}}"));
            viewer.until(|status| {
                status["phase"] == "finished"
                    && status["mode"] == "shadows"
                    && status["hour"] == f64::from(hour)
            });
            let next = picture();
            assert!(next != last, "{hour} o'clock looks like the time before");
            last = next;
        }
        wish("{\"mode\": \"hours\"}");
        viewer.until(|status| status["phase"] == "finished" && status["mode"] == "hours");
        assert!(picture() == hours, "the same hours have other bits");

        for bad in ["{\"hour\": 24.5}", "{\"hour\": -1}"] {
            assert_eq!(wish(bad).0, "HTTP/1.1 400 Bad Request", "{bad}");
        }
        assert_eq!(get("point?x=0.5").0, "HTTP/1.1 400 Bad Request");
    };
    std::thread::scope(|scope| {
        let engine = scope.spawn(|| {
            let world = World::new(&scene).expect("a valid scene");
            server.run(&scene, world, &options(1), &|| done.load(Ordering::Relaxed))
        });
        let looked = scope.spawn(look).join();
        done.store(true, Ordering::Relaxed);
        engine.join().expect("no panic").expect("no error");
        if let Err(panic) = looked {
            std::panic::resume_unwind(panic);
        }
    });
}

#[test]
fn pages_without_a_day_have_no_sun() {
    let server = Server::bind(0, "town").expect("a server");
    let (port, path) = parts(&server.address());
    let host = format!("127.0.0.1:{port}");
    for (method, name, body, status) in [
        ("GET", "sun", "", "HTTP/1.1 404 Not Found"),
        ("GET", "point?x=0.5&y=0.5", "", "HTTP/1.1 404 Not Found"),
        ("POST", "wish", "{\"hour\": 12}", "HTTP/1.1 400 Bad Request"),
        (
            "POST",
            "wish",
            "{\"mode\": \"hours\"}",
            "HTTP/1.1 400 Bad Request",
        ),
    ] {
        let found = ask(port, method, &format!("{path}{name}"), &host, body);
        assert_eq!(found.0, status, "{name} {body}");
    }
}
