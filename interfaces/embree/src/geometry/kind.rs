//! Kinds of geometry, and the formats of their buffers.

use crate::abi::{buffer_type, format};
use crate::device::{Failure, Outcome};

/// What the points of a curve mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    Linear,
    Bezier,
    BSpline,
    CatmullRom,
}

/// Kinds of geometry that there are here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Triangles,
    Quads,
    Spheres,
    Disks,
    /// Flat curves.
    Curves(Basis),
    User,
    Instance,
    InstanceArray,
}

impl Kind {
    pub fn new(kind: u32) -> Outcome<Self> {
        Ok(match kind {
            0 => Self::Triangles,
            1 => Self::Quads,
            50 => Self::Spheres,
            52 => Self::Disks,
            120 => Self::User,
            121 => Self::Instance,
            122 => Self::InstanceArray,
            2 => return Err(unsupported("grids")),
            8 => return Err(unsupported("subdivision surfaces")),
            51 => return Err(unsupported("discs that face the ray")),
            17 => Self::Curves(Basis::Linear),
            25 => Self::Curves(Basis::Bezier),
            33 => Self::Curves(Basis::BSpline),
            59 => Self::Curves(Basis::CatmullRom),
            15 | 16 | 24 | 32 | 40 | 58 => return Err(unsupported("round curves")),
            26 | 34 | 42 | 60 => return Err(unsupported("curves with normals")),
            41 => return Err(unsupported("Hermite curves")),
            _ => {
                return Err(Failure::argument(format!(
                    "unknown type of geometry {kind}"
                )));
            }
        })
    }

    /// Format of the items of a buffer. `None` if the kind has no such buffer, or one of several formats.
    pub fn format(self, buffer: u32) -> Option<u32> {
        Some(match (buffer, self) {
            (buffer_type::INDEX, Self::Triangles) => format::UINT3,
            (buffer_type::INDEX, Self::Quads) => format::UINT4,
            (buffer_type::INDEX, Self::Curves(_) | Self::InstanceArray) => format::UINT,
            (buffer_type::VERTEX, Self::Triangles | Self::Quads) => format::FLOAT3,
            (buffer_type::VERTEX, Self::Spheres | Self::Disks | Self::Curves(_)) => format::FLOAT4,
            (buffer_type::NORMAL, Self::Disks) => format::FLOAT3,
            _ => return None,
        })
    }

    /// Kinds whose hits have `u` and `v` on corners.
    pub fn has_corners(self) -> bool {
        matches!(self, Self::Triangles | Self::Quads)
    }

    /// Kinds that place scenes.
    pub fn is_instance(self) -> bool {
        matches!(self, Self::Instance | Self::InstanceArray)
    }
}

pub fn unsupported(what: &str) -> Failure {
    Failure::operation(format!("{what} are not supported"))
}
