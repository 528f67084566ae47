//! `--time` and `--noise`: samples are added until the time is over or the picture is good enough.

use std::time::{Duration, Instant};

use antumbra_render::{Error, Monitor, Options, Rendering, Snapshot, Task, World, render_task};
use antumbra_scene::Sampler;

use crate::args::UntilArgs;
use crate::exit::say;

/// Samples per pixel of the first step. Later ones are multiples, since tiles keep samples in batches of so many.
const FIRST: u32 = 16;

/// Samples per pixel that textures are made for. The final number is unknown when the first sample is taken.
pub const TEXTURES: u32 = 64;

/// When to stop.
#[derive(Clone, Copy, Debug, Default)]
pub struct Until {
    time: Option<Duration>,
    noise: Option<f64>,
}

impl Until {
    /// Limits that the command line gives. `None` if there are none.
    pub fn of(args: &UntilArgs) -> Option<Self> {
        let until = Self {
            time: args.time.map(|time| time.0),
            noise: args.noise.map(|noise| noise.0),
        };
        (until.time.is_some() || until.noise.is_some()).then_some(until)
    }

    /// Whether standard errors are needed.
    pub fn needs_errors(&self) -> bool {
        self.noise.is_some()
    }

    /// Samples per pixel of the next step, or `None` to stop: after `spp` of at most `most`, which took `elapsed`.
    fn next(&self, spp: u32, most: u32, elapsed: Duration, noise: Option<f64>) -> Option<u32> {
        if spp >= most
            || self
                .noise
                .zip(noise)
                .is_some_and(|(limit, noise)| noise <= limit)
        {
            return None;
        }
        let mut next = spp.saturating_mul(2);
        if let Some(time) = self.time {
            let affordable = f64::from(spp) * time.as_secs_f64() / elapsed.as_secs_f64().max(1e-3);
            next = next.min(affordable.min(f64::from(u32::MAX)) as u32 / FIRST * FIRST);
        }
        let next = next.min(most);
        // A step of a few samples is not worth the work around it.
        (next > spp && (next - spp >= spp / 8 || next == most)).then_some(next)
    }
}

/// Mean standard error of a pixel over the mean of the picture, in luminance. `None` without standard errors.
pub fn noise(rendering: &Rendering) -> Option<f64> {
    let errors = rendering.standard_error.as_ref()?;
    let luminance = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let (error, mean) = (luminance(errors.mean()), luminance(rendering.image.mean()));
    (mean > 0.0).then_some(error / mean)
}

/// A picture whose number of samples was found while rendering.
pub struct Grown {
    pub rendering: Rendering,
    pub snapshot: Snapshot,
    /// Seconds of rendering in which the rays of `rendering` were traced: all steps, and earlier runs.
    pub seconds: f64,
    /// Whether more samples were under way.
    pub interrupted: bool,
}

/// Renders a task, or without its shard and training rays in steps until a limit is reached, from its samples on, with at most the
/// samples per pixel of the options.
///
/// An interruption of steps ends with the last finished step of this run, if there is one.
pub fn render(
    world: &World,
    options: &Options,
    until: Option<Until>,
    monitor: &dyn Monitor,
    task: Task,
) -> Result<Grown, Error> {
    let before = task.resume.as_ref().map_or(0.0, Snapshot::seconds);
    let Some(until) = until else {
        let (rendering, snapshot) = render_task(world, options, task, monitor)?;
        return Ok(Grown {
            seconds: before + rendering.stats.render_seconds,
            rendering,
            snapshot,
            interrupted: false,
        });
    };
    let most = options.spp.unwrap_or(Sampler::MAX_SAMPLES);
    let start = Instant::now();
    let elapsed = || start.elapsed() + Duration::try_from_secs_f64(before).unwrap_or_default();
    let step = |spp: u32, resume: Option<Snapshot>| {
        let options = Options {
            spp: Some(spp),
            ..options.clone()
        };
        let task = Task {
            resume,
            extendable: true,
            ..Task::default()
        };
        render_task(world, &options, task, monitor)
    };
    let resume = task.resume;
    let mut spp = resume.as_ref().map_or(FIRST.min(most), Snapshot::spp);
    let (rendering, snapshot) = step(spp, resume)?;
    let mut grown = Grown {
        seconds: before + rendering.stats.render_seconds,
        rendering,
        snapshot,
        interrupted: false,
    };
    while let Some(next) = until.next(spp, most, elapsed(), noise(&grown.rendering)) {
        // A sampler whose samples depend on their number begins afresh.
        let resume = grown.snapshot.clone().extend(world, next).ok();
        let before = if resume.is_some() { grown.seconds } else { 0.0 };
        match step(next, resume) {
            Ok((rendering, snapshot)) => {
                grown.seconds = before + rendering.stats.render_seconds;
                (grown.rendering, grown.snapshot, spp) = (rendering, snapshot, next);
            }
            Err(Error::Cancelled) => {
                say(format_args!(
                    "interrupted: the image has {spp} samples per pixel"
                ));
                grown.interrupted = true;
                break;
            }
            Err(error) => return Err(error),
        }
    }
    Ok(grown)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_end_at_the_first_limit() {
        let seconds = Duration::from_secs;
        let time = Until {
            time: Some(seconds(100)),
            noise: None,
        };
        assert_eq!(time.next(16, u32::MAX, seconds(10), None), Some(32));
        // 64 samples took 70 seconds: only 91 fit, which are 80 in whole batches.
        assert_eq!(time.next(64, u32::MAX, seconds(70), None), Some(80));
        assert_eq!(time.next(64, u32::MAX, seconds(95), None), None);
        assert_eq!(time.next(64, u32::MAX, seconds(120), None), None);
        assert_eq!(time.next(64, 70, seconds(1), None), Some(70));
        assert_eq!(time.next(70, 70, seconds(1), None), None);
        let noise = Until {
            time: None,
            noise: Some(0.01),
        };
        assert_eq!(noise.next(16, u32::MAX, seconds(9), Some(0.02)), Some(32));
        assert_eq!(noise.next(16, u32::MAX, seconds(9), Some(0.009)), None);
    }

    /// Counts samples.
    #[derive(Default)]
    struct Count(std::sync::atomic::AtomicU64);

    impl Monitor for Count {
        fn traced(&self, samples: u64, _: u64) {
            self.0
                .fetch_add(samples, std::sync::atomic::Ordering::Relaxed);
        }
    }

    /// Every step adds samples to those that are there, with textures too, and ends at the bits of one step.
    #[test]
    fn steps_begin_where_the_last_one_ended() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("model.glb");
        std::fs::write(&path, antumbra_testkit::model::all_textures()).expect("a file");
        let loaded = antumbra_load::load(&path, &antumbra_load::Options::default());
        let mut scene = loaded.expect("a scene").scene;
        // Whole tiles: those at the edges begin afresh if their samples are no whole batches.
        scene.film.resolution = [48, 32];
        let world = World::new(&scene).expect("a valid scene");
        let until = Until {
            time: Some(Duration::from_secs(1000)),
            noise: None,
        };
        let options = Options {
            spp: Some(64),
            texture_spp: Some(TEXTURES),
            ..Options::default()
        };
        let count = Count::default();
        let grown = render(&world, &options, Some(until), &count, Task::default());
        let grown = grown.expect("a picture");
        assert!(!grown.interrupted);
        assert_eq!(grown.snapshot.spp(), 64);
        // The rays are those of all steps, and so are the seconds.
        assert!(grown.seconds > grown.rendering.stats.render_seconds);
        assert_eq!(count.0.into_inner(), 48 * 32 * 64);
        let task = Task::default();
        let whole = render_task(&world, &options, task, &()).expect("a picture");
        assert!(whole.0.image == grown.rendering.image);
    }
}
