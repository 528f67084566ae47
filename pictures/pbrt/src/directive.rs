//! Directives of pbrt-v3, and the [`Handler`] that receives them from the parser.

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

/// Directive with its arguments. `Include` is missing, because the parser follows it.
#[derive(Debug)]
pub(crate) enum Directive {
    Accelerator(Quoted, Params),
    ActiveTransform(ActiveTransform),
    AreaLightSource(Quoted, Params),
    /// Values of parameters that directives of a group do not give, of pbrt-v4.
    Attribute(Quoted, Params),
    AttributeBegin,
    AttributeEnd,
    Camera(Quoted, Params),
    /// Primaries of colours, of pbrt-v4.
    ColorSpace(Quoted),
    ConcatTransform([f64; 16]),
    CoordSysTransform(Quoted),
    CoordinateSystem(Quoted),
    Film(Quoted, Params),
    Identity,
    Integrator(Quoted, Params),
    LightSource(Quoted, Params),
    LookAt([f64; 9]),
    MakeNamedMaterial(Quoted, Params),
    MakeNamedMedium(Quoted, Params),
    Material(Quoted, Params),
    MediumInterface {
        inside: Quoted,
        outside: Quoted,
    },
    NamedMaterial(Quoted),
    ObjectBegin(Quoted),
    ObjectEnd,
    ObjectInstance(Quoted),
    /// Options of the program, of pbrt-v4.
    Option(Params),
    PixelFilter(Quoted, Params),
    ReverseOrientation,
    Rotate([f64; 4]),
    Sampler(Quoted, Params),
    Scale([f64; 3]),
    Shape(Quoted, Params),
    Texture {
        name: Quoted,
        /// `float`, `color` or `spectrum`.
        value_type: Quoted,
        class: Quoted,
        params: Params,
    },
    Transform([f64; 16]),
    TransformBegin,
    TransformEnd,
    /// Times of the transformations at the start and at the end.
    TransformTimes([f64; 2]),
    Translate([f64; 3]),
    WorldBegin,
    WorldEnd,
}

impl Directive {
    /// List of parameters, if the directive ends with one.
    pub fn params_mut(&mut self) -> Option<&mut Params> {
        match self {
            Self::Accelerator(_, params)
            | Self::AreaLightSource(_, params)
            | Self::Attribute(_, params)
            | Self::Camera(_, params)
            | Self::Film(_, params)
            | Self::Integrator(_, params)
            | Self::LightSource(_, params)
            | Self::MakeNamedMaterial(_, params)
            | Self::MakeNamedMedium(_, params)
            | Self::Material(_, params)
            | Self::Option(params)
            | Self::PixelFilter(_, params)
            | Self::Sampler(_, params)
            | Self::Shape(_, params)
            | Self::Texture { params, .. } => Some(params),
            _ => None,
        }
    }
}

/// Receiver of directives.
pub(crate) trait Handler {
    /// Called once per well-formed directive, in the order of the file. `at` is the place of the directive's name.
    fn directive(&mut self, at: Span, directive: Directive, report: &mut Report);
}
