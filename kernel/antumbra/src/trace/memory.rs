//! Traversal memory: allocated once, reused by every query.

use alloc::vec::Vec;
#[cfg(feature = "std")]
use std::sync::{Mutex, PoisonError};

use crate::geometry::ray_setup::RaySetup;
use crate::ray::{Hit, Ray};
use crate::trace::instrumented::Open;
use crate::trace::ray_sort::Keys;
use crate::trace::stack::Item;
use crate::trace::visit::Ahead;

/// The stacks of one thread, one for each kind of items, and answers on their way. They grow to what the queries
/// so far needed.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// Stacks of children in a static order.
    pub children: Vec<u32>,
    /// Stacks of children with their distances.
    pub entries: Vec<u64>,
    /// Stack of the instrumented traversal.
    pub open: Vec<Open>,
    /// Memory for hits that are reported front to back.
    pub ahead: Ahead,
    /// Answers that are to be packed into bits.
    pub answers: Vec<bool>,
    /// Indices of the rays of a batch that packets have left over.
    pub pending: Vec<u32>,
    /// Closest hits of queries that report surfaces; the answers are not used.
    pub hits: Vec<Option<Hit>>,
    /// Rays made ready for a stream.
    pub setups: Vec<RaySetup>,
    /// Rays of a batch that were brought together.
    pub rays: Vec<Ray>,
    /// Order of the rays of a batch, as sort keys.
    pub keys: Keys,
}

/// An [`Item`] knows which part of the memory it lies in.
pub(crate) trait Stored: Item {
    fn of(memory: &mut Memory) -> &mut Vec<Self>;

    /// At least `len` items.
    #[inline(always)]
    fn at_least(memory: &mut Memory, len: usize) -> &mut [Self] {
        let items = Self::of(memory);
        if items.len() < len {
            items.resize(len, Self::BOTTOM);
        }
        items
    }
}

impl Stored for u32 {
    #[inline(always)]
    fn of(memory: &mut Memory) -> &mut Vec<u32> {
        &mut memory.children
    }
}

impl Stored for u64 {
    #[inline(always)]
    fn of(memory: &mut Memory) -> &mut Vec<u64> {
        &mut memory.entries
    }
}

/// Memory that waits for its next use. A clone is empty.
#[cfg(feature = "std")]
#[derive(Debug, Default)]
pub(crate) struct Pool(Mutex<Vec<Memory>>);

#[cfg(feature = "std")]
impl Pool {
    /// Runs `f` with memory of the pool, or new one when all is in use.
    pub fn with<R>(&self, f: impl FnOnce(&mut Memory) -> R) -> R {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut memory = lock().pop().unwrap_or_default();
        let result = f(&mut memory);
        lock().push(memory);
        result
    }
}

#[cfg(feature = "std")]
impl Clone for Pool {
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// No memory is kept: `core` has no lock.
#[cfg(not(feature = "std"))]
#[derive(Clone, Debug, Default)]
pub(crate) struct Pool(());

#[cfg(not(feature = "std"))]
impl Pool {
    /// Runs `f` with new memory.
    pub fn with<R>(&self, f: impl FnOnce(&mut Memory) -> R) -> R {
        f(&mut Memory::default())
    }
}
