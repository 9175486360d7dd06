//! Looks up names of matchers, estimators and the like, as users write them.

/// There is no entry with this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown {kind} `{name}`{suggestion}; there are: {known}{beside}")]
pub struct UnknownName {
    kind: &'static str,
    name: String,
    suggestion: String,
    known: String,
    /// What else a name may be.
    beside: &'static str,
}

/// The entry with the name `name`; `name_of` gives the name of an entry.
///
/// # Errors
/// If there is none. The error says what `kind` of thing was looked for, names the most similar one if there is
/// one, and lists all.
pub fn find<'n, E: Copy>(
    kind: &'static str,
    entries: &[E],
    name_of: impl Fn(E) -> &'n str,
    name: &str,
) -> Result<E, UnknownName> {
    let names = || entries.iter().map(|&entry| name_of(entry));
    if let Some(index) = names().position(|known| known == name) {
        return Ok(entries[index]);
    }
    let nearest = (names().map(|known| (edits(name, known), known)))
        // If half of the letters are wrong, it is probably another word.
        .filter(|&(edits, known)| 2 * edits <= known.len())
        .min();
    Err(UnknownName {
        kind,
        name: name.into(),
        suggestion: nearest.map_or_else(String::new, |(_, known)| {
            format!(" (did you mean `{known}`?)")
        }),
        known: names().collect::<Vec<_>>().join(", "),
        beside: "",
    })
}

impl UnknownName {
    /// The same, with what else a name may be: the end of its message.
    pub(crate) fn beside(self, beside: &'static str) -> Self {
        Self { beside, ..self }
    }
}

/// Number of letters to insert, remove or replace to turn `a` into `b`, ignoring case (Levenshtein, "Binary
/// codes capable of correcting deletions, insertions, and reversals", 1966).
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.to_lowercase().chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter_a) in a.to_lowercase().chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, letter_b) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(letter_a != *letter_b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_counted() {
        for (a, b, count) in [("", "", 0), ("sift", "SIFT", 0), ("sfit", "sift", 2)] {
            assert_eq!((edits(a, b), edits(b, a)), (count, count), "{a} {b}");
        }
        for (a, b, count) in [("sif", "sift", 1), ("surf", "sift", 3), ("", "orb", 3)] {
            assert_eq!((edits(a, b), edits(b, a)), (count, count), "{a} {b}");
        }
    }

    #[test]
    fn an_unknown_name_is_answered_with_the_nearest_known_one() {
        let answer = |name| find("matcher", &["sift", "binboost"], |entry| entry, name);
        assert_eq!(answer("binboost"), Ok("binboost"));
        let message = |name| answer(name).expect_err("not on the list").to_string();
        assert_eq!(
            message("binbost"),
            "unknown matcher `binbost` (did you mean `binboost`?); there are: sift, binboost"
        );
        assert_eq!(
            message("superglue"),
            "unknown matcher `superglue`; there are: sift, binboost"
        );
        let more = answer("superglue").expect_err("not on the list");
        assert_eq!(
            more.beside("; or a path").to_string(),
            "unknown matcher `superglue`; there are: sift, binboost; or a path"
        );
    }
}
