//! Directives of pbrt, and the [`Handler`] that receives them from the parser.

use crate::arguments::{Argument, Arguments, Failed, Matrix};
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;

/// String of the file with its place.
#[derive(Clone, Debug)]
pub(crate) struct Quoted {
    pub text: String,
    pub span: Span,
}

/// Transformations that the following directives change: at the start or the end of the exposure, or both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ActiveTransform {
    All,
    StartTime,
    EndTime,
}

/// Section of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Phase {
    /// Before `WorldBegin`.
    Options,
    /// Between `WorldBegin` and `WorldEnd`.
    World,
    /// After `WorldEnd`.
    Done,
}

/// Makes the directives of rows: name, the section of the file that it belongs to, and arguments.
macro_rules! directives {
    ($($(#[$doc:meta])* $name:ident $(in $phase:ident)? ($($argument:ident: $type:ty),*);)*) => {
        /// Directive with its arguments.
        #[derive(Debug)]
        pub(crate) enum Directive {
            $($(#[$doc])* $name($($type),*),)*
        }

        /// The names of all directives, in alphabetical order.
        pub(crate) const DIRECTIVES: &[&str] = &[$(stringify!($name)),*];

        impl Directive {
            /// Reads the arguments of the directive of a name.
            pub fn read(name: &str, from: &mut Arguments) -> Result<Self, Failed> {
                Ok(match name {
                    $(stringify!($name) => Self::$name($(<$type as Argument>::read(from)?),*),)*
                    _ => return Err(Failed),
                })
            }

            /// List of parameters, if the directive ends with one.
            pub fn params_mut(&mut self) -> Option<&mut Params> {
                match self {
                    $(Self::$name($($argument),*) => None$(.or($argument.params_mut()))*,)*
                }
            }

            /// Section of the file that the directive belongs to, if it is not allowed in both.
            pub fn phase(&self) -> Option<Phase> {
                match self {
                    $(Self::$name(..) => None$(.or(Some(Phase::$phase)))?,)*
                }
            }
        }
    };
}

directives! {
    Accelerator in Options (kind: Quoted, params: Params);
    ActiveTransform (active: ActiveTransform);
    AreaLightSource in World (kind: Quoted, params: Params);
    /// Values of parameters that directives of a group do not give, of pbrt-v4.
    Attribute (group: Quoted, params: Params);
    AttributeBegin in World ();
    AttributeEnd in World ();
    Camera in Options (kind: Quoted, params: Params);
    /// Primaries of colours, of pbrt-v4.
    ColorSpace (name: Quoted);
    ConcatTransform (matrix: Matrix);
    CoordSysTransform (name: Quoted);
    CoordinateSystem (name: Quoted);
    Film in Options (kind: Quoted, params: Params);
    Identity ();
    /// An `Include` between blocks of its own, of pbrt-v4. The parser follows both.
    Import (path: Quoted);
    Include (path: Quoted);
    Integrator in Options (kind: Quoted, params: Params);
    LightSource in World (kind: Quoted, params: Params);
    LookAt (numbers: [f64; 9]);
    MakeNamedMaterial in World (name: Quoted, params: Params);
    MakeNamedMedium (name: Quoted, params: Params);
    Material in World (kind: Quoted, params: Params);
    /// Media inside and outside. A single name is for both sides.
    MediumInterface (inside: Quoted, outside: Option<Quoted>);
    NamedMaterial in World (name: Quoted);
    ObjectBegin in World (name: Quoted);
    ObjectEnd in World ();
    ObjectInstance in World (name: Quoted);
    /// Options of the program, of pbrt-v4.
    Option in Options (params: Params);
    PixelFilter in Options (kind: Quoted, params: Params);
    ReverseOrientation in World ();
    Rotate (by: [f64; 4]);
    Sampler in Options (kind: Quoted, params: Params);
    Scale (by: [f64; 3]);
    Shape in World (kind: Quoted, params: Params);
    /// The type of the values is `float`, `color` or `spectrum`.
    Texture in World (name: Quoted, value_type: Quoted, class: Quoted, params: Params);
    Transform (matrix: Matrix);
    TransformBegin in World ();
    TransformEnd in World ();
    /// Times of the transformations at the start and at the end.
    TransformTimes in Options (times: [f64; 2]);
    Translate (by: [f64; 3]);
    WorldBegin in Options ();
    WorldEnd in World ();
}

/// Receiver of directives.
pub(crate) trait Handler {
    /// Called once per well-formed directive, in the order of the file. `at` is the place of the directive's name.
    fn directive(&mut self, at: Span, directive: Directive, report: &mut Report);
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_names_can_be_searched() {
        assert!(super::DIRECTIVES.is_sorted());
    }
}
