//! The form of all functions: what C passes becomes what the body takes, and failures become codes.
//!
//! The functions under `functions!` and `frees!` are the list from which the declarations of the header are written. Their
//! documentation is the header's, line by line.

use std::ffi::{CStr, c_char};
use std::path::Path;

use antumbra::Recipe;

use crate::arrays::{Handle, MaybeSlot, Slot, exclusive, optional, shared, text};
use crate::batch::{BatchOptions, Rays};
use crate::build::{BuildOptions, Prepared};
use crate::functions::{FunctionLists, Given};
use crate::groups::{self, GroupOptions};
use crate::hits::OnHit;
use crate::points::{self, PointOptions};
use crate::recipe::RecipeChoices;
use crate::status::Outcome;
use crate::threads::{Place, Threads};

/// What the body of a function takes.
pub trait Argument: Sized {
    /// What C passes.
    type Passed: Copy;

    /// Prepares places for answers, before anything can fail.
    ///
    /// # Safety
    /// As of [`Argument::read`].
    unsafe fn clear(_passed: Self::Passed) {}

    /// # Safety
    /// What the header says of this argument.
    unsafe fn read(passed: Self::Passed, name: &str) -> Outcome<Self>;
}

/// Defines functions of C.
macro_rules! functions {
    ($($(#[doc = $doc:literal])* fn $name:ident($($argument:ident: $Type:ty),* $(,)?) $body:block)*) => {$(
        $(#[doc = $doc])*
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            $($argument: <$Type as $crate::interface::Argument>::Passed),*
        ) -> $crate::status::Status {
            $crate::status::guarded(|| {
                // SAFETY: the header says what is at these addresses.
                $(unsafe { <$Type as $crate::interface::Argument>::clear($argument) };)*
                // SAFETY: as above.
                $(let $argument = unsafe {
                    <$Type as $crate::interface::Argument>::read($argument, stringify!($argument))
                }?;)*
                $body
            })
        }
    )*};
}

/// Defines functions that free handles.
macro_rules! frees {
    ($($(#[doc = $doc:literal])* fn $name:ident($handle:ident: $Type:ty);)*) => {$(
        $(#[doc = $doc])*
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($handle: *mut $Type) {
            // SAFETY: the header says that a handle is freed once.
            unsafe { $crate::arrays::take_back($handle) }
        }
    )*};
}

pub(crate) use {frees, functions};

/// Numbers, and addresses that mean something only with a count.
macro_rules! as_passed {
    ($($Type:ty $(, $T:ident)?;)*) => {$(
        impl$(<$T>)? Argument for $Type {
            type Passed = Self;

            unsafe fn read(passed: Self, _: &str) -> Outcome<Self> {
                Ok(passed)
            }
        }
    )*};
}

as_passed! { u32; usize; f64; Option<OnHit>; *const T, T; *mut T, T; }

/// Arguments that a function of this library reads.
macro_rules! read_by {
    ($($Type:ty $(, $T:ident $(: $Bound:ident)?)? = $Passed:ty: $read:expr;)*) => {$(
        impl<'a $(, $T $(: $Bound)?)?> Argument for $Type {
            type Passed = $Passed;

            unsafe fn read(passed: $Passed, name: &str) -> Outcome<Self> {
                // SAFETY: the caller's promise.
                unsafe { $read(passed, name) }
            }
        }
    )*};
}

read_by! {
    &'a T, T = *const T: shared;
    &'a mut T, T = *mut T: exclusive;
    Option<&'a T>, T = *const T: optional;
    Slot<T>, T: Copy = *mut T: Slot::new;
    MaybeSlot<T>, T: Copy = *mut T: MaybeSlot::new;
    Place<'a> = *const Threads: |threads, _: &str| Place::of(threads);
    Recipe = *const RecipeChoices: |choices, _: &str| RecipeChoices::recipe(choices);
    Prepared<'a> = *const BuildOptions: |options, _: &str| Prepared::new(options);
    Given = *const FunctionLists: |lists, _: &str| FunctionLists::functions(lists);
    Rays<'a> = *const BatchOptions: |batch, _: &str| Rays::new(batch);
    groups::Points<'a> = *const GroupOptions: |group, _: &str| groups::Points::new(group);
    points::Points<'a> = *const PointOptions: |points, _: &str| points::Points::new(points);
    FilePath<'a> = *const c_char: |path, name: &str| text(path, name).and_then(FilePath::new);
}

impl<T> Argument for Handle<T> {
    type Passed = *mut *mut T;

    unsafe fn clear(passed: *mut *mut T) {
        // SAFETY: the caller's promise.
        if let Ok(slot) = unsafe { Slot::new(passed, "") } {
            slot.put(std::ptr::null_mut());
        }
    }

    unsafe fn read(passed: *mut *mut T, name: &str) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        unsafe { Slot::new(passed, name) }.map(Handle)
    }
}

/// A handle that the caller need not take.
impl<T> Argument for Option<Handle<T>> {
    type Passed = *mut *mut T;

    unsafe fn clear(passed: *mut *mut T) {
        // SAFETY: the caller's promise.
        unsafe { Handle::clear(passed) }
    }

    unsafe fn read(passed: *mut *mut T, name: &str) -> Outcome<Self> {
        // SAFETY: the caller's promise.
        (!passed.is_null())
            .then(|| unsafe { Handle::read(passed, name) })
            .transpose()
    }
}

/// A path of the caller.
pub struct FilePath<'a>(pub &'a Path);

impl<'a> FilePath<'a> {
    #[cfg(unix)]
    fn new(path: &'a CStr) -> Outcome<Self> {
        use std::os::unix::ffi::OsStrExt;
        Ok(Self(Path::new(std::ffi::OsStr::from_bytes(
            path.to_bytes(),
        ))))
    }

    /// In UTF-8.
    #[cfg(not(unix))]
    fn new(path: &'a CStr) -> Outcome<Self> {
        let path = path.to_str();
        let path = path.map_err(|_| crate::status::Failure::argument("`path` is not UTF-8"))?;
        Ok(Self(Path::new(path)))
    }
}
