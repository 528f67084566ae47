//! Errors as Embree reports them: a code for each device and thread, a text, and a function of the device.
//!
//! A device keeps the first code of a thread until `rtcGetDeviceError` takes it. Without a device, and while there is
//! none yet, codes belong to the thread.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};

use crate::abi::ErrorCode;

/// Why a call fails.
#[derive(Debug)]
pub struct Failure {
    pub code: ErrorCode,
    pub text: String,
}

impl Failure {
    pub fn argument(text: impl Into<String>) -> Self {
        Self::new(ErrorCode::InvalidArgument, text)
    }

    pub fn operation(text: impl Into<String>) -> Self {
        Self::new(ErrorCode::InvalidOperation, text)
    }

    pub fn new(code: ErrorCode, text: impl Into<String>) -> Self {
        let text = text.into();
        Self { code, text }
    }
}

impl From<&(dyn Any + Send)> for Failure {
    /// From what a panic carries.
    fn from(panic: &(dyn Any + Send)) -> Self {
        let text = (panic.downcast_ref::<&str>().copied())
            .or(panic.downcast_ref::<String>().map(String::as_str));
        Self::new(ErrorCode::Unknown, text.unwrap_or("unknown panic"))
    }
}

impl From<antumbra::Error> for Failure {
    fn from(error: antumbra::Error) -> Self {
        let code = match &error {
            antumbra::Error::Cancelled => ErrorCode::Cancelled,
            antumbra::Error::OutOfMemory { .. } => ErrorCode::OutOfMemory,
            _ => ErrorCode::InvalidOperation,
        };
        Self::new(code, error.to_string())
    }
}

pub type Outcome<T = ()> = Result<T, Failure>;

/// What one thread has to say about one device.
struct Record {
    /// 0 stands for no device.
    device: u64,
    code: ErrorCode,
    text: CString,
}

thread_local! {
    static RECORDS: RefCell<Vec<Record>> = const { RefCell::new(Vec::new()) };
}

/// Records a failure of this thread for a device, and returns its text.
#[cold]
pub fn record(device: u64, failure: &Failure) -> CString {
    let text = CString::new(failure.text.replace('\0', " ")).unwrap_or_default();
    RECORDS.with_borrow_mut(|records| {
        match records.iter_mut().find(|record| record.device == device) {
            Some(record) => {
                if record.code == ErrorCode::None {
                    record.code = failure.code;
                }
                record.text.clone_from(&text);
            }
            None => records.push(Record {
                device,
                code: failure.code,
                text: text.clone(),
            }),
        }
    });
    text
}

/// Takes the code of this thread for a device.
pub fn take(device: u64) -> ErrorCode {
    RECORDS.with_borrow_mut(|records| {
        let found = records.iter_mut().find(|record| record.device == device);
        found.map_or(ErrorCode::None, |record| {
            std::mem::replace(&mut record.code, ErrorCode::None)
        })
    })
}

/// Text of the last failure of this thread for a device. Valid until the next failure on this thread.
pub fn last_text(device: u64) -> *const c_char {
    RECORDS.with_borrow(|records| {
        let found = records.iter().find(|record| record.device == device);
        found.map_or(c"".as_ptr(), |record| record.text.as_ptr())
    })
}

/// Forgets a device that is gone.
pub fn forget(device: u64) {
    // The thread may be ending.
    let _ = RECORDS.try_with(|records| {
        records
            .borrow_mut()
            .retain(|record| record.device != device);
    });
}
