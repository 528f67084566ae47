//! Virtual rasters of GDAL (`.vrt`): windows of files as XML, as `gdalbuildvrt` writes them.
//!
//! Whatever else makes cells is refused by its name: resampling, several bands, warps, masks, pixel functions. `gdal_translate`
//! writes the cells of such a raster to a file.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};

use crate::grid::check_transform;
use crate::mosaic::{Mosaic, Whole};
use crate::{Crs, Error, Grid, Purpose, Quantity, broken, check_lengths, read_file, stored};

/// Elements and attributes that are read.
const READ: &str = "VRTDataset rasterXSize rasterYSize SRS dataAxisToSRSAxisMapping GeoTransform VRTRasterBand dataType NoDataValue Offset \
                    Scale SimpleSource ComplexSource SourceFilename relativeToVRT SourceBand SrcRect DstRect xOff yOff xSize ySize NODATA";
/// Those that change no cell, whatever is in them.
const HARMLESS: &str = "band blockXSize blockYSize BlockXSize BlockYSize CategoryNames ColorInterp ColorTable Description Histograms Metadata \
                        name Overview OverviewList resampling shared SourceProperties UnitType";

/// Reads all files of a virtual raster as one.
pub fn read(path: &Path, max_bytes: u64, purpose: Purpose) -> Result<Mosaic, Error> {
    let broken = |reason: String| broken(path, reason);
    // The tree takes several times the memory of its text.
    let bytes = read_file(path, max_bytes / 16)?;
    let text = String::from_utf8_lossy(&bytes);
    let document = Document::parse(&text).map_err(|error| broken(error.to_string()))?;
    let root = document.root_element();
    check(root).map_err(broken)?;
    let (grid, band) = parse(root).map_err(broken)?;
    check_lengths(path, &grid)?;
    let mut whole = Whole::new(grid, max_bytes, purpose).map_err(broken)?;
    whole.tiles.is_last_above = true;
    let mut files = vec![path.to_path_buf()];
    let is_source = |node: &Node<'_, '_>| node.tag_name().name().ends_with("Source");
    for source in band.node.children().filter(is_source) {
        let file = file(source, path);
        let tile = stored(&file, whole.left(max_bytes), Purpose::Values, true)?;
        let put = band.put(source, tile, &mut whole);
        put.map_err(|reason| broken(format!("{}: {reason}", file.display())))?;
        files.push(file);
    }
    // Files may know the system that the document does not name.
    check_lengths(path, &whole.raster.grid)?;
    Ok(whole.finish(&files))
}

/// A file of a virtual raster that is written.
#[derive(Clone, Debug, PartialEq)]
pub struct VrtTile {
    /// Name of the file.
    pub path: PathBuf,
    /// Column and row of its first cell.
    pub at: [usize; 2],
    /// Numbers of columns and rows.
    pub size: [usize; 2],
}

/// A virtual raster of tiles in single precision, NaN without data, all with the same bands. `path` is where the text will be: names of
/// files in its folder are relative.
///
/// The coordinate system is named by its code of EPSG; without one, GDAL takes it from nowhere.
///
/// ```
/// use antumbra_raster::{Grid, Quantity, VrtTile, vrt_text};
///
/// let grid = Grid::north_up([4, 2], [600_000.0, 5_340_000.0], 10.0);
/// let hours = Quantity { name: "hours", unit: "h" };
/// let tile = VrtTile { path: "out/west.tif".into(), at: [0, 0], size: [2, 2] };
/// let text = vrt_text("out/hours.vrt".as_ref(), &grid, &[hours], &[tile]);
/// assert!(text.contains("<SourceFilename relativeToVRT=\"1\">west.tif</SourceFilename>"));
/// ```
pub fn vrt_text(path: &Path, grid: &Grid, bands: &[Quantity<'_>], tiles: &[VrtTile]) -> String {
    let plain = |text: &str| {
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        text.replace('>', "&gt;")
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let transform = grid.transform.map(|number| number.to_string()).join(", ");
    let code = grid.crs.as_ref().and_then(Crs::epsg);
    let system = code.map_or(String::new(), |code| format!("  <SRS>EPSG:{code}</SRS>\n"));
    let mut text = format!(
        "<VRTDataset rasterXSize=\"{}\" rasterYSize=\"{}\">\n{system}  <GeoTransform>{transform}</GeoTransform>\n",
        grid.width, grid.height
    );
    for (number, Quantity { name, unit }) in bands.iter().enumerate() {
        let band = number + 1;
        text += &format!(
            "  <VRTRasterBand dataType=\"Float32\" band=\"{band}\">\n    <Description>{}</Description>\n    \
             <UnitType>{}</UnitType>\n    <NoDataValue>nan</NoDataValue>\n",
            plain(name),
            plain(unit)
        );
        for VrtTile { path, at, size } in tiles {
            let name = path.strip_prefix(folder);
            let is_relative = u8::from(name.is_ok() && path.is_relative() == folder.is_relative());
            let name = plain(&name.unwrap_or(path).to_string_lossy());
            let ([column, row], [columns, rows]) = (at, size);
            text += &format!(
                "    <SimpleSource>\n      <SourceFilename relativeToVRT=\"{is_relative}\">{name}</SourceFilename>\n      \
                 <SourceBand>{band}</SourceBand>\n      \
                 <SrcRect xOff=\"0\" yOff=\"0\" xSize=\"{columns}\" ySize=\"{rows}\"/>\n      \
                 <DstRect xOff=\"{column}\" yOff=\"{row}\" xSize=\"{columns}\" ySize=\"{rows}\"/>\n    </SimpleSource>\n"
            );
        }
        text += "  </VRTRasterBand>\n";
    }
    text + "</VRTDataset>\n"
}

/// Refuses a document with more than windows of files.
fn check(root: Node<'_, '_>) -> Result<(), String> {
    let is_in = |list: &str, name: &str| list.split_whitespace().any(|known| known == name);
    let is_harmless = |node: Node<'_, '_>| is_in(HARMLESS, node.tag_name().name());
    let is_said = |node: &Node<'_, '_>| node.is_element() && !node.ancestors().any(is_harmless);
    for node in root.descendants().filter(is_said) {
        let name = node.tag_name().name();
        if !is_in(READ, name) || name == "SourceBand" && node.text() != Some("1") {
            let text = node.text().unwrap_or_default().trim();
            return Err(not_read(&format!("<{name}>{text}")));
        }
        let mut others = node.attributes();
        if let Some(other) =
            others.find(|one| !is_in(READ, one.name()) && !is_in(HARMLESS, one.name()))
        {
            let (key, value) = (other.name(), other.value());
            return Err(not_read(&format!("{key}=\"{value}\" of <{name}>")));
        }
    }
    let bands = root
        .children()
        .filter(|node| node.has_tag_name("VRTRasterBand"));
    match bands.count() {
        1 => Ok(()),
        bands => Err(format!(
            "found {bands} bands, wanted one; take one with gdal_translate -b 1 in.vrt out.tif"
        )),
    }
}

/// The band, and what its numbers mean.
struct Band<'a> {
    node: Node<'a, 'a>,
    no_data: Option<f64>,
    scale: f64,
    offset: f64,
}

/// Where the cells are, and the band.
fn parse<'a>(root: Node<'a, 'a>) -> Result<(Grid, Band<'a>), String> {
    let place = text(root, "GeoTransform").unwrap_or_default().split(',');
    let place: Vec<f64> = place.map_while(|word| word.trim().parse().ok()).collect();
    let transform = <[f64; 6]>::try_from(place);
    let transform = transform.map_err(|_| "it needs a <GeoTransform> of six numbers")?;
    let size = |key: &str| {
        let found = root.attribute(key).and_then(|text| text.parse().ok());
        found.ok_or_else(|| format!("it needs a number of cells, {key}"))
    };
    let grid = Grid {
        width: size("rasterXSize")?,
        height: size("rasterYSize")?,
        transform: check_transform(transform)?,
        crs: text(root, "SRS").and_then(Crs::from_wkt),
    };
    let node = child(root, "VRTRasterBand").unwrap_or(root);
    let band = Band {
        node,
        no_data: number(node, "NoDataValue")?,
        scale: number(node, "Scale")?.unwrap_or(1.0),
        offset: number(node, "Offset")?.unwrap_or(0.0),
    };
    Ok((grid, band))
}

/// Path of a source.
fn file(source: Node<'_, '_>, path: &Path) -> PathBuf {
    let name = child(source, "SourceFilename");
    let is_beside = name.and_then(|name| name.attribute("relativeToVRT")) == Some("1");
    let folder = path.parent().filter(|_| is_beside).unwrap_or(Path::new(""));
    folder.join(text(source, "SourceFilename").unwrap_or_default())
}

impl Band<'_> {
    /// Puts the window of a source into the whole.
    fn put(
        &self,
        source: Node<'_, '_>,
        mut tile: crate::Raster,
        whole: &mut Whole,
    ) -> Result<(), String> {
        let grid = &mut whole.raster.grid;
        let codes = [&grid.crs, &tile.grid.crs].map(|crs| crs.as_ref().and_then(Crs::epsg));
        if let [Some(said), Some(own)] = codes
            && said != own
        {
            return Err(format!("it is in EPSG:{own}, and the .vrt in EPSG:{said}"));
        }
        grid.crs = tile.grid.crs.take().or(grid.crs.take());
        let from = rectangle(source, "SrcRect", &tile.grid)?;
        let to = rectangle(source, "DstRect", grid)?;
        let [x, y, columns, rows] = from;
        let size = [tile.grid.width as i64, tile.grid.height as i64];
        if from.iter().any(|&cells| cells < 0) || x + columns > size[0] || y + rows > size[1] {
            return Err(format!(
                "the window {from:?} (SrcRect) is not inside of its {size:?} cells"
            ));
        }
        if from[2..] != to[2..] {
            let what = format!(
                "resampling of {columns} x {rows} to {} x {} cells",
                to[2], to[3]
            );
            return Err(not_read(&what));
        }
        // Windows of simple sources are copied with their marks.
        let mark = number(source, "NODATA")?.filter(|_| source.has_tag_name("ComplexSource"));
        let factor = tile.height_factor.unwrap_or(1.0);
        let kind = self.node.attribute("dataType").unwrap_or("Byte");
        // Marks of floats may be written with fewer digits than the pixels have.
        let is = |value: f64, mark: Option<f64>| {
            let is_rounded = |mark: f64| kind == "Float32" && value as f32 == mark as f32;
            mark.is_some_and(|mark| {
                value == mark || is_rounded(mark) || value.is_nan() && mark.is_nan()
            })
        };
        let mut odd = None;
        let height = |stored: f64| {
            if is(stored, mark) {
                return None;
            }
            let value = held(kind, stored);
            if value != stored && kind != "Float32" && !stored.is_nan() {
                odd = odd.or(Some(stored));
            }
            let is_data = value.is_finite() && !is(value, self.no_data);
            let height = factor * (self.scale * value + self.offset);
            Some(if is_data { height } else { f64::NAN })
        };
        let window = from.map(|cells| cells as usize);
        whole.put(&tile, window, [to[0], to[1]], height)?;
        let refused = |odd: f64| not_read(&format!("a cell of {odd} in a band of {kind}"));
        odd.map_or(Ok(()), |odd| Err(refused(odd)))
    }
}

/// A number as a band of some type holds it, NaN in types that are not known.
fn held(kind: &str, value: f64) -> f64 {
    match kind {
        "Byte" => (value as u8).into(),
        "Int8" => (value as i8).into(),
        "UInt16" => (value as u16).into(),
        "Int16" => (value as i16).into(),
        "UInt32" => (value as u32).into(),
        "Int32" => (value as i32).into(),
        "UInt64" => value as u64 as f64,
        "Int64" => value as i64 as f64,
        "Float32" => (value as f32).into(),
        "Float64" => value,
        _ => f64::NAN,
    }
}

/// Column, row, columns and rows of a window in whole cells; all of a grid if a source does not say.
fn rectangle(source: Node<'_, '_>, name: &str, grid: &Grid) -> Result<[i64; 4], String> {
    let mut all = [0, 0, grid.width as i64, grid.height as i64];
    let Some(node) = child(source, name) else {
        return Ok(all);
    };
    for (cells, key) in all.iter_mut().zip(["xOff", "yOff", "xSize", "ySize"]) {
        let found = node.attribute(key).and_then(|text| text.parse().ok());
        let found: f64 = found.ok_or_else(|| format!("<{name}> needs a number {key}"))?;
        let is_whole = (found - found.round()).abs() <= 1e-6 && found.abs() < 1e12;
        if !is_whole {
            let what = format!("a part of a cell, {key} {found} of <{name}>,");
            return Err(not_read(&what));
        }
        *cells = found.round() as i64;
    }
    Ok(all)
}

fn child<'a, 'b>(node: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// Text of an element.
fn text<'a>(node: Node<'a, '_>, name: &str) -> Option<&'a str> {
    child(node, name)?.text().map(str::trim)
}

/// Number in an element.
fn number(node: Node<'_, '_>, name: &str) -> Result<Option<f64>, String> {
    let wrong = |text: &str| format!("<{name}>: found `{text}`, wanted a number");
    let parse = |text: &str| text.parse().map_err(|_| wrong(text));
    text(node, name).map(parse).transpose()
}

/// Why something is refused, and what helps.
pub fn not_read(what: &str) -> String {
    format!(
        "{what} is not read in a .vrt; write its cells to a file first, with gdal_translate in.vrt out.tif"
    )
}
