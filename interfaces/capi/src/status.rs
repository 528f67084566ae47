//! What calls return: a code, and a text for each thread. Nothing unwinds into C.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use antumbra::Error;

/// Whether a call did what it should, `antumbra_status`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Status {
    /// Done.
    Ok = 0,
    /// An argument is null, too small, unknown or out of range.
    InvalidArgument = 1,
    /// A primitive or an instance names something that is not there.
    BadGeometry = 2,
    /// More of something than can be numbered.
    TooMany = 3,
    /// The geometry or the object does not fit the tree.
    OtherGeometry = 4,
    /// The call is not possible for what it was called for.
    Unsupported = 5,
    /// A callback stopped the build.
    Cancelled = 6,
    /// A file or memory is damaged or holds something else.
    Unreadable = 7,
    /// A file was read with too few or too many functions.
    OtherFunctions = 8,
    /// A file cannot be opened, read or written.
    Io = 9,
    /// Threads could not be started.
    NoThreads = 10,
    /// A mistake of the library.
    Internal = 11,
    /// There is no memory for it.
    NoMemory = 12,
}

impl Status {
    /// Every code.
    pub const ALL: [Self; 13] = [
        Self::Ok,
        Self::InvalidArgument,
        Self::BadGeometry,
        Self::TooMany,
        Self::OtherGeometry,
        Self::Unsupported,
        Self::Cancelled,
        Self::Unreadable,
        Self::OtherFunctions,
        Self::Io,
        Self::NoThreads,
        Self::Internal,
        Self::NoMemory,
    ];

    fn words(self) -> &'static CStr {
        match self {
            Self::Ok => c"done",
            Self::InvalidArgument => c"invalid argument",
            Self::BadGeometry => c"bad geometry",
            Self::TooMany => c"too many",
            Self::OtherGeometry => c"other geometry than that of the build",
            Self::Unsupported => c"unsupported",
            Self::Cancelled => c"cancelled",
            Self::Unreadable => c"unreadable",
            Self::OtherFunctions => c"too few or too many functions",
            Self::Io => c"input or output failed",
            Self::NoThreads => c"threads could not be started",
            Self::Internal => c"internal error",
            Self::NoMemory => c"out of memory",
        }
    }
}

/// Why a call fails.
#[derive(Debug)]
pub struct Failure {
    status: Status,
    text: String,
}

impl Failure {
    pub fn new(status: Status, text: impl fmt::Display) -> Self {
        let text = text.to_string();
        Self { status, text }
    }

    /// An argument is wrong.
    pub fn argument(text: impl fmt::Display) -> Self {
        Self::new(Status::InvalidArgument, text)
    }

    /// Names what the failure is about.
    pub fn about(mut self, what: &str) -> Self {
        self.text = format!("{what}: {}", self.text);
        self
    }

    /// Ends the work on all threads with this failure, which [`guarded`] returns. No message is printed.
    pub fn unwind(self) -> ! {
        std::panic::resume_unwind(Box::new(self))
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::IndexOutOfRange { .. }
            | Error::QuadIndexOutOfRange { .. }
            | Error::ObjectOutOfRange { .. } => Status::BadGeometry,
            Error::TooMany { .. } => Status::TooMany,
            Error::OutOfMemory { .. } => Status::NoMemory,
            Error::TooShort { .. } => Status::InvalidArgument,
            Error::OtherFunctions { .. } => Status::OtherFunctions,
            Error::Unreadable { .. } => Status::Unreadable,
            Error::Io { .. } => Status::Io,
            Error::Cancelled => Status::Cancelled,
            Error::OtherPrimitives { .. }
            | Error::PrimitiveIsGone { .. }
            | Error::OtherWidth { .. } => Status::OtherGeometry,
            Error::HasInstances => Status::Unsupported,
            _ => Status::Internal,
        };
        Self::new(status, error)
    }
}

/// Result of a call before it becomes a code.
pub type Outcome<T = ()> = Result<T, Failure>;

/// Fails if there is no memory for lists of the library's own.
pub fn if_no_memory(items: usize, each: usize, what: &str) -> Outcome {
    let bytes = items.saturating_mul(each);
    let mut room = Vec::<u8>::new();
    let answer = room.try_reserve_exact(bytes);
    std::hint::black_box(&mut room);
    answer.map_err(|_| {
        let text = format!("not enough memory for {items} {what}: {bytes} bytes");
        Failure::new(Status::NoMemory, text)
    })
}

thread_local! {
    /// Text of the last failure on this thread.
    static LAST: RefCell<CString> = RefCell::default();
}

/// Runs a call, and turns failures and panics into codes.
#[inline]
pub fn guarded(call: impl FnOnce() -> Outcome) -> Status {
    // Trees stay as they were when a query panics, see `UserGeometry`. What a call builds is dropped.
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(failure)) => failed(failure),
        Err(panic) => failed(panicked(panic)),
    }
}

/// Keeps the text of a failure.
#[cold]
fn failed(failure: Failure) -> Status {
    let text = failure.text.replace('\0', "\u{fffd}");
    LAST.with_borrow_mut(|last| *last = CString::new(text).unwrap_or_default());
    failure.status
}

fn panicked(panic: Box<dyn Any + Send>) -> Failure {
    match panic.downcast::<Failure>() {
        Ok(failure) => *failure,
        Err(panic) => {
            let text = (panic.downcast_ref::<&str>().copied())
                .or(panic.downcast_ref::<String>().map(String::as_str));
            Failure::new(Status::Internal, text.unwrap_or("unknown panic"))
        }
    }
}

/// Text of the last failure on the calling thread.
#[unsafe(no_mangle)]
pub extern "C" fn antumbra_last_error() -> *const c_char {
    LAST.with_borrow(|last| last.as_ptr())
}

/// A code in words.
#[unsafe(no_mangle)]
pub extern "C" fn antumbra_status_text(status: i32) -> *const c_char {
    let known = Status::ALL
        .into_iter()
        .find(|known| *known as i32 == status);
    known.map_or(c"unknown status", Status::words).as_ptr()
}

/// Version of the library.
#[unsafe(no_mangle)]
pub extern "C" fn antumbra_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
