//! Rasters: images read as their files store them.

use antumbra_image::{Allowance, Error, Image, Raster, Samples, Window, raster_extensions};
use png::{BitDepth, ColorType, Encoder};
use tempfile::TempDir;

/// Reads bytes as a file of the given name.
fn read(name: &str, bytes: &[u8]) -> Result<Raster, Error> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    Raster::read(path)
}

/// Values of a valid file of 3 x 2 pixels.
fn samples(name: &str, bytes: &[u8]) -> Samples {
    let raster = read(name, bytes).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((raster.width(), raster.height()), (3, 2));
    assert_eq!(raster.samples().len(), 6);
    raster.into_samples()
}

/// PNG file of 3 x 2 pixels.
fn png(color: ColorType, depth: BitDepth, palette: Option<&[u8]>, values: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, 3, 2);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if let Some(palette) = palette {
        encoder.set_palette(palette.to_vec());
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(values).unwrap();
    writer.finish().unwrap();
    bytes
}

#[test]
fn png_of_every_kind() {
    use BitDepth as B;
    use ColorType as C;
    let grey = [0, 1, 2, 3, 4, 255];
    assert_eq!(
        samples("a.png", &png(C::Grayscale, B::Eight, None, &grey)),
        Samples::Grey8(grey.to_vec())
    );
    // Grey values of 1 bit fill the range.
    assert_eq!(
        samples(
            "a.PNG",
            &png(C::Grayscale, B::One, None, &[0b0100_0000, 0b1010_0000])
        ),
        Samples::Grey8(vec![0, 255, 0, 255, 0, 255])
    );
    let with_alpha: Vec<u8> = grey.iter().flat_map(|v| [*v, 7]).collect();
    assert_eq!(
        samples(
            "a.png",
            &png(C::GrayscaleAlpha, B::Eight, None, &with_alpha)
        ),
        Samples::Grey8(grey.to_vec())
    );
    let rgb: Vec<[u8; 3]> = (0..6).map(|i| [i, 100 + i, 200 + i]).collect();
    let expected = Samples::Rgb8(rgb.clone());
    assert_eq!(
        samples("a.png", &png(C::Rgb, B::Eight, None, rgb.as_flattened())),
        expected
    );
    let rgba: Vec<u8> = rgb.iter().flat_map(|[r, g, b]| [*r, *g, *b, 9]).collect();
    assert_eq!(
        samples("a.png", &png(C::Rgba, B::Eight, None, &rgba)),
        expected
    );
    let palette = Some(rgb.as_flattened());
    assert_eq!(
        samples(
            "a.png",
            &png(C::Indexed, B::Four, palette, &[0x01, 0x20, 0x34, 0x50])
        ),
        expected
    );
    let wide: Vec<u8> = [0u16, 1, 0x8000, 0xFFFF, 7, 9]
        .iter()
        .flat_map(|v| v.to_be_bytes())
        .collect();
    let fractions = [0.0, 1.0, 32768.0, 65535.0, 7.0, 9.0].map(|v: f32| v / 65535.0);
    assert_eq!(
        samples("a.png", &png(C::Grayscale, B::Sixteen, None, &wide)),
        Samples::Rgb32(fractions.map(|v| [v; 3]).to_vec())
    );
    let wide_rgba: Vec<u8> = (0..24u16).flat_map(|i| (256 * i).to_be_bytes()).collect();
    let value = |i: u16| f32::from(256 * i) / 65535.0;
    let expected = (0..6).map(|p| [value(4 * p), value(4 * p + 1), value(4 * p + 2)]);
    assert_eq!(
        samples("a.png", &png(C::Rgba, B::Sixteen, None, &wide_rgba)),
        Samples::Rgb32(expected.collect())
    );
}

/// TGA header of 3 x 2 pixels. Bit 5 of the descriptor is set if the top row comes first.
fn tga(kind: u8, bits: u8, descriptor: u8, values: &[u8]) -> Vec<u8> {
    let mut bytes = vec![
        0, 0, kind, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 2, 0, bits, descriptor,
    ];
    bytes.extend(values);
    bytes
}

#[test]
fn tga_grey_and_coloured_plain_and_run_length_encoded() {
    let grey = [0, 1, 2, 3, 4, 255];
    assert_eq!(
        samples("a.tga", &tga(3, 8, 0x20, &grey)),
        Samples::Grey8(grey.to_vec())
    );
    // Bottom row first.
    assert_eq!(
        samples("a.tga", &tga(3, 8, 0, &grey)),
        Samples::Grey8(vec![3, 4, 255, 0, 1, 2])
    );
    // Blue, green, red.
    let rgb: Vec<[u8; 3]> = (0..6).map(|i| [i, 100 + i, 200 + i]).collect();
    let bgr: Vec<u8> = rgb.iter().flat_map(|[r, g, b]| [*b, *g, *r]).collect();
    let expected = Samples::Rgb8(rgb.clone());
    assert_eq!(samples("a.tga", &tga(2, 24, 0x20, &bgr)), expected);
    let bgra: Vec<u8> = rgb.iter().flat_map(|[r, g, b]| [*b, *g, *r, 9]).collect();
    assert_eq!(samples("a.tga", &tga(2, 32, 0x28, &bgra)), expected);
    // A run of four pixels, then two single pixels.
    let runs = [0x83, 3, 2, 1, 0x01, 6, 5, 4, 9, 8, 7];
    assert_eq!(
        samples("a.tga", &tga(10, 24, 0x20, &runs)),
        Samples::Rgb8(vec![
            [1, 2, 3],
            [1, 2, 3],
            [1, 2, 3],
            [1, 2, 3],
            [4, 5, 6],
            [7, 8, 9]
        ])
    );
}

#[test]
fn hdr_is_mantissas_and_an_exponent() {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 3\n".to_vec();
    for i in 0..6u8 {
        bytes.extend([128, 64, i, 129]);
    }
    for name in ["a.hdr", "a.pic"] {
        let expected = (0..6).map(|i| [1.0, 0.5, f32::from(i as u8) / 128.0]);
        assert_eq!(
            samples(name, &bytes),
            Samples::Rgb32(expected.collect()),
            "{name}"
        );
    }
}

/// PFM file: the header, and the values from the bottom row to the top.
fn pfm(header: &str, values: &[f32], bytes_of: impl Fn(f32) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(values.iter().flat_map(|v| bytes_of(*v)));
    bytes
}

#[test]
fn pfm_of_either_byte_order() {
    let values = [3.0, 4.0, 5.0, 0.0, 1.0, -2.0];
    let expected = Samples::Rgb32(
        [0.0, 1.0, -2.0, 3.0, 4.0, 5.0]
            .map(|v: f32| [v; 3])
            .to_vec(),
    );
    let little = pfm("Pf\n3 2\n-1.0\n", &values, f32::to_le_bytes);
    assert_eq!(samples("a.pfm", &little), expected);
    let big = pfm("Pf 3\n2 1\n", &values, f32::to_be_bytes);
    assert_eq!(samples("a.pfm", &big), expected);
    let colours: Vec<f32> = (0..18).map(|i| i as f32).collect();
    let scaled = pfm("PF 3 2 -2 ", &colours, f32::to_le_bytes);
    let Samples::Rgb32(pixels) = samples("a.pfm", &scaled) else {
        panic!()
    };
    assert_eq!(
        (pixels[0], pixels[5]),
        ([18.0, 20.0, 22.0], [12.0, 14.0, 16.0])
    );
}

#[test]
fn exr_is_its_data_window() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.exr");
    let window = Window {
        x0: 5,
        y0: 1,
        x1: 8,
        y1: 3,
    };
    let picture = Image::from_fn(20, 10, window, |x, y| [x as f32, y as f32, 0.5]).unwrap();
    picture.write(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(
        samples("a.exr", &bytes),
        Samples::Rgb32(picture.into_pixels())
    );
}

#[test]
fn sizes_are_checked_before_anything_is_allocated() {
    let mut huge_tga = tga(2, 24, 0, &[]);
    huge_tga[12..16].fill(0xFF);
    let huge_hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000000000 +X 2000000000\n";
    let mut huge_png = png(ColorType::Grayscale, BitDepth::Eight, None, &[0; 6]);
    huge_png[16..24].fill(0x7F);
    // Checksum of the bytes after the length of the first chunk.
    let sum = crc(&huge_png[12..29]).to_be_bytes();
    huge_png[29..33].copy_from_slice(&sum);
    for (name, bytes, words) in [
        ("a.tga", &huge_tga[..], "65535 x 65535 pixels are more than"),
        (
            "a.hdr",
            huge_hdr,
            "2000000000 x 2000000000 pixels are more than",
        ),
        (
            "a.png",
            &huge_png,
            "2139062143 x 2139062143 pixels are more than",
        ),
        (
            "a.pfm",
            b"PF 4000000000 4000000000 1\n",
            "pixels are more than",
        ),
        ("a.pfm", b"PF 0 5 1\n", "the size 0 x 5 is empty"),
        ("a.pfm", b"PF 2 2 1\n\0\0", "need 48 bytes, but there are 2"),
        ("a.pfm", b"PF 2 2 0\n\0\0", "the scale is 0"),
        ("a.pfm", b"P6 2 2 1\n", "does not begin with PF"),
        (
            "a.pfm",
            b"PF 2 x 1\n",
            "the height \"x\" is not a valid number",
        ),
        ("a.pfm", b"PF 2", "ends in its header"),
    ] {
        let error = read(name, bytes).unwrap_err();
        assert!(matches!(error, Error::Decode { .. }), "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }
}

/// CRC-32 of PNG.
fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, byte: &u8| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xEDB8_8320 * (crc & 1))
        })
    };
    !bytes.iter().fold(!0, step)
}

/// Huge files of something else are refused by their first bytes, without being read.
#[test]
fn sparse_files_are_not_read() {
    let folder = TempDir::new().unwrap();
    for extension in raster_extensions() {
        let path = folder.path().join("sparse").with_extension(extension);
        let file = std::fs::File::create(&path).unwrap();
        file.set_len(1 << 40).unwrap();
        let raster = Raster::read(&path);
        assert!(matches!(raster, Err(Error::Decode { .. })), "{raster:?}");
    }
    let image = Image::read(folder.path().join("sparse.exr"));
    assert!(matches!(image, Err(Error::Decode { .. })), "{image:?}");
}

/// Pictures take their memory from the allowance, and give back what only their decoder needed.
#[test]
fn pictures_stay_within_the_memory_allowed() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.png");
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, 300, 100);
    encoder.set_color(ColorType::Rgb);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[7; 90_000]).unwrap();
    writer.finish().unwrap();
    std::fs::write(&path, bytes).unwrap();
    let allowance = Allowance::new(300_000);
    assert!(Raster::read_within(&path, &allowance).is_ok());
    assert_eq!(allowance.left(), 210_000);
    assert!(Raster::read_within(&path, &allowance).is_ok());
    assert_eq!(allowance.left(), 120_000);
    let error = Raster::read_within(&path, &allowance).unwrap_err();
    assert!(error.to_string().contains("more than the"), "{error}");
    assert_eq!(allowance.left(), 120_000);

    let exr = folder.path().join("a.exr");
    let window = Window::full(64, 64);
    let image = Image::new(64, 64, window, vec![[0.5; 3]; 4096]).unwrap();
    image.write(&exr).unwrap();
    assert!(Image::read_within(&exr, &Allowance::new(80_000)).is_ok());
    assert!(Image::read_within(&exr, &Allowance::new(40_000)).is_err());
}

#[test]
fn other_files_are_refused() {
    assert!(matches!(
        read("a.gif", b""),
        Err(Error::UnknownFormat { .. })
    ));
    assert!(matches!(
        Raster::read("nowhere.png"),
        Err(Error::Read { .. })
    ));
    let folder = TempDir::with_suffix(".png").unwrap();
    assert!(matches!(
        Raster::read(folder.path()),
        Err(Error::Read { .. })
    ));
    let known: Vec<_> = raster_extensions().collect();
    assert_eq!(
        known,
        ["exr", "png", "hdr", "jpeg", "jpg", "pfm", "pic", "tga"]
    );
    assert!(matches!(
        Raster::new(0, 3, Samples::Grey8(vec![])),
        Err(Error::BadSize {
            width: 0,
            height: 3
        })
    ));
    assert!(matches!(
        Raster::new(2, 3, Samples::Grey8(vec![0; 5])),
        Err(Error::WrongCount {
            expected: 6,
            found: 5
        })
    ));
}

/// Xorshift generator of 64 bits (Marsaglia 2003).
struct XorShift(u64);

impl XorShift {
    fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % bound as u64) as usize
    }
}

#[test]
fn damaged_files_are_errors_or_pictures() {
    const SEED: u64 = 0x7E57_1A6E;
    println!("seed {SEED:#x}");
    let mut random = XorShift(SEED);
    let runs = [0x83, 3, 2, 1, 0x01, 6, 5, 4, 9, 8, 7];
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 3\n".to_vec();
    hdr.extend([128; 24]);
    let originals = [
        (
            "a.png",
            png(ColorType::Rgb, BitDepth::Eight, None, &[5; 18]),
        ),
        ("a.tga", tga(10, 24, 0x20, &runs)),
        ("a.hdr", hdr),
        ("a.pfm", pfm("Pf 3 2 -1\n", &[1.0; 6], f32::to_le_bytes)),
    ];
    let folder = TempDir::new().unwrap();
    for (name, original) in originals {
        let path = folder.path().join(name);
        for _ in 0..300 {
            let mut bytes = original.clone();
            for _ in 0..=random.below(3) {
                let at = random.below(bytes.len());
                match random.below(3) {
                    0 => bytes[at] = random.below(256) as u8,
                    1 => bytes.insert(at, random.below(256) as u8),
                    _ => bytes.truncate(at.max(1)),
                }
            }
            std::fs::write(&path, bytes).unwrap();
            match Raster::read(&path) {
                Ok(raster) => {
                    let pixels = raster.width() as usize * raster.height() as usize;
                    assert_eq!(raster.samples().len(), pixels);
                }
                Err(error) => assert!(!error.to_string().is_empty()),
            }
        }
    }
}

/// Reads the seeds of the fuzzer, among which are the files of past failures.
#[test]
fn seeds_of_the_fuzzer_are_read_or_refused() {
    let seeds = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz/seeds/raster");
    let mut read = 0;
    for seed in std::fs::read_dir(seeds).unwrap() {
        let bytes = std::fs::read(seed.unwrap().path()).unwrap();
        let (format, bytes) = bytes.split_first().unwrap();
        // The steps are those of the fuzz target with the same name.
        let name = ["t.png", "t.tga", "t.exr", "t.pfm", "t.hdr"][usize::from(*format) % 5];
        read += usize::from(Raster::parse(bytes, name).is_ok());
    }
    assert!(read >= 17, "only {read} are read");
}

#[test]
fn palettes_of_a_whole_number_of_colours_are_read() {
    let with = |length: usize| {
        let palette: Vec<u8> = (0..length).map(|i| i as u8).collect();
        let bytes = png(ColorType::Indexed, BitDepth::Eight, Some(&palette), &[0; 6]);
        Raster::parse(&bytes, "palette.png")
    };
    for length in [3, 6, 768] {
        let raster = with(length).unwrap();
        assert_eq!(raster.samples(), &Samples::Rgb8(vec![[0, 1, 2]; 6]));
    }
    // Refused before the decoder panics. The decoder itself refuses palettes of no or more than 256 colours.
    for length in [4, 44, 767] {
        let error = with(length).unwrap_err().to_string();
        assert!(error.contains(&format!("{length} bytes")), "{error}");
    }
    for length in [2, 769, 771] {
        assert!(matches!(with(length), Err(Error::Decode { .. })));
    }
}

/// Refusal of headers that declare more pixels than the file can hold at the best compression.
///
/// The message names both sizes, and nothing is allocated before.
#[test]
fn headers_are_held_against_the_length_of_the_file() {
    let seeds = [
        // Width and height are 16 bits at bytes 12 and 14.
        ("big.tga", tga_header(0x2000, 0x2000)),
        (
            "big.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8192 +X 8192\n".to_vec(),
        ),
        ("big.png", png_header(8192, 8192)),
        ("big.pfm", b"PF 8192 8192 -1\n".to_vec()),
    ];
    for (name, bytes) in seeds {
        let error = Raster::parse(&bytes, name).expect_err(name).to_string();
        let told = ["67108864", "8192 x 8192", "67117056", "201334784"];
        assert!(
            told.iter().any(|size| error.contains(size)),
            "{name}: {error}"
        );
        let length = bytes.len().to_string();
        assert!(
            error.contains(&length) || name == "big.pfm",
            "{name}: {error}"
        );
    }
}

fn tga_header(width: u16, height: u16) -> Vec<u8> {
    let mut bytes = vec![0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    bytes.extend(width.to_le_bytes());
    bytes.extend(height.to_le_bytes());
    bytes.extend([24, 0]);
    bytes
}

fn png_header(width: u32, height: u32) -> Vec<u8> {
    let mut chunk = b"IHDR".to_vec();
    chunk.extend(width.to_be_bytes());
    chunk.extend(height.to_be_bytes());
    chunk.extend([8, 0, 0, 0, 0]);
    // Annex D of the specification.
    let crc = chunk.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| {
            (c >> 1) ^ (0xedb8_8320 * (c & 1))
        })
    });
    let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\x0d".to_vec();
    bytes.extend(chunk);
    bytes.extend((!crc).to_be_bytes());
    bytes.extend(b"\0\0\0\x08IDAT\x78\x9c\x03\0\0\0\0\x01");
    bytes
}
