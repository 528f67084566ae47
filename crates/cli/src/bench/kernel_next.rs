//! Stop-gap until the kernel has instances and opacity itself.

use std::fmt;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    pub object: u32,
    pub transform: [[f32; 4]; 3],
}

pub trait Opacity: fmt::Debug + Send + Sync {
    fn opacity(&self, candidate: &Candidate) -> f32;
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    pub u: f32,
    pub v: f32,
    pub prim_id: u32,
    pub geom_id: u32,
    pub inst_id: u32,
    pub query: QueryKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum QueryKind {
    Occluded,
    Intersect,
}
