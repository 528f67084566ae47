//! Frames of a day of sun: first coarse ones, then the picture in full size.

use std::sync::Arc;
use std::time::Instant;

use antumbra_image::Image;
use antumbra_render::{Error, KeptTree, LiveTiles};
use antumbra_scene::{Camera, Film};

use crate::camera::Look;
use crate::engine::{COARSE, COARSEST, Engine, coarser};
use crate::state::{Mode, Phase, Wish};
use crate::sun::{Probe, Sights, Sun, SunDay};

/// Suns of a coarse picture of hours.
const FEW: usize = 8;
/// Rays per second before any were measured.
const FIRST_PACE: f64 = 4e6;

/// What a camera sees in full size, and its picture.
#[derive(Debug)]
pub struct SunView {
    look: Look,
    crop: Option<[f32; 4]>,
    mode: Mode,
    sights: Sights,
    tiles: Arc<LiveTiles>,
}

/// Whether work is to be given up.
type Outdated<'a> = dyn Fn() -> bool + 'a;

impl Engine<'_> {
    /// Shows the sun of a day as it is wished, until the picture is finished or something else is wished.
    ///
    /// # Errors
    /// The camera or the film cannot be used.
    pub fn follow_sun(
        &mut self,
        wish: &Wish,
        day: &Arc<SunDay>,
        (look, camera, film): (Look, &Camera, &Film),
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), Error> {
        let suns = suns(day, wish);
        self.begin(wish, look, camera, suns.len());
        let shared = Arc::clone(&self.shared);
        let outdated = || shared.is_outdated(wish.number) || shared.quits() || cancelled();
        let tree = self.tree(Mode::Picture);
        let is_it = |view: &mut SunView| view.look == look && view.crop == wish.crop;
        let view = match self.sun_view.take_if(is_it) {
            Some(view) => view,
            None => {
                let has_moved = self.last.replace(look).is_some_and(|last| last != look);
                self.coarse_sun(wish, day, (camera, film), &tree)?;
                if outdated() || (has_moved && self.moves_on(wish, cancelled)) {
                    return Ok(());
                }
                let world = self.world.look(camera, film)?;
                let tiles = Arc::new(LiveTiles::new(film));
                let sights = Sights::new(&world, &tree, (film.resolution, tiles.window()));
                let probe = Probe {
                    world: Arc::new(world),
                    tree: Arc::clone(&tree),
                    day: Arc::clone(day),
                    resolution: film.resolution,
                    origin: self.scene.origin.into(),
                };
                self.shared.change(|state| state.probe = Some(probe));
                SunView {
                    look,
                    crop: wish.crop,
                    // No picture has been shown.
                    mode: Mode::Picture,
                    sights,
                    tiles,
                }
            }
        };
        self.last = Some(look);
        let mut view = view;
        if let Some(image) = self.paint(wish, day, (&suns, &view.sights), &tree, &outdated) {
            view.tiles.show(&image);
            if view.mode != wish.mode || self.shown != Some(wish.mode) {
                view.mode = wish.mode;
                self.show(1, film, wish.mode, Arc::clone(&view.tiles));
            }
            self.shared.tell(|status| {
                status.phase = Phase::Finished;
                status.text = "finished".into();
                status.remaining = None;
                status.samples = status.spp;
            });
        }
        self.sun_view = Some(view);
        Ok(())
    }

    /// Says what is begun.
    fn begin(&self, wish: &Wish, look: Look, own: &Camera, suns: usize) {
        self.shared.tell(|status| {
            status.phase = Phase::Rendering;
            status.text = match wish.mode {
                Mode::Shadows => "shadows".into(),
                _ => "hours of sun".into(),
            };
            status.wish = wish.number;
            status.mode = wish.mode;
            status.hour = wish.hour;
            status.look = Some(look);
            status.mirrored = crate::camera::is_mirrored(own);
            status.cropped = wish.crop.is_some();
            (status.samples, status.spp) = (0, suns as u32);
            (status.elapsed, status.remaining) = (0.0, None);
        });
    }

    /// Shows a coarse picture, of few suns.
    fn coarse_sun(
        &mut self,
        wish: &Wish,
        day: &SunDay,
        (camera, film): (&Camera, &Film),
        tree: &KeptTree,
    ) -> Result<(), Error> {
        let suns = suns(day, wish);
        let every = suns.len().div_ceil(FEW).max(1);
        let few: Vec<(Sun, f32)> = suns.chunks(every).map(together).collect();
        let [x0, x1, y0, y1] = film.pixel_bounds().map(f64::from);
        let rays = (x1 - x0) * (y1 - y0) * (1.0 + few.len() as f64);
        let pace = if self.sun_pace > 0.0 {
            self.sun_pace
        } else {
            FIRST_PACE
        };
        let scale = (rays / pace / COARSE).sqrt().ceil().max(1.0) as u32;
        let mut scale = scale.min(COARSEST);
        while scale > 1 && coarser(film, scale).is_empty() {
            scale -= 1;
        }
        let coarse = coarser(film, scale);
        let mut camera = camera.clone();
        if camera.screen_window.is_none() {
            let [width, height] = film.resolution.map(|side| side as f32);
            camera.frame_aspect_ratio.get_or_insert(width / height);
        }
        let world = self.world.look(&camera, &coarse)?;
        let tiles = Arc::new(LiveTiles::new(&coarse));
        let sights = Sights::new(&world, tree, (coarse.resolution, tiles.window()));
        if let Some(image) = self.paint(wish, day, (&few, &sights), tree, &|| false) {
            tiles.show(&image);
            self.show(scale, film, wish.mode, tiles);
        }
        Ok(())
    }

    /// The picture that is wished; `None` if it is outdated before it is finished.
    fn paint(
        &mut self,
        wish: &Wish,
        day: &SunDay,
        (suns, sights): (&[(Sun, f32)], &Sights),
        tree: &KeptTree,
        outdated: &Outdated<'_>,
    ) -> Option<Image> {
        let (start, mut told) = (Instant::now(), Instant::now());
        let mut values = vec![0.0; sights.count()];
        for (index, (sun, weight)) in suns.iter().enumerate() {
            if outdated() {
                return None;
            }
            sights.add(tree.bvh(), sun, *weight, &mut values);
            if told.elapsed().as_millis() > 200 {
                told = Instant::now();
                let (done, left) = (index + 1, suns.len() - index - 1);
                let seconds = start.elapsed().as_secs_f64();
                self.shared.tell(|status| {
                    status.samples = done as u32;
                    status.elapsed = seconds;
                    status.remaining = Some(seconds / done as f64 * left as f64);
                });
            }
        }
        let rays = sights.count() as f64 * suns.len().max(1) as f64;
        let seconds = start.elapsed().as_secs_f64().max(1e-6);
        self.sun_pace = rays / seconds;
        self.shared.tell(|status| {
            status.elapsed = seconds;
            status.rays_per_second = rays / seconds;
        });
        match wish.mode {
            Mode::Shadows => {
                let (sun, _) = suns.first()?;
                sights.shadows(day.up, &values, sun)
            }
            _ => sights.hours(day.up, &values, day.longest()),
        }
    }
}

/// Suns that a picture is made of, and the hours of each. A sun below the horizon lights nothing.
fn suns(day: &SunDay, wish: &Wish) -> Vec<(Sun, f32)> {
    match wish.mode {
        Mode::Shadows => day
            .at(wish.hour)
            .map(|sun| (*sun, 1.0))
            .into_iter()
            .collect(),
        _ => day.painted(),
    }
}

/// Several suns as the middle one of them.
fn together(suns: &[(Sun, f32)]) -> (Sun, f32) {
    let weight = suns.iter().map(|(_, weight)| weight).sum();
    (suns[suns.len() / 2].0, weight)
}
