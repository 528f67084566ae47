//! A picture file that follows a running rendering.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use antumbra_render::{LiveTiles, Seen};

use crate::Error;

/// A file that is replaced by the picture so far every few seconds, by a thread of its own.
#[derive(Debug)]
pub struct PreviewFile {
    stop: Arc<AtomicBool>,
    failure: Arc<Mutex<Option<Error>>>,
    thread: JoinHandle<()>,
}

impl PreviewFile {
    /// Starts to write the tiles to `path`, in the format of its extension and with these values for displays. The file is replaced as a whole, `every` so
    /// often at most, and only if the picture has changed.
    ///
    /// # Errors
    /// [`Error::Thread`].
    pub fn start(
        path: PathBuf,
        tiles: Arc<LiveTiles>,
        display: antumbra_image::Display,
        every: Duration,
    ) -> Result<Self, Error> {
        let stop = Arc::new(AtomicBool::new(false));
        let failure = Arc::new(Mutex::new(None));
        let (stopped, failed) = (Arc::clone(&stop), Arc::clone(&failure));
        let write = move || {
            let mut seen = Seen::default();
            let mut last = Instant::now();
            loop {
                // Read before the picture, so that the last look comes after the last change.
                let end = stopped.load(Ordering::Acquire);
                if end || last.elapsed() >= every {
                    if !tiles.changed(&mut seen).is_empty()
                        && let Err(error) = write_once(&tiles, &path, &display)
                    {
                        let mut failed = failed.lock().unwrap_or_else(PoisonError::into_inner);
                        failed.get_or_insert(error);
                    }
                    last = Instant::now();
                }
                if end {
                    break;
                }
                thread::park_timeout(every.saturating_sub(last.elapsed()));
            }
        };
        let thread = thread::Builder::new().name("preview".into()).spawn(write);
        Ok(Self {
            stop,
            failure,
            thread: thread.map_err(Error::Thread)?,
        })
    }

    /// Writes the last changes, and ends. Returns the first error of all that was written.
    pub fn finish(self) -> Option<Error> {
        self.stop.store(true, Ordering::Release);
        self.thread.thread().unpark();
        // A panic of the writer costs the preview only.
        let _ = self.thread.join();
        self.failure
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take()
    }
}

fn write_once(
    tiles: &LiveTiles,
    path: &Path,
    display: &antumbra_image::Display,
) -> Result<(), Error> {
    let image = tiles.image().map_err(Error::Render)?;
    image.write_for(path, display).map_err(Error::Image)
}
