//! A scene, and a rendering that publishes its tiles.

use std::num::NonZeroUsize;
use std::sync::Arc;

use antumbra_image::Image;
use antumbra_render::{LiveTiles, Monitor, Options, World, render};
use antumbra_scene::{Scene, builtin};

/// A small town.
pub fn scene(resolution: [u32; 2]) -> Scene {
    let mut scene = builtin::by_name("city:2000").expect("a built-in scene");
    scene.film.resolution = resolution;
    scene
}

/// Options of a rendering with so many samples per pixel.
pub fn options(spp: u32) -> Options {
    Options {
        spp: Some(spp),
        threads: NonZeroUsize::new(2),
        ..Options::default()
    }
}

/// A rendering that publishes its tiles.
pub struct Live(pub Arc<LiveTiles>);

impl Monitor for Live {
    fn tiles(&self) -> Option<&LiveTiles> {
        Some(&self.0)
    }
}

/// Renders a scene into its tiles.
pub fn grow(scene: &Scene, tiles: &Arc<LiveTiles>, spp: u32) -> Image {
    let world = World::new(scene).expect("a valid scene");
    let live = Live(Arc::clone(tiles));
    let rendering = render(&world, &options(spp), &live);
    rendering.expect("a picture").image
}
