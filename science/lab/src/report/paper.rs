//! The figures of the paper, beside which ours are set.

use antumbra::recipe::Order;
use antumbra_trees::FTOB;
use serde::Deserialize;

use crate::Error;

/// The tables, with their source.
const TABLES: &str = include_str!("paper.csv");

/// Our scenes that the paper has too, or has one like: ours, the paper's, whether it is the same one.
const SCENES: [(&str, &str, bool); 7] = [
    ("sponza", "sponza", true),
    ("sibenik", "sibenik", true),
    ("sanmiguel", "sanmiguel", true),
    ("bathroom", "room", false),
    ("pavilion", "villa", false),
    ("microcity", "city", false),
    ("ingolstadt", "city", false),
];

/// Share of shadow rays among all rays of a scene (Figure 2).
const SHARES: [(&str, f64); 6] = [
    ("city", 0.280),
    ("room", 0.118),
    ("villa", 0.442),
    ("sponza", 0.517),
    ("sanmiguel", 0.939),
    ("sibenik", 0.521),
];

/// A line of the tables.
#[derive(Clone, Debug, Deserialize)]
pub struct Figures {
    scene: String,
    width: usize,
    pub technique: String,
    pub box_tests_before: f64,
    pub prim_tests_before: f64,
    pub box_tests_after: Option<f64>,
    pub prim_tests_after: Option<f64>,
    pub logging_s: Option<f64>,
    pub sorting_ms: Option<f64>,
    pub total_render_s: f64,
}

/// A scene of the paper that is compared with one of ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counterpart {
    /// Name in the paper.
    pub name: &'static str,
    /// Whether it is the same scene; otherwise ours replaces one that is not public.
    pub same: bool,
    /// Share of shadow rays among all rays.
    pub shadow_share: f64,
}

/// The scene of the paper that ours is or replaces.
pub fn counterpart(scene: &str) -> Option<Counterpart> {
    let found = SCENES.iter().find(|(ours, ..)| *ours == scene);
    let &(_, name, same) = found?;
    let share = SHARES.iter().find(|(theirs, _)| *theirs == name);
    share.map(|&(_, shadow_share)| Counterpart {
        name,
        same,
        shadow_share,
    })
}

/// The tables of the paper.
pub fn tables() -> Result<Vec<Figures>, Error> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .from_reader(TABLES.as_bytes());
    let lines: Result<_, _> = reader.deserialize().collect();
    lines.map_err(Error::report)
}

/// Lines of the paper about the scene that ours is or replaces, in the order of its tables.
pub fn lines(scene: &str, width: usize) -> Vec<Figures> {
    let Some(theirs) = counterpart(scene) else {
        return Vec::new();
    };
    let all = tables().unwrap_or_default().into_iter();
    all.filter(|line| (&*line.scene, line.width) == (theirs.name, width))
        .collect()
}

/// How a scene, and what was done with it, differ from the paper.
pub fn differences(scene: &str) -> Option<&'static str> {
    const NOTES: [(&str, &str); 7] = [
        (
            "sponza",
            "The model is the paper's; camera and light are not. Shadow rays are 35 % of all rays here and 52 % there, and a sky-sized area light is blocked by roof and walls, which few large leaves hold: the order gains more here.",
        ),
        (
            "sibenik",
            "The model is the paper's with its holes closed; the disk and sphere lights became quads. More than half of the rays there were shadow rays. Rays to the light in the dome meet nothing, and no order helps those, so the gain is small in both, and with 8 children half of the paper's.",
        ),
        (
            "sanmiguel",
            "About nine tenths of the triangles; trunks, ivy and some leaf groups are rebuilt. Only the tree of the world is compared, as in the paper. Foliage in one cut-out mesh makes the unsorted order worse than the paper's, and the gain larger.",
        ),
        (
            "bathroom",
            "Another room: the paper's is not public. It has far more triangles, and most of its light samples are not blocked, which leaves an order little to save.",
        ),
        (
            "pavilion",
            "Another house with trees around it: the paper's is not public. The trees are instances with cut-out leaves.",
        ),
        (
            "microcity",
            "By the author and the generator of the paper's city, which is not public, but small: 30 thousand triangles.",
        ),
        (
            "ingolstadt",
            "A second city beside the paper's, which is not public: real facades, repeated as instances.",
        ),
    ];
    let found = NOTES.iter().find(|(name, _)| *name == scene);
    found.map(|(_, note)| *note)
}

impl Figures {
    /// Node tests of the training rays; `None` for an order that learns nothing.
    pub fn n_b_before(&self) -> Option<f64> {
        self.box_tests_after.map(|_| self.box_tests_before)
    }

    /// Primitive tests of the training rays; `None` for an order that learns nothing.
    pub fn n_t_before(&self) -> Option<f64> {
        self.prim_tests_after.map(|_| self.prim_tests_before)
    }

    /// Node tests in the order. The paper has the only figure of an order that learns nothing under "before".
    pub fn n_b_after(&self) -> f64 {
        self.box_tests_after.unwrap_or(self.box_tests_before)
    }

    /// Primitive tests in the order.
    pub fn n_t_after(&self) -> f64 {
        self.prim_tests_after.unwrap_or(self.prim_tests_before)
    }

    /// Whether the line is about this scene of the paper, width and order.
    pub fn is_of(&self, scene: &str, width: usize, order: &str) -> bool {
        let technique = match order {
            _ if order == FTOB.name() => "FtoB",
            _ if order == Order::Sato.name() => "SATO",
            _ if order == Order::Simple.name() => "Simple",
            _ if order == Order::SortMinus.name() => "Sort-",
            _ if order == Order::Sort.name() => "Sort",
            _ if order == Order::SortPlus.name() => "Sort+",
            _ => return false,
        };
        (&*self.scene, self.width, &*self.technique) == (scene, width, technique)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_whole() {
        let tables = tables().expect("tables");
        assert_eq!(tables.len(), 2 * 6 * 6);
        for (scene, _) in SHARES {
            for width in [4, 8] {
                for order in ["simple", "ftob", "sato", "sort-", "sort", "sort+"] {
                    let found = tables.iter().filter(|f| f.is_of(scene, width, order));
                    assert_eq!(found.count(), 1, "{scene} {width} {order}");
                }
            }
        }
        let sponza = tables.iter().find(|f| f.is_of("sponza", 8, "sort+"));
        let sponza = sponza.expect("a line");
        assert_eq!(sponza.box_tests_after, Some(5.92));
        assert_eq!(sponza.sorting_ms, Some(4.0));
        for (ours, theirs, same) in SCENES {
            let found = counterpart(ours).expect("a counterpart");
            assert_eq!((found.name, found.same), (theirs, same));
        }
        assert_eq!(counterpart("ecosys"), None);
    }
}
