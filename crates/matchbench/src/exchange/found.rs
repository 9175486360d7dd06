//! Names that were found where others were expected, in a few words.

use std::fmt::Write as _;

/// The most names that are listed.
const LISTED: usize = 4;
/// The most characters of a name.
const LONGEST: usize = 60;

/// The first of some names, and how many more there are; `None` if there is none.
pub(super) fn some_of(names: &[String]) -> Option<String> {
    with_more(names, |_| String::new())
}

/// The same, and something `more` about each of the first.
pub(super) fn with_more(names: &[String], mut more: impl FnMut(&str) -> String) -> Option<String> {
    let first: Vec<_> = (names.iter().take(LISTED))
        .map(|name| format!("`{}`{}", brief(name), more(name)))
        .collect();
    let mut text = first.join(", ");
    if let Some(more @ 1..) = names.len().checked_sub(LISTED) {
        let _ = write!(text, " and {more} more");
    }
    (!text.is_empty()).then_some(text)
}

/// A name that somebody else chose: shortened, and without characters that control a terminal.
fn brief(name: &str) -> String {
    let start: String = name.chars().take(LONGEST).collect();
    let cut = if start.len() < name.len() { "..." } else { "" };
    start.replace(char::is_control, "\u{fffd}") + cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_names_are_listed_and_all_are_short_and_harmless() {
        let names = [
            "plain",
            "in\u{1b}[2Jliers",
            &"é".repeat(1000),
            "d",
            "e",
            "f",
        ];
        let mut names: Vec<String> = names.map(str::to_owned).into();
        let long = "é".repeat(60);
        assert_eq!(
            some_of(&names).as_deref(),
            Some(&*format!(
                "`plain`, `in\u{fffd}[2Jliers`, `{long}...`, `d` and 2 more"
            ))
        );
        names.truncate(1);
        let said = with_more(&names, |name| format!(" {}", name.len()));
        assert_eq!(said.as_deref(), Some("`plain` 5"));
        assert_eq!(some_of(&[]), None);
    }
}
