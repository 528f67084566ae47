//! How people look at a rendering while it lasts: the preview beside the image, and tev.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use antumbra_image::is_our_picture;
use antumbra_render::LiveTiles;
use antumbra_scene::Scene;
use antumbra_view::{Display, PreviewFile};

use crate::args::{RenderArgs, usual};
use crate::exit::{Failure, say, tell};
use crate::output;
use crate::progress::lock;

/// Time between two previews.
const EVERY: Duration = Duration::from_secs(3);

/// Everything that shows a rendering. By default nothing does.
#[derive(Default)]
pub struct Looks {
    tiles: Option<Arc<LiveTiles>>,
    file: Option<PathBuf>,
    preview: Mutex<Option<PreviewFile>>,
    display: Mutex<Option<Display>>,
}

impl Looks {
    /// Choices of the command line for a rendering of a scene to `output`.
    pub fn begin(args: &RenderArgs, scene: &Scene, output: &Path) -> Result<Self, Failure> {
        let file = preview(output).filter(|_| args.preview);
        if file.is_none() && args.display_server.is_none() {
            return Ok(Self::default());
        }
        let tiles = Arc::new(LiveTiles::new(&scene.film));
        let shown = || Arc::clone(&tiles);
        let display = args.display_server.as_deref().map(|address| {
            Display::start(address, &scene.name, shown())
                .map_err(|error| Failure::Usage(format!("--display-server {address}: {error}")))
        });
        let values = args.display.display(usual(scene.integrator.is_light()));
        let preview = file
            .clone()
            .map(|path| PreviewFile::start(path, shown(), values, EVERY));
        Ok(Self {
            file,
            preview: Mutex::new(preview.transpose()?),
            display: Mutex::new(display.transpose()?),
            tiles: Some(tiles),
        })
    }

    /// Where the rendering publishes its tiles.
    pub fn tiles(&self) -> Option<&LiveTiles> {
        self.tiles.as_deref()
    }

    /// Shows the picture as it is, for the last time.
    pub fn finish(&self) {
        if let Some(failure) = lock(&self.preview).take().and_then(PreviewFile::finish) {
            say(format_args!("warning: no preview: {failure}"));
        }
        if lock(&self.display)
            .take()
            .is_some_and(|display| !display.finish())
        {
            tell(format_args!(
                "note: the viewer of --display-server did not get all of the picture"
            ));
        }
    }

    /// Shows the picture for the last time, and takes away the preview of a picture that is there now.
    pub fn end(&self) {
        self.finish();
        if let Some(path) = &self.file
            && is_our_picture(path).unwrap_or(false)
        {
            // A stale preview does no harm.
            let _ = std::fs::remove_file(path);
        }
    }
}

/// Where the preview of an output lies. Streams have none.
pub fn preview(output: &Path) -> Option<PathBuf> {
    output::beside(output, ".preview.png")
}
