//! `--time` and `--noise`: samples are added until the time is over or the picture is good enough.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use antumbra_render::{
    Error, LiveTiles, Monitor, Options, Phase, Rendering, Snapshot, Task, World, render_task,
};
use antumbra_scene::Sampler;

use crate::args::UntilArgs;
use crate::exit::say;

/// Samples per pixel of the first step. Later ones are multiples, since tiles keep samples in batches of so many.
const FIRST: u32 = 16;

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

/// Progress and interruptions alone: there are no checkpoints between steps.
struct Steps<'a> {
    inner: &'a dyn Monitor,
    cancelled: AtomicBool,
}

impl Monitor for Steps<'_> {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        self.inner.progress(phase, done, total);
    }

    fn traced(&self, samples: u64, rays: u64) {
        self.inner.traced(samples, rays);
    }

    fn tiles(&self) -> Option<&LiveTiles> {
        self.inner.tiles()
    }

    fn cancelled(&self) -> bool {
        let cancelled = self.inner.cancelled();
        self.cancelled.fetch_or(cancelled, Ordering::Relaxed);
        cancelled
    }
}

/// Renders in steps until a limit is reached. Sets the samples per pixel of `options` to those of the picture.
///
/// An interruption ends with the last finished step, if there is one.
pub fn render(
    world: &World,
    options: &mut Options,
    most: Option<u32>,
    until: Until,
    monitor: &dyn Monitor,
) -> Result<(Rendering, Snapshot), Error> {
    let most = most.unwrap_or(Sampler::MAX_SAMPLES);
    let monitor = Steps {
        inner: monitor,
        cancelled: AtomicBool::new(false),
    };
    let start = Instant::now();
    let mut spp = FIRST.min(most);
    options.spp = Some(spp);
    let task = Task {
        extendable: true,
        ..Task::default()
    };
    let (mut rendering, mut snapshot) = render_task(world, options, task, &monitor)?;
    loop {
        let noise = noise(&rendering);
        let Some(next) = until.next(spp, most, start.elapsed(), noise) else {
            return Ok((rendering, snapshot));
        };
        options.spp = Some(next);
        // Samples of textured scenes depend on their number. They are all traced again.
        let resume = snapshot.clone().extend(world, next).ok();
        let task = Task {
            resume,
            extendable: true,
            ..Task::default()
        };
        match render_task(world, options, task, &monitor) {
            Ok(step) => (rendering, snapshot) = step,
            Err(Error::Cancelled) => {
                say(format_args!(
                    "interrupted: the image has {spp} samples per pixel"
                ));
                options.spp = Some(spp);
                return Ok((rendering, snapshot));
            }
            Err(error) => return Err(error),
        }
        spp = next;
    }
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
}
