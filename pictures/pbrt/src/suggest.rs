//! Suggestions: the known name that is closest to an unknown one.

/// Closest known name, if at most a third of its letters differ. Case is ignored.
pub(crate) fn closest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    const LONGEST: usize = 64;
    if name.is_empty() || name.len() > LONGEST {
        return None;
    }
    let wanted = name.to_lowercase();
    let length = wanted.chars().count();
    let allowed = |candidate: &str| (candidate.chars().count().max(length) / 3).max(1);
    known
        .into_iter()
        .filter(|candidate| candidate.len() <= LONGEST)
        // The difference of the lengths is a lower bound of the distance, which excludes most names cheaply.
        .filter(|candidate| candidate.chars().count().abs_diff(length) <= allowed(candidate))
        .map(|candidate| (distance(&wanted, &candidate.to_lowercase()), candidate))
        .filter(|(distance, candidate)| {
            *distance <= allowed(candidate) && *distance < candidate.chars().count()
        })
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Help for an unknown name: the closest known name, or the list of known names.
pub(crate) fn help(name: &str, known: &[&str]) -> String {
    const SHOWN: usize = 20;
    match closest(name, known.iter().copied()) {
        Some(closest) => format!("did you mean {closest:?}?"),
        None if known.is_empty() => "no name is known here".into(),
        None if known.len() > SHOWN => {
            let rest = known.len() - SHOWN;
            format!("known: {} and {rest} more", known[..SHOWN].join(", "))
        }
        None => format!("known: {}", known.join(", ")),
    }
}

/// Restricted Damerau-Levenshtein distance: the number of insertions, deletions, changes and swaps of neighbours.
fn distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().collect();
    let b: Vec<char> = b.chars().collect();
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            rows[i][j] = if i == 0 || j == 0 {
                i + j
            } else {
                let change = usize::from(a[i - 1] != b[j - 1]);
                let mut best = (rows[i - 1][j] + 1)
                    .min(rows[i][j - 1] + 1)
                    .min(rows[i - 1][j - 1] + change);
                if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                    best = best.min(rows[i - 2][j - 2] + 1);
                }
                best
            };
        }
    }
    rows[a.len()][b.len()]
}

/// Advice as of [`help`] where the known names are keys of a map.
pub(crate) fn among<'a>(name: &str, known: impl Iterator<Item = &'a String>) -> String {
    let mut known: Vec<&str> = known.map(String::as_str).collect();
    known.sort_unstable();
    help(name, &known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typing_slip_is_recognised_and_a_stranger_is_not() {
        let known = ["Shape", "Scale", "LookAt"];
        assert_eq!(closest("Shpae", known), Some("Shape"));
        assert_eq!(closest("lookat", known), Some("LookAt"));
        assert_eq!(closest("Xyzzy", known), None);
        assert_eq!(closest("", known), None);
        assert_eq!(distance("ab", "ba"), 1);
        assert_eq!(distance("kitten", "sitting"), 3);
    }
}
