//! `antumbra view`: a local page that shows a scene while it is rendered.

use antumbra::recipe::Builder;
use antumbra_bake::{Moment, Orientation, Place, Refraction, UpAxis, sun_positions};
use antumbra_load::{Loaded, MemorySize, Up};
use antumbra_render::{Options, World};
use antumbra_scene::Scene;
use antumbra_view::{Server, Sun, SunDay};

use crate::args::ViewArgs;
use crate::bake::ground::extent;
use crate::bake::map;
use crate::bake::site::Asked;
use crate::exit::{Failure, print, tell};
use crate::{interrupt, scenes};

/// Runs the command.
pub fn run(args: &ViewArgs, memory: MemorySize) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    args.machine.start_threads()?;
    let title = args.scene.file_name().unwrap_or(args.scene.as_os_str());
    let server = Server::bind(args.port, &title.to_string_lossy())?;
    // Before the scene is read, so that the page can be opened meanwhile.
    print(server.address())?;
    tell(format_args!(
        "Open this address in a browser on this machine. Ctrl-C ends the program."
    ));
    server.tell("reading the scene");
    let (scene, world, day) = match ready(args, memory, &server) {
        Ok(ready) => ready,
        Err(failure) => {
            server.fail(&failure.to_string());
            return Err(failure);
        }
    };
    let options = Options {
        spp: args.picture.spp,
        seed: args.picture.seed,
        recipe: args.tree.recipe(&scene, isa),
        ..Options::default()
    };
    let server = match day {
        Some(day) => server.with_sun(day),
        None => server,
    };
    // Ctrl-C is the usual end of a server, and no failure.
    Ok(server.run(&scene, world, &options, &interrupt::requested)?)
}

/// Reads the scene, and builds its first tree.
fn ready(
    args: &ViewArgs,
    memory: MemorySize,
    server: &Server,
) -> Result<(Scene, World, Option<SunDay>), Failure> {
    let loaded = scenes::load_picture(&args.scene, &args.picture, &args.camera, memory)?;
    let day = args.day.map(|date| sun_day(args, &date, &loaded));
    let day = day.transpose()?;
    let scene = loaded.scene;
    server.tell("building the first tree");
    // Quickly built. The learned tree gets the builder that was asked for.
    let world = scenes::world(&scene, Builder::BinnedSah)?;
    Ok((scene, world, day))
}

/// Minutes between the suns of a day.
const STEP: u32 = 5;

/// The suns of a day at the place of the command line.
fn sun_day(args: &ViewArgs, date: &Moment, loaded: &Loaded) -> Result<SunDay, Failure> {
    let up = match loaded.up.axis {
        Up::Y => UpAxis::Y,
        Up::Z => UpAxis::Z,
        axis => {
            let reason = format!("{axis} is up in the scene; the sun needs y or z");
            return Err(Failure::Usage(reason));
        }
    };
    let asked = Asked {
        crs: None,
        units: None,
        north: Some(&args.north),
    };
    asked.of((loaded, extent(&loaded.scene)), up)?;
    // Both are required beside the date.
    let [latitude, longitude] = [args.lat, args.lon].map(Option::unwrap_or_default);
    let place = Place {
        latitude,
        longitude,
        ..Place::default()
    };
    let zone = args.timezone.unwrap_or((longitude / 15.0).round());
    if !(zone.abs() <= 26.0) {
        return Err(Failure::Usage(format!(
            "--timezone {zone}: it must be from -26 to 26"
        )));
    }
    let midnight = Moment {
        seconds: 0.0,
        ..*date
    };
    let hour = |step: u32| f64::from(STEP) / 60.0 * (f64::from(step) + 0.5);
    let steps = 0..24 * 60 / STEP;
    let times: Vec<f64> = steps
        .map(|step| midnight.unix(zone) + 3600.0 * hour(step))
        .collect();
    let positions = sun_positions(&place, Refraction::default(), &times).map_err(Failure::usage)?;
    let orientation = Orientation::new(up, args.north.degrees()).map_err(Failure::usage)?;
    let suns = (0..).zip(&positions).map(|(step, sun)| Sun {
        hour: hour(step),
        azimuth: sun.azimuth,
        elevation: sun.elevation,
        direction: orientation
            .direction(sun.azimuth, sun.elevation)
            .map(|x| x as f32),
    });
    let end = Moment {
        seconds: 86_400.0,
        ..midnight
    };
    Ok(SunDay {
        caption: format!(
            "{}, {}, UTC{zone:+}",
            map::period(&midnight, &end),
            map::place(latitude, longitude)
        ),
        suns: suns.collect(),
        up: orientation.up.map(|x| x as f32),
        step: f64::from(STEP) / 60.0,
    })
}
