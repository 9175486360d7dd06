//! Names in a sentence.

/// `a`, `a and b`, `a, b and c`.
pub(super) fn together(names: &[impl AsRef<str>]) -> String {
    let names: Vec<&str> = names.iter().map(AsRef::as_ref).collect();
    match names.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        _ => names.concat(),
    }
}

/// Most names that a sentence lists.
const MAX_NAMES: usize = 4;

/// The names in a sentence; where there are more than four, how many of `all` they are: `a, b and c`, `14 of 20`.
pub fn names_or_count(names: &[impl AsRef<str>], all: usize) -> String {
    if names.len() > MAX_NAMES {
        format!("{} of {all}", names.len())
    } else {
        together(names)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_names_are_counted() {
        let names = ["a", "b", "c", "d", "e"];
        assert_eq!(names_or_count(&names[..1], 7), "a");
        assert_eq!(names_or_count(&names[..4], 7), "a, b, c and d");
        assert_eq!(names_or_count(&names, 7), "5 of 7");
    }
}
