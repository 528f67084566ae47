//! Drawings as PDF files.

use std::collections::BTreeMap;
use std::io::Write as _;

use antumbra_image::Rgb8Image;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use subsetter::GlyphRemapper;

use crate::drawing::{Colour, Drawing, Item, Text, Weight};
use crate::{Error, font};

/// Points of PDF in a pixel, of which an inch has 96.
const POINT: f32 = 0.75;

/// Glyphs are named by numbers of their own, without a language (ISO 32000-1, 9.7.3).
const IDENTITY: SystemInfo<'static> = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
};

/// Number of objects before the pictures: catalogue, pages, page, contents, information, and five for each of two fonts.
const BEFORE_PICTURES: i32 = 5 + 2 * 5;

/// Letters of a font that a file uses.
struct Font {
    weight: Weight,
    /// New numbers of glyphs. Number 0 is the box of missing characters.
    glyphs: GlyphRemapper,
    /// Character and width, in thousandths of an em, of new numbers.
    letters: BTreeMap<u16, (char, f32)>,
}

impl Font {
    fn new(weight: Weight) -> Self {
        Self {
            weight,
            glyphs: GlyphRemapper::new(),
            letters: BTreeMap::new(),
        }
    }

    fn name(&self) -> Name<'static> {
        match self.weight {
            Weight::Regular => Name(b"F0"),
            Weight::Bold => Name(b"F1"),
        }
    }

    /// The glyphs of a text, two bytes each.
    fn encode(&mut self, text: &str) -> Vec<u8> {
        let face = font::face(self.weight);
        let mut bytes = Vec::with_capacity(2 * text.len());
        for c in text.chars() {
            let glyph = font::glyph(face, c);
            let number = self.glyphs.remap(glyph.0);
            let advance = f32::from(face.glyph_hor_advance(glyph).unwrap_or(0));
            let width = 1000.0 * advance / f32::from(face.units_per_em());
            self.letters.insert(number, (c, width));
            bytes.extend(number.to_be_bytes());
        }
        bytes
    }

    /// Writes the font with the objects `first` to `first + 4`.
    fn write(&self, pdf: &mut Pdf, first: i32) -> Result<(), Error> {
        let [whole, letters, descriptor, file, unicode] =
            [0, 1, 2, 3, 4].map(|i| Ref::new(first + i));
        let face = font::face(self.weight);
        // A mark of six letters says that the font is a part.
        let base = match self.weight {
            Weight::Regular => Name(b"MAPREG+NotoSans-Regular"),
            Weight::Bold => Name(b"MAPBLD+NotoSans-Bold"),
        };
        pdf.type0_font(whole)
            .base_font(base)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(letters)
            .to_unicode(unicode);
        let mut cid = pdf.cid_font(letters);
        cid.subtype(CidFontType::Type2)
            .base_font(base)
            .system_info(IDENTITY)
            .font_descriptor(descriptor)
            .default_width(0.0)
            .cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = cid.widths();
        for (&number, &(_, width)) in &self.letters {
            widths.consecutive(number, [width]);
        }
        widths.finish();
        cid.finish();
        let scale = 1000.0 / f32::from(face.units_per_em());
        let bounds = face.global_bounding_box();
        let [x0, y0, x1, y1] =
            [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(|x| scale * f32::from(x));
        let cap_height = face.capital_height().unwrap_or(face.ascender());
        pdf.font_descriptor(descriptor)
            .name(base)
            .flags(FontFlags::NON_SYMBOLIC)
            .bbox(Rect::new(x0, y0, x1, y1))
            .italic_angle(0.0)
            .ascent(scale * f32::from(face.ascender()))
            .descent(scale * f32::from(face.descender()))
            .cap_height(scale * f32::from(cap_height))
            .stem_v(match self.weight {
                Weight::Regular => 80.0,
                Weight::Bold => 140.0,
            })
            .font_file2(file);
        let part = subsetter::subset(font::bytes(self.weight), 0, &self.glyphs);
        let part = part.map_err(|error| Error::Font(error.to_string()))?;
        let packed = compressed(&part)?;
        pdf.stream(file, &packed)
            .filter(Filter::FlateDecode)
            .pair(Name(b"Length1"), part.len() as i32);
        let mut map = UnicodeCmap::new(Name(b"Letters"), IDENTITY);
        for (&number, &(c, _)) in &self.letters {
            map.pair(number, c);
        }
        pdf.cmap(unicode, &map.finish());
        Ok(())
    }
}

/// The bytes of a file.
pub(crate) fn write(drawing: &Drawing) -> Result<Vec<u8>, Error> {
    let [catalogue, pages, page, contents, information] = [1, 2, 3, 4, 5].map(Ref::new);
    let picture = |index: usize| Ref::new(BEFORE_PICTURES + 1 + index as i32);
    let [width, height] = [drawing.width, drawing.height].map(|side| POINT * side as f32);
    let Painted {
        content,
        fonts,
        pictures,
    } = Painted::new(drawing, height);
    let mut pdf = Pdf::new();
    pdf.catalog(catalogue).pages(pages);
    pdf.pages(pages).kids([page]).count(1);
    pdf.document_info(information)
        .title(TextStr(&drawing.title))
        .producer(TextStr("Antumbra"));
    let mut sheet = pdf.page(page);
    sheet.media_box(Rect::new(0.0, 0.0, width, height));
    sheet.parent(pages).contents(contents);
    let mut resources = sheet.resources();
    let mut known = resources.x_objects();
    for (index, (name, _)) in pictures.iter().enumerate() {
        known.pair(Name(name.as_bytes()), picture(index));
    }
    known.finish();
    let used = fonts.iter().zip([6, 11]);
    let used = used.filter(|(font, _)| !font.letters.is_empty());
    let mut known = resources.fonts();
    for (font, first) in used.clone() {
        known.pair(font.name(), Ref::new(first));
    }
    known.finish();
    resources.finish();
    sheet.finish();
    for (font, first) in used {
        font.write(&mut pdf, first)?;
    }
    for (index, (_, image)) in pictures.iter().enumerate() {
        let bytes = compressed(image.pixels().as_flattened())?;
        let mut object = pdf.image_xobject(picture(index), &bytes);
        object.filter(Filter::FlateDecode);
        object
            .width(image.width() as i32)
            .height(image.height() as i32)
            .bits_per_component(8);
        object.color_space().device_rgb();
    }
    pdf.stream(contents, &compressed(&content.finish())?)
        .filter(Filter::FlateDecode);
    Ok(pdf.finish())
}

/// The items of a drawing as operators of a page, with what they use.
struct Painted<'a> {
    content: Content,
    fonts: [Font; 2],
    /// Names of pictures.
    pictures: Vec<(String, &'a Rgb8Image)>,
}

impl<'a> Painted<'a> {
    /// Paints all items on a page of some height in points.
    fn new(drawing: &'a Drawing, height: f32) -> Self {
        let mut painted = Self {
            content: Content::new(),
            fonts: [Weight::Regular, Weight::Bold].map(Font::new),
            pictures: Vec::new(),
        };
        // From here on in pixels, with y downwards.
        let content = &mut painted.content;
        content.transform([POINT, 0.0, 0.0, -POINT, 0.0, height]);
        drawing.items.iter().for_each(|item| painted.add(item));
        painted
    }

    fn add(&mut self, item: &'a Item) {
        let content = &mut self.content;
        match item {
            Item::Polygon { corners, fill } => {
                colour(content, *fill);
                polygon(content, corners);
                content.fill_nonzero();
            }
            Item::Outline {
                corners,
                colour,
                width,
            } => {
                let [r, g, b] = colour.map(|x| f32::from(x) / 255.0);
                content.set_stroke_rgb(r, g, b).set_line_width(*width);
                polygon(content, corners);
                content.stroke();
            }
            Item::Text(found) => {
                let [regular, bold] = &mut self.fonts;
                let font = match found.weight {
                    Weight::Regular => regular,
                    Weight::Bold => bold,
                };
                text(content, found, font);
            }
            Item::Picture { image, at, size } => {
                let name = format!("P{}", self.pictures.len());
                // A picture is a square of size 1 with its top at 1.
                content
                    .save_state()
                    .transform([size[0], 0.0, 0.0, -size[1], at[0], at[1] + size[1]])
                    .x_object(Name(name.as_bytes()))
                    .restore_state();
                self.pictures.push((name, image));
            }
        }
    }
}

fn colour(content: &mut Content, colour: Colour) {
    let [r, g, b] = colour.map(|x| f32::from(x) / 255.0);
    content.set_fill_rgb(r, g, b);
}

fn polygon(content: &mut Content, corners: &[[f32; 2]]) {
    for (index, &[x, y]) in corners.iter().enumerate() {
        match index {
            0 => content.move_to(x, y),
            _ => content.line_to(x, y),
        };
    }
    content.close_path();
}

fn text(content: &mut Content, text: &Text, font: &mut Font) {
    let before = text.anchor.share() * font::width(&text.text, text.size, text.weight);
    colour(content, text.colour);
    let glyphs = font.encode(&text.text);
    content
        .begin_text()
        .set_font(font.name(), text.size)
        // Letters stand upright although y points down.
        .set_text_matrix([1.0, 0.0, 0.0, -1.0, text.at[0] - before, text.at[1]])
        .show(Str(&glyphs))
        .end_text();
}

fn compressed(bytes: &[u8]) -> Result<Vec<u8>, Error> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.map_err(|error| Error::Font(error.to_string()))
}
