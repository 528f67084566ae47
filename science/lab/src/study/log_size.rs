//! Number of training rays, as people say it.

use std::fmt;
use std::str::FromStr;

/// Number of training rays: `1%` of the shadow rays, or `4096`.
///
/// A share is clamped: to some thousand rays at least, to a quarter of the rays of a small picture, and to 16384
/// rays at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LogSize {
    /// A share of the shadow rays, in 0..=1.
    Share(f64),
    /// A number of rays.
    Rays(u32),
}

impl Default for LogSize {
    /// One per cent.
    fn default() -> Self {
        Self::Share(0.01)
    }
}

impl LogSize {
    /// Limit on rays: each takes some hundred bytes, in a forest of instances a few thousand.
    const MOST: u32 = 1 << 20;
}

impl fmt::Display for LogSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Share(share) => write!(f, "{}%", 100.0 * share),
            Self::Rays(rays) => write!(f, "{rays}"),
        }
    }
}

impl FromStr for LogSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let size = match text.strip_suffix('%') {
            Some(percent) => percent
                .trim_end()
                .parse()
                .ok()
                .filter(|percent| (0.0..=100.0).contains(percent))
                .map(|percent: f64| Self::Share(percent / 100.0)),
            None => text
                .parse()
                .ok()
                .filter(|rays| *rays <= Self::MOST)
                .map(Self::Rays),
        };
        size.ok_or_else(|| {
            format!(
                "`{text}` is neither a share of the shadow rays such as 1% nor a number of rays up to {}",
                Self::MOST
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_sizes_are_shares_or_numbers() {
        assert_eq!("1%".parse(), Ok(LogSize::Share(0.01)));
        assert_eq!("4000".parse(), Ok(LogSize::Rays(4000)));
        assert_eq!("0".parse(), Ok(LogSize::Rays(0)));
        for text in ["1%", "0.5%", "4000"] {
            assert_eq!(text.parse::<LogSize>().expect("a size").to_string(), text);
        }
        for bad in ["", "%", "-1", "101%", "nan%", "0.5", "many", "99999999"] {
            assert!(bad.parse::<LogSize>().is_err(), "{bad}");
        }
    }
}
