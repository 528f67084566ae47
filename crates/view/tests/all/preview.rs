//! The file beside a running rendering is always a whole picture, and the last one in the end.

use std::sync::Arc;
use std::time::Duration;

use antumbra_image::Image;
use antumbra_render::LiveTiles;
use antumbra_view::PreviewFile;

use crate::support::{grow, scene};

#[test]
fn a_preview_is_the_picture_in_the_end() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("preview.exr");
    let scene = scene([80, 50]);
    let tiles = Arc::new(LiveTiles::new(&scene.film));
    let preview = PreviewFile::start(path.clone(), Arc::clone(&tiles), Duration::from_millis(5))
        .expect("a preview");
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
    let preview = PreviewFile::start(path, Arc::clone(&tiles), Duration::from_millis(1));
    let preview = preview.expect("a preview");
    grow(&scene, &tiles, 1);
    assert!(preview.finish().is_some());
}

#[test]
fn nothing_is_written_where_nothing_was_rendered() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("preview.png");
    let tiles = Arc::new(LiveTiles::new(&scene([20, 20]).film));
    let preview = PreviewFile::start(path.clone(), tiles, Duration::from_millis(1));
    let preview = preview.expect("a preview");
    std::thread::sleep(Duration::from_millis(20));
    assert!(preview.finish().is_none());
    assert!(!path.exists());
}
