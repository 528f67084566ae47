//! The file beside a running rendering is always a whole picture, and the last one in the end.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use antumbra_image::{Display, Image, Tonemap};
use antumbra_render::LiveTiles;
use antumbra_view::PreviewFile;

use crate::support::{grow, scene};

/// Values of the previews.
const DISPLAY: Display = Display {
    exposure: 1.0,
    tonemap: Tonemap::AgX,
};

fn start(path: &Path, tiles: &Arc<LiveTiles>, milliseconds: u64) -> PreviewFile {
    let every = Duration::from_millis(milliseconds);
    let tiles = Arc::clone(tiles);
    PreviewFile::start(path.to_path_buf(), tiles, DISPLAY, every).expect("a preview")
}

#[test]
fn a_preview_for_displays_has_the_values_of_the_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let [preview, picture] = ["preview.png", "picture.png"].map(|name| folder.path().join(name));
    let scene = scene([20, 20]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let file = start(&preview, &tiles, 1);
    let image = grow(&scene, &tiles, 1);
    assert!(file.finish().is_none());
    image.write_for(&picture, &DISPLAY).expect("a picture");
    let read = |path| std::fs::read(path).expect("a file");
    assert!(read(&preview) == read(&picture));
    image.write(&picture).expect("a picture");
    assert!(read(&preview) != read(&picture));
}

#[test]
fn a_preview_is_the_picture_in_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("preview.exr");
    let scene = scene([80, 50]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let preview = start(&path, &tiles, 5);
    let done = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let reader = {
        let (path, done) = (path.clone(), Arc::clone(&done));
        std::thread::spawn(move || {
            let mut read = 0;
            while !done.load(std::sync::atomic::Ordering::Relaxed) {
                if path.exists() {
                    Image::read(&path).expect("a whole file");
                    read += 1;
                }
            }
            read
        })
    };
    let image = grow(&scene, &tiles, 32);
    assert!(preview.finish().is_none());
    done.store(true, std::sync::atomic::Ordering::Relaxed);
    reader.join().expect("no broken file");
    assert!(Image::read(&path).expect("a picture") == image);
}

#[test]
fn a_preview_that_cannot_be_written_says_so_at_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("gone").join("preview.png");
    let scene = scene([20, 20]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let preview = start(&path, &tiles, 1);
    grow(&scene, &tiles, 1);
    assert!(preview.finish().is_some());
}

#[test]
fn nothing_is_written_where_nothing_was_rendered() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("preview.png");
    let tiles = Arc::new(LiveTiles::new(&scene([20, 20]).film));
    let preview = start(&path, &tiles, 1);
    std::thread::sleep(Duration::from_millis(20));
    assert!(preview.finish().is_none());
    assert!(!path.exists());
}
