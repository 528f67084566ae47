//! Decoders of other crates: a file that one of them panics over is an unreadable file, not the end of a rendering.
//!
//! Such panics are mistakes of those crates, found by fuzzing now and then. Where the cause is known, the file is
//! checked before its decoder sees it, for a message that says what is wrong; this is for what is not known yet.

use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What `decode` returns, its error or its panic in words. To be wrapped around calls of other crates only. After a
/// panic whatever `decode` worked on is in no particular state and must not be used again. (The panic hook runs: by
/// default it prints where the panic was.)
pub(crate) fn contained<T, E: Display>(decode: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(decoded) => decoded.map_err(|error| error.to_string()),
        Err(panic) => {
            let message = words(panic.as_ref());
            Err(format!(
                "it is damaged in a way that its decoder is not prepared for ({message})"
            ))
        }
    }
}

/// The message of a panic.
fn words(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::contained;

    #[test]
    fn results_errors_and_panics() {
        let decoded: Result<i32, &str> = Ok(7);
        assert_eq!(contained(|| decoded), Ok(7));
        let refused: Result<i32, &str> = Err("no picture");
        assert_eq!(contained(|| refused), Err("no picture".into()));
        let broken = contained(|| -> Result<i32, &str> { panic!("row {} is missing", 3) });
        assert!(broken.unwrap_err().contains("(row 3 is missing)"));
        let broken = contained(|| -> Result<i32, &str> { panic!("no rows") });
        assert!(broken.unwrap_err().contains("(no rows)"));
    }
}
