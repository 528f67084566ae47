//! What engine, pages and server share: the wish of the viewers, the picture under way, and words about both.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use antumbra_render::LiveTiles;
use serde::{Deserialize, Serialize};

use crate::camera::Look;
use crate::sun::Probe;

/// What is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// The picture.
    #[default]
    Picture,
    /// Tests per shadow ray in the tree that has learned nothing.
    Before,
    /// Tests per shadow ray in the learned tree.
    After,
    /// Hours of direct sun in a day.
    Hours,
    /// Light and shadow at a time of the day.
    Shadows,
}

impl Mode {
    /// Whether tests are mapped.
    pub fn is_map(self) -> bool {
        matches!(self, Self::Before | Self::After)
    }

    /// Whether the sun of a day is shown.
    pub fn is_sun(self) -> bool {
        matches!(self, Self::Hours | Self::Shadows)
    }
}

/// What the viewers want to see. All viewers share one wish.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wish {
    /// Number of the wish. Every change counts it up.
    pub number: u64,
    /// Camera; `None` is the scene's own.
    pub look: Option<Look>,
    /// Part of the picture, `[x0, x1, y0, y1]` in fractions of it; `None` is the scene's own.
    pub crop: Option<[f32; 4]>,
    /// What is shown.
    pub mode: Mode,
    /// Time of day of [`Mode::Shadows`], in hours since midnight.
    pub hour: f64,
    /// Whether nothing is to be rendered.
    pub stopped: bool,
}

/// Change of a wish, as a page sends it. Absent fields stay as they are.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Change {
    /// Camera to render with.
    pub look: Option<Look>,
    /// Back to the scene's own camera.
    pub home: bool,
    /// Part of the picture, `[x0, x1, y0, y1]` in fractions of it.
    pub crop: Option<[f32; 4]>,
    /// Back to the scene's own part of the picture.
    pub whole: bool,
    /// What is shown.
    pub mode: Option<Mode>,
    /// Time of day in hours, which also shows the shadows.
    pub hour: Option<f64>,
    /// Stop, or go on.
    pub stopped: Option<bool>,
}

/// What the engine is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// The scene is read, and its first tree is built.
    #[default]
    Loading,
    /// The picture is traced.
    Rendering,
    /// All samples are there.
    Finished,
    /// A viewer has stopped the rendering.
    Stopped,
    /// The scene cannot be shown.
    Failed,
}

/// Mean tests per shadow ray, node tests and primitive tests apart.
pub type Tests = [f64; 2];

/// Words and figures about the engine, as the pages get them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Status {
    /// Name of the scene.
    pub title: String,
    /// What the engine is doing.
    pub phase: Phase,
    /// The same in words.
    pub text: String,
    /// Number of the wish that the picture follows.
    pub wish: u64,
    /// What is shown.
    pub mode: Mode,
    /// Whether the page has a day of sun.
    pub has_sun: bool,
    /// Time of day of the shadows, in hours.
    pub hour: f64,
    /// Camera of the picture; `None` before there is one.
    pub look: Option<Look>,
    /// Whether the camera makes mirror images.
    pub mirrored: bool,
    /// Whether the picture is a part of the whole.
    pub cropped: bool,
    /// Samples that every pixel has.
    pub samples: u32,
    /// Samples that every pixel will have.
    pub spp: u32,
    /// Seconds since the picture was begun.
    pub elapsed: f64,
    /// Seconds that the rest may take; `None` if unknown.
    pub remaining: Option<f64>,
    /// Samples of all pixels per second.
    pub samples_per_second: f64,
    /// Rays of any kind per second.
    pub rays_per_second: f64,
    /// Whether the tree has learned from this camera.
    pub learned: bool,
    /// Tests per shadow ray before learning, if they were counted for this camera.
    pub before: Option<Tests>,
    /// Tests per shadow ray after learning, if they were counted for this camera.
    pub after: Option<Tests>,
    /// Triangles of the scene.
    pub triangles: usize,
    /// Origin of the scene in the world. Cameras are measured from it.
    pub origin: [f64; 3],
}

/// A picture under way.
#[derive(Debug)]
pub struct Frame {
    /// Number of the frame. Later frames have larger numbers.
    pub number: u64,
    /// Edge of a traced pixel in pixels of the picture. 1 for the picture itself.
    pub scale: u32,
    /// Size of the full picture in pixels.
    pub resolution: [u32; 2],
    /// What is shown.
    pub mode: Mode,
    /// Tiles with the pixels, which threads publish while they render.
    pub tiles: Arc<LiveTiles>,
}

/// Everything that is shared.
#[derive(Debug, Default)]
pub struct State {
    /// Wish of the viewers.
    pub wish: Wish,
    /// Words about the engine.
    pub status: Status,
    /// Number of changes of the words.
    pub changes: u64,
    /// Picture that is shown.
    pub frame: Option<Arc<Frame>>,
    /// Picture in full size, for saving.
    pub full: Option<Arc<Frame>>,
    /// The day of sun as JSON, or nothing.
    pub day: Vec<u8>,
    /// What clicks on points see, where there is a day of sun.
    pub probe: Option<Probe>,
    /// Whether a viewer has requested the end.
    pub quit: bool,
    /// Whether the engine has ended.
    pub ended: bool,
}

/// The shared state behind its lock.
#[derive(Debug, Default)]
pub struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Copies for the workers, which read them often and must not wait.
    newest: AtomicU64,
    quit: AtomicBool,
}

impl Shared {
    /// The state. Nobody keeps it while tracing, encoding or sending.
    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the state, and wakes whoever waits for a change.
    pub fn change<R>(&self, change: impl FnOnce(&mut State) -> R) -> R {
        let mut state = self.lock();
        let result = change(&mut state);
        self.newest.store(state.wish.number, Ordering::Relaxed);
        self.quit.store(state.quit, Ordering::Relaxed);
        drop(state);
        self.changed.notify_all();
        result
    }

    /// Whether a later wish than this one is there. Waits for nobody.
    pub fn is_outdated(&self, wish: u64) -> bool {
        self.newest.load(Ordering::Relaxed) != wish
    }

    /// Whether a viewer has requested the end. Waits for nobody.
    pub fn quits(&self) -> bool {
        self.quit.load(Ordering::Relaxed)
    }

    /// Changes the words about the engine.
    pub fn tell(&self, tell: impl FnOnce(&mut Status)) {
        self.change(|state| {
            tell(&mut state.status);
            state.changes += 1;
        });
    }

    /// Applies the change of a viewer. Returns the number of the wish. A camera that spans no picture, and a part
    /// without extent, are refused with the reason.
    pub fn wish(&self, change: &Change) -> Result<u64, &'static str> {
        if let Some(crop) = change.crop {
            let [x0, x1, y0, y1] = crop;
            let inside = crop.iter().all(|edge| (0.0..=1.0).contains(edge));
            if !(inside && x0 < x1 && y0 < y1) {
                return Err("the part of the picture is empty or outside of it");
            }
        }
        if let Some(look) = &change.look
            && look.camera(&antumbra_scene::Camera::default()).is_none()
        {
            return Err("the camera spans no picture");
        }
        if change
            .hour
            .is_some_and(|hour| !(0.0..=24.0).contains(&hour))
        {
            return Err("the time is not from 0 to 24 hours");
        }
        let wants_sun = change.hour.is_some() || change.mode.is_some_and(Mode::is_sun);
        if wants_sun && !self.lock().status.has_sun {
            return Err("there is no day of sun");
        }
        Ok(self.change(|state| {
            let wish = &mut state.wish;
            if change.home {
                wish.look = None;
            }
            if change.look.is_some() {
                wish.look = change.look;
            }
            if change.whole {
                wish.crop = None;
            }
            if change.crop.is_some() {
                wish.crop = change.crop;
            }
            wish.mode = change.mode.unwrap_or(wish.mode);
            if let Some(hour) = change.hour {
                wish.hour = hour;
                wish.mode = Mode::Shadows;
            }
            // Whoever moves the camera wants to see something.
            wish.stopped = change.stopped.unwrap_or(false);
            wish.number += 1;
            wish.number
        }))
    }

    /// Waits for a change, for `most` at most.
    pub fn wait(&self, most: Duration, until: impl Fn(&State) -> bool) -> MutexGuard<'_, State> {
        let state = self.lock();
        if until(&state) {
            return state;
        }
        let waited = self.changed.wait_timeout(state, most);
        waited.map_or_else(|error| error.into_inner().0, |(state, _)| state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wishes_change_field_by_field() {
        let shared = Shared::default();
        let parse = |text: &str| serde_json::from_str::<Change>(text);
        let look = r#"{"look": {"eye": [0,0,-3], "at": [0,0,0], "up": [0,1,0], "fov": 30}}"#;
        assert_eq!(shared.wish(&parse(look).expect("valid")), Ok(1));
        let change = r#"{"crop": [0.25, 0.5, 0, 1], "mode": "before", "stopped": true}"#;
        assert_eq!(shared.wish(&parse(change).expect("valid")), Ok(2));
        let wish = shared.lock().wish.clone();
        assert_eq!(wish.look.map(|look| look.eye), Some([0.0, 0.0, -3.0]));
        assert_eq!(wish.crop, Some([0.25, 0.5, 0.0, 1.0]));
        assert!(wish.stopped && wish.mode == Mode::Before);
        let change = parse(r#"{"home": true, "whole": true}"#).expect("valid");
        assert_eq!(shared.wish(&change), Ok(3));
        let wish = shared.lock().wish.clone();
        assert_eq!((wish.look, wish.crop, wish.stopped), (None, None, false));
        assert_eq!(wish.mode, Mode::Before);
    }

    #[test]
    fn wishes_that_make_no_picture_are_refused() {
        let shared = Shared::default();
        for crop in [
            [0.5, 0.5, 0.0, 1.0],
            [0.0, 1.5, 0.0, 1.0],
            [0.0, f32::NAN, 0.0, 1.0],
        ] {
            let change = Change {
                crop: Some(crop),
                ..Change::default()
            };
            assert!(shared.wish(&change).is_err(), "{crop:?}");
        }
        let flat = Look {
            eye: [0.0; 3],
            at: [0.0; 3],
            up: [0.0, 1.0, 0.0],
            fov: 30.0,
        };
        let change = Change {
            look: Some(flat),
            ..Change::default()
        };
        assert!(shared.wish(&change).is_err());
        assert_eq!(shared.lock().wish.number, 0);
        for bad in [
            r#"{"loook": 1}"#,
            r#"{"mode": "x"}"#,
            r#"{"crop": [1]}"#,
            "[",
        ] {
            assert!(serde_json::from_str::<Change>(bad).is_err(), "{bad}");
        }
    }
}
