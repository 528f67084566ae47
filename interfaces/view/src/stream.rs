//! The stream that a page reads: words, frames and changed tiles, for as long as the page is open.
//!
//! A message is the length of what follows (`u32`), its kind (one byte) and its body. Numbers are little-endian.
//!
//! | kind | body |
//! |---|---|
//! | `S` | [`Status`] as JSON |
//! | `F` | a new frame: number, scale, width and height of the full picture, x0, y0, x1, y1 of its pixels (`i32` each; divided by the scale), 1 for a map of tests |
//! | `T` | tiles of the last frame: for each x, y, width, height (`i32`), and its pixels as 16-bit floats: three each, or one in a map |

use std::io::{self, Write};
use std::sync::Arc;
use std::time::{Duration, Instant};

use antumbra_render::{LiveTile, Seen};
use half::f16;

use crate::state::{Frame, Shared, Status};

/// Time between two looks at the tiles of a frame. Browsers without a graphics processor take 20 ms to paint. New frames,
/// as of a moving camera, are sent at once.
const EVERY: Duration = Duration::from_millis(33);
/// Longest silence. A page that is gone is noticed by what is sent.
const SILENCE: Duration = Duration::from_secs(2);

/// Sends what changes until the page is gone or the engine has ended.
///
/// # Errors
/// Errors of the connection.
pub fn run(shared: &Shared, stream: &mut impl Write) -> io::Result<()> {
    let mut told = u64::MAX;
    let mut shown: Option<(Arc<Frame>, Seen)> = None;
    let mut spoken = Instant::now();
    loop {
        let (frame, status, ended) = {
            let shown = shown.as_ref().map(|(frame, _)| frame.number);
            let news = |state: &crate::state::State| {
                state.ended
                    || state.changes != told
                    || state.frame.as_ref().map(|frame| frame.number) != shown
            };
            let state = shared.wait(EVERY, news);
            let due = spoken.elapsed() > SILENCE;
            let status = (state.changes != told || due).then(|| state.status.clone());
            told = state.changes;
            (state.frame.clone(), status, state.ended)
        };
        let mut message = Vec::new();
        if let Some(status) = status {
            put_status(&mut message, &status);
        }
        if let Some(frame) = frame {
            let is_new = shown
                .as_ref()
                .is_none_or(|(old, _)| old.number != frame.number);
            if is_new {
                put_frame(&mut message, &frame);
                shown = Some((frame, Seen::default()));
            }
        }
        if let Some((frame, seen)) = &mut shown {
            let tiles = frame.tiles.changed(seen);
            if !tiles.is_empty() {
                put_tiles(&mut message, &tiles, frame.mode.is_map());
            }
        }
        if !message.is_empty() {
            stream.write_all(&message)?;
            stream.flush()?;
            spoken = Instant::now();
        }
        if ended {
            return Ok(());
        }
    }
}

/// Puts a message, whose body `body` writes.
fn put(out: &mut Vec<u8>, kind: u8, body: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.extend([0, 0, 0, 0, kind]);
    body(out);
    let length = (out.len() - start - 4) as u32;
    out[start..start + 4].copy_from_slice(&length.to_le_bytes());
}

fn put_status(out: &mut Vec<u8>, status: &Status) {
    put(out, b'S', |out| {
        // Writing to memory cannot fail, and a status has no keys that are not strings.
        let _ = serde_json::to_writer(out, status);
    });
}

fn put_frame(out: &mut Vec<u8>, frame: &Frame) {
    let window = frame.tiles.window();
    let [width, height] = frame.resolution.map(|side| side as i32);
    let numbers = [
        frame.number as i32,
        frame.scale as i32,
        width,
        height,
        window.x0,
        window.y0,
        window.x1,
        window.y1,
        frame.mode.is_map().into(),
    ];
    put(out, b'F', |out| put_numbers(out, &numbers));
}

fn put_tiles(out: &mut Vec<u8>, tiles: &[Arc<LiveTile>], map: bool) {
    put(out, b'T', |out| {
        for tile in tiles {
            let window = tile.window;
            let size = [window.width() as i32, window.height() as i32];
            put_numbers(out, &[window.x0, window.y0, size[0], size[1]]);
            if map {
                let tests = tile.tests.as_deref().unwrap_or_default();
                let missing = tile.pixels.len() - tests.len();
                let tests = tests
                    .iter()
                    .copied()
                    .chain(std::iter::repeat_n(0.0, missing));
                out.extend(tests.flat_map(|tests| f16::from_f32(tests).to_le_bytes()));
            } else {
                let values = tile.pixels.iter().flatten();
                out.extend(values.flat_map(|&value| f16::from_f32(value).to_le_bytes()));
            }
        }
    });
}

fn put_numbers(out: &mut Vec<u8>, numbers: &[i32]) {
    out.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}
