//! Named lists: every list leads from name to row and back, and has the kernel's rows.

use antumbra::recipe::{Builder, Collapse, Order};
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS, builder, collapse, order};

/// Names are unique and lead back to their rows. Sentences have more than ten bytes and no full stop.
macro_rules! check {
    ($list:ident, $find:ident, $Kernel:ident) => {
        for (place, row) in $list.into_iter().enumerate() {
            assert_eq!($find(row.name()), Ok(row));
            assert_eq!(row.to_string(), row.name());
            let first = $list.iter().position(|other| other.name() == row.name());
            assert_eq!(first, Some(place), "{row} stands there twice");
            let sentence = row.sentence();
            assert!(sentence.len() > 10 && !sentence.ends_with('.'), "{row}: {sentence}");
            let is_kernels = matches!(row.name().parse(), Ok::<$Kernel, _>(found) if found == row);
            assert_eq!(is_kernels, !matches!(row, $Kernel::Other(_)), "{row}");
        }
        assert!($Kernel::ALL.iter().all(|row| $list.contains(row)));
        let unknown = $find("nonesuch").expect_err("no such name");
        assert_eq!((unknown.kind, &*unknown.name), (stringify!($find), "nonesuch"));
        assert_eq!(unknown.known, $list.map($Kernel::name).join(", "));
    };
}

#[test]
fn names_lead_back_to_their_rows() {
    check!(BUILDERS, builder, Builder);
    check!(COLLAPSES, collapse, Collapse);
    check!(ORDERS, order, Order);
}
