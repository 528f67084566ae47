//! One line about work under way, for a terminal and for a log.

use std::time::Duration;

/// Columns of a terminal line. One less than 80, because some terminals wrap after the last column.
pub const COLUMNS: usize = 79;
/// Columns that a bar may have between its brackets. Few choices, so that it keeps still.
const BARS: [usize; 3] = [20, 10, 4];
/// Most columns of a title: with rates beside it, and without.
const TITLES: [usize; 2] = [24, 40];

/// Work under way.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Line {
    /// Name of the scene or piece of work. May be empty.
    pub title: String,
    /// Name of the work that is under way.
    pub doing: String,
    /// Piece of work that is under way, and how many there are, if there are several.
    pub piece: Option<[usize; 2]>,
    /// Part that is done, in 0..=1, if it is known.
    pub share: Option<f64>,
    /// Time since the work was begun.
    pub elapsed: Duration,
    /// Time that the rest may take, if it is known.
    pub left: Option<Duration>,
    /// Samples per second.
    pub samples: Option<f64>,
    /// Rays per second.
    pub rays: Option<f64>,
}

impl Line {
    /// The line for a terminal: never wider than [`COLUMNS`]. Facts come before the bar, which takes the room that is
    /// left. Facts that have no room are left out, from the end.
    pub fn bar(&self) -> String {
        let [short, long] = TITLES;
        let start = self.start(if self.samples.is_some() { short } else { long });
        let share = self.share.map(|share| share.clamp(0.0, 1.0));
        let percent = share.map_or(String::new(), |share| format!(" {:3.0} %", 100.0 * share));
        let mut facts = String::new();
        let width = |text: &str| text.chars().count();
        let taken = width(&start) + width(&percent);
        for fact in self.facts() {
            if taken + width(&facts) + 2 + width(&fact) > COLUMNS {
                break;
            }
            facts = format!("{facts}, {fact}");
        }
        let room = COLUMNS.saturating_sub(taken + width(&facts) + 1);
        let cells = BARS.into_iter().find(|cells| cells + 2 <= room);
        let bar = share.zip(cells).map_or(String::new(), |(share, cells)| {
            let full = (share * cells as f64) as usize;
            format!(" [{}{}]", "=".repeat(full), " ".repeat(cells - full))
        });
        cut(&format!("{start}{bar}{percent}{facts}"), COLUMNS)
    }

    /// The line for a log.
    pub fn log(&self) -> String {
        let mut line = self.start(usize::MAX);
        if let Some(share) = self.share {
            line = format!("{line}, {:.0} %", 100.0 * share.clamp(0.0, 1.0));
        }
        for fact in self.facts() {
            line = format!("{line}, {fact}");
        }
        line
    }

    fn start(&self, most: usize) -> String {
        match self.title.is_empty() {
            true => self.doing.clone(),
            false if self.doing.is_empty() => cut(&self.title, most),
            false => format!("{}: {}", cut(&self.title, most), self.doing),
        }
    }

    fn facts(&self) -> impl Iterator<Item = String> {
        let million = |x: f64| match x / 1e6 {
            x if x < 0.1 => format!("{x:.3}"),
            x if x < 10.0 => format!("{x:.2}"),
            x => format!("{x:.0}"),
        };
        let facts = [
            self.piece.map(|[own, all]| format!("{own} of {all}")),
            Some(time(self.elapsed)),
            self.left.map(|left| format!("{} left", time(left))),
            self.samples.map(|x| format!("{} Msample/s", million(x))),
            self.rays.map(|x| format!("{} Mray/s", million(x))),
        ];
        facts.into_iter().flatten()
    }
}

/// A length of time in its two largest units.
pub fn time(time: Duration) -> String {
    let seconds = time.as_secs();
    let (minutes, hours, days) = (seconds / 60, seconds / 3600, seconds / 86_400);
    match (days, hours, minutes) {
        (0, 0, 0) => format!("{seconds} s"),
        (0, 0, _) => format!("{minutes} min {} s", seconds % 60),
        (0, _, _) => format!("{hours} h {} min", minutes % 60),
        _ => format!("{days} d {} h", hours % 24),
    }
}

/// A text of so many columns at most. What is left out is marked.
fn cut(text: &str, columns: usize) -> String {
    if text.chars().count() <= columns {
        return text.to_owned();
    }
    let start: String = text.chars().take(columns - 1).collect();
    format!("{start}…")
}

/// Breaks long lines between words. Lines that begin with a space are not broken: they show places in files.
pub fn wrapped(text: &str) -> String {
    let lines = text.split('\n').map(|line| {
        if line.chars().count() <= COLUMNS || line.starts_with(' ') {
            return line.to_owned();
        }
        let (mut out, mut column) = (String::new(), 0);
        for word in line.split(' ') {
            let length = word.chars().count();
            if column > 0 && column + 1 + length > COLUMNS {
                out.push_str("\n    ");
                column = 4;
            } else if column > 0 {
                out.push(' ');
                column += 1;
            }
            out.push_str(word);
            column += length;
        }
        out
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full(title: &str) -> Line {
        Line {
            title: title.into(),
            doing: "tracing training rays".into(),
            piece: Some([1234, 5678]),
            share: Some(0.421),
            elapsed: Duration::from_secs(3 * 86_400 + 7201),
            left: Some(Duration::from_secs(5000)),
            samples: Some(123_456_789.0),
            rays: Some(1_234.0),
        }
    }

    #[test]
    fn lines_fit_a_terminal_of_80_columns() {
        for title in ["", "town", "a scene whose name is far too long for a line"] {
            for share in [None, Some(0.0), Some(1.0), Some(7.0)] {
                let line = Line {
                    share,
                    ..full(title)
                };
                let bar = line.bar();
                assert!(bar.chars().count() <= COLUMNS, "{bar}");
            }
        }
        let doing = "x".repeat(200);
        let line = Line {
            doing,
            ..Line::default()
        };
        assert_eq!(line.bar().chars().count(), COLUMNS);
    }

    #[test]
    fn facts_come_in_order_and_words() {
        let line = Line {
            doing: "rendering".into(),
            piece: Some([3, 20]),
            elapsed: Duration::from_secs(12),
            left: Some(Duration::from_secs(77)),
            ..full("town")
        };
        assert_eq!(
            line.log(),
            "town: rendering, 42 %, 3 of 20, 12 s, 1 min 17 s left, 123 Msample/s, 0.001 Mray/s"
        );
        assert_eq!(
            line.bar(),
            "town: rendering [=   ]  42 %, 3 of 20, 12 s, 1 min 17 s left, 123 Msample/s"
        );
        let line = Line {
            samples: None,
            ..line
        };
        let bar = line.bar();
        assert!(bar.starts_with("town: rendering [=   ]  42 %, 3 of 20, 12 s, "));
    }

    #[test]
    fn long_lines_break_between_words() {
        let words = "a word and another ".repeat(10);
        let text = format!("{words}\n{}\n    {words}", "y".repeat(100));
        let lines: Vec<_> = text.split('\n').collect();
        let wrapped = wrapped(&text);
        let (head, code) = wrapped.rsplit_once('\n').expect("several lines");
        assert_eq!(code, lines[2]);
        let (head, long) = head.rsplit_once('\n').expect("several lines");
        assert_eq!(long, lines[1]);
        assert!(head.lines().all(|line| line.chars().count() <= COLUMNS));
        let unwrapped = head.replace("\n    ", " ");
        assert_eq!(unwrapped, lines[0]);
    }
}
