//! Pictures one after the other, as GIF.
//!
//! All pictures share 255 colours: the commonest ones of the first picture and of the one that differs from it most. What does not
//! change from one picture to the next is left as it is, so files are small.

use std::collections::HashMap;

use antumbra_image::Rgb8Image;
use gif::{DisposalMethod, Encoder, Frame, Repeat};

use crate::Error;

/// Colours of a file; one more is for what does not change.
const COLOURS: usize = 255;

/// Mark of pixels that do not change.
const SAME: u8 = 255;

/// Most bytes of pictures that are kept until the file is written.
const MOST_BYTES: usize = 2_000_000_000;

/// Pictures of one size that are shown one after the other, again and again.
pub struct Animation {
    seconds: f32,
    pictures: Vec<Rgb8Image>,
}

impl Animation {
    /// Nothing yet; each picture will be shown for so many seconds, in hundredths.
    pub fn new(seconds: f32) -> Self {
        Self {
            seconds,
            pictures: Vec::new(),
        }
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// [`Error::Length`] if it has another number of pixels than the first one; [`Error::Size`] if a side has more than 65 535
    /// pixels, or if all pictures take more than 2 GB.
    pub fn add(&mut self, picture: &Rgb8Image) -> Result<(), Error> {
        let size = |picture: &Rgb8Image| [picture.width(), picture.height()];
        let bytes = 3 * picture.pixels().len() * (self.pictures.len() + 1);
        let [width, height] = size(picture);
        if width.max(height) > usize::from(u16::MAX) || bytes > MOST_BYTES {
            return Err(Error::Size {
                width: width as u32,
                height: height as u32,
                least: 1,
                most: (MOST_BYTES / 3 / (self.pictures.len() + 1)) as u64,
            });
        }
        if let Some(first) = self.pictures.first()
            && size(first) != size(picture)
        {
            return Err(Error::Length {
                what: "pixels of a picture",
                found: picture.pixels().len(),
                wanted: first.pixels().len(),
            });
        }
        self.pictures.push(picture.clone());
        Ok(())
    }

    /// Bytes of the file.
    ///
    /// # Errors
    /// [`Error::Gif`] if there is no picture, or if it cannot be encoded.
    pub fn finish(&self) -> Result<Vec<u8>, Error> {
        let bad = |error: gif::EncodingError| Error::Gif(error.to_string());
        let Some(first) = self.pictures.first() else {
            return Err(Error::Gif("there is no picture".into()));
        };
        let mut colours = Colours::of(&self.pictures);
        let (width, height) = (first.width() as u16, first.height() as u16);
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, width, height, &colours.table()).map_err(bad)?;
        encoder.set_repeat(Repeat::Infinite).map_err(bad)?;
        let mut before: Vec<u8> = Vec::new();
        for picture in &self.pictures {
            let now: Vec<u8> = picture.pixels().iter().map(|&p| colours.index(p)).collect();
            let changed = now.iter().enumerate().map(|(place, &colour)| {
                let is_same = before.get(place) == Some(&colour);
                if is_same { SAME } else { colour }
            });
            let frame = Frame {
                width,
                height,
                delay: (100.0 * self.seconds).round().clamp(1.0, 6000.0) as u16,
                dispose: DisposalMethod::Keep,
                transparent: Some(SAME),
                buffer: changed.collect::<Vec<u8>>().into(),
                ..Frame::default()
            };
            encoder.write_frame(&frame).map_err(bad)?;
            before = now;
        }
        drop(encoder);
        Ok(bytes)
    }
}

/// The colours of a file.
struct Colours {
    table: Vec<[u8; 3]>,
    known: HashMap<[u8; 3], u8>,
}

impl Colours {
    fn of(pictures: &[Rgb8Image]) -> Self {
        let differing = |picture: &&Rgb8Image| {
            let pairs = picture.pixels().iter().zip(pictures[0].pixels());
            pairs.filter(|(a, b)| a != b).count()
        };
        let other = pictures.iter().max_by_key(differing);
        let mut counts: HashMap<[u8; 3], usize> = HashMap::new();
        for picture in pictures.iter().take(1).chain(other) {
            for pixel in picture.pixels() {
                // Neighbouring colours share a place in the table.
                *counts.entry(pixel.map(|x| x & 0xf8 | x >> 5)).or_default() += 1;
            }
        }
        let mut all: Vec<([u8; 3], usize)> = counts.into_iter().collect();
        all.sort_unstable_by_key(|&(colour, count)| (usize::MAX - count, colour));
        all.truncate(COLOURS);
        Self {
            table: all.into_iter().map(|(colour, _)| colour).collect(),
            known: HashMap::new(),
        }
    }

    fn table(&self) -> Vec<u8> {
        let mut table = self.table.concat();
        table.resize(3 * (COLOURS + 1), 0);
        table
    }

    /// Place of the nearest colour.
    fn index(&mut self, pixel: [u8; 3]) -> u8 {
        let table = &self.table;
        *self.known.entry(pixel).or_insert_with(|| {
            let apart = |&place: &usize| {
                let pairs = table[place].iter().zip(pixel);
                pairs
                    .map(|(&a, b)| (i32::from(a) - i32::from(b)).pow(2))
                    .sum::<i32>()
            };
            (0..table.len()).min_by_key(apart).unwrap_or_default() as u8
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(pixels: &[[u8; 3]]) -> Rgb8Image {
        Rgb8Image::new(2, pixels.len() / 2, pixels.to_vec()).expect("a picture")
    }

    #[test]
    fn pictures_come_back_with_their_colours_and_changes() {
        let (a, b, c) = ([255, 0, 0], [0, 255, 0], [0, 0, 255]);
        let pictures = [[a, b, c, a], [a, b, c, b], [c, b, c, b]];
        let mut animation = Animation::new(0.2);
        for pixels in &pictures {
            animation.add(&picture(pixels)).expect("a picture");
        }
        let bytes = animation.finish().expect("a file");
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&bytes[..]).expect("a file");
        let mut shown = [[0; 3]; 4];
        for wanted in &pictures {
            let frame = decoder
                .read_next_frame()
                .expect("a frame")
                .expect("a frame");
            assert_eq!(frame.delay, 20);
            for (place, pixel) in shown.iter_mut().zip(frame.buffer.chunks(4)) {
                if pixel[3] > 0 {
                    place.copy_from_slice(&pixel[..3]);
                }
            }
            assert_eq!(&shown[..], wanted);
        }
        assert!(decoder.read_next_frame().expect("an end").is_none());
        assert!(Animation::new(1.0).finish().is_err());
        assert!(animation.add(&picture(&[a; 2])).is_err());
    }

    #[test]
    fn more_colours_than_the_table_has_are_the_nearest_ones() {
        let pixels: Vec<[u8; 3]> = (0..4096)
            .map(|i| {
                [
                    (i % 16 * 17) as u8,
                    (i / 16 % 16 * 17) as u8,
                    (i / 256 * 17) as u8,
                ]
            })
            .collect();
        let mut colours = Colours::of(&[picture(&pixels)]);
        assert_eq!(colours.table.len(), COLOURS);
        let first = colours.table[3];
        assert_eq!(colours.index(first), 3);
        assert!(usize::from(colours.index([1, 2, 250])) < COLOURS);
    }
}
