//! The engine: follows the wish of the viewers, frame by frame.
//!
//! A new camera first gets a coarse picture, in pixels so large that it takes a twenty-fifth of a second. While a camera
//! moves, only coarse pictures are made. When it rests, the picture itself grows in rounds over all pixels, and a
//! thread beside learns the tree from the shadow rays of this camera. The learned tree takes over in the next round:
//! all trees give the same bits.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use antumbra_render::{
    Error, Growth, KeptTree, LiveTiles, Monitor, Options, Round, World, render_rounds,
    training_rays,
};
use antumbra_scene::{Camera, Film, Scene};

use crate::camera::{Look, is_mirrored};
use crate::state::{Frame, Mode, Phase, Shared, Status, Wish};
use crate::sun::SunDay;
use crate::sun_frames::SunView;

/// Time that a coarse picture may take.
pub(crate) const COARSE: f64 = 0.04;
/// Largest edge of a coarse pixel.
pub(crate) const COARSEST: u32 = 16;
/// Samples of the first picture, whose speed nobody knows.
const FIRST: f64 = 8_000.0;
/// Time between two looks at the signals of the program.
const LOOK: Duration = Duration::from_millis(100);
/// Time that a moved camera has to rest before the picture itself is begun. Its tiles would only take time from the
/// browser, which paints on the same processor.
const REST: Duration = Duration::from_millis(60);

/// What is rendered for a page.
#[derive(Debug)]
pub struct Engine<'a> {
    pub(crate) shared: Arc<Shared>,
    pub(crate) scene: &'a Scene,
    options: &'a Options,
    /// Suns of the day that is shown, if there is one.
    day: Option<Arc<SunDay>>,
    pub(crate) world: Arc<World>,
    plain: Arc<KeptTree>,
    learning: Arc<Learning>,
    /// Seconds per sample, as last measured.
    pace: f64,
    frames: u64,
    /// Look of the scene's own camera.
    home: Look,
    /// Look of the last picture.
    pub(crate) last: Option<Look>,
    /// What was shown last.
    pub(crate) shown: Option<Mode>,
    /// The last view of the sun in full size, for other times of the day.
    pub(crate) sun_view: Option<SunView>,
    /// Rays to suns per second, as last measured.
    pub(crate) sun_pace: f64,
    /// The last picture in full size, for those who come back from a map or go on after a stop.
    kept: Option<Kept>,
}

/// A picture in full size, and of what it is.
#[derive(Debug)]
struct Kept {
    look: Look,
    crop: Option<[f32; 4]>,
    tiles: Arc<LiveTiles>,
    /// Its samples, until it is finished.
    growth: Growth,
    /// Words about it.
    status: Status,
}

/// Tree that has learned, and from which camera.
#[derive(Debug, Default)]
struct Learning {
    tree: Mutex<Option<(Look, Arc<KeptTree>)>>,
    /// Whether a thread is learning.
    busy: AtomicBool,
}

impl Learning {
    /// The learned tree, of whatever camera.
    fn tree(&self) -> Option<Arc<KeptTree>> {
        let tree = self.tree.lock().unwrap_or_else(PoisonError::into_inner);
        tree.as_ref().map(|(_, tree)| Arc::clone(tree))
    }

    /// Whether the tree has learned from this camera.
    fn is_of(&self, look: &Look) -> bool {
        let tree = self.tree.lock().unwrap_or_else(PoisonError::into_inner);
        tree.as_ref().is_some_and(|(of, _)| of == look)
    }
}

/// Monitor of a rendering: stops it, and receives its tiles.
struct Watch<'a> {
    shared: &'a Shared,
    tiles: &'a LiveTiles,
    /// Wish that the rendering follows. `None` if later wishes do not stop it.
    wish: Option<u64>,
    cancelled: &'a (dyn Fn() -> bool + Sync),
}

impl Monitor for Watch<'_> {
    fn tiles(&self) -> Option<&LiveTiles> {
        Some(self.tiles)
    }

    fn cancelled(&self) -> bool {
        let newer = self.wish.is_some_and(|wish| self.shared.is_outdated(wish));
        newer || self.shared.quits() || (self.cancelled)()
    }
}

impl<'a> Engine<'a> {
    /// An engine for a scene, whose world it gets, and perhaps for a day of sun on it.
    pub fn new(
        shared: Arc<Shared>,
        (scene, world): (&'a Scene, World),
        options: &'a Options,
        day: Option<Arc<SunDay>>,
    ) -> Self {
        let plain = KeptTree::unlearned(&world, &options.recipe);
        let [width, height] = scene.film.resolution.map(|side| side as f32);
        let middle = plain.seen(&world, [width / 2.0, height / 2.0]);
        let eye = scene.camera.world_from_camera.w_axis.truncate();
        let bounds = world.primitives().bounds();
        let heart = (glam::Vec3::from(bounds.min) + glam::Vec3::from(bounds.max)) / 2.0;
        let target = middle.map_or(heart, |sight| sight.point.into());
        let distance = eye.distance(target);
        let distance = if distance.is_finite() && distance > 0.0 {
            distance
        } else {
            1.0
        };
        Self {
            home: Look::of(&scene.camera, distance),
            shared,
            scene,
            options,
            day,
            world: Arc::new(world),
            plain: Arc::new(plain),
            learning: Arc::default(),
            pace: 0.0,
            frames: 0,
            last: None,
            shown: None,
            sun_view: None,
            sun_pace: 0.0,
            kept: None,
        }
    }

    /// Follows the wishes until a viewer or `cancelled` ends it.
    ///
    /// # Errors
    /// Errors of the renderer, except [`Error::Cancelled`].
    pub fn run(mut self, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<(), Error> {
        let triangles = self.scene.triangle_count();
        self.shared.tell(|status| {
            status.triangles = triangles;
            status.origin = self.scene.origin.into();
        });
        let mut done = None;
        loop {
            let wish = {
                let news = |state: &crate::state::State| {
                    state.quit || Some(state.wish.number) != done || cancelled()
                };
                let state = self.shared.wait(LOOK, news);
                if state.quit || cancelled() {
                    return Ok(());
                }
                state.wish.clone()
            };
            if done == Some(wish.number) {
                continue;
            }
            done = Some(wish.number);
            match self.follow(&wish, cancelled) {
                Ok(()) | Err(Error::Cancelled) => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Renders what is wished, until it is finished or something else is wished.
    fn follow(&mut self, wish: &Wish, cancelled: &(dyn Fn() -> bool + Sync)) -> Result<(), Error> {
        if wish.stopped {
            self.shared.tell(|status| {
                status.phase = Phase::Stopped;
                status.text = "stopped".into();
                status.remaining = None;
                status.wish = wish.number;
            });
            return Ok(());
        }
        let (look, camera, film) = self.aim(wish);
        if let Some(day) = self.day.clone().filter(|_| wish.mode.is_sun()) {
            return self.follow_sun(wish, &day, (look, &camera, &film), cancelled);
        }
        let is_it = |kept: &mut Kept| {
            wish.mode == Mode::Picture && kept.look == look && kept.crop == wish.crop
        };
        if let Some(kept) = self.kept.take_if(is_it) {
            return self.go_on(wish, kept, &camera, &film, cancelled);
        }
        self.first_look(wish, look, (&camera, &film), cancelled)?;
        let has_moved = self.last.replace(look).is_some_and(|last| last != look);
        if self.shared.is_outdated(wish.number) || (has_moved && self.moves_on(wish, cancelled)) {
            return Ok(());
        }
        let kept = Kept {
            look,
            crop: wish.crop,
            tiles: Arc::new(LiveTiles::new(&film)),
            growth: Growth::default(),
            status: self.shared.lock().status.clone(),
        };
        self.go_on(wish, kept, &camera, &film, cancelled)
    }

    /// Look, camera and film of a wish.
    fn aim(&self, wish: &Wish) -> (Look, Camera, Film) {
        let own = &self.scene.camera;
        let look = wish.look.unwrap_or(self.home);
        let camera = match look == self.home {
            true => own.clone(),
            // Checked when it was wished.
            false => look.camera(own).unwrap_or_else(|| own.clone()),
        };
        let mut film = self.scene.film.clone();
        film.crop_window = wish.crop.unwrap_or(film.crop_window);
        if film.is_empty() {
            film.crop_window = self.scene.film.crop_window;
        }
        (look, camera, film)
    }

    /// Shows a coarse picture, as fine as the time allows.
    fn first_look(
        &mut self,
        wish: &Wish,
        look: Look,
        (camera, film): (&Camera, &Film),
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), Error> {
        let spp = self.options.spp;
        let spp = spp.unwrap_or(self.scene.sampler.pixel_samples);
        let learned = self.learning.is_of(&look);
        self.shared.tell(|status| {
            let same = status.look == Some(look);
            status.phase = Phase::Rendering;
            status.text = "first look".into();
            status.wish = wish.number;
            status.mode = wish.mode;
            status.look = Some(look);
            status.mirrored = is_mirrored(&self.scene.camera);
            status.cropped = wish.crop.is_some();
            status.samples = 0;
            status.spp = spp;
            status.elapsed = 0.0;
            status.remaining = None;
            status.learned = learned;
            if !same {
                status.before = None;
                status.after = None;
            }
        });

        let scale = self.scale(film);
        let coarse = coarser(film, scale);
        let mut camera_of = camera.clone();
        if camera_of.screen_window.is_none() {
            let [width, height] = film.resolution.map(|side| side as f32);
            camera_of.frame_aspect_ratio.get_or_insert(width / height);
        }
        let world = self.world.look(&camera_of, &coarse)?;
        let tiles = Arc::new(LiveTiles::new(&coarse));
        let options = Options {
            spp: Some(1),
            cost_map: wish.mode.is_map(),
            ..self.options.clone()
        };
        let watch = Watch {
            shared: &self.shared,
            tiles: &tiles,
            wish: None,
            cancelled,
        };
        let tree = self.tree(wish.mode);
        let start = Instant::now();
        let (tree, all) = (|| Arc::clone(&tree), &mut Growth::default());
        render_rounds(&world, &options, &tree, &watch, &|_| {}, all)?;
        self.note_pace(start.elapsed(), tiles.window().area());
        self.show(scale, film, wish.mode, tiles);
        Ok(())
    }

    /// Shows a picture in full size as it is, and renders what it lacks. Keeps it, whatever happens, unless it is a map.
    fn go_on(
        &mut self,
        wish: &Wish,
        mut kept: Kept,
        camera: &Camera,
        film: &Film,
        cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), Error> {
        self.last = Some(kept.look);
        self.show(1, film, wish.mode, Arc::clone(&kept.tiles));
        self.shared.tell(|status| {
            // Tests counted for another camera do not belong to this one.
            let is_same = status.look == Some(kept.look);
            *status = Status {
                wish: wish.number,
                learned: self.learning.is_of(&kept.look),
                before: status.before.filter(|_| is_same),
                after: status.after.filter(|_| is_same),
                ..kept.status.clone()
            };
        });
        let mut outcome = Ok(());
        if kept.status.phase != Phase::Finished {
            let world = Arc::new(self.world.look(camera, film)?);
            let tiles = Arc::clone(&kept.tiles);
            let watch = Watch {
                shared: &self.shared,
                tiles: &tiles,
                wish: Some(wish.number),
                cancelled,
            };
            let options = Options {
                spp: Some(kept.status.spp),
                cost_map: wish.mode.is_map(),
                ..self.options.clone()
            };
            outcome = self.grow(wish, &mut kept, &world, &options, &watch);
            self.shared.tell(|status| {
                if outcome.is_ok() {
                    status.phase = Phase::Finished;
                    status.text = "finished".into();
                    status.remaining = None;
                }
                kept.status = status.clone();
            });
        }
        if wish.mode == Mode::Picture {
            self.kept = Some(kept);
        }
        outcome
    }

    /// Waits until the camera rests. Returns whether something else is wished meanwhile.
    pub(crate) fn moves_on(&self, wish: &Wish, cancelled: &(dyn Fn() -> bool + Sync)) -> bool {
        let end = Instant::now() + REST;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let news = |state: &crate::state::State| state.quit || state.wish.number != wish.number;
            let state = self.shared.wait(left, news);
            if news(&state) || cancelled() {
                return true;
            }
            if left.is_zero() {
                return false;
            }
        }
    }

    /// Renders the picture itself.
    fn grow(
        &self,
        wish: &Wish,
        kept: &mut Kept,
        world: &Arc<World>,
        options: &Options,
        watch: &Watch<'_>,
    ) -> Result<(), Error> {
        let (start, earlier, look) = (Instant::now(), kept.status.elapsed, kept.look);
        let pixels = watch.tiles.window().area();
        let (learning, plain) = (&self.learning, &self.plain);
        // A map stays with the tree that it began with.
        let fixed = wish.mode.is_map().then(|| self.tree(wish.mode));
        let tree = || match &fixed {
            Some(tree) => Arc::clone(tree),
            None => learning.tree().unwrap_or_else(|| Arc::clone(plain)),
        };
        let after = |round: &Round| {
            let seconds = earlier + start.elapsed().as_secs_f64();
            let rays = (round.closest_rays + round.shadow_rays) as f64;
            let left = f64::from(round.spp - round.samples) / f64::from(round.samples);
            let mean = |tests: u64| tests as f64 / (round.shadow_rays.max(1)) as f64;
            let tests = [mean(round.node_tests), mean(round.prim_tests)];
            self.shared.tell(|status| {
                status.text = "rendering".into();
                status.samples = round.samples;
                status.elapsed = seconds;
                status.remaining = (left > 0.0).then_some(left * seconds);
                status.samples_per_second =
                    pixels as f64 * f64::from(round.samples) / seconds.max(1e-9);
                status.rays_per_second = rays / seconds.max(1e-9);
                match wish.mode {
                    Mode::Before => status.before = Some(tests),
                    Mode::After if fixed.as_ref().is_some_and(|tree| tree.is_learned()) => {
                        status.after = Some(tests);
                    }
                    _ => {}
                }
            });
            if !learning.is_of(&look) {
                self.learn(look, world, options);
            }
        };
        render_rounds(world, options, &tree, watch, &after, &mut kept.growth).map(drop)
    }

    /// Tree that a mode is traced in.
    pub(crate) fn tree(&self, mode: Mode) -> Arc<KeptTree> {
        match (mode, self.learning.tree()) {
            (Mode::Picture | Mode::After, Some(tree)) => tree,
            _ => Arc::clone(&self.plain),
        }
    }

    fn note_pace(&mut self, time: Duration, samples: usize) {
        let pace = time.as_secs_f64() / samples.max(1) as f64;
        self.pace = if self.pace > 0.0 {
            0.7 * self.pace + 0.3 * pace
        } else {
            pace
        };
    }

    /// Edge of coarse pixels, so that a picture takes the time that it may.
    fn scale(&self, film: &Film) -> u32 {
        let [x0, x1, y0, y1] = film.pixel_bounds().map(f64::from);
        let pixels = (x1 - x0) * (y1 - y0);
        let affordable = if self.pace > 0.0 {
            COARSE / self.pace
        } else {
            FIRST
        };
        let scale = (pixels / affordable).sqrt().ceil().max(1.0) as u32;
        let mut scale = scale.min(COARSEST);
        while scale > 1 && coarser(film, scale).is_empty() {
            scale -= 1;
        }
        scale
    }

    /// Shows a frame to all viewers.
    pub(crate) fn show(&mut self, scale: u32, film: &Film, mode: Mode, tiles: Arc<LiveTiles>) {
        self.frames += 1;
        self.shown = (scale == 1).then_some(mode);
        let frame = Arc::new(Frame {
            number: self.frames,
            scale,
            resolution: film.resolution,
            mode,
            tiles,
        });
        self.shared.change(|state| {
            state.full = (scale == 1).then(|| Arc::clone(&frame));
            state.frame = Some(frame);
        });
    }

    /// Learns a tree for a camera, in a thread with a pool of its own, so that frames go on meanwhile. One at a time.
    fn learn(&self, look: Look, world: &Arc<World>, options: &Options) {
        let learning = Arc::clone(&self.learning);
        if learning.busy.swap(true, Ordering::AcqRel) {
            return;
        }
        let (shared, plain) = (Arc::clone(&self.shared), Arc::clone(&self.plain));
        let (world, options) = (Arc::clone(world), options.clone());
        let work = move || {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
            let learn = || {
                let options = Options {
                    threads: None,
                    ..options
                };
                let lesson = training_rays(&world, &plain, &options, &()).ok()?;
                KeptTree::learned(&world, &options.recipe, &lesson).ok()
            };
            // A tree that cannot be learned costs speed only.
            if let Some(tree) = pool.ok().and_then(|pool| pool.install(learn)) {
                let mut kept = learning.tree.lock().unwrap_or_else(PoisonError::into_inner);
                *kept = Some((look, Arc::new(tree)));
                drop(kept);
                shared.change(|state| {
                    if state.status.look == Some(look) {
                        state.status.learned = true;
                        state.changes += 1;
                        // The map that is shown is one of another tree.
                        state.wish.number += u64::from(state.wish.mode == Mode::After);
                    }
                });
            }
            learning.busy.store(false, Ordering::Release);
        };
        let thread = std::thread::Builder::new().name("learning".into());
        if thread.spawn(work).is_err() {
            self.learning.busy.store(false, Ordering::Release);
        }
    }
}

/// The film with pixels that are `scale` times as large.
pub(crate) fn coarser(film: &Film, scale: u32) -> Film {
    Film {
        resolution: film.resolution.map(|side| side.div_ceil(scale)),
        ..film.clone()
    }
}
