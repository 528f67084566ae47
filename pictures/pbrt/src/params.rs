//! Parameter lists: `"type name" value` or `"type name" [values]`.
//!
//! Values are read by the declared type, so a wrong value is reported at its own place. [`crate::lookup`] then looks
//! up the parameters that a directive knows.

use glam::DVec3;

use crate::lexer::{Lexer, Token, TokenKind, unquote};
use crate::number::{NumberError, parse_float, parse_integer};
use crate::report::Report;
use crate::source::Span;
use crate::{directive, suggest};

/// Declared type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ParamType {
    Integer,
    Float,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    String,
    Bool,
    Texture,
    Rgb,
    Xyz,
    Spectrum,
    Blackbody,
}

/// Spellings of all types. Messages use the first spelling of a type.
const TYPE_NAMES: &[(&str, ParamType)] = &[
    ("integer", ParamType::Integer),
    ("float", ParamType::Float),
    ("point2", ParamType::Point2),
    ("vector2", ParamType::Vector2),
    ("point", ParamType::Point3),
    ("point3", ParamType::Point3),
    ("vector", ParamType::Vector3),
    ("vector3", ParamType::Vector3),
    ("normal", ParamType::Normal),
    ("string", ParamType::String),
    ("bool", ParamType::Bool),
    ("texture", ParamType::Texture),
    ("rgb", ParamType::Rgb),
    ("color", ParamType::Rgb),
    ("xyz", ParamType::Xyz),
    ("spectrum", ParamType::Spectrum),
    ("blackbody", ParamType::Blackbody),
];

impl ParamType {
    /// Name of the type in files.
    pub fn name(self) -> &'static str {
        TYPE_NAMES
            .iter()
            .find(|(_, t)| *t == self)
            .map_or("", |(name, _)| name)
    }

    /// Number of values per item of the type.
    fn group(self) -> usize {
        match self {
            Self::Point2 | Self::Vector2 => 2,
            Self::Point3 | Self::Vector3 | Self::Normal | Self::Rgb | Self::Xyz => 3,
            _ => 1,
        }
    }
}

/// Values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    Integers(Vec<i32>),
    Floats(Vec<f32>),
    /// Coordinates of points, which may be large.
    Points(Vec<f64>),
    Strings(Vec<String>),
    Bools(Vec<bool>),
    /// Values with a mistake that has been reported.
    Broken,
}

impl Values {
    /// The values, if they are integers.
    pub fn integers(&self) -> Option<&[i32]> {
        match self {
            Self::Integers(values) => Some(values),
            _ => None,
        }
    }

    /// The values, if they are numbers but no coordinates of points.
    pub fn floats(&self) -> Option<&[f32]> {
        match self {
            Self::Floats(values) => Some(values),
            _ => None,
        }
    }

    /// The values, if they are numbers, in double precision.
    pub fn doubles(&self) -> Option<Vec<f64>> {
        match self {
            Self::Points(values) => Some(values.clone()),
            Self::Floats(values) => Some(values.iter().copied().map(f64::from).collect()),
            _ => None,
        }
    }

    /// The values, if they are strings.
    pub fn strings(&self) -> Option<&[String]> {
        match self {
            Self::Strings(values) => Some(values),
            _ => None,
        }
    }

    /// The values, if they are true or false.
    pub fn bools(&self) -> Option<&[bool]> {
        match self {
            Self::Bools(values) => Some(values),
            _ => None,
        }
    }

    /// The points, if the values are points.
    pub fn points(&self) -> Option<impl ExactSizeIterator<Item = DVec3>> {
        match self {
            Self::Points(values) => Some(values.chunks_exact(3).map(DVec3::from_slice)),
            _ => None,
        }
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Integers(v) => v.len(),
            Self::Floats(v) => v.len(),
            Self::Points(v) => v.len(),
            Self::Strings(v) => v.len(),
            Self::Bools(v) => v.len(),
            Self::Broken => 0,
        }
    }
}

/// Parameter with its values and their places.
#[derive(Clone, Debug)]
pub(crate) struct Param {
    pub param_type: ParamType,
    pub name: String,
    /// Place of the quoted declaration.
    pub declaration: Span,
    pub values: Values,
    /// Place of the value, or of the bracket that opens the list.
    pub list: Span,
    /// Place of the first value, or of the bracket if the list is empty.
    pub value: Span,
    /// Whether an `Attribute` gives the value. Directives without such a parameter leave the value out.
    pub is_attribute: bool,
}

impl Param {
    /// Place of a value. The list is read again, so that long lists need not store places.
    pub fn value_span(&self, index: usize, report: &mut Report) -> Span {
        let mut lexer = Lexer::at(report, self.list);
        let mut tokens = std::iter::from_fn(|| lexer.next(report))
            .filter(|t| matches!(t.kind, TokenKind::Word | TokenKind::Text));
        tokens.nth(index).map_or(self.list, |token| token.span)
    }
}

/// Parameters of one directive.
#[derive(Clone, Debug, Default)]
pub(crate) struct Params {
    pub list: Vec<Param>,
}

/// Largest number of parameters of a directive, several times more than any directive knows.
const MAX_PARAMS: usize = 500;

/// Reads parameters up to the first token that does not begin a parameter. `None`: a mistake was reported, and the parser continues
/// at the next directive.
pub(crate) fn parse(lexer: &mut Lexer, report: &mut Report) -> Option<Params> {
    let mut params = Params::default();
    while let Some(token) = lexer.peek(report) {
        match token.kind {
            TokenKind::Text => {}
            TokenKind::Broken => return None,
            _ => break,
        }
        lexer.next(report);
        let declared = declaration(lexer.slice(token), token.span, report);
        let wanted = declared.as_ref().map(|(param_type, _)| *param_type);
        let (values, list, value) = read_values(lexer, report, token, wanted)?;
        if let Some((param_type, name)) = declared {
            params.add(
                Param {
                    param_type,
                    name,
                    declaration: token.span,
                    values,
                    list,
                    value,
                    is_attribute: false,
                },
                report,
            );
        }
    }
    Some(params)
}

impl Params {
    /// Adds further parameters of the same directive.
    pub fn extend(&mut self, more: Self, report: &mut Report) {
        for param in more.list {
            self.add(param, report);
        }
    }

    /// Adds the parameters of an `Attribute` of other names than those that are given.
    pub fn fill(&mut self, attributes: &Self) {
        let mut given: Vec<Param> = Vec::new();
        for param in &attributes.list {
            if self.list.iter().all(|own| own.name != param.name) {
                given.push(Param {
                    is_attribute: true,
                    ..param.clone()
                });
            }
        }
        self.list.extend(given);
    }

    /// Adds a parameter. An earlier one with the same name and type is replaced, as in pbrt.
    fn add(&mut self, param: Param, report: &mut Report) {
        let is_same = |p: &Param| p.name == param.name && p.param_type == param.param_type;
        if let Some(index) = self.list.iter().position(is_same) {
            let message = format!("parameter {:?} is given twice, the last counts", param.name);
            report.note(param.declaration, message);
            self.list[index] = param;
        } else if self.list.len() == MAX_PARAMS {
            let message = format!("the directive has more than {MAX_PARAMS} parameters");
            report.error_once(param.declaration, message, None);
        } else {
            self.list.push(param);
        }
    }
}

/// Splits a declaration `"type name"`. `None`: a mistake was reported.
fn declaration(quoted: &[u8], span: Span, report: &mut Report) -> Option<(ParamType, String)> {
    let text = unquote(quoted, span, report);
    let mut words = text.split_ascii_whitespace();
    let (Some(type_name), Some(name), None) = (words.next(), words.next(), words.next()) else {
        let message = format!("{text:?} does not declare a parameter");
        let help = "write a type and a name, as in \"float fov\"";
        report.error_help(span, message, help);
        return None;
    };
    match TYPE_NAMES.iter().find(|(known, _)| *known == type_name) {
        Some((_, param_type)) => Some((*param_type, name.to_owned())),
        None => {
            let known: Vec<&str> = TYPE_NAMES.iter().map(|(name, _)| *name).collect();
            let message = format!("unknown parameter type {type_name:?}");
            report.error_help(span, message, suggest::help(type_name, &known));
            None
        }
    }
}

/// Reads a value or a bracketed list, with the places of the list and of its first value.
///
/// `None`: a token is missing, which was reported.
fn read_values(
    lexer: &mut Lexer,
    report: &mut Report,
    declaration: Token,
    wanted: Option<ParamType>,
) -> Option<(Values, Span, Span)> {
    let missing = |report: &mut Report| {
        let help = "give one value, or several in [ ]";
        report.fail_help(declaration.span, "the parameter has no value", help)
    };
    let Some(first) = lexer.peek(report) else {
        return missing(report);
    };
    let mut reader = ValueReader::new(wanted);
    let mut value = first.span;
    match first.kind {
        TokenKind::Broken => return None,
        TokenKind::Close => return missing(report),
        TokenKind::Word if is_directive(lexer.slice(first)) => return missing(report),
        TokenKind::Word | TokenKind::Text => {
            lexer.next(report);
            reader.read(lexer, first, report);
        }
        TokenKind::Open => {
            lexer.next(report);
            if let Some(token) = lexer.peek(report)
                && matches!(token.kind, TokenKind::Word | TokenKind::Text)
            {
                value = token.span;
            }
            reader.read_list(lexer, first, report)?;
        }
    }
    reader.check_group(first.span, report);
    Some((reader.values, first.span, value))
}

fn is_directive(word: &[u8]) -> bool {
    std::str::from_utf8(word).is_ok_and(|w| directive::DIRECTIVES.binary_search(&w).is_ok())
}

/// Reader of values of one type. After the first wrong value, the rest is skipped.
struct ValueReader {
    wanted: Option<ParamType>,
    values: Values,
}

impl ValueReader {
    fn new(wanted: Option<ParamType>) -> Self {
        let values = match wanted {
            None => Values::Broken,
            Some(ParamType::Integer) => Values::Integers(Vec::new()),
            Some(ParamType::Bool) => Values::Bools(Vec::new()),
            Some(ParamType::String | ParamType::Texture) => Values::Strings(Vec::new()),
            Some(ParamType::Point3) => Values::Points(Vec::new()),
            Some(_) => Values::Floats(Vec::new()),
        };
        Self { wanted, values }
    }

    /// Reads values to the end of a list. `None`: the list is broken, which was reported.
    fn read_list(&mut self, lexer: &mut Lexer, open: Token, report: &mut Report) -> Option<()> {
        loop {
            let token = lexer.peek(report).filter(|token| {
                let word = lexer.slice(*token);
                let is_name = token.kind == TokenKind::Word && word[0].is_ascii_uppercase();
                !(is_name && is_directive(word))
            });
            let Some(token) = token else {
                return report.fail_help(open.span, "the list is not closed", "close it with ]");
            };
            lexer.next(report);
            match token.kind {
                TokenKind::Close => return Some(()),
                TokenKind::Broken => return None,
                TokenKind::Open => {
                    report.error(token.span, "lists do not nest: [ within [ ]");
                    self.values = Values::Broken;
                }
                _ => self.read(lexer, token, report),
            }
        }
    }

    fn read(&mut self, lexer: &Lexer, token: Token, report: &mut Report) {
        let Some(wanted) = self.wanted else { return };
        let bytes = lexer.slice(token);
        if token.kind == TokenKind::Text {
            // A spectrum is a list of numbers or of file names.
            if wanted == ParamType::Spectrum
                && self.values.len() == 0
                && let Values::Floats(_) = self.values
            {
                self.values = Values::Strings(Vec::new());
            }
            match &mut self.values {
                Values::Broken => {}
                Values::Strings(list) => list.push(unquote(bytes, token.span, report)),
                Values::Bools(list) if bytes == b"\"true\"" => list.push(true),
                Values::Bools(list) if bytes == b"\"false\"" => list.push(false),
                _ => self.reject(wanted, bytes, token.span, report),
            }
            return;
        }
        let error = match &mut self.values {
            Values::Broken => return,
            Values::Floats(list) => match parse_float(bytes) {
                Ok(value) => return list.push(value as f32),
                Err(error) => error,
            },
            Values::Points(list) => match parse_float(bytes) {
                Ok(value) => return list.push(value),
                Err(error) => error,
            },
            Values::Integers(list) => match parse_integer(bytes) {
                Ok(value) => return list.push(value),
                Err(error) => error,
            },
            Values::Bools(list) if bytes == b"true" => return list.push(true),
            Values::Bools(list) if bytes == b"false" => return list.push(false),
            Values::Bools(_) | Values::Strings(_) => NumberError::NotANumber,
        };
        let shown = String::from_utf8_lossy(bytes);
        match error {
            NumberError::NotANumber => self.reject(wanted, bytes, token.span, report),
            NumberError::OutOfRange => self.fail(
                report,
                token.span,
                format!("{shown} is beyond the range of a 32-bit {}", wanted.name()),
            ),
            NumberError::NotAnInteger => self.fail(
                report,
                token.span,
                format!("{shown} is not an integer, and the type is integer"),
            ),
        }
    }

    fn reject(&mut self, wanted: ParamType, found: &[u8], span: Span, report: &mut Report) {
        let takes = match wanted {
            ParamType::String | ParamType::Texture => "strings in quotes",
            ParamType::Bool => "\"true\" or \"false\"",
            _ => "numbers",
        };
        let what = if found.first() == Some(&b'"') {
            "the string "
        } else {
            ""
        };
        let shown = shorten(&String::from_utf8_lossy(found));
        self.fail(
            report,
            span,
            format!(
                "a parameter of type {} takes {takes}, found {what}{shown}",
                wanted.name()
            ),
        );
    }

    fn fail(&mut self, report: &mut Report, span: Span, message: String) {
        report.error(span, message);
        self.values = Values::Broken;
    }

    fn check_group(&mut self, span: Span, report: &mut Report) {
        let Some(wanted) = self.wanted else { return };
        let count = self.values.len();
        let group = match (&self.values, wanted) {
            (Values::Floats(_), ParamType::Spectrum) => 2,
            _ => wanted.group(),
        };
        if !count.is_multiple_of(group) {
            let message = format!(
                "{} values come in groups of {group}, found {count} values",
                wanted.name()
            );
            report.error(span, message);
            self.values = Values::Broken;
        }
    }
}

/// Word of the file for a message: at most 40 characters, without control characters.
pub(crate) fn shorten(text: &str) -> String {
    const SHOWN: usize = 40;
    let mut shown: String = text
        .chars()
        .take(SHOWN)
        .map(|c| if c.is_control() { '\u{FFFD}' } else { c })
        .collect();
    if text.chars().nth(SHOWN).is_some() {
        shown.push('…');
    }
    shown
}
