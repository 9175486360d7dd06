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
    Err(UnknownName {
        kind,
        name: name.into(),
        suggestion: suggestion(name, names()),
        known: names().collect::<Vec<_>>().join(", "),
        beside: "",
    })
}

/// The question whether the most similar one of these names was meant, in brackets; empty if none is similar.
fn suggestion<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> String {
    let nearest = (known.map(|known| (edits(name, known), known)))
        // If half of the letters are wrong, it is probably another word.
        .filter(|&(edits, known)| 2 * edits <= known.len())
        .min();
    nearest.map_or_else(String::new, |(_, known)| {
        format!(" (did you mean `{known}`?)")
    })
}

/// An error of serde, "unknown field `x`, expected one of `y`, `z`", with the name that was probably meant.
pub(crate) fn with_suggestion(error: &str) -> String {
    let Some((unknown, known)) = error.split_once(", expected ") else {
        return error.to_owned();
    };
    let Some(("unknown field ", name)) = unknown.trim_end_matches('`').split_once('`') else {
        return error.to_owned();
    };
    let names = known.split('`').skip(1).step_by(2);
    format!("{unknown}{}, expected {known}", suggestion(name, names))
}

impl UnknownName {
    /// The same, with the question whether one of the names in this part was meant, if it is such a name.
    pub(crate) fn of_part<'n>(
        mut self,
        part: &str,
        mut names: impl Iterator<Item = &'n str>,
    ) -> Self {
        if names.any(|known| known == self.name) {
            self.suggestion = format!(" (did you mean `{part}.{}`?)", self.name);
        }
        self
    }

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
    fn an_unknown_field_is_told_with_the_one_that_was_meant() {
        let error = "unknown field `threshold`, expected one of `score`, `threshold_px`";
        assert_eq!(
            with_suggestion(error),
            "unknown field `threshold` (did you mean `threshold_px`?), expected one of `score`, `threshold_px`"
        );
        for other in [
            "unknown field `abc`, expected `score`",
            "invalid type: string \"a, expected b\", expected a number",
            "missing field `score`",
        ] {
            assert_eq!(with_suggestion(other), other);
        }
    }

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
