//! Rounded numbers of legends and scale bars.

use antumbra_image::palette;

/// A class of values in a legend.
#[derive(Clone, Debug, PartialEq)]
pub struct Class {
    /// Name beside its colour.
    pub name: String,
    /// Colour of sRGB.
    pub colour: [u8; 3],
    /// Part of the values that are in the class, from 0 to 1, below its name; `None` writes none.
    pub share: Option<f64>,
}

/// Numbers of a legend: its ends and the steps between, all of them round.
#[derive(Clone, Debug, PartialEq)]
pub struct Steps {
    /// Value at the dark end.
    pub low: f64,
    /// Value at the light end.
    pub high: f64,
    /// Values that are labelled, rising. Ends that were chosen by hand are labelled only where they are round.
    pub marks: Vec<f64>,
    /// Decimals of labels.
    pub decimals: usize,
    /// Classes instead of numbers: of the values 0, 1 and so on. Empty for numbers.
    pub classes: Vec<Class>,
    /// Class of the value 0 beside numbers, where 0 is no small number but none at all.
    pub zero: Option<Class>,
}

/// Largest number of steps.
const MOST: f64 = 7.0;

/// Counts from here on are numbers, not classes.
const MOST_CLASSES: f32 = 9.0;

/// Colour of a class of none: no colour of the others, and lighter than all but the largest values.
const NONE: [u8; 3] = [206, 207, 211];

/// Share of the values that may lie beyond each end of a legend.
const BEYOND: f64 = 0.002;

impl Steps {
    /// Steps for these values: round numbers around almost all of them. A few outliers in a thousand may lie beyond, which
    /// the map marks. Values from 0 up begin at 0, unless they are far from it. NaN and infinities do not count.
    ///
    /// With `whole` values are counts: up to 8 each of them is a class of its own, with its share of the values, because nobody
    /// distinguishes more colours. Of more none lies beyond, because the few places with the highest count are those that people
    /// look for.
    pub fn around(values: &[f32], whole: bool) -> Self {
        let mut known: Vec<f32> = values.iter().copied().filter(|x| x.is_finite()).collect();
        if known.is_empty() {
            return Self::between(0.0, 1.0, whole);
        }
        let most = known.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let least = known.iter().copied().fold(f32::INFINITY, f32::min);
        if whole && least >= 0.0 && most < MOST_CLASSES {
            let last = most.max(1.0);
            let class = |i: usize| Class {
                name: i.to_string(),
                colour: palette::colour(i as f32 / last),
                share: share(values, i as f32),
            };
            return Self::of_classes((0..=last as usize).map(class).collect());
        }
        let share = if whole { 0.0 } else { BEYOND };
        let last = known.len() - 1;
        let beyond = (share * known.len() as f64) as usize;
        let mut nth = |index| *known.select_nth_unstable_by(index, f32::total_cmp).1;
        let [mut low, mut high] = [beyond, last - beyond].map(|i| f64::from(nth(i)));
        if low >= 0.0 && low < 0.6 * high {
            low = 0.0;
        }
        if low >= high {
            // All are alike: one step around them.
            let size = if low == 0.0 { 1.0 } else { low.abs() };
            (low, high) = if low < 0.0 { (-size, 0.0) } else { (0.0, size) };
        }
        let step = step((high - low) / MOST, whole);
        low = (low / step).floor() * step;
        high = (high / step - 1e-9).ceil() * step;
        Self::between(low, high.max(low + step), whole)
    }

    /// Steps between two ends, the larger one last.
    pub fn between(low: f64, high: f64, whole: bool) -> Self {
        let step = step((high - low) / MOST, whole);
        let first = (low / step - 1e-9).ceil();
        let count = ((high / step + 1e-9).floor() - first).max(0.0) as usize + 1;
        let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
        // 2.5 has a digit more than its power of ten.
        let scaled = step * 10f64.powi(decimals as i32);
        let decimals = decimals + usize::from((scaled - scaled.round()).abs() > 1e-6);
        let marks = (0..count).map(|i| (first + i as f64) * step);
        Self {
            low,
            high,
            // Minus 0 would be written with its sign.
            marks: marks.map(|x| x + 0.0).collect(),
            decimals,
            classes: Vec::new(),
            zero: None,
        }
    }

    /// The same steps with a class of its own for the value 0, such as places that nobody sees, with its share of these values.
    pub fn with_zero(mut self, name: &str, values: &[f32]) -> Self {
        let zero = Class {
            name: name.to_owned(),
            colour: NONE,
            share: share(values, 0.0),
        };
        match self.classes.first_mut() {
            Some(class) => *class = zero,
            None => {
                self.marks.retain(|&mark| mark != 0.0);
                self.zero = Some(zero);
            }
        }
        self
    }

    /// Classes with names and colours: the values 0, 1 and so on.
    pub fn classes(classes: &[(&str, [u8; 3])]) -> Self {
        let named = classes.iter().map(|&(name, colour)| Class {
            name: name.to_owned(),
            colour,
            share: None,
        });
        Self::of_classes(named.collect())
    }

    fn of_classes(classes: Vec<Class>) -> Self {
        Self {
            low: 0.0,
            high: classes.len().saturating_sub(1).max(1) as f64,
            marks: (0..classes.len()).map(|i| i as f64).collect(),
            decimals: 0,
            classes,
            zero: None,
        }
    }

    /// Colour of a value: of viridis, or between the colours of two classes.
    pub fn colour(&self, value: f64) -> [u8; 3] {
        if let (Some(zero), true) = (&self.zero, value == 0.0) {
            return zero.colour;
        }
        if self.classes.is_empty() {
            return palette::colour(self.place(value) as f32);
        }
        let last = self.classes.len() - 1;
        let value = value.clamp(0.0, last as f64);
        let below = value.floor() as usize;
        let [a, b] = [below, (below + 1).min(last)].map(|class| self.classes[class].colour);
        let part = value - below as f64;
        let mix = |(&a, b): (&u8, u8)| f64::from(a) + part * (f64::from(b) - f64::from(a));
        let mut colour = a;
        for (own, mixed) in colour.iter_mut().zip(a.iter().zip(b).map(mix)) {
            *own = mixed.round() as u8;
        }
        colour
    }

    /// Whether colours are of classes, between which there are no values.
    pub(crate) fn has_classes(&self) -> bool {
        self.zero.is_some() || !self.classes.is_empty()
    }

    /// Whether some of these values lie below and above the legend. NaN does not, nor does a 0 with a class of its own.
    pub fn beyond(&self, values: &[f32]) -> [bool; 2] {
        // Values of single precision may round beyond an end that they equal.
        let slack = 1e-6 * (self.high - self.low);
        let any = |beyond: &dyn Fn(f64) -> bool| values.iter().any(|&x| beyond(f64::from(x)));
        [
            any(&|x| x < self.low - slack && (x != 0.0 || self.zero.is_none())),
            any(&|x| x > self.high + slack),
        ]
    }

    /// Place of a value on the legend: 0 at the dark end, 1 at the light one.
    pub fn place(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// Label of a mark.
    pub fn label(&self, mark: f64) -> String {
        let text = format!("{:.*}", self.decimals, mark);
        match text.strip_prefix('-') {
            Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
            Some(rest) => format!("\u{2212}{rest}"),
            None => text,
        }
    }
}

/// Part of the values that are finite which equals a value.
fn share(values: &[f32], value: f32) -> Option<f64> {
    let count =
        |is_counted: &dyn Fn(f32) -> bool| values.iter().filter(|&&x| is_counted(x)).count();
    Some(count(&|x| x == value) as f64 / count(&f32::is_finite).max(1) as f64)
}

/// The least round number that is not below `least`: 1, 2, 2.5 or 5 times a power of ten; at least 1 if it has to be `whole`.
pub(crate) fn step(least: f64, whole: bool) -> f64 {
    let least = if whole { least.max(1.0) } else { least };
    let power = 10f64.powf(least.log10().floor());
    let known = [1.0, 2.0, 2.5, 5.0, 10.0].map(|factor| factor * power);
    let fits = |step: &f64| *step >= least * (1.0 - 1e-9) && (!whole || step.fract() == 0.0);
    known.into_iter().find(fits).unwrap_or(10.0 * power)
}

/// The largest round number that is not above `most`: 1, 2 or 5 times a power of ten.
pub(crate) fn below(most: f64) -> f64 {
    let power = 10f64.powf(most.log10().floor());
    let known = [5.0, 2.0, 1.0].map(|factor| factor * power);
    let fits = |step: &f64| *step <= most * (1.0 + 1e-9);
    known.into_iter().find(fits).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_round_and_marks_are_few() {
        let hours: Vec<f32> = (0..1000).map(|i| i as f32 * 15.75 / 999.0).collect();
        let steps = Steps::around(&hours, false);
        assert_eq!((steps.low, steps.high), (0.0, 17.5));
        assert_eq!(steps.marks.len(), 8);
        assert_eq!(steps.label(steps.marks[1]), "2.5");

        let view: Vec<f32> = (0..1000).map(|i| 0.5 + i as f32 * 0.0005).collect();
        let steps = Steps::around(&view, false);
        assert_eq!(
            (steps.low, steps.label(steps.high)),
            (0.0, "1.0".to_owned())
        );

        let counts = [0.0, 1.0, 3.0];
        let steps = Steps::around(&counts, true);
        assert_eq!(steps.marks, [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(steps.label(3.0), "3");
        assert_eq!(steps.classes.len(), 4);
        // The few places that two observers see.
        let mut seen = vec![0.0; 1000];
        seen[7] = 2.0;
        seen[8] = 1.0;
        let steps = Steps::around(&seen, true);
        assert_eq!(steps.marks, [0.0, 1.0, 2.0]);
        assert_eq!(steps.beyond(&seen), [false; 2]);
        let shares: Vec<_> = steps.classes.iter().map(|class| class.share).collect();
        assert_eq!(shares, [Some(0.998), Some(0.001), Some(0.001)]);
        seen[7] = 40.0;
        let steps = Steps::around(&seen, true);
        assert!(steps.classes.is_empty() && steps.high >= 40.0);
    }

    #[test]
    fn none_is_a_class_of_its_own() {
        for most in [2.0, 40.0] {
            let seen = [0.0, 1.0, 0.0, most, f32::NAN];
            let plain = Steps::around(&seen, true);
            let steps = plain.clone().with_zero("not seen", &seen);
            assert_eq!(plain.has_classes(), most < 10.0);
            assert!(steps.has_classes());
            let zero = steps
                .zero
                .as_ref()
                .or(steps.classes.first())
                .expect("a class");
            assert_eq!((zero.name.as_str(), zero.share), ("not seen", Some(0.5)));
            assert_eq!(steps.colour(0.0), NONE);
            for count in [1.0, 2.0] {
                assert_eq!(steps.colour(count), plain.colour(count));
            }
            assert!(steps.zero.is_none() || !steps.marks.contains(&0.0));
            // Of ends that were chosen, 0 is not below.
            let chosen = Steps::between(1.0, 40.0, true).with_zero("not seen", &seen);
            assert_eq!(chosen.beyond(&seen), [false; 2]);
        }
    }

    #[test]
    fn far_from_zero_and_below_it() {
        let steps = Steps::around(&[950.0, 1010.0, f32::NAN, f32::INFINITY], false);
        assert_eq!((steps.low, steps.high), (950.0, 1010.0));
        let steps = Steps::around(&[-3.0, 4.0], false);
        assert_eq!((steps.low, steps.high), (-3.0, 4.0));
        assert_eq!(steps.label(-3.0), "\u{2212}3");
        assert_eq!(steps.label(-0.0), "0");
    }

    #[test]
    fn an_outlier_does_not_decide() {
        let mut values = vec![1.0; 10_000];
        values[17] = 1e6;
        assert_eq!(Steps::around(&values, false).high, 1.0);
    }

    #[test]
    fn values_that_are_alike_or_absent() {
        for (values, low, high) in [
            (&[][..], 0.0, 1.0),
            (&[0.0], 0.0, 1.0),
            (&[7.0, 7.0], 0.0, 7.0),
            (&[-2.0], -2.0, 0.0),
        ] {
            let steps = Steps::around(values, false);
            assert_eq!((steps.low, steps.high), (low, high), "{values:?}");
        }
    }

    #[test]
    fn values_beyond_the_legend_are_seen() {
        let steps = Steps::between(0.0, 1.0, false);
        assert_eq!(steps.beyond(&[0.0, 1.0]), [false; 2]);
        assert_eq!(steps.beyond(&[-0.1, 1.0]), [true, false]);
        assert_eq!(steps.beyond(&[f32::NAN, 1.5]), [false, true]);
        assert_eq!(steps.beyond(&[f32::NEG_INFINITY]), [true, false]);
    }

    #[test]
    fn classes_have_their_colours_and_mixtures_between() {
        let steps = Steps::classes(&[("shadow", [0, 10, 20]), ("sun", [100, 110, 255])]);
        assert_eq!(steps.colour(0.0), [0, 10, 20]);
        assert_eq!(steps.colour(1.0), [100, 110, 255]);
        assert_eq!(steps.colour(0.5), [50, 60, 138]);
        assert_eq!(steps.colour(7.0), [100, 110, 255]);
        assert_eq!(
            Steps::between(0.0, 2.0, false).colour(2.0),
            palette::colour(1.0)
        );
    }

    #[test]
    fn round_numbers() {
        assert_eq!(step(0.3, false), 0.5);
        assert_eq!(step(0.3, true), 1.0);
        assert_eq!(step(2.1, true), 5.0);
        assert_eq!(step(210.0, false), 250.0);
        assert_eq!(below(260.0), 200.0);
        assert_eq!(below(0.99), 0.5);
    }
}
