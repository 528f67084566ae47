//! Arguments of directives, each type read in its own way.

use crate::directive::{ActiveTransform, Quoted};
use crate::lexer::{Lexer, Token, TokenKind, unquote};
use crate::number::parse_float;
use crate::params::{self, Params, shorten};
use crate::report::Report;

/// Failure that was reported. The rest of the directive is to be skipped.
pub(crate) struct Failed;

/// Where the arguments of a directive are read.
pub(crate) struct Arguments<'a> {
    pub lexer: &'a mut Lexer,
    pub report: &'a mut Report,
    /// Name of the directive.
    pub at: Token,
}

/// Type of an argument.
pub(crate) trait Argument: Sized {
    fn read(from: &mut Arguments) -> Result<Self, Failed>;

    /// The parameters, if the argument is a list of them.
    fn params_mut(&mut self) -> Option<&mut Params> {
        None
    }
}

impl Argument for Quoted {
    fn read(from: &mut Arguments) -> Result<Self, Failed> {
        let token = from.expect("a name in quotes", |_, t| t.kind == TokenKind::Text)?;
        Ok(Self {
            text: unquote(from.lexer.slice(token), token.span, from.report),
            span: token.span,
        })
    }
}

/// A name that may be missing.
impl Argument for Option<Quoted> {
    fn read(from: &mut Arguments) -> Result<Self, Failed> {
        match from.lexer.peek(from.report) {
            Some(token) if token.kind == TokenKind::Text => Quoted::read(from).map(Some),
            _ => Ok(None),
        }
    }
}

impl Argument for Params {
    fn read(from: &mut Arguments) -> Result<Self, Failed> {
        params::parse(from.lexer, from.report).ok_or(Failed)
    }

    fn params_mut(&mut self) -> Option<&mut Params> {
        Some(self)
    }
}

impl<const N: usize> Argument for [f64; N] {
    fn read(from: &mut Arguments) -> Result<Self, Failed> {
        let takes = format!("{N} numbers");
        let mut values = [0.0; N];
        for value in &mut values {
            let is_number =
                |lexer: &Lexer, t: Token| t.kind == TokenKind::Word && number(lexer, t).is_some();
            let token = from.expect(&takes, is_number)?;
            *value = number(from.lexer, token).unwrap_or_default();
        }
        Ok(values)
    }
}

fn number(lexer: &Lexer, token: Token) -> Option<f64> {
    parse_float(lexer.slice(token))
        .ok()
        .filter(|v| v.is_finite())
}

/// Numbers of a matrix, in brackets.
#[derive(Debug)]
pub(crate) struct Matrix(pub [f64; 16]);

impl Argument for Matrix {
    fn read(from: &mut Arguments) -> Result<Self, Failed> {
        let takes = "16 numbers in [ ]";
        from.expect(takes, |_, t| t.kind == TokenKind::Open)?;
        let values = Argument::read(from)?;
        from.expect(takes, |_, t| t.kind == TokenKind::Close)?;
        Ok(Self(values))
    }
}

/// Words that are no directives though they begin with a capital.
pub(crate) const ACTIVE_TRANSFORMS: &[(&[u8], ActiveTransform)] = &[
    (b"All", ActiveTransform::All),
    (b"StartTime", ActiveTransform::StartTime),
    (b"EndTime", ActiveTransform::EndTime),
];

impl Argument for ActiveTransform {
    fn read(from: &mut Arguments) -> Result<Self, Failed> {
        let choice = |lexer: &Lexer, token: Token| {
            let mut choices = ACTIVE_TRANSFORMS.iter();
            choices.find(|(name, _)| *name == lexer.slice(token))
        };
        let takes = "All, StartTime or EndTime";
        let token = from.expect(takes, |l, t| choice(l, t).is_some())?;
        choice(from.lexer, token)
            .map(|(_, choice)| *choice)
            .ok_or(Failed)
    }
}

impl Arguments<'_> {
    /// Consumes the next token if `wanted` holds. Otherwise reports what the directive takes.
    fn expect(
        &mut self,
        takes: &str,
        wanted: impl Fn(&Lexer, Token) -> bool,
    ) -> Result<Token, Failed> {
        let Self { lexer, report, at } = self;
        let name = String::from_utf8_lossy(lexer.slice(*at)).into_owned();
        match lexer.peek(report) {
            Some(token) if wanted(lexer, token) => {
                lexer.next(report);
                return Ok(token);
            }
            Some(token) if token.kind == TokenKind::Broken => {}
            Some(token) => {
                let found = shorten(&String::from_utf8_lossy(lexer.slice(token)));
                report.error(token.span, format!("{name} takes {takes}, found {found}"));
            }
            None => {
                let message = format!("{name} takes {takes}, but the file ends here");
                report.error(at.span, message);
            }
        }
        Err(Failed)
    }
}
