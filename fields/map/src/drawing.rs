//! Drawings: lists of shapes and text that every file format is made of.

use antumbra_image::Rgb8Image;

use crate::{Error, pdf, pixels, svg};

/// A colour of sRGB.
pub(crate) type Colour = [u8; 3];

/// A drawing. Lengths are pixels, x to the right and y downwards.
#[derive(Clone, Debug)]
pub struct Drawing {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Title of the file.
    pub(crate) title: String,
    /// Shapes, the lowest first.
    pub(crate) items: Vec<Item>,
}

/// A part of a drawing.
#[derive(Clone, Debug)]
pub(crate) enum Item {
    /// A filled polygon.
    Polygon {
        corners: Vec<[f32; 2]>,
        fill: Colour,
    },
    /// A polygon's outline, closed.
    Outline {
        corners: Vec<[f32; 2]>,
        colour: Colour,
        width: f32,
    },
    /// A line of text.
    Text(Text),
    /// A picture, stretched over a rectangle.
    Picture {
        image: Rgb8Image,
        at: [f32; 2],
        size: [f32; 2],
    },
}

/// A line of text.
#[derive(Clone, Debug)]
pub(crate) struct Text {
    pub text: String,
    /// Place of the anchor, on the base line.
    pub at: [f32; 2],
    pub size: f32,
    pub weight: Weight,
    pub anchor: Anchor,
    pub colour: Colour,
}

/// Weight of a font.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Weight {
    Regular,
    Bold,
}

/// Part of a line of text that is at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    /// Share of the width of a text that is before its place.
    pub fn share(self) -> f32 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
}

/// Corners of a rectangle.
pub(crate) fn rectangle([x, y]: [f32; 2], [width, height]: [f32; 2]) -> Vec<[f32; 2]> {
    vec![
        [x, y],
        [x + width, y],
        [x + width, y + height],
        [x, y + height],
    ]
}

impl Drawing {
    /// Width and height in pixels. Files of other formats give 96 pixels an inch.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The drawing as pixels.
    ///
    /// # Errors
    /// [`Error::Image`] if there is no memory.
    pub fn pixels(&self) -> Result<Rgb8Image, Error> {
        pixels::draw(self)
    }

    /// The drawing as the text of an SVG file. Text stays text, and pictures are embedded as PNG.
    ///
    /// # Errors
    /// [`Error::Image`] if a picture cannot be encoded.
    pub fn svg(&self) -> Result<String, Error> {
        svg::write(self)
    }

    /// The drawing as the bytes of a PDF file of one page, 96 pixels an inch. Text can be searched and copied, and the
    /// letters that are used are embedded. The same drawing gives the same bytes.
    ///
    /// # Errors
    /// [`Error::Font`] if the font cannot be embedded.
    pub fn pdf(&self) -> Result<Vec<u8>, Error> {
        pdf::write(self)
    }
}
