use alloc::vec::Vec;

use super::parts::{MAX_LEVELS, MIN_LEVELS, WHOLE, numbers, part_around, part_at, quarters, words};
use super::*;
use crate::geometry::{Candidate, Coverage, Opacity, Pattern};
use antumbra_testkit::Rng;
use core::sync::atomic::{AtomicUsize, Ordering};

/// All parts, by dividing.
fn all_parts(corners: [[f32; 2]; 3], levels: u32, parts: &mut Vec<[[f32; 2]; 3]>) {
    if levels == 0 {
        parts.push(corners);
    } else {
        for quarter in quarters(&corners) {
            all_parts(quarter, levels - 1, parts);
        }
    }
}

#[test]
fn every_point_lies_in_the_part_of_its_number() {
    for levels in MIN_LEVELS..=MAX_LEVELS {
        let mut parts = Vec::new();
        all_parts(WHOLE, levels, &mut parts);
        let mut places: Vec<_> = parts.iter().map(|part| part_around(levels, part)).collect();
        let told: Vec<_> = numbers(levels).into_iter().map(usize::from).collect();
        assert_eq!(told, places, "in the order of the division");
        places.sort_unstable();
        assert_eq!(places, (0..64 * words(levels)).collect::<Vec<_>>());

        let mut rng = Rng::new(51);
        for part in parts {
            for _ in 0..200 {
                let (mut s, mut t) = (rng.unit(), rng.unit());
                if s + t > 1.0 {
                    (s, t) = (1.0 - s, 1.0 - t);
                }
                // Away from the lines between parts.
                let [s, t] = [s, t].map(|x| 0.001 + 0.997 * x);
                let at = |i: usize| {
                    part[0][i] + s * (part[1][i] - part[0][i]) + t * (part[2][i] - part[0][i])
                };
                assert_eq!(part_at(levels, at(0), at(1)), part_around(levels, &part));
            }
        }
        // What rounding puts outside of the triangle.
        let over = 1.0f32.next_up();
        for (u, v) in [
            (over, 0.0),
            (0.0, over),
            (0.5, 0.5f32.next_up()),
            (-0.0, -0.0),
            (over, over),
        ] {
            assert!(part_at(levels, u, v) < 64 * words(levels), "{u} {v}");
        }
    }
}

/// A disk, opaque inside and clear outside. `coverage`, if given, is the answer for every part.
#[derive(Debug)]
struct Disk {
    coverage: Option<Coverage>,
    /// How many triangles in a row show the same.
    alike: Option<u32>,
    asked: AtomicUsize,
}

impl Disk {
    fn new() -> Self {
        Self {
            coverage: None,
            alike: None,
            asked: AtomicUsize::new(0),
        }
    }

    fn maps(&self, count: usize) -> (MicroMaps, Vec<Known>) {
        let (maps, known, mixed) =
            MicroMaps::new(count, |index| (self as &dyn Opacity, index as u32));
        // The representative of a pattern has this pattern and the same micromap.
        for (index, of_it) in known.iter().enumerate() {
            if let Known::Mixed(cutout) = of_it {
                let asked = mixed[cutout.pattern as usize];
                assert_eq!(known[asked], *of_it);
                let pattern = |index: usize| self.pattern(index as u32);
                assert!(asked == index || pattern(asked) == pattern(index));
            }
        }
        (maps, known)
    }

    /// Whether the hit counts.
    fn accepts(&self, u: f32, v: f32) -> bool {
        let candidate = Candidate {
            u,
            v,
            prim_id: 0,
            geom_id: 0,
            inst_id: 0,
            query: crate::geometry::QueryKind::Occluded,
        };
        self.opacity(&candidate) == 1.0
    }
}

impl Opacity for Disk {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        let (u, v) = (candidate.u - 0.3, candidate.v - 0.3);
        if u * u + v * v < 0.04 { 1.0 } else { 0.0 }
    }
    fn coverage(&self, _: u32, corners: &[[f32; 2]; 3]) -> Coverage {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let distance = |[u, v]: [f32; 2]| (u - 0.3).hypot(v - 0.3);
        let distances = corners.map(distance);
        let size = (corners[0][0] - corners[1][0]).abs() * 1.5;
        self.coverage
            .unwrap_or(if distances.iter().all(|d| *d < 0.199) {
                Coverage::Opaque
            } else if distances.iter().all(|d| *d > 0.201 + size) {
                Coverage::Clear
            } else {
                Coverage::Mixed
            })
    }
    fn pattern(&self, prim_id: u32) -> Option<Pattern> {
        self.alike
            .map(|alike| Pattern([u64::from(prim_id / alike), 1, 2, 3]))
    }
}

/// How many of these points a map does not know; what it knows is right.
fn unknown(disk: &Disk, maps: &MicroMaps, known: Known) -> usize {
    let Known::Mixed(Cutout { map, .. }) = known else {
        panic!("{known:?}");
    };
    let mut rng = Rng::new(52);
    let mut unknown = 0;
    for _ in 0..10_000 {
        let (u, v) = (rng.unit(), rng.unit());
        if u + v > 1.0 {
            continue;
        }
        match maps.accepts(maps.part(map, u, v)) {
            Some(accepts) => assert_eq!(accepts, disk.accepts(u, v), "{u} {v}"),
            None => unknown += 1,
        }
    }
    unknown
}

#[test]
fn what_is_known_is_right() {
    let disk = Disk::new();
    let (maps, known) = disk.maps(1);
    assert_eq!(known.len(), 1);
    // About 5000 points are in the triangle.
    let unknown = unknown(&disk, &maps, known[0]);
    assert!((500..4000).contains(&unknown), "{unknown}");
}

/// Triangles that show the same have one map, and it is the finer, the more they are.
#[test]
fn what_many_triangles_share_is_known_better() {
    let mut last = 10_000;
    for alike in [1, 4, 16, 64, 4096] {
        let disk = Disk {
            alike: Some(alike),
            ..Disk::new()
        };
        let count = 2 * alike as usize;
        let (maps, known) = disk.maps(count);
        let (first, second) = known.split_at(alike as usize);
        assert!(first.iter().all(|known| *known == first[0]), "{alike}");
        assert!(second.iter().all(|known| *known == second[0]), "{alike}");
        assert_ne!(first[0], second[0]);
        let unknown = unknown(&disk, &maps, first[0]);
        assert!(
            alike > 64 || unknown < last * 3 / 4,
            "{alike}: {unknown}, {last}"
        );
        last = unknown;
        assert!(maps.bytes() <= 16 * (1 + count), "{alike}");
    }
    let disk = Disk::new();
    let (maps, known) = disk.maps(3);
    assert_eq!(maps.bytes(), 16 * 4);
    assert_ne!(known[0], known[1]);
}

#[test]
fn only_mixed_triangles_are_looked_at_closely() {
    let nothing = Known::Mixed(Cutout {
        map: MapRef::UNKNOWN,
        pattern: 0,
    });
    for (coverage, whole, asked) in [
        (Coverage::Opaque, Known::Opaque, 1),
        (Coverage::Clear, Known::Clear, 1),
        (Coverage::Unknown, nothing, 1),
        (Coverage::Mixed, nothing, 1 + 4 + 16 + 64),
    ] {
        let disk = Disk {
            coverage: Some(coverage),
            ..Disk::new()
        };
        let (maps, known) = disk.maps(1);
        assert_eq!(known, [whole]);
        assert_eq!(maps.bytes(), 16);
        assert_eq!(disk.asked.into_inner(), asked, "{coverage:?}");
    }
}
