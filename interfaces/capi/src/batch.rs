//! Batches: many rays with conditions, as the caller stores them, in pieces.

use std::ffi::c_void;
use std::ops::Range;
use std::ptr::{null, null_mut};

use antumbra::{Batch, Bvh, Hit, PrimId, Ray, RayOrder};

use crate::arrays::{Items, Versioned, sized};
use crate::recipe::unknown;
use crate::status::{Failure, Outcome};
use crate::threads::{Place, Threads};

/// So many rays stay on the calling thread, as in the kernel.
pub const FEW: usize = 1 << 14;

/// Rays that are handed to the kernel at a time where answers or rays are copied: copies stay in the cache.
pub const PIECE: usize = 1 << 12;

/// Flags of batches, groups and points.
pub const CLOSED: u32 = 1;
pub const THIS_THREAD: u32 = 2;

type Filter = extern "C" fn(*mut c_void, usize, *const Hit) -> i32;

/// Many rays with conditions, `antumbra_batch`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct BatchOptions {
    pub size: usize,
    pub count: usize,
    pub rays: *const Ray,
    pub ray_stride: usize,
    pub origins: *const f32,
    pub origin_stride: usize,
    pub directions: *const f32,
    pub direction_stride: usize,
    pub tnear: *const f32,
    pub tnear_stride: usize,
    pub tfar: *const f32,
    pub tfar_stride: usize,
    pub masks: *const u32,
    pub mask_stride: usize,
    pub except: *const PrimId,
    pub except_stride: usize,
    pub data: *mut c_void,
    pub filter: Option<Filter>,
    pub flags: u32,
    pub order: u32,
    pub threads: *const Threads,
}

// SAFETY: `repr(C)`, the size first, and then numbers and pointers, which are only used as the header says.
unsafe impl Versioned for BatchOptions {
    const NAME: &'static str = "antumbra_batch";
}

impl BatchOptions {
    /// Packed rays without conditions, as `antumbra_batch_of` of the header. The rays must live as long as the batch is used.
    pub fn of(rays: &[Ray]) -> Self {
        Self {
            size: size_of::<Self>(),
            count: rays.len(),
            rays: rays.as_ptr(),
            ray_stride: 0,
            origins: null(),
            origin_stride: 0,
            directions: null(),
            direction_stride: 0,
            tnear: null(),
            tnear_stride: 0,
            tfar: null(),
            tfar_stride: 0,
            masks: null(),
            mask_stride: 0,
            except: null(),
            except_stride: 0,
            data: null_mut(),
            filter: None,
            flags: 0,
            order: 0,
            threads: null(),
        }
    }
}

/// Rays of the caller.
enum Source<'a> {
    /// One structure each.
    Rays(Items<'a, Ray>),
    /// In arrays of their own.
    Columns {
        origins: Items<'a, [f32; 3]>,
        directions: Items<'a, [f32; 3]>,
        tnear: Option<Items<'a, f32>>,
        tfar: Option<Items<'a, f32>>,
    },
}

impl Source<'_> {
    #[inline(always)]
    fn get(&self, index: usize) -> Ray {
        match self {
            Self::Rays(rays) => rays.get(index),
            Self::Columns {
                origins,
                directions,
                tnear,
                tfar,
            } => Ray {
                org: origins.get(index),
                tnear: tnear.map_or(0.0, |tnear| tnear.get(index)),
                dir: directions.get(index),
                tfar: tfar.map_or(f32::INFINITY, |tfar| tfar.get(index)),
            },
        }
    }
}

/// A filter with its data.
#[derive(Clone, Copy)]
struct Callback {
    data: *mut c_void,
    filter: Filter,
}

// SAFETY: the library never looks at what `data` points to. The header says that filters are called from any thread.
unsafe impl Sync for Callback {}

impl Callback {
    fn accepts(&self, ray: usize, hit: &Hit) -> bool {
        (self.filter)(self.data, ray, hit) != 0
    }
}

/// A batch of the caller, checked.
pub struct Rays<'a> {
    source: Source<'a>,
    count: usize,
    masks: Option<Items<'a, u32>>,
    except: Option<Items<'a, PrimId>>,
    filter: Option<Callback>,
    is_closed: bool,
    order: RayOrder,
    place: Place<'a>,
}

/// Fails for flags that stand for nothing.
pub fn checked_flags(flags: u32, known: u32, name: &str) -> Outcome<u32> {
    match flags & !known {
        0 => Ok(flags),
        _ => Err(unknown(flags, name)),
    }
}

impl<'a> Rays<'a> {
    /// Checks a batch.
    ///
    /// # Safety
    /// If the pointer is not null, it is of a structure as the header says.
    pub unsafe fn new(batch: *const BatchOptions) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let batch = unsafe { sized(batch, "batch") }?;
        let count = batch.count;
        let is_columns = !batch.origins.is_null() || !batch.directions.is_null();
        if is_columns && !batch.rays.is_null() {
            let text = "a batch has either `rays` or `origins` and `directions`";
            return Err(Failure::argument(text));
        }
        let has_ends = !batch.tnear.is_null() || !batch.tfar.is_null();
        if has_ends && !is_columns {
            let text = "`tnear` and `tfar` belong to `origins` and `directions`: structures have their own";
            return Err(Failure::argument(text));
        }
        let flags = checked_flags(batch.flags, CLOSED | THIS_THREAD, "batch->flags")?;
        // SAFETY: as above, for the arrays of the structure.
        let (source, masks, except, place) = unsafe {
            let source = if is_columns {
                let (origins, directions) = (batch.origins.cast(), batch.directions.cast());
                Source::Columns {
                    origins: Items::or_same(origins, count, batch.origin_stride, "origins")?,
                    directions: Items::or_same(
                        directions,
                        count,
                        batch.direction_stride,
                        "directions",
                    )?,
                    tnear: Items::optional(batch.tnear, count, batch.tnear_stride, "tnear")?,
                    tfar: Items::optional(batch.tfar, count, batch.tfar_stride, "tfar")?,
                }
            } else {
                Source::Rays(Items::new(batch.rays, count, batch.ray_stride, "rays")?)
            };
            (
                source,
                Items::optional(batch.masks, count, batch.mask_stride, "masks")?,
                Items::optional(batch.except, count, batch.except_stride, "except")?,
                Place::flagged(batch.threads, flags)?,
            )
        };
        let order = match batch.order {
            0 => RayOrder::AsGiven,
            1 => RayOrder::Alike,
            2 => RayOrder::Sorted,
            3 => RayOrder::ByRule,
            other => return Err(unknown(other, "batch->order")),
        };
        let filter = batch.filter.map(|filter| Callback {
            data: batch.data,
            filter,
        });
        Ok(Self {
            source,
            count,
            masks,
            except,
            filter,
            is_closed: flags & CLOSED != 0,
            order,
            place,
        })
    }

    pub fn count(&self) -> usize {
        self.count
    }

    pub fn place(&self) -> Place<'a> {
        self.place
    }

    /// Whether the kernel must see all rays at once, because it sorts them.
    pub fn are_sorted(&self) -> bool {
        matches!(self.order, RayOrder::Sorted | RayOrder::ByRule)
    }

    /// Whether the kernel can read rays and conditions where they are.
    pub fn are_in_place(&self) -> bool {
        let rays = match &self.source {
            Source::Rays(rays) => rays.as_slice().is_some(),
            Source::Columns { .. } => false,
        };
        let masks = self
            .masks
            .is_none_or(|masks| masks.is_same() || masks.as_slice().is_some());
        rays && masks && self.except.is_none_or(|except| except.as_slice().is_some())
    }

    /// Runs `query` on all rays as one batch of the kernel.
    pub fn whole<R>(&self, bvh: &Bvh, query: impl FnOnce(Batch<'_>) -> R) -> R {
        let is_shared = !self.place.is_here();
        self.with(bvh, 0..self.count, is_shared, &mut Vec::new(), query)
    }

    /// Runs `query` on some of the rays as a batch of the kernel, on the calling thread or, if it may, on the threads of the
    /// current pool.
    pub fn with<R>(
        &self,
        bvh: &Bvh,
        range: Range<usize>,
        is_shared: bool,
        gathered: &mut Vec<Ray>,
        query: impl FnOnce(Batch<'_>) -> R,
    ) -> R {
        let in_place = match &self.source {
            Source::Rays(rays) => rays.as_slice(),
            Source::Columns { .. } => None,
        };
        let rays = match in_place {
            Some(rays) => &rays[range.clone()],
            None => {
                gathered.clear();
                gathered.extend(range.clone().map(|index| self.source.get(index)));
                gathered
            }
        };
        let mut batch = bvh.batch(rays).order(self.order);
        if !is_shared {
            batch = batch.on_this_thread();
        }
        if self.is_closed {
            batch = batch.closed();
        }
        let masks = self.masks.filter(|masks| !masks.is_same());
        let masks = masks.map(|masks| masks.some(range.clone()));
        let except = self.except.map(|except| except.some(range.clone()));
        if let Some(masks) = &masks {
            batch = batch.masks(masks);
        } else if let Some(masks) = self.masks.filter(|masks| masks.count() > 0) {
            batch = batch.mask(masks.get(0));
        }
        if let Some(except) = &except {
            batch = batch.except(except);
        }
        let filter = self.filter;
        let accepts = |ray: usize, hit: &Hit| {
            filter
                .as_ref()
                .is_none_or(|filter| filter.accepts(range.start + ray, hit))
        };
        if filter.is_some() {
            batch = batch.filter(&accepts);
        }
        query(batch)
    }
}
