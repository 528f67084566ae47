//! Files of `write` and `write_planes`: the crate `tiff` reads their tags, and tiles are unpacked here as its specification says.

use std::borrow::Cow;
use std::io::{Cursor, Read};

use antumbra_raster::{Crs, Grid, Quantity, Raster, write, write_planes};
use flate2::read::ZlibDecoder;
use tiff::decoder::Decoder;
use tiff::tags::Tag;

const TILE: usize = 512;

/// A number of a cell, or NaN in one of seven and in a block that is larger than a cell of an overview.
fn value(band: usize, column: usize, row: usize) -> f32 {
    let mixed =
        ((column * 2_654_435_761) ^ (row * 40_503) ^ (band * 97)).wrapping_mul(0x9E37_79B9) >> 7;
    match mixed.is_multiple_of(7) || column / 40 == 1 && row / 40 == 1 {
        true => f32::NAN,
        false => (mixed % 10_007) as f32 / 7.0 - 300.0,
    }
}

fn planes([width, height]: [usize; 2], bands: usize) -> Vec<f32> {
    let cell = move |band, at: usize| value(band, at % width, at / width);
    let plane = |band| (0..width * height).map(move |at| cell(band, at));
    (0..bands).flat_map(plane).collect()
}

fn grid([width, height]: [usize; 2], transform: [f64; 6]) -> Grid {
    Grid {
        width,
        height,
        transform,
        crs: Some(Crs::from_epsg(25_832).expect("a code")),
    }
}

const NORTH: [f64; 6] = [600_000.0, 10.0, 0.0, 5_340_000.0, 0.0, -5.0];
const TURNED: [f64; 6] = [600_000.0, 7.0, 3.0, 5_340_000.0, 3.0, -7.0];
const NAMES: [&str; 3] = ["horizon_000", "a < b & c", "horizon_026.57"];

fn bands(count: usize) -> Vec<Quantity<'static>> {
    let band = |name| Quantity {
        name,
        unit: "degrees",
    };
    NAMES[..count].iter().copied().map(band).collect()
}

/// Sizes around those of tiles and of their halves, with the number of overviews.
const SIZES: [([usize; 2], usize); 10] = [
    ([1, 1], 0),
    ([16, 17], 0),
    ([255, 257], 0),
    ([512, 512], 0),
    ([513, 256], 1),
    ([1, 5000], 4),
    ([1024, 3], 1),
    ([1025, 700], 2),
    ([700, 1300], 2),
    ([2049, 30], 3),
];

fn same(a: f64, b: f64) -> bool {
    a == b || a.is_nan() && b.is_nan()
}

#[test]
fn cells_come_back() {
    for (index, (size, _)) in SIZES.into_iter().enumerate() {
        let grid = grid(size, [NORTH, TURNED][index % 2]);
        let values = planes(size, 1);
        let bytes = write("a.tif".as_ref(), &grid, &values, &bands(1)).expect("a file");
        let raster = Raster::from_geotiff(&bytes).expect("a raster");
        assert_eq!(raster.grid, grid, "{size:?}");
        let mut pairs = raster.values.iter().zip(&values);
        assert_eq!(raster.values.len(), values.len());
        assert!(
            pairs.all(|(&found, &wanted)| same(found, wanted.into())),
            "{size:?}"
        );
    }
}

/// Values of all bands of a page, one after the other: the crate `tiff` (0.11) unpacks only the first.
fn page(bytes: &[u8], decoder: &mut Decoder<Cursor<&[u8]>>, bands: usize) -> Vec<f32> {
    let mut list = |tag| decoder.get_tag_u64_vec(tag).expect("a list");
    let [offsets, counts] = [Tag::TileOffsets, Tag::TileByteCounts].map(&mut list);
    let sizes = [
        Tag::ImageWidth,
        Tag::ImageLength,
        Tag::TileWidth,
        Tag::TileLength,
    ];
    let [width, height, columns, rows] = sizes.map(|tag| list(tag)[0] as usize);
    let across = width.div_ceil(columns);
    let tiles = across * height.div_ceil(rows);
    assert_eq!([offsets.len(), counts.len()], [bands * tiles; 2]);
    let mut values = vec![0.0; bands * width * height];
    for (index, (&offset, &count)) in offsets.iter().zip(&counts).enumerate() {
        let mut data = Vec::new();
        let mut packed = ZlibDecoder::new(&bytes[offset as usize..][..count as usize]);
        packed.read_to_end(&mut data).expect("a tile");
        assert_eq!(data.len(), 4 * columns * rows);
        let [left, top] = [
            index % tiles % across * columns,
            index % tiles / across * rows,
        ];
        for (row, line) in (top..height).zip(data.chunks_mut(4 * columns)) {
            (1..line.len()).for_each(|at| line[at] = line[at].wrapping_add(line[at - 1]));
            for column in 0..columns.min(width - left) {
                let number = [0, 1, 2, 3].map(|byte| line[byte * columns + column]);
                let at = (index / tiles * height + row) * width + left + column;
                values[at] = f32::from_be_bytes(number);
            }
        }
    }
    values
}

/// Mean of the cells with data whose columns and rows, halved so often, are those of a cell.
fn mean(values: &[f32], [width, _]: [usize; 2], level: usize, [column, row]: [usize; 2]) -> f64 {
    let cells = values.iter().enumerate().filter(|&(at, value)| {
        (at % width) >> level == column && (at / width) >> level == row && !value.is_nan()
    });
    let cells: Vec<f64> = cells.map(|(_, &value)| f64::from(value)).collect();
    cells.iter().sum::<f64>() / cells.len() as f64
}

#[test]
fn overviews_are_means_of_cells_with_data() {
    for (index, (size, overviews)) in SIZES.into_iter().enumerate() {
        let count = 1 + index % 3;
        let (grid, values) = (grid(size, NORTH), planes(size, count));
        let bytes = write("a.tif".as_ref(), &grid, &values, &bands(count)).expect("a file");
        let mut decoder = Decoder::new(Cursor::new(&bytes[..])).expect("a file");
        let mut holes = 0;
        for level in 0..=overviews {
            let [width, height] = size.map(|side| side.div_ceil(1 << level));
            let found = decoder.dimensions().expect("a size");
            assert_eq!(found, (width as u32, height as u32), "{size:?}");
            let found = page(&bytes, &mut decoder, count);
            assert_eq!(found.len(), count * width * height);
            for (band, found) in found.chunks(width * height).enumerate() {
                let plane = &values[band * size[0] * size[1]..][..size[0] * size[1]];
                // All cells are compared, and a few overviews of each page by brute force.
                for (at, &found) in found.iter().enumerate() {
                    let (column, row) = (at % width, at / width);
                    let is_some = at % 9973 == 0 || column == 48 >> level && row == 48 >> level;
                    let wanted = match level {
                        0 => f64::from(plane[at]),
                        _ if is_some => mean(plane, size, level, [column, row]) as f32 as f64,
                        _ => continue,
                    };
                    assert!(
                        same(found.into(), wanted),
                        "{size:?}, level {level}, band {band}, cell {at}: {found}, not {wanted}"
                    );
                    holes += usize::from(level > 0 && found.is_nan());
                }
            }
            assert_eq!(decoder.more_images(), level < overviews, "{size:?}");
            if level < overviews {
                assert!(width > TILE || height > TILE, "{size:?}");
                decoder.next_image().expect("a page");
            }
        }
        assert!(
            holes > 0 || size[0].min(size[1]) < 80 || overviews == 0,
            "{size:?}"
        );
    }
}

#[test]
fn directories_come_first_and_small_pages_before_large_ones() {
    for count in [1, 3] {
        let size = [1025, 700];
        let (grid, values) = (grid(size, NORTH), planes(size, count));
        let bytes = write("a.tif".as_ref(), &grid, &values, &bands(count)).expect("a file");
        // The first directory is where the note of GDAL ends.
        let note = String::from_utf8_lossy(&bytes[8..300]).into_owned();
        let (head, body) = note.split_once(" bytes\n").expect("a note");
        let length: usize = head[head.len() - 6..].parse().expect("a length");
        assert!(body[..length].starts_with("LAYOUT=IFDS_BEFORE_DATA\n"));
        assert!(body[..length].ends_with("KNOWN_INCOMPATIBLE_EDITION=NO\n "));
        let mut decoder = Decoder::new(Cursor::new(&bytes[..])).expect("a file");
        let first = decoder.ifd_pointer().expect("a directory").0 as usize;
        assert_eq!(first, (8 + head.len() + 7 + length).next_multiple_of(2));
        let (mut directories, mut starts) = (vec![first], Vec::new());
        loop {
            let kind = decoder.get_tag_u32(Tag::NewSubfileType).expect("a kind");
            assert_eq!(kind, u32::from(directories.len() > 1));
            let mut list = |tag| decoder.get_tag_u16_vec(tag).unwrap_or_default();
            assert_eq!(list(Tag::BitsPerSample), vec![32; count]);
            assert_eq!(list(Tag::SampleFormat), vec![3; count]);
            assert_eq!(list(Tag::ExtraSamples), vec![0; count - 1]);
            assert_eq!(list(Tag::SamplesPerPixel), [count as u16]);
            let order = if count > 1 { 2 } else { 1 };
            assert_eq!(list(Tag::PlanarConfiguration), [order]);
            let offsets = decoder.get_tag_u64_vec(Tag::TileOffsets).expect("places");
            let counts = decoder
                .get_tag_u64_vec(Tag::TileByteCounts)
                .expect("lengths");
            assert_eq!(offsets.len(), counts.len());
            assert!(offsets.is_sorted(), "tiles by their numbers");
            for (&offset, &count) in offsets.iter().zip(&counts) {
                let (start, end) = (offset as usize, (offset + count) as usize);
                assert_eq!(bytes[start - 4..start], (count as u32).to_le_bytes());
                assert_eq!(bytes[end - 4..end], bytes[end..end + 4]);
            }
            starts.push(offsets[0] as usize);
            if !decoder.more_images() {
                break;
            }
            decoder.next_image().expect("a page");
            directories.push(decoder.ifd_pointer().expect("a directory").0 as usize);
        }
        assert!(directories.is_sorted() && starts.is_sorted_by(|a, b| a > b));
        assert!(directories.last() < starts.last(), "all before the data");
        let text = String::from_utf8_lossy(&bytes[..*starts.last().expect("a tile")]).into_owned();
        for (band, name) in ["horizon_000", "a &lt; b &amp; c", "horizon_026.57"][..count]
            .iter()
            .enumerate()
        {
            let item = format!(
                "<Item name=\"DESCRIPTION\" sample=\"{band}\" role=\"description\">{name}</Item>"
            );
            assert!(text.contains(&item), "{item}");
        }
    }
}

#[test]
fn files_are_the_same_for_any_number_of_threads_and_from_planes() {
    let size = [1500, 1100];
    let (grid, values) = (grid(size, TURNED), planes(size, 2));
    for name in ["a.tif", "a.npy"] {
        let file = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads")
                .install(|| write(name.as_ref(), &grid, &values, &bands(2)).expect("a file"))
        };
        let one = file(1);
        assert!(one == file(5), "{name}");
        let (mut order, mut file) = (Vec::new(), Cursor::new(Vec::new()));
        let plane = &mut |band: usize| {
            order.push(band);
            Ok(Cow::Borrowed(&values[band * 1_650_000..][..1_650_000]))
        };
        write_planes(name.as_ref(), &mut file, &grid, &bands(2), plane).expect("a file");
        assert!(one == file.into_inner(), "{name}");
        assert_eq!(order, [0, 1]);
    }
}

#[test]
fn what_a_file_cannot_hold_is_refused() {
    let none = grid([0, 4], NORTH);
    let one = grid([1, 1], NORTH);
    for (name, grid, values, count, words) in [
        ("a.tif", &none, vec![], 1, "no 1 bands of 0 x 4 cells"),
        ("a.tif", &one, vec![], 0, "no 0 bands of 1 x 1 cells"),
        ("a.asc", &one, vec![1.0; 2], 2, ".tif and .npy have several"),
        ("a.xyz", &one, vec![1.0], 1, "`xyz` is no extension"),
    ] {
        let error = write(name.as_ref(), grid, &values, &bands(count)).expect_err(words);
        assert!(error.to_string().contains(words), "{error}");
    }
    let plane = &mut |_| Ok(Cow::Owned(vec![1.0]));
    let written = write_planes(
        "a.asc".as_ref(),
        &mut Cursor::new(Vec::new()),
        &one,
        &bands(1),
        plane,
    );
    assert!(written.is_err());
}
