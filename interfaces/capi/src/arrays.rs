//! Memory of the caller: handles, arrays with strides, places for answers. All reading and writing of it is here.

use std::borrow::Cow;
use std::ffi::{CStr, c_char};
use std::marker::PhantomData;
use std::ops::Range;

use crate::status::{Failure, Outcome};

/// Stride of an array that has one item for all.
pub const SAME: usize = usize::MAX;

/// Types without padding of which any bits are a value, so that they may be read from any memory of the caller.
///
/// # Safety
/// Any bits are a value.
pub unsafe trait Plain: Copy + Send + Sync + 'static {}

macro_rules! plain {
    ($($Type:ty),* $(,)?) => {
        $(
            // SAFETY: made only of integers and floats.
            unsafe impl Plain for $Type {}
        )*
    };
}

plain!(u8, u32, u64, f32, f64, usize);
plain!(
    [f32; 3], [f32; 4], [f64; 2], [f64; 3], [u32; 3], [u32; 4], [f32; 12]
);
plain!(antumbra::Ray, antumbra::Hit, antumbra::PrimId);

/// Fails if a pointer is null.
fn not_null<T>(pointer: *const T, name: &str) -> Outcome {
    match pointer.is_null() {
        true => Err(Failure::argument(format_args!("`{name}` is null"))),
        false => Ok(()),
    }
}

/// Fails if a pointer is null or not aligned for its type.
fn check_pointer<T>(pointer: *const T, name: &str) -> Outcome {
    not_null(pointer, name)?;
    match pointer.is_aligned() {
        true => Ok(()),
        false => Err(Failure::argument(format_args!(
            "`{name}` is not a multiple of {} bytes",
            align_of::<T>()
        ))),
    }
}

/// A handle or structure of the caller.
///
/// # Safety
/// If the pointer is not null, it must point to a `T` which nobody changes while the result is used.
pub unsafe fn shared<'a, T>(pointer: *const T, name: &str) -> Outcome<&'a T> {
    check_pointer(pointer, name)?;
    // SAFETY: not null and aligned; the rest is the caller's promise.
    Ok(unsafe { &*pointer })
}

/// A handle or structure of the caller, or none.
///
/// # Safety
/// As [`shared`].
pub unsafe fn optional<'a, T>(pointer: *const T, name: &str) -> Outcome<Option<&'a T>> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's promise.
    unsafe { shared(pointer, name) }.map(Some)
}

/// A handle of the caller that changes.
///
/// # Safety
/// If the pointer is not null, it must point to a `T` which nobody else uses while the result is used.
pub unsafe fn exclusive<'a, T>(pointer: *mut T, name: &str) -> Outcome<&'a mut T> {
    check_pointer(pointer, name)?;
    // SAFETY: not null and aligned; the rest is the caller's promise.
    Ok(unsafe { &mut *pointer })
}

/// Takes back a handle that [`Handle::give`] gave. Null is nothing.
///
/// # Safety
/// If the pointer is not null, it must come from [`Handle::give`], and nobody may use it any more.
pub unsafe fn take_back<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // SAFETY: made by `Box::into_raw` in `Handle::give`; not freed before by the caller's promise.
        drop(unsafe { Box::from_raw(pointer) });
    }
}

/// Place where a result goes.
pub struct Slot<T>(*mut T);

impl<T: Copy> Slot<T> {
    /// # Safety
    /// If the pointer is not null, a `T` can be written to it until the call ends.
    pub unsafe fn new(pointer: *mut T, name: &str) -> Outcome<Self> {
        check_pointer(pointer, name)?;
        Ok(Self(pointer))
    }

    pub fn put(&self, value: T) {
        // SAFETY: not null and aligned by `new`, writable by the promise given there.
        unsafe { self.0.write(value) }
    }
}

/// Place where a result goes that the caller need not take.
pub struct MaybeSlot<T>(Option<Slot<T>>);

impl<T: Copy> MaybeSlot<T> {
    /// # Safety
    /// As [`Slot::new`].
    pub unsafe fn new(pointer: *mut T, name: &str) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        let slot = (!pointer.is_null()).then(|| unsafe { Slot::new(pointer, name) });
        Ok(Self(slot.transpose()?))
    }

    pub fn put(&self, value: T) {
        if let Some(slot) = &self.0 {
            slot.put(value);
        }
    }
}

/// Place where a handle goes, which is null until then.
pub struct Handle<T>(pub Slot<*mut T>);

impl<T> Handle<T> {
    /// Gives a handle to the caller, who frees it.
    pub fn give(&self, value: T) {
        self.0.put(Box::into_raw(Box::new(value)));
    }
}

/// Items of the caller in memory, the same number of bytes apart.
#[derive(Clone, Copy)]
pub struct Items<'a, T> {
    first: *const T,
    count: usize,
    /// Bytes from an item to the next; 0 for the same item again and again.
    step: usize,
    lifetime: PhantomData<&'a [T]>,
}

// SAFETY: only read, by the promise of `new` while nobody writes; `T` is plain.
unsafe impl<T: Plain> Send for Items<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Plain> Sync for Items<'_, T> {}

/// Bytes from an item to the next: 0 stands for packed items.
fn step_of<T>(stride: usize, count: usize, name: &str) -> Outcome<usize> {
    let size = size_of::<T>();
    if stride == SAME {
        return Err(Failure::argument(format_args!(
            "`{name}` cannot be the same for all"
        )));
    }
    let step = if stride == 0 { size } else { stride };
    if step < size {
        return Err(Failure::argument(format_args!(
            "the stride of `{name}` is {stride} bytes, less than the {size} bytes of an item"
        )));
    }
    let bytes = (count.saturating_sub(1))
        .checked_mul(step)
        .and_then(|bytes| bytes.checked_add(size));
    if bytes.is_none_or(|bytes| bytes > isize::MAX as usize) {
        return Err(Failure::argument(format_args!(
            "{count} items of `{name}`, {step} bytes apart, are more than any memory has"
        )));
    }
    Ok(step)
}

impl<'a, T: Plain> Items<'a, T> {
    /// `count` items, `stride` bytes apart: 0 for packed ones. The pointer may be null if there are none.
    ///
    /// # Safety
    /// If the pointer is not null, so many items can be read until the call ends, and nobody writes to them.
    pub unsafe fn new(first: *const T, count: usize, stride: usize, name: &str) -> Outcome<Self> {
        let step = step_of::<T>(stride, count, name)?;
        if count > 0 {
            not_null(first, name)?;
        }
        let lifetime = PhantomData;
        Ok(Self {
            first,
            count,
            step,
            lifetime,
        })
    }

    /// Items as of [`Items::new`], or one for all with the stride [`SAME`].
    ///
    /// # Safety
    /// As [`Items::new`].
    pub unsafe fn or_same(
        first: *const T,
        count: usize,
        stride: usize,
        name: &str,
    ) -> Outcome<Self> {
        let is_same = stride == SAME;
        let stride = if is_same { 0 } else { stride };
        // SAFETY: the caller's promise; of one item for all only that one is read.
        let items = unsafe { Self::new(first, count, stride, name) }?;
        Ok(Self {
            step: if is_same { 0 } else { items.step },
            ..items
        })
    }

    /// Items that may be missing: null stands for none.
    ///
    /// # Safety
    /// As [`Items::new`].
    pub unsafe fn optional(
        first: *const T,
        count: usize,
        stride: usize,
        name: &str,
    ) -> Outcome<Option<Self>> {
        if first.is_null() {
            return Ok(None);
        }
        // SAFETY: the caller's promise.
        unsafe { Self::or_same(first, count, stride, name) }.map(Some)
    }

    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether all share one item.
    pub fn is_same(&self) -> bool {
        self.step == 0
    }

    /// Item `index`.
    ///
    /// # Panics
    /// If there is none.
    #[inline(always)]
    pub fn get(&self, index: usize) -> T {
        assert!(index < self.count);
        // SAFETY: below `count`, so inside of what the caller of `new` promised; steps do not overflow by `step_of`. Not
        // aligned perhaps.
        unsafe { self.first.byte_add(index * self.step).read_unaligned() }
    }

    /// All items.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = T> + '_ {
        (0..self.count).map(|index| self.get(index))
    }

    /// Some of the items as a list: where they are, or copied.
    pub fn some(&self, range: Range<usize>) -> Cow<'a, [T]> {
        match self.as_slice() {
            Some(items) => Cow::Borrowed(&items[range]),
            None => Cow::Owned(range.map(|index| self.get(index)).collect()),
        }
    }

    /// All items as a list: where they are, or copied.
    pub fn all(&self) -> Cow<'a, [T]> {
        self.some(0..self.count)
    }

    /// All items as a list, copied.
    pub fn to_vec(&self) -> Vec<T> {
        self.iter().collect()
    }

    /// The items where they are, if they are packed and aligned.
    pub fn as_slice(&self) -> Option<&'a [T]> {
        if self.count == 0 {
            return Some(&[]);
        }
        if self.step != size_of::<T>() || !self.first.is_aligned() {
            return None;
        }
        // SAFETY: not null by `new`, aligned, packed, of a size that `step_of` checked, and plain; readable and not written to
        // by the promise of the caller.
        Some(unsafe { std::slice::from_raw_parts(self.first, self.count) })
    }
}

/// Places of the caller for answers, the same number of bytes apart.
pub struct Answers<'a, T> {
    first: *mut T,
    count: usize,
    step: usize,
    lifetime: PhantomData<&'a mut [T]>,
}

// SAFETY: the memory is the call's own by the promise of `new`, and no place is written to by two threads, see `set`.
unsafe impl<T: Send> Send for Answers<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for Answers<'_, T> {}

impl<'a, T: Copy> Answers<'a, T> {
    /// `count` places, `stride` bytes apart: 0 for packed ones. The pointer may be null if there are none.
    ///
    /// # Safety
    /// If the pointer is not null, so many items can be written until the call ends, and nobody else uses them.
    pub unsafe fn new(first: *mut T, count: usize, stride: usize, name: &str) -> Outcome<Self> {
        let step = step_of::<T>(stride, count, name)?;
        if count > 0 {
            not_null(first, name)?;
        }
        let lifetime = PhantomData;
        Ok(Self {
            first,
            count,
            step,
            lifetime,
        })
    }

    /// Writes answer `index`. Threads write to different places.
    ///
    /// # Panics
    /// If there is no such place.
    #[inline(always)]
    pub fn set(&self, index: usize, value: T) {
        assert!(index < self.count);
        // SAFETY: below `count`, so inside of what the caller of `new` promised; steps do not overflow by `step_of`.
        unsafe { (self.first.byte_add(index * self.step)).write_unaligned(value) }
    }

    /// Address and bytes per step of packed places; `None` for others.
    fn packed(&self) -> Option<*mut T> {
        (self.step == size_of::<T>() && self.first.is_aligned()).then_some(self.first)
    }
}

impl<'a> Answers<'a, u8> {
    /// Packed places as a list, all false.
    pub fn into_bools(self) -> Option<&'a mut [bool]> {
        if self.count == 0 {
            return Some(&mut []);
        }
        let first = self.packed()?;
        // SAFETY: writable by the promise of `new`; 0 is a `bool`. The lifetime ends with the call.
        unsafe {
            first.write_bytes(0, self.count);
            Some(std::slice::from_raw_parts_mut(first.cast(), self.count))
        }
    }
}

impl<'a> Answers<'a, u64> {
    /// Packed and aligned places as a list, all 0.
    pub fn into_words(self, name: &str) -> Outcome<&'a mut [u64]> {
        if self.count == 0 {
            return Ok(&mut []);
        }
        check_pointer(self.first, name)?;
        // SAFETY: not null, aligned, packed by `step_of` with the stride 0 of all callers; writable by the promise of `new`.
        unsafe {
            self.first.write_bytes(0, self.count);
            Ok(std::slice::from_raw_parts_mut(self.first, self.count))
        }
    }
}

/// An array of handles of the caller.
///
/// # Safety
/// If the pointer is not null, so many addresses are there, and each is as for [`shared`].
pub unsafe fn handles<'a, T>(
    first: *const *const T,
    count: usize,
    name: &str,
) -> Outcome<Vec<&'a T>> {
    step_of::<*const T>(0, count, name)?;
    if count > 0 {
        not_null(first, name)?;
    }
    (0..count)
        .map(|index| {
            // SAFETY: below `count`, and of a size that `step_of` checked.
            let address = unsafe { first.add(index).read_unaligned() };
            // SAFETY: the caller's promise.
            unsafe { shared(address, &format!("{name}[{index}]")) }
        })
        .collect()
}

/// A text of the caller.
///
/// # Safety
/// If the pointer is not null, a text that ends with a zero begins there, and nobody changes it during the call.
pub unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Outcome<&'a CStr> {
    not_null(pointer, name)?;
    // SAFETY: the caller's promise.
    Ok(unsafe { CStr::from_ptr(pointer) })
}

/// Structures that begin with their size, so that later versions can have more fields.
///
/// # Safety
/// `repr(C)`, and the first field is a `usize`. Any bits are a value.
pub unsafe trait Versioned: Copy {
    /// Name in C.
    const NAME: &'static str;
}

/// A structure of the caller that begins with its size.
///
/// # Safety
/// If the pointer is not null, a structure of as many bytes begins there as its first field says.
pub unsafe fn sized<T: Versioned>(pointer: *const T, name: &str) -> Outcome<T> {
    check_pointer(pointer, name)?;
    // SAFETY: not null and aligned; `Versioned` says that the first field is a `usize`.
    let size = unsafe { pointer.cast::<usize>().read() };
    if size != size_of::<T>() {
        return Err(Failure::argument(format_args!(
            "`{name}->size` is {size}, and sizeof({}) is {} in this library: call its init function",
            T::NAME,
            size_of::<T>()
        )));
    }
    // SAFETY: of this size by the caller's promise.
    Ok(unsafe { pointer.read() })
}
