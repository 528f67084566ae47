//! Header of a PLY file: the format, and the elements with their properties.

use super::{Fault, PlyPlace};
use crate::params::shorten;

/// Bytes of a triangle.
const PER_TRIANGLE: u64 = 4 * 3;

/// Format of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a single value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Size in a binary file in bytes.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// Type of a property: a single value or a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub name: String,
    pub kind: Kind,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
    /// Line of the file that declares the element.
    pub line: u64,
}

impl Element {
    /// Least size of an element in bytes, with empty lists and, in ASCII files, numbers of one digit.
    pub fn min_size(&self, format: Format) -> u64 {
        let sizes = self.properties.iter().map(|p| match (format, p.kind) {
            (Format::Ascii, _) => 2,
            (_, Kind::Scalar(scalar)) => scalar.size() as u64,
            (_, Kind::List { count, .. }) => count.size() as u64,
        });
        sizes.sum()
    }

    /// Returns true if all elements have an equal size in a binary file.
    pub fn has_fixed_size(&self) -> bool {
        let is_scalar = |p: &Property| matches!(p.kind, Kind::Scalar(_));
        self.properties.iter().all(is_scalar)
    }

    /// Index of the property with the given name.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name)
    }
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub format: Format,
    pub elements: Vec<Element>,
    /// The first line that is not read. Some writers forget that a line is a comment.
    pub unknown: Option<Fault>,
    /// Offset of the first byte after the header.
    pub body: usize,
    /// Line number of the first line after the header.
    pub body_line: u64,
}

impl Header {
    /// Checks that the mesh takes at most so many bytes: positions, normals, texture coordinates, and two triangles of
    /// every face. Returns how many triangles these bytes hold.
    pub fn check_memory(&self, max_bytes: u64) -> Result<u64, Fault> {
        let of = |name: &str, each: u64| {
            let element = self.element(name);
            element.map_or(0, |element| element.count.saturating_mul(each))
        };
        let vertices = of("vertex", 4 * 8);
        let needed = vertices.saturating_add(of("face", 2 * PER_TRIANGLE));
        if needed <= max_bytes {
            return Ok((max_bytes - vertices) / PER_TRIANGLE);
        }
        let message = format!(
            "the mesh needs {needed} bytes of memory, more than the {max_bytes} bytes that are allowed"
        );
        Err(Fault::at_line(1, message))
    }

    pub fn element(&self, name: &str) -> Option<&Element> {
        self.elements.iter().find(|e| e.name == name)
    }
}

/// Lines of a header, for any kind of line ends.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
    end: u8,
}

impl<'a> Lines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let first_end = bytes.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let end = match first_end {
            // Lone CRs are the line ends of very old files.
            Some(i) if bytes[i] == b'\r' && bytes.get(i + 1) != Some(&b'\n') => b'\r',
            _ => b'\n',
        };
        Self {
            bytes,
            at: bytes.len() - antumbra_scene::without_mark(bytes).len(),
            line: 0,
            end,
        }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|r| !r.is_empty())?;
        let length = rest.iter().position(|b| *b == self.end);
        self.at += length.map_or(rest.len(), |l| l + 1);
        self.line += 1;
        Some(rest[..length.unwrap_or(rest.len())].trim_ascii())
    }
}

pub(super) fn parse(bytes: &[u8]) -> Result<Header, Fault> {
    let mut lines = Lines::new(bytes);
    if lines.next() != Some(b"ply") {
        return Err(Fault::at_line(1, "the file is not a PLY file")
            .help("a PLY file begins with a line that says ply"));
    }
    let (mut format, mut unknown) = (None, None);
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let Some(line) = lines.next() else {
            return Err(Fault::at_line(lines.line, "the file ends in its header")
                .help("a header ends with a line that says end_header"));
        };
        let place = PlyPlace::Line(lines.line);
        let line = String::from_utf8_lossy(line);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words[..] {
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, version] => format = Some(parse_format(name, version, place)?),
            ["element", name, count] => {
                let count = count
                    .parse()
                    .map_err(|_| Fault::new(place, format!("{} is not a count", shorten(count))))?;
                if elements.iter().any(|e| e.name == name) {
                    let message = format!("element {} is declared twice", shorten(name));
                    return Err(Fault::new(place, message));
                }
                elements.push(Element {
                    name: name.to_owned(),
                    count,
                    properties: Vec::new(),
                    line: lines.line,
                });
            }
            ["property", ref rest @ ..] => {
                let property = parse_property(rest, place)?;
                let Some(element) = elements.last_mut() else {
                    return Err(Fault::new(place, "a property comes before any element"));
                };
                element.properties.push(property);
            }
            _ => {
                let message = format!("unknown header line: {}", shorten(&line));
                unknown.get_or_insert_with(|| {
                    let help = "known: format, element, property, comment, obj_info, end_header";
                    Fault::new(place, message).help(help)
                });
            }
        }
    }
    let format = format.ok_or_else(|| {
        Fault::at_line(lines.line, "the header has no format line")
            .help("such as format binary_little_endian 1.0")
    })?;
    Ok(Header {
        format,
        elements,
        unknown,
        body: lines.at,
        body_line: lines.line + 1,
    })
}

fn parse_format(name: &str, version: &str, place: PlyPlace) -> Result<Format, Fault> {
    if version != "1.0" {
        let message = format!("PLY version {} is not known", shorten(version));
        return Err(Fault::new(place, message).help("the version is 1.0"));
    }
    match name {
        "ascii" => Ok(Format::Ascii),
        "binary_little_endian" => Ok(Format::LittleEndian),
        "binary_big_endian" => Ok(Format::BigEndian),
        _ => Err(
            Fault::new(place, format!("unknown format {}", shorten(name)))
                .help("known: ascii, binary_little_endian, binary_big_endian"),
        ),
    }
}

fn parse_property(words: &[&str], place: PlyPlace) -> Result<Property, Fault> {
    let scalar = |name: &str| {
        Scalar::from_name(name).ok_or_else(|| {
            Fault::new(place, format!("unknown property type {}", shorten(name)))
                .help("known: char, uchar, short, ushort, int, uint, float, double")
        })
    };
    match *words {
        ["list", count, item, name] => {
            let count = scalar(count)?;
            if !count.is_integer() {
                return Err(Fault::new(place, "the length of a list must be an integer"));
            }
            Ok(Property {
                name: name.to_owned(),
                kind: Kind::List {
                    count,
                    item: scalar(item)?,
                },
            })
        }
        [kind, name] => Ok(Property {
            name: name.to_owned(),
            kind: Kind::Scalar(scalar(kind)?),
        }),
        _ => Err(Fault::new(place, "the property has the wrong form")
            .help("write property TYPE NAME, or property list TYPE TYPE NAME")),
    }
}
