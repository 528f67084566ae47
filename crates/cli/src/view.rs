//! `antumbra view`: a local page that shows a scene while it is rendered.

use antumbra::recipe::Builder;
use antumbra_load::MemorySize;
use antumbra_render::{Options, World};
use antumbra_scene::Scene;
use antumbra_view::Server;

use crate::args::ViewArgs;
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
    let (scene, world) = match ready(args, memory, &server) {
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
    // Ctrl-C is the usual end of a server, and no failure.
    Ok(server.run(&scene, world, &options, &interrupt::requested)?)
}

/// Reads the scene, and builds its first tree.
fn ready(args: &ViewArgs, memory: MemorySize, server: &Server) -> Result<(Scene, World), Failure> {
    let mut loaded = scenes::load_one(&args.scene, &args.picture, memory)?;
    scenes::apply_camera(&mut loaded, &args.camera)?;
    let scene = loaded.scene;
    server.tell("building the first tree");
    // Quickly built. The learned tree gets the builder that was asked for.
    let world = scenes::world(&scene, Builder::BinnedSah)?;
    Ok((scene, world))
}
