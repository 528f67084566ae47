//! Named lists: every table leads from name to row and back.

use crate::Width;
use crate::recipe::{Builder, Collapse, Level, Order, Preset};

/// Names are unique and lead back to their rows. Sentences have more than ten bytes and no full stop.
macro_rules! check {
    ($($list:ident),*) => {
        $(
            for (place, row) in $list::ALL.into_iter().enumerate() {
                assert_eq!(row.name().parse(), Ok(row));
                let first = $list::ALL.iter().position(|other| other.name() == row.name());
                assert_eq!(first, Some(place), "{row} stands there twice");
                let sentence = row.sentence();
                assert!(sentence.len() > 10 && !sentence.ends_with('.'), "{row}: {sentence}");
            }
            let unknown = "nonesuch".parse::<$list>().expect_err("no such name");
            assert_eq!((&*unknown.name, unknown.known), ("nonesuch", $list::names()));
        )*
    };
}

#[test]
fn names_lead_back_to_their_rows() {
    check!(Builder, Collapse, Level, Order, Preset, Width);
}
