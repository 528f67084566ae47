//! Protection against panics in decoders of other crates: the file counts as damaged, and rendering goes on.
//!
//! Such panics are bugs of the decoders. Where fuzzing found the cause, the file is checked before its decoder sees it,
//! for a better message. [`contained`] covers unknown causes.

use std::any::Any;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Calls `decode` and turns its error or panic into a message. Wrap only calls of other crates.
///
/// After a panic, values that `decode` worked on are in an unspecified state and must not be used again. The panic
/// hook runs, which by default prints the place of the panic.
pub(crate) fn contained<T, E: Display>(decode: impl FnOnce() -> Result<T, E>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(decode)) {
        Ok(decoded) => decoded.map_err(|error| error.to_string()),
        Err(panic) => {
            let message = words(panic.as_ref());
            Err(format!(
                "the file is damaged in a way that the decoder does not handle ({message})"
            ))
        }
    }
}

/// Message of a panic.
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
