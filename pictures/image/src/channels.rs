//! Layers beside the colours of an EXR file, and notes in it.

/// A channel beside red, green and blue.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name, such as `Albedo.R` or `Z`.
    pub name: String,
    /// Values of the window, row by row, top row first.
    pub values: Vec<f32>,
}

/// Sentences about a picture, kept in the attribute `comments` of an EXR file: one `name: value` per line.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Notes(pub Vec<(String, String)>);

impl Notes {
    /// The text of the attribute.
    pub(crate) fn text(&self) -> String {
        let lines = self
            .0
            .iter()
            .map(|(name, value)| format!("{name}: {value}"));
        let text = lines.collect::<Vec<_>>().join("\n");
        // Texts of EXR files hold single bytes.
        let ascii = |c: char| if c.is_ascii() { c } else { '?' };
        text.chars().map(ascii).collect()
    }
}
