//! Formats and files: written images are read back bit by bit, and damaged files are errors.

use std::fs;
use std::path::Path;

use crate::support::{Random, assert_same_bits, image};
use antumbra_image::{
    Error, Image, Rgb8Image, Window, readable_extensions, srgb8, writable_extensions,
};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as File,
    ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, SmallVec, SpecificChannels,
    Vec2, WritableImage, f16,
};

fn window(x0: i32, y0: i32, x1: i32, y1: i32) -> Window {
    Window { x0, y0, x1, y1 }
}

#[test]
fn exr_round_trip_keeps_every_bit() {
    let seed = 0x5eed_0001;
    println!("seed {seed:#x}");
    let mut random = Random(seed);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.exr");
    let windows = [
        (1, 1, window(0, 0, 1, 1)),
        (37, 19, window(0, 0, 37, 19)),
        (100, 80, window(13, 7, 14, 70)),
        (100, 80, window(99, 79, 100, 80)),
        (20, 10, window(-3, -5, 25, 12)),
        (4, 4, window(100, -200, 117, -190)),
        (1 << 29, 1 << 29, window(5, 6, 8, 9)),
    ];
    for (width, height, window) in windows {
        let pixel = |_, _| [random.hostile(), random.hostile(), random.hostile()];
        let written = Image::from_fn(width, height, window, pixel).unwrap();
        written.write(&path).unwrap();
        assert_same_bits(&Image::read(&path).unwrap(), &written);
    }
}

#[test]
fn the_same_image_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(7);
    let picture = image(65, 43, |_, _| [random.hostile(), 0.5, random.hostile()]);
    for extension in writable_extensions() {
        let (a, b) = (
            folder.path().join(format!("a.{extension}")),
            folder.path().join(format!("another.{extension}")),
        );
        picture.write(&a).unwrap();
        picture.clone().write(&b).unwrap();
        assert!(fs::read(a).unwrap() == fs::read(b).unwrap(), "{extension}");
    }
}

#[test]
fn exr_is_compressed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flat.exr");
    image(256, 256, |_, _| [0.25; 3]).write(&path).unwrap();
    assert!(fs::metadata(&path).unwrap().len() < 10_000);
}

/// Half a step of 8 bits is lost, whatever the size of the values, and impossible values become 0.
#[test]
fn hdr_round_trip_rounds_to_eight_bits_of_the_largest_value() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.hdr");
    let mut random = Random(11);
    for width in [5, 300] {
        let mut value =
            || (random.bits() % 1000) as f32 * ((random.bits() % 200) as f32 - 100.0).exp2();
        let picture = image(width, 7, |_, _| [value(), value(), value()]);
        picture.write(&path).unwrap();
        let read = Image::read(&path).unwrap();
        assert_eq!(read.window(), picture.window());
        for (read, written) in read.pixels().iter().zip(picture.pixels()) {
            let most = written.iter().fold(0.0_f32, |most, value| most.max(*value));
            for (read, written) in read.iter().zip(written) {
                assert!((read - written).abs() <= most / 255.0, "{read} {written}");
            }
        }
    }
    let hostile = [
        ([f32::NAN, 1.0, -1.0], [0.0, 1.0, 0.0]),
        ([f32::INFINITY, 0.0, 0.0], [8e37, 0.0, 0.0]),
        ([f32::MAX, 0.0, 0.0], [8e37, 0.0, 0.0]),
        ([1e-40, -0.0, 1e-45], [0.0; 3]),
        ([2e-38, 0.0, 0.0], [2e-38, 0.0, 0.0]),
    ];
    let picture = image(hostile.len(), 1, |x, _| hostile[x as usize].0);
    picture.write(&path).unwrap();
    for (read, (_, expected)) in Image::read(&path).unwrap().pixels().iter().zip(hostile) {
        for (read, expected) in read.iter().zip(expected) {
            assert!(
                (read / 1.1..=read * 1.1).contains(&expected),
                "{read} {expected}"
            );
        }
    }
    // Of a part of a picture, the pixels of the part.
    let part = Image::new(9, 9, window(2, 3, 4, 4), vec![[1.0; 3]; 2]).unwrap();
    part.write(&path).unwrap();
    assert_eq!(Image::read(&path).unwrap().window(), Window::full(2, 1));
}

#[test]
fn what_exr_cannot_hold_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wide.exr");
    let picture = Image::new(i32::MAX as usize, 1, window(0, 0, 1, 1), vec![[0.0; 3]]);
    let error = picture.unwrap().write(&path).unwrap_err();
    assert!(
        matches!(error, Error::Encode { format: "exr", .. }),
        "{error}"
    );
    assert!(!path.exists());
}

/// File written by the crate `exr` alone: channels by name, at `position` of `display`.
fn foreign(
    path: &Path,
    display: IntegerBounds,
    position: Vec2<i32>,
    size: Vec2<usize>,
    channels: Vec<(&str, FlatSamples)>,
    compression: Compression,
) {
    let list = channels
        .into_iter()
        .map(|(name, samples)| AnyChannel::new(name, samples))
        .collect::<SmallVec<_>>();
    let layer = Layer::new(
        size,
        LayerAttributes {
            layer_position: position,
            ..LayerAttributes::default()
        },
        Encoding {
            compression,
            ..Encoding::SMALL_LOSSLESS
        },
        AnyChannels::sort(list),
    );
    let file = File::new(ImageAttributes::new(display), layer);
    file.write().non_parallel().to_file(path).unwrap();
}

#[test]
fn exr_reads_half_floats_moved_windows_and_further_channels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.exr");
    let half = |values: [f32; 2]| FlatSamples::F16(values.map(f16::from_f32).to_vec());
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
    ] {
        foreign(
            &path,
            IntegerBounds::new(Vec2(10, -20), Vec2(30, 40)),
            Vec2(9, -18),
            Vec2(2, 1),
            vec![
                ("A", half([0.5, 0.5])),
                ("B", FlatSamples::F32(vec![0.3, -0.3])),
                ("G", half([65_504.0, -5.960_464_5e-8])),
                ("R", half([1.5, f32::INFINITY])),
                ("Z", FlatSamples::F32(vec![9.0, 9.0])),
            ],
            compression,
        );
        let read = Image::read(&path).unwrap();
        assert_eq!((read.width(), read.height()), (30, 40));
        assert_eq!(read.window(), window(-1, 2, 1, 3));
        assert_eq!(
            read.pixels(),
            [[1.5, 65_504.0, 0.3], [f32::INFINITY, -5.960_464_5e-8, -0.3]]
        );
        assert_eq!(read.get(0, 2), Some(read.pixels()[1]));
        assert_eq!(read.get(1, 2), None);
    }
}

/// File compressed with DWA, which consists of squares of 8 x 8 and of sections whose sizes the chunks declare.
#[test]
fn exr_of_lossy_blocks_is_read_and_asks_for_no_more_than_it_holds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dwa.exr");
    for compression in [Compression::DWAA(None), Compression::DWAB(None)] {
        let size = Vec2(20, 12);
        let ramp = |scale: f32| (0..240).map(|i| scale * (i % 20) as f32).collect();
        let channels = vec![
            ("A", FlatSamples::F16(vec![f16::ONE; 240])),
            ("B", FlatSamples::F32(ramp(0.0))),
            ("G", FlatSamples::F32(ramp(0.05))),
            ("R", FlatSamples::F32(ramp(0.1))),
            ("Z", FlatSamples::F32(ramp(3.0))),
        ];
        let display = IntegerBounds::from_dimensions(size);
        foreign(&path, display, Vec2(0, 0), size, channels, compression);
        for (i, [r, g, b]) in Image::read(&path).unwrap().pixels().iter().enumerate() {
            let x = (i % 20) as f32;
            assert!((r - 0.1 * x).abs() < 0.02 && (g - 0.05 * x).abs() < 0.02 && b.abs() < 0.02);
        }

        // Four bytes for the line and four for the length, then the numbers.
        let bytes = std::fs::read(&path).unwrap();
        let numbers = only_chunk(&bytes) + 8;
        assert_eq!(bytes[numbers..numbers + 8], [2, 0, 0, 0, 0, 0, 0, 0]);
        for index in [1, 6, 7, 8, 9] {
            for value in [1 << 20, 1 << 33, i64::MAX as u64, u64::MAX] {
                let mut bytes = bytes.clone();
                let at = numbers + 8 * index;
                bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
                let message = Image::parse(&bytes, "dwa.exr").unwrap_err().to_string();
                assert!(message.contains("declares a section of"), "{message}");
            }
        }
    }

    // A tile of one column takes eight times its pixels.
    let size = Vec2(1, 1 << 18);
    let zero = |_: Vec2<usize>| (f16::ZERO,);
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        Encoding {
            compression: Compression::DWAA(None),
            blocks: Blocks::Tiles(size),
            line_order: LineOrder::Increasing,
        },
        SpecificChannels::build()
            .with_channel("Y")
            .with_pixel_fn(zero),
    );
    let file = File::new(ImageAttributes::with_size(size), layer);
    file.write().non_parallel().to_file(&path).unwrap();
    let message = Image::read(&path).unwrap_err().to_string();
    assert!(message.contains("4194304 bytes of pixels"), "{message}");
}

/// Position of the only chunk, or of the first of two: after the table of offsets.
fn only_chunk(bytes: &[u8]) -> usize {
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    let mut places = 8..bytes.len() - 8;
    let is_here = |at: &usize| [8, 16].iter().any(|back| number(at - back) == *at as u64);
    places.find(|at| *at >= 16 && is_here(at)).unwrap()
}

/// Tiles larger than the picture: a chunk may then declare a length as large as the tile.
#[test]
fn exr_blocks_are_no_larger_than_anybody_needs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tile.exr");
    let size = Vec2(4, 4);
    let layer = Layer::new(
        size,
        LayerAttributes::default(),
        Encoding {
            compression: Compression::Uncompressed,
            blocks: Blocks::Tiles(Vec2(512, 512)),
            line_order: LineOrder::Increasing,
        },
        SpecificChannels::rgb(|_: Vec2<usize>| (1.0_f32, 2.0_f32, 3.0_f32)),
    );
    let file = File::new(ImageAttributes::with_size(size), layer);
    file.write().non_parallel().to_file(&path).unwrap();
    assert_eq!(Image::read(&path).unwrap().pixels(), [[1.0, 2.0, 3.0]; 16]);

    let mut bytes = std::fs::read(&path).unwrap();
    let sizes: Vec<u8> = [512_u32, 512]
        .iter()
        .flat_map(|n| n.to_le_bytes())
        .collect();
    let at = bytes.windows(8).position(|w| w == sizes).unwrap();
    bytes[at + 3] = 0x10;
    let message = Image::parse(&bytes, "tile.exr").unwrap_err().to_string();
    assert!(message.contains("blocks of 268435968 x 512"), "{message}");
}

#[test]
fn exr_chunks_do_not_change_layers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.exr");
    let layer = |name: &str, value: f32| {
        let attributes = LayerAttributes::named(name);
        let channels = SpecificChannels::rgb(move |_: Vec2<usize>| (value, value, value));
        Layer::new((3, 1), attributes, Encoding::UNCOMPRESSED, channels)
    };
    let display = ImageAttributes::with_size((3, 1));
    let file = File::empty(display).with_layer(layer("a", 1.0));
    let file = file.with_layer(layer("b", 2.0));
    file.write().non_parallel().to_file(&path).unwrap();
    assert_eq!(Image::read(&path).unwrap().pixels(), [[1.0; 3]; 3]);

    let mut bytes = std::fs::read(&path).unwrap();
    let chunk = only_chunk(&bytes);
    assert_eq!(bytes[chunk], 0, "the first layer");
    bytes[chunk] = 1;
    let message = Image::parse(&bytes, "two.exr").unwrap_err().to_string();
    assert!(message.contains("that is listed for layer"), "{message}");
}

#[test]
fn exr_luminance_becomes_grey() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grey.exr");
    let size = Vec2(2, 2);
    let samples = FlatSamples::F32(vec![0.0, 1.0, -2.0, 3.5]);
    let display = IntegerBounds::from_dimensions(size);
    let channels = vec![("Y", samples.clone())];
    foreign(&path, display, Vec2(0, 0), size, channels, Compression::PIZ);
    let read = Image::read(&path).unwrap();
    assert_eq!(read.pixels(), [[0.0; 3], [1.0; 3], [-2.0; 3], [3.5; 3]]);

    for (channels, reason) in [
        (vec!["Q"], "no layer has channels"),
        (vec!["R", "G"], "no layer has channels"),
        (vec!["Y", "RY", "BY"], "chroma"),
    ] {
        let channels = channels.into_iter().map(|name| (name, samples.clone()));
        let channels = channels.collect();
        foreign(&path, display, Vec2(0, 0), size, channels, Compression::PIZ);
        let message = Image::read(&path).unwrap_err().to_string();
        assert!(message.contains(reason), "{message}");
        assert!(message.contains("grey.exr"), "{message}");
    }
}

#[test]
fn damaged_exr_files_are_errors_not_panics() {
    let seed = 0x5eed_0002;
    println!("seed {seed:#x}");
    let mut random = Random(seed);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.exr");
    let picture = image(40, 33, |x, y| [x as f32, y as f32, random.hostile()]);
    picture.write(&path).unwrap();
    let good = fs::read(&path).unwrap();

    for length in (0..good.len()).step_by(97) {
        fs::write(&path, &good[..length]).unwrap();
        assert!(matches!(Image::read(&path), Err(Error::Decode { .. })));
    }
    for _ in 0..3000 {
        let mut bytes = good.clone();
        for _ in 0..=random.below(3) {
            // Most changes hit the header, where the lengths are.
            let end = if random.below(4) == 0 {
                good.len()
            } else {
                400
            };
            bytes[random.below(end)] = random.bits() as u8;
        }
        fs::write(&path, &bytes).unwrap();
        // Damage to pixel data may go unnoticed. Any answer without a panic is right.
        let _answer = Image::read(&path);
    }
}

/// Chunk names of a PNG file, in order.
fn png_chunks(bytes: &[u8]) -> Vec<String> {
    let mut rest = &bytes[8..];
    let mut names = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        names.push(String::from_utf8(after[..4].to_vec()).unwrap());
        rest = &after[4 + u32::from_be_bytes(*length) as usize + 4..];
    }
    names
}

fn png_pixels(bytes: &[u8]) -> (u32, u32, Vec<u8>) {
    let decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgb);
    assert_eq!(info.bit_depth, png::BitDepth::Eight);
    (info.width, info.height, pixels)
}

#[test]
fn png_holds_the_srgb_bytes_of_the_window_and_the_name_of_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.PNG");
    let crop = window(2, 3, 9, 5);
    let pixel = |x, y| [x as f32 / 9.0, y as f32 - 4.0, f32::NAN];
    let picture = Image::from_fn(20, 10, crop, pixel).unwrap();
    picture.write(&path).unwrap();
    let bytes = fs::read(&path).unwrap();
    let (width, height, pixels) = png_pixels(&bytes);
    assert_eq!((width, height), (7, 2));
    let expected = picture.pixels().as_flattened().iter().map(|&v| srgb8(v));
    assert_eq!(pixels, expected.collect::<Vec<_>>());
    for name in png_chunks(&bytes) {
        assert!(
            ["IHDR", "sRGB", "gAMA", "cHRM", "tEXt", "IDAT", "IEND"].contains(&name.as_str()),
            "{name}"
        );
    }
    let text = b"tEXtSoftware\0antumbra";
    assert!(bytes.windows(text.len()).any(|part| part == text));
    assert!(png_chunks(&bytes).contains(&"sRGB".into()));
}

#[test]
fn rgb8_round_trip() {
    let mut random = Random(3);
    let pixels: Vec<[u8; 3]> = (0..31 * 17).map(|_| [random.bits() as u8; 3]).collect();
    let picture = Rgb8Image::new(31, 17, pixels.clone()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bytes.png");
    picture.write(&path).unwrap();
    let (width, height, bytes) = png_pixels(&fs::read(&path).unwrap());
    assert_eq!((width, height), (31, 17));
    assert_eq!(bytes, pixels.as_flattened());
}

#[test]
fn the_extension_chooses_and_unknown_ones_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let picture = image(2, 2, |_, _| [1.0; 3]);
    let readable: Vec<_> = readable_extensions().collect();
    assert_eq!(readable, ["exr", "png", "hdr", "jpeg", "jpg"]);
    let writable: Vec<_> = writable_extensions().collect();
    assert_eq!(writable, ["exr", "png", "hdr", "jpeg", "jpg"]);

    for name in ["picture", "picture.gif", "picture.exr.", ".exr", "exr"] {
        let path = folder.path().join(name);
        for error in [
            picture.write(&path).unwrap_err(),
            Image::read(&path).unwrap_err(),
            picture.to_srgb8().write(&path).unwrap_err(),
        ] {
            assert!(matches!(error, Error::UnknownFormat { .. }), "{name}");
            assert!(error.to_string().contains("exr, png"), "{error}");
        }
        assert!(!path.exists());
    }

    let path = folder.path().join("picture.png");
    picture.write(&path).unwrap();
    assert_same_bits(&Image::read(&path).unwrap(), &picture);
    let path = folder.path().join("picture.tga");
    let message = Image::read(&path).unwrap_err().to_string();
    assert!(message.contains("tga images cannot be read; try: exr"));
    let path = folder.path().join("picture.ExR");
    let error = picture.to_srgb8().write(&path).unwrap_err();
    assert!(matches!(error, Error::Unsupported { format: "exr", .. }));
    picture.write(&path).unwrap();
    assert_same_bits(&Image::read(&path).unwrap(), &picture);

    let missing = folder.path().join("missing.exr");
    let error = Image::read(&missing).unwrap_err();
    assert!(matches!(error, Error::Read { .. }));
    assert!(error.to_string().contains("missing.exr"));
}

#[test]
fn image_parts_must_agree() {
    let pixels = |count| vec![[0.0; 3]; count];
    let full = Window::full(2, 3);
    assert!(Image::new(2, 3, full, pixels(6)).is_ok());
    assert!(matches!(
        Image::new(2, 3, full, pixels(5)),
        Err(Error::WrongCount {
            expected: 6,
            found: 5
        })
    ));
    assert!(matches!(
        Image::new(0, 3, full, pixels(6)),
        Err(Error::BadSize { width: 0, .. })
    ));
    let too_wide = i32::MAX as usize + 1;
    assert!(matches!(
        Image::new(too_wide, 3, full, pixels(6)),
        Err(Error::BadSize { .. })
    ));
    for empty in [window(1, 1, 1, 2), window(1, 2, 2, 1)] {
        assert!(matches!(
            Image::new(2, 3, empty, pixels(0)),
            Err(Error::EmptyWindow { .. })
        ));
    }
    assert_eq!(window(i32::MIN, 0, i32::MAX, 1).width(), u32::MAX as usize);
}

#[test]
fn mean_and_non_finite() {
    let mut picture = image(4, 1, |x, _| [x as f32, 1e30, -0.5]);
    assert_eq!(picture.mean(), [1.5, f64::from(1e30_f32), -0.5]);
    assert_eq!(picture.non_finite(), 0);
    picture.pixels_mut()[1] = [f32::NAN, 1.0, 1.0];
    picture.pixels_mut()[2] = [1.0, f32::INFINITY, f32::NEG_INFINITY];
    assert_eq!(picture.non_finite(), 2);
    let [r, g, b] = picture.mean();
    assert!(r.is_nan());
    assert_eq!((g, b), (f64::INFINITY, f64::NEG_INFINITY));
}
