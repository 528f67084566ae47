//! Values of flags: choices, lists, sizes.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use antumbra::recipe::{Builder, Collapse, Level, Order, UnknownName};
use antumbra::{Isa, Width};
use antumbra_lab::RaysFrom;
use antumbra_scene::Film;
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS};
use clap::builder::{PathBufValueParser, TypedValueParser};

use crate::exit::Failure;

/// A length of time, longer than none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interval(pub Duration);

impl FromStr for Interval {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match humantime::parse_duration(text) {
            Ok(Duration::ZERO) => Err("it must be longer than 0".into()),
            Ok(duration) => Ok(Self(duration)),
            Err(error) => Err(format!(
                "{error}; lengths of time are written as 90s, 10m or 1h30m"
            )),
        }
    }
}

/// Share of noise in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise(pub f64);

impl FromStr for Noise {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit) = match text.strip_suffix('%') {
            Some(number) => (number, 0.01),
            None => (text, 1.0),
        };
        let share = number
            .trim()
            .parse::<f64>()
            .ok()
            .map(|number| number * unit);
        match share {
            Some(share) if share > 0.0 && share < 1.0 => Ok(Self(share)),
            _ => Err(format!("`{text}` is not a share such as 1% or 0.01")),
        }
    }
}

/// A row of a list, or what suits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice<T> {
    Auto,
    Fixed(T),
}

impl<T: FromStr<Err = UnknownName>> FromStr for Choice<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            name => {
                let row = name.parse().map_err(|error| format!("{error}, auto"));
                row.map(Self::Fixed)
            }
        }
    }
}

/// Several choices, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choices<T>(pub Vec<Choice<T>>);

impl<T: FromStr<Err = UnknownName> + PartialEq> FromStr for Choices<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        list(text, str::parse).map(Self)
    }
}

/// An instruction set or the best there is.
pub type LevelChoice = Choice<Level>;

impl LevelChoice {
    /// The instruction set, checked against this CPU.
    pub fn isa(self) -> Result<Isa, Failure> {
        match self {
            Self::Auto => Ok(Isa::best()),
            Self::Fixed(level) => Isa::new(level).map_err(Failure::usage),
        }
    }
}

/// Several instruction sets, each once.
pub type Levels = Choices<Level>;

impl Levels {
    /// The instruction sets, each once and checked against this CPU.
    pub fn isas(&self) -> Result<Vec<Isa>, Failure> {
        let mut isas: Vec<Isa> = Vec::new();
        for choice in &self.0 {
            let isa = choice.isa()?;
            if isas.iter().all(|other| other.level() != isa.level()) {
                isas.push(isa);
            }
        }
        Ok(isas)
    }
}

/// Whether batches prefetch; `None`: by the size of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrefetchChoice(pub Option<bool>);

impl FromStr for PrefetchChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self(None)),
            "on" => Ok(Self(Some(true))),
            "off" => Ok(Self(Some(false))),
            _ => Err(format!("`{text}` is not auto, on or off")),
        }
    }
}

/// Several numbers of threads; `None` is one per CPU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ThreadCounts(pub Vec<Option<NonZeroUsize>>);

impl ThreadCounts {
    /// Most threads that can be chosen.
    const MOST: usize = 1024;
}

impl FromStr for ThreadCounts {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |name: &str| match name {
            "all" => Ok(None),
            number => match number.parse() {
                Ok(count) if count <= Self::MOST => NonZeroUsize::new(count).map(Some),
                _ => None,
            }
            .ok_or_else(|| format!("`{number}` is not all or a number from 1 to {}", Self::MOST)),
        };
        list(text, parse).map(Self)
    }
}

/// A width or what suits the instruction set.
pub type WidthChoice = Choice<Width>;

impl WidthChoice {
    /// The width on an instruction set.
    pub fn on(self, isa: Isa) -> Width {
        match self {
            Self::Auto => Width::auto(isa.level()),
            Self::Fixed(width) => width,
        }
    }
}

/// Declares a list of rows of a table, each once.
macro_rules! list_of {
    ($(#[$doc:meta])* $list:ident($row:ty), $all:expr, $parse:expr) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub struct $list(pub Vec<$row>);

        impl FromStr for $list {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                list_or_all(text, $all, $parse).map(Self)
            }
        }
    };
}

list_of!(/** Several orders. */ Orders(Order), &ORDERS, antumbra_trees::order);
list_of!(/** Several collapses. */ Collapses(Collapse), &COLLAPSES, antumbra_trees::collapse);
list_of!(/** Several builders. */ Trees(Builder), &BUILDERS, antumbra_trees::builder);

/// A place of the eye.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraChoice {
    /// Eye, target and up vector, as in pbrt's `LookAt`.
    LookAt([f64; 9]),
    /// The camera of this scene file.
    OfScene(PathBuf),
}

impl FromStr for CameraChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split([',', ' ']).filter(|part| !part.is_empty());
        let numbers: Option<Vec<f64>> = parts.map(|part| part.parse().ok()).collect();
        match numbers.map(<[f64; 9]>::try_from) {
            None => Ok(Self::OfScene(text.into())),
            Some(Ok(numbers)) if numbers.iter().all(|number| number.is_finite()) => {
                Ok(Self::LookAt(numbers))
            }
            Some(_) => Err(format!(
                "`{text}` is neither a scene file nor nine finite numbers `eyex,eyey,eyez atx,aty,atz upx,upy,upz`"
            )),
        }
    }
}

/// Parser of the name of an output; `-` is the standard output.
pub fn output_file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|path| {
        if path.as_os_str() == "-" {
            "/dev/stdout".into()
        } else {
            path
        }
    })
}

/// Parses a number that is as wanted.
fn number<T: FromStr>(text: &str, is_right: fn(&T) -> bool, wanted: &str) -> Result<T, String> {
    let number = text.parse().ok().filter(is_right);
    number.ok_or_else(|| format!("it must be a number{wanted}"))
}

/// Parses a distance above 0.
pub fn distance(text: &str) -> Result<f32, String> {
    number(text, |&distance: &f32| distance > 0.0, " above 0")
}

/// Parses an angle between 0 and 180 degrees.
pub fn angle_of_view(text: &str) -> Result<f32, String> {
    let is_right = |&angle: &f32| angle > 0.0 && angle < 180.0;
    number(text, is_right, " between 0 and 180")
}

/// Parses a number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    number(text, |&x: &f64| x > 0.0 && x.is_finite(), " above 0")
}

/// Parses a finite number.
pub fn finite(text: &str) -> Result<f64, String> {
    number(text, |x: &f64| x.is_finite(), "")
}

/// Parses a number that is not negative.
pub fn from_zero(text: &str) -> Result<f64, String> {
    number(text, |&x: &f64| x >= 0.0 && x.is_finite(), " from 0")
}

/// Parses a part of a whole.
pub fn part(text: &str) -> Result<f64, String> {
    number(text, |x: &f64| (0.0..=1.0).contains(x), " from 0 to 1")
}

/// Parses the cost of a step of a traversal.
pub fn cost(text: &str) -> Result<f32, String> {
    let cost: f32 = text.parse().map_err(|_| "no number".to_owned())?;
    if cost.is_finite() && cost >= 0.0 {
        Ok(cost)
    } else {
        Err("a cost is finite and not negative".to_owned())
    }
}

/// Parses the origin of training rays.
pub fn rays_from(text: &str) -> Result<RaysFrom, String> {
    let mut all = RaysFrom::ALL.into_iter();
    all.find(|choice| choice.name() == text).ok_or_else(|| {
        let known = RaysFrom::ALL.map(RaysFrom::name).join(", ");
        format!("unknown source `{text}`; known are {known}")
    })
}

/// Several widths, each once.
pub type Widths = Choices<Width>;

impl Widths {
    /// The widths; `None` is what suits the instruction set.
    pub fn choices(&self) -> Vec<Option<Width>> {
        let choices = self.0.iter().map(|choice| match choice {
            WidthChoice::Auto => None,
            WidthChoice::Fixed(width) => Some(*width),
        });
        choices.collect()
    }

    /// Whether nothing but `auto` was chosen.
    pub fn is_auto(&self) -> bool {
        self.0 == [WidthChoice::Auto]
    }

    /// The widths on an instruction set, each once: `auto` may be one that is also listed.
    pub fn on(&self, isa: Isa) -> Vec<Width> {
        each_once(self.0.iter().map(|choice| choice.on(isa)))
    }
}

/// The items without repetitions, in the order in which they first come.
fn each_once<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut once = Vec::new();
    for item in items {
        if !once.contains(&item) {
            once.push(item);
        }
    }
    once
}

/// [`list`] of names, or every one there is for `all`.
fn list_or_all<T: Copy + PartialEq>(
    text: &str,
    all: &[T],
    find: fn(&str) -> Result<T, UnknownName>,
) -> Result<Vec<T>, String> {
    if text == "all" {
        return Ok(all.to_vec());
    }
    list(text, |name| {
        find(name).map_err(|error| format!("{error}; or all"))
    })
}

/// The parts of a list separated by commas; an error names the part that occurs twice.
fn list<T: PartialEq>(
    text: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<T>, String> {
    let mut items = Vec::new();
    for name in text.split(',') {
        let item = parse(name)?;
        if items.contains(&item) {
            return Err(format!("`{name}` is listed twice"));
        }
        items.push(item);
    }
    Ok(items)
}

/// Size of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution(pub [u32; 2]);

impl FromStr for Resolution {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text
            .split_once('x')
            .and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]))
            .ok_or("expected two whole numbers such as 640x360")?;
        let pixels = u64::from(sides[0]) * u64::from(sides[1]);
        if (1..=Film::MAX_PIXELS).contains(&pixels) {
            Ok(Self(sides))
        } else {
            Err(format!(
                "{pixels} pixels are not between 1 and {}",
                Film::MAX_PIXELS
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_hold_each_item_once() {
        assert_eq!("all".parse(), Ok(Orders(ORDERS.to_vec())));
        assert_eq!(
            "sort-,sort+".parse(),
            Ok(Orders(vec![Order::SortMinus, Order::SortPlus]))
        );
        for bad in ["", "sort,", "sort,sort", "best", "all,sort"] {
            assert!(bad.parse::<Orders>().is_err(), "{bad}");
            assert!(bad.parse::<Collapses>().is_err(), "{bad}");
        }
        assert_eq!("all".parse(), Ok(Collapses(COLLAPSES.to_vec())));
        let collapses = vec![Collapse::Learned, Collapse::Area];
        assert_eq!("learned,area".parse(), Ok(Collapses(collapses)));
        for bad in ["", "5", "4,4", "4;8"] {
            assert!(bad.parse::<Widths>().is_err(), "{bad}");
        }
        for bad in ["", "0", "2,2", "1025", "-1", "many", "all,all"] {
            assert!(bad.parse::<ThreadCounts>().is_err(), "{bad}");
        }
        for bad in ["", "mmx", "auto,auto", "avx2;scalar"] {
            assert!(bad.parse::<Levels>().is_err(), "{bad}");
        }
        let threads = [NonZeroUsize::new(3), None, NonZeroUsize::new(1)];
        assert_eq!("3,all,1".parse(), Ok(ThreadCounts(threads.to_vec())));
        let levels: Levels = "auto,scalar".parse().expect("a list");
        let isas = levels.isas().expect("scalar code runs everywhere");
        assert_eq!(isas.last().map(|isa| isa.level()), Some(Level::Scalar));
        let widths: Widths = "16,auto,8,4".parse().expect("a list");
        assert_eq!(widths.on(Isa::best()).len(), 3);
    }

    #[test]
    fn cameras_are_nine_numbers_or_a_file() {
        let numbers = [0.0, 1.5, -5.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0];
        for text in ["0,1.5,-5 0,1,0 0,1,0", "0 1.5 -5  0 1 0  0 1 0"] {
            assert_eq!(text.parse(), Ok(CameraChoice::LookAt(numbers)));
        }
        let file = CameraChoice::OfScene("other.pbrt".into());
        assert_eq!("other.pbrt".parse(), Ok(file));
        for bad in ["", "1,2,3", "0,0,0 0,0,1 0,1,inf", "1 2 3 4 5 6 7 8 9 10"] {
            assert!(bad.parse::<CameraChoice>().is_err(), "{bad}");
        }
    }

    #[test]
    fn prefetching_is_by_size_or_set() {
        for (text, choice) in [("auto", None), ("on", Some(true)), ("off", Some(false))] {
            assert_eq!(text.parse(), Ok(PrefetchChoice(choice)));
        }
        assert!("yes".parse::<PrefetchChoice>().is_err());
    }

    #[test]
    fn resolutions_are_two_numbers() {
        assert_eq!("640x360".parse(), Ok(Resolution([640, 360])));
        for bad in [
            "",
            "640",
            "0x5",
            "5x0",
            "-1x4",
            "1x2x3",
            "99999x99999",
            "axb",
        ] {
            assert!(bad.parse::<Resolution>().is_err(), "{bad}");
        }
    }
}
