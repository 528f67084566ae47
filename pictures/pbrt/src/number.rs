//! Numbers in the forms of pbrt-v3: `.5`, `5.`, `+3`, `-1e-3`, `inf`, `nan`.

/// Reason why a word is not a usable number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum NumberError {
    /// The word is not a number.
    NotANumber,
    /// The number is finite as written, but beyond the range of the type.
    OutOfRange,
    /// The number is a fraction, but an integer is required.
    NotAnInteger,
}

/// Reads a number in the range of 32-bit floats.
///
/// `inf` and `nan` are accepted. A finite number that overflows is an error, and one that underflows is 0.
pub(crate) fn parse_float(word: &[u8]) -> Result<f64, NumberError> {
    let text = std::str::from_utf8(word).map_err(|_| NumberError::NotANumber)?;
    let value: f64 = text.parse().map_err(|_| NumberError::NotANumber)?;
    let is_written_finite = word.iter().any(u8::is_ascii_digit);
    if is_written_finite && !(value as f32).is_finite() {
        return Err(NumberError::OutOfRange);
    }
    Ok(value)
}

/// Reads a 32-bit integer. Float forms such as `1e3` are accepted if their value is an integer.
pub(crate) fn parse_integer(word: &[u8]) -> Result<i32, NumberError> {
    if let ([first, ..], 1..=9) = (word, word.len()) {
        // Fast path for the usual case of a few digits.
        if first.is_ascii_digit() && word.iter().all(u8::is_ascii_digit) {
            return Ok(word
                .iter()
                .fold(0, |sum, digit| sum * 10 + i32::from(digit - b'0')));
        }
    }
    let text = std::str::from_utf8(word).map_err(|_| NumberError::NotANumber)?;
    let value: f64 = text.parse().map_err(|_| NumberError::NotANumber)?;
    if !value.is_finite() || value < f64::from(i32::MIN) || value > f64::from(i32::MAX) {
        return Err(NumberError::OutOfRange);
    }
    if value.fract() != 0.0 {
        return Err(NumberError::NotAnInteger);
    }
    Ok(value as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_a_float() {
        for (text, value) in [
            (".5", 0.5),
            ("5.", 5.0),
            ("-1e-3", -1e-3),
            ("+3", 3.0),
            ("-.25E+2", -25.0),
            ("007", 7.0),
            ("1e-999", 0.0),
            ("inf", f64::INFINITY),
        ] {
            assert_eq!(parse_float(text.as_bytes()), Ok(value), "{text}");
        }
        for text in ["", ".", "-", "e5", "1.5x", "1,5", "0x10", "\0"] {
            assert_eq!(
                parse_float(text.as_bytes()),
                Err(NumberError::NotANumber),
                "{text}"
            );
        }
        for text in ["1e999", "-1e39", "1e99999999999999999999"] {
            assert_eq!(
                parse_float(text.as_bytes()),
                Err(NumberError::OutOfRange),
                "{text}"
            );
        }
    }

    #[test]
    fn integers_may_be_written_as_floats_when_exact() {
        for (text, value) in [
            ("0", 0),
            ("+12", 12),
            ("-7", -7),
            ("3.0", 3),
            ("1e3", 1000),
            ("2147483647", i32::MAX),
            ("-2147483648", i32::MIN),
        ] {
            assert_eq!(parse_integer(text.as_bytes()), Ok(value), "{text}");
        }
        assert_eq!(parse_integer(b"1.5"), Err(NumberError::NotAnInteger));
        assert_eq!(parse_integer(b"2147483648"), Err(NumberError::OutOfRange));
        assert_eq!(parse_integer(b"1e999"), Err(NumberError::OutOfRange));
        assert_eq!(parse_integer(b"nan"), Err(NumberError::OutOfRange));
        assert_eq!(parse_integer(b"ten"), Err(NumberError::NotANumber));
    }
}
