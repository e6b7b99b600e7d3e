//! Proposals of known names for an unknown one.

/// Maximum number of names that an error proposes.
const PROPOSED: usize = 5;

/// Lists the known names that are most similar to an unknown one.
pub(crate) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let mut names: Vec<_> = known.collect();
    names.sort_by_cached_key(|candidate| edit_distance(name, candidate));
    names.dedup();
    let rest = names.len().saturating_sub(PROPOSED);
    let listed: Vec<_> = names.iter().take(PROPOSED).map(|name| format!("'{name}'")).collect();
    if rest == 0 { listed.join(", ") } else { format!("{} ({rest} more)", listed.join(", ")) }
}

/// Levenshtein distance of the first 64 characters, ignoring case.
fn edit_distance(a: &str, b: &str) -> usize {
    const COMPARED: usize = 64;
    let letters = |text: &str| text.chars().take(COMPARED).flat_map(char::to_lowercase).collect::<Vec<_>>();
    let (a, b) = (letters(a), letters(b));
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distances_are_those_of_levenshtein() {
        for (a, b, distance) in [("", "", 0), ("", "ab", 2), ("kitten", "sitting", 3), ("Floor", "floor", 0)]
        {
            assert_eq!((edit_distance(a, b), edit_distance(b, a)), (distance, distance), "{a} {b}");
        }
    }
}
