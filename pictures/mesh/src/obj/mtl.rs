//! Statements of `.mtl` files.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use antumbra_scene::{Rgb, Wrap};
use glam::Vec2;

use super::scan::{self, Mistakes, number, words};
use crate::Model;

/// A material as its file has it. `None` is not given.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    pub name: String,
    pub kd: Option<Rgb>,
    pub ks: Option<Rgb>,
    pub ke: Option<Rgb>,
    /// Transmission filter.
    pub tf: Option<Rgb>,
    /// Exponent of the highlight.
    pub ns: Option<f32>,
    /// Index of refraction.
    pub ni: Option<f32>,
    /// Opacity.
    pub d: Option<f32>,
    /// Transparency: 1 minus the opacity. Not part of the format's specification.
    pub tr: Option<f32>,
    /// Statement that says how clear the material is, with its place.
    pub clear_at: Option<String>,
    pub illum: Option<u32>,
    pub roughness: Option<f32>,
    pub metallic: Option<f32>,
    pub map_kd: Option<Map>,
    pub map_ks: Option<Map>,
    pub map_ke: Option<Map>,
    pub map_d: Option<Map>,
    pub bump: Option<Map>,
    pub normal: Option<Map>,
    pub map_roughness: Option<Map>,
    pub map_metallic: Option<Map>,
}

/// An image with its options.
#[derive(Clone, Debug)]
pub(super) struct Map {
    pub path: PathBuf,
    /// File and place of the statement, for errors.
    pub library: PathBuf,
    pub line: usize,
    pub column: usize,
    pub name: String,
    pub scale: Vec2,
    pub offset: Vec2,
    pub wrap: Wrap,
    /// Factor of bumps.
    pub strength: f32,
}

/// Statements without a meaning for a picture made of light: ambient colour, sharpness of reflection maps, antialiasing.
const SILENT: &[&str] = &["Ka", "map_Ka", "sharpness", "map_aat", "aniso", "anisor"];

/// Reads the materials of a file. Statements that cannot be read are left out with warnings.
pub(super) fn parse(
    bytes: &[u8],
    path: &Path,
    model: &mut Model,
    mistakes: &mut Mistakes,
) -> Vec<Mtl> {
    let mut all: Vec<Mtl> = Vec::new();
    for (line_number, text) in scan::lines(bytes) {
        let text = &*text;
        let all_words: Vec<(usize, &[u8])> = words(text).collect();
        let Some(&(column, first)) = all_words.first() else {
            continue;
        };
        let word = String::from_utf8_lossy(first).into_owned();
        if word == "newmtl" {
            let name = scan::text_after(text, column + first.len());
            all.push(Mtl {
                name,
                ..Mtl::default()
            });
            continue;
        }
        let mut wrong = |column: usize, text: String| {
            mistakes.warn_of_file(path, line_number, column, text);
        };
        let Some(mtl) = all.last_mut() else {
            let text = format!("there is no `newmtl` before it; `{word}` is left out");
            wrong(column, text);
            continue;
        };
        let mut statement = Statement {
            word: &word,
            words: &all_words[1..],
            place: (path, line_number, column),
            wrong: &mut wrong,
        };
        statement.read(text, mtl, model);
    }
    for mtl in &all {
        if let (Some(d), Some(tr), Some(at)) = (mtl.d, mtl.tr, &mtl.clear_at)
            && (d - (1.0 - tr)).abs() > 1e-3
        {
            model.note(format!(
                "`d` and `Tr` of a material contradict each other ({at}, but `Tr {tr}`); `d` counts"
            ));
            break;
        }
    }
    all
}

/// A statement in backticks, with its place.
fn said(line: &[u8], path: &Path, number: usize, column: usize) -> String {
    let text = String::from_utf8_lossy(line);
    let path = path.display();
    format!("`{}` in {path}:{number}:{column}", text.trim())
}

impl Mtl {
    /// Opacity, from `d` or else from `Tr`.
    pub fn opacity(&self) -> f32 {
        let clear = self.tr.map(|clear| 1.0 - clear);
        self.d.or(clear).unwrap_or(1.0)
    }
}

/// A statement with the words behind the first one.
struct Statement<'a> {
    word: &'a str,
    words: &'a [(usize, &'a [u8])],
    /// File, line and column.
    place: (&'a Path, usize, usize),
    /// Warns of a place in the line.
    wrong: &'a mut dyn FnMut(usize, String),
}

impl Statement<'_> {
    /// Sets what the statement says of a material. `line` is its whole text.
    fn read(&mut self, line: &[u8], mtl: &mut Mtl, model: &mut Model) {
        let (path, number, column) = self.place;
        match self.word {
            "Kd" => mtl.kd = self.color(),
            "Ks" => mtl.ks = self.color(),
            "Ke" => mtl.ke = self.color(),
            "Tf" => mtl.tf = self.color(),
            "Ns" => mtl.ns = self.number(),
            "Ni" => mtl.ni = self.number(),
            "d" => {
                if let Some((_, b"-halo")) = self.words.first() {
                    self.words = &self.words[1..];
                    model.note("`d -halo` is taken as `d`");
                }
                mtl.d = self.number();
                mtl.clear_at = Some(said(line, path, number, column));
            }
            "Tr" => {
                mtl.tr = self.number();
                let at = || said(line, path, number, column);
                mtl.clear_at.get_or_insert_with(at);
            }
            "illum" => mtl.illum = self.number().map(|kind| kind as u32),
            "Pr" => mtl.roughness = self.number(),
            "Pm" => mtl.metallic = self.number(),
            "map_Kd" => mtl.map_kd = self.map(),
            "map_Ks" => mtl.map_ks = self.map(),
            "map_Ke" => mtl.map_ke = self.map(),
            "map_d" => mtl.map_d = self.map(),
            "map_Tr" => {
                model.note("`map_Tr` is taken as `map_d`");
                mtl.map_d = self.map();
            }
            "map_Bump" | "map_bump" | "bump" | "Bump" => mtl.bump = self.map(),
            "norm" | "map_Kn" => mtl.normal = self.map(),
            "map_Pr" => mtl.map_roughness = self.map(),
            "map_Pm" => mtl.map_metallic = self.map(),
            word if SILENT.contains(&word) => {}
            word => {
                let text = format!("`{word}` is unknown or not supported, and is left out");
                (self.wrong)(column, text);
            }
        }
    }

    /// Warns that the statement cannot be read, and why.
    fn leave_out(&mut self, column: usize, reason: impl Display) {
        (self.wrong)(column, format!("{reason}; `{}` is left out", self.word));
    }

    fn number(&mut self) -> Option<f32> {
        let Some(&(column, word)) = self.words.first() else {
            self.leave_out(self.place.2, "a number is needed here");
            return None;
        };
        let found = number::<f32>(word).filter(|number| number.is_finite());
        if found.is_none() {
            let word = String::from_utf8_lossy(word);
            self.leave_out(column, format!("`{word}` is not a finite number"));
        }
        found
    }

    /// Three numbers, or one for all three.
    fn color(&mut self) -> Option<Rgb> {
        if let Some((column, word @ (b"spectral" | b"xyz"))) = self.words.first() {
            let word = String::from_utf8_lossy(word);
            self.leave_out(*column, format!("colours as `{word}` are not supported"));
            return None;
        }
        let all = self.words;
        let red = self.number()?;
        if all.len() < 3 {
            return Some(Rgb::splat(red));
        }
        self.words = &all[1..];
        let green = self.number()?;
        self.words = &all[2..];
        let blue = self.number()?;
        Some(Rgb::new(red, green, blue))
    }

    /// An image: options, then the rest of the line as its name.
    fn map(&mut self) -> Option<Map> {
        let (library, line, column) = self.place;
        let mut map = Map {
            path: PathBuf::new(),
            library: library.to_path_buf(),
            line,
            column,
            name: String::new(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            wrap: Wrap::Repeat,
            strength: 1.0,
        };
        let mut words = self.words;
        while let [(column, option), rest @ ..] = words {
            if !option.starts_with(b"-") {
                break;
            }
            let numbers = rest.iter().map_while(|(_, word)| number::<f32>(word));
            let numbers: Vec<f32> = numbers.take(3).collect();
            let mut used = numbers.len();
            match (*option, &numbers[..]) {
                (b"-bm", [strength, ..]) => (map.strength, used) = (*strength, 1),
                (b"-s", [u, rest @ ..]) => {
                    map.scale = Vec2::new(*u, rest.first().copied().unwrap_or(1.0));
                }
                (b"-o", [u, rest @ ..]) => {
                    map.offset = Vec2::new(*u, rest.first().copied().unwrap_or(0.0));
                }
                (b"-clamp", []) => {
                    if rest.first().is_some_and(|(_, word)| *word == b"on") {
                        map.wrap = Wrap::Clamp;
                    }
                    used = 1;
                }
                (b"-mm", [_, _, ..]) => used = 2,
                (b"-boost" | b"-texres", [_, ..]) => used = 1,
                (b"-t", [_, ..]) => {}
                (b"-blendu" | b"-blendv" | b"-cc" | b"-imfchan" | b"-type", _) => used = 1,
                _ => {
                    let option = String::from_utf8_lossy(option);
                    let reason = format!("option `{option}` is unknown or lacks its value");
                    self.leave_out(*column, reason);
                    return None;
                }
            }
            words = rest.get(used..).unwrap_or_default();
        }
        let Some(&(column, _)) = words.first() else {
            self.leave_out(self.place.2, "the name of an image is needed here");
            return None;
        };
        let names = words.iter().map(|(_, w)| String::from_utf8_lossy(w));
        let names: Vec<_> = names.collect();
        map.name = names.join(" ");
        map.column = column;
        let folder = library.parent().unwrap_or(Path::new(""));
        map.path = folder.join(map.name.replace('\\', "/"));
        Some(map)
    }
}
