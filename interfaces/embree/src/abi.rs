//! Constants and structures of Embree 4's binary interface, from its documentation.
//!
//! Structures have the layout of release libraries since 4.3: one level of instances, and `instPrimID` in hits.

use std::ffi::{c_char, c_int, c_uint, c_void};

/// No geometry, primitive or instance.
pub const INVALID: u32 = u32::MAX;

/// `RTCFormat`.
pub mod format {
    pub const UINT: u32 = 0x5001;
    pub const UINT3: u32 = 0x5003;
    pub const UINT4: u32 = 0x5004;
    pub const FLOAT: u32 = 0x9001;
    pub const FLOAT3: u32 = 0x9003;
    pub const FLOAT4: u32 = 0x9004;
    pub const FLOAT16: u32 = 0x9010;
    pub const FLOAT3X4_ROW_MAJOR: u32 = 0x9134;
    pub const FLOAT4X4_ROW_MAJOR: u32 = 0x9144;
    pub const FLOAT3X4_COLUMN_MAJOR: u32 = 0x9234;
    pub const FLOAT4X4_COLUMN_MAJOR: u32 = 0x9244;
    /// `RTCQuaternionDecomposition`: scale, skew, shift, rotation, translation.
    pub const QUATERNION: u32 = 0xb001;

    /// Bytes of an item; `None` for a format that no supported buffer has.
    pub fn size(format: u32) -> Option<usize> {
        Some(match format {
            0x5001..=0x5004 => 4 * (format as usize & 15),
            0x9001..=0x9010 => 4 * (format as usize & 31),
            FLOAT3X4_ROW_MAJOR | FLOAT3X4_COLUMN_MAJOR => 48,
            FLOAT4X4_ROW_MAJOR | FLOAT4X4_COLUMN_MAJOR | QUATERNION => 64,
            _ => return None,
        })
    }
}

/// `RTCBufferType`.
pub mod buffer_type {
    pub const INDEX: u32 = 0;
    pub const VERTEX: u32 = 1;
    pub const VERTEX_ATTRIBUTE: u32 = 2;
    pub const NORMAL: u32 = 3;
    pub const TRANSFORM: u32 = 23;
}

/// `RTCError`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum ErrorCode {
    None = 0,
    Unknown = 1,
    InvalidArgument = 2,
    InvalidOperation = 3,
    OutOfMemory = 4,
    Cancelled = 6,
}

/// `RTC_SCENE_FLAG_DYNAMIC`.
pub const SCENE_DYNAMIC: u32 = 1;
/// `RTC_SCENE_FLAG_ROBUST`.
pub const SCENE_ROBUST: u32 = 4;
/// `RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER`.
pub const INVOKE_ARGUMENT_FILTER: c_int = 1 << 1;

pub type ErrorFunction = unsafe extern "C" fn(*mut c_void, c_int, *const c_char);
pub type MemoryFunction = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;
pub type ProgressFunction = unsafe extern "C" fn(*mut c_void, f64) -> bool;
pub type FilterFunction = unsafe extern "C" fn(*const FilterArguments);
pub type BoundsFunction = unsafe extern "C" fn(*const BoundsArguments);
pub type IntersectFunction = unsafe extern "C" fn(*const UserArguments);
pub type PointFunction = unsafe extern "C" fn(*mut PointArguments) -> bool;

/// `RTCBounds`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct Bounds {
    pub lower: [f32; 3],
    pub align0: f32,
    pub upper: [f32; 3],
    pub align1: f32,
}

impl Bounds {
    pub fn new(lower: [f32; 3], upper: [f32; 3]) -> Self {
        Self {
            lower,
            align0: 0.0,
            upper,
            align1: 0.0,
        }
    }
}

/// `RTCRay`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct RtcRay {
    pub org: [f32; 3],
    pub tnear: f32,
    pub dir: [f32; 3],
    pub time: f32,
    pub tfar: f32,
    pub mask: u32,
    pub id: u32,
    pub flags: u32,
}

/// `RTCHit`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct RtcHit {
    pub ng: [f32; 3],
    pub u: f32,
    pub v: f32,
    pub prim_id: u32,
    pub geom_id: u32,
    pub inst_id: u32,
    pub inst_prim_id: u32,
}

impl RtcHit {
    /// No hit.
    pub const MISS: Self = Self {
        ng: [0.0; 3],
        u: 0.0,
        v: 0.0,
        prim_id: INVALID,
        geom_id: INVALID,
        inst_id: INVALID,
        inst_prim_id: INVALID,
    };
}

/// `RTCRayHit`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct RtcRayHit {
    pub ray: RtcRay,
    pub hit: RtcHit,
}

/// Numbers of a ray and of a hit, in the order of their fields: a packet has an array for each.
pub const RAY_FIELDS: usize = 12;

/// `RTCRayQueryContext`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Context {
    pub inst_id: u32,
    pub inst_prim_id: u32,
}

impl Context {
    /// Outside of instances.
    pub const WORLD: Self = Self {
        inst_id: INVALID,
        inst_prim_id: INVALID,
    };
}

/// `RTCIntersectArguments` and `RTCOccludedArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Arguments {
    pub flags: c_int,
    pub feature_mask: c_int,
    pub context: *mut Context,
    pub filter: Option<FilterFunction>,
    /// `intersect` or `occluded`.
    pub user: Option<IntersectFunction>,
}

/// `RTCFilterFunctionNArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct FilterArguments {
    pub valid: *mut c_int,
    pub user: *mut c_void,
    pub context: *mut Context,
    pub ray: *mut c_void,
    pub hit: *mut c_void,
    pub n: c_uint,
}

/// `RTCBoundsFunctionArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct BoundsArguments {
    pub user: *mut c_void,
    pub prim_id: u32,
    pub time_step: u32,
    pub bounds: *mut Bounds,
}

/// `RTCIntersectFunctionNArguments` and `RTCOccludedFunctionNArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct UserArguments {
    pub valid: *mut c_int,
    pub user: *mut c_void,
    pub prim_id: u32,
    pub context: *mut Context,
    /// A ray with a hit, or a ray.
    pub ray: *mut c_void,
    pub n: c_uint,
    pub geom_id: u32,
}

/// `RTCPointQuery`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct PointQuery {
    pub point: [f32; 3],
    pub time: f32,
    pub radius: f32,
}

/// `RTCPointQueryContext`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct PointContext {
    pub world_to_instance: [f32; 16],
    pub instance_to_world: [f32; 16],
    pub inst_id: u32,
    pub inst_prim_id: u32,
    pub size: u32,
}

/// `RTCPointQueryFunctionArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct PointArguments {
    pub query: *mut PointQuery,
    pub user: *mut c_void,
    pub prim_id: u32,
    pub geom_id: u32,
    pub context: *mut PointContext,
    pub similarity: f32,
}

/// The ends of `RTCInterpolateArguments` and `RTCInterpolateNArguments`. Null places are left out.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct InterpolateResults {
    pub p: *mut f32,
    pub dp_du: *mut f32,
    pub dp_dv: *mut f32,
    pub ddp_dudu: *mut f32,
    pub ddp_dvdv: *mut f32,
    pub ddp_dudv: *mut f32,
    pub values: u32,
}

/// `RTCInterpolateArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct InterpolateArguments<G> {
    pub geometry: *const G,
    pub prim_id: u32,
    pub u: f32,
    pub v: f32,
    pub buffer_type: u32,
    pub slot: u32,
    pub results: InterpolateResults,
}

/// `RTCInterpolateNArguments`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct InterpolateManyArguments<G> {
    pub geometry: *const G,
    pub valid: *const c_int,
    pub prim_ids: *const u32,
    pub u: *const f32,
    pub v: *const f32,
    pub n: u32,
    pub buffer_type: u32,
    pub slot: u32,
    pub results: InterpolateResults,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::{align_of, offset_of, size_of};

    /// Sizes and places that C compilers give the structures of Embree 4.4's headers.
    #[test]
    fn layouts_are_those_of_embree() {
        assert_eq!((size_of::<RtcRay>(), align_of::<RtcRay>()), (48, 16));
        assert_eq!((size_of::<RtcHit>(), align_of::<RtcHit>()), (48, 16));
        assert_eq!((size_of::<RtcRayHit>(), size_of::<Bounds>()), (96, 32));
        assert_eq!(offset_of!(RtcRay, tfar), 32);
        assert_eq!(offset_of!(RtcHit, inst_prim_id), 32);
        assert_eq!(size_of::<PointQuery>(), 32);
        assert_eq!(size_of::<PointContext>(), 144);
        assert_eq!(size_of::<PointArguments>(), 48);
        assert_eq!(size_of::<Arguments>(), 32);
        assert_eq!(offset_of!(UserArguments, geom_id), 44);
        assert_eq!(offset_of!(InterpolateArguments<()>, buffer_type), 20);
        assert_eq!(offset_of!(InterpolateArguments<()>, results), 32);
        assert_eq!(offset_of!(InterpolateManyArguments<()>, buffer_type), 44);
        assert_eq!(offset_of!(InterpolateManyArguments<()>, results), 56);
        assert_eq!(size_of::<InterpolateResults>(), 56);
    }
}
