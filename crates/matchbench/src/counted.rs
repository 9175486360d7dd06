//! Numbers with what they count, as messages and pages say them: `1 pair`, `2 pairs`.
//!
//! A sentence about them is put so that it holds for one and for many ("left out: 1 image"), since a verb would
//! have to follow the number too.

use std::fmt::Display;

/// The number and the noun, which is given for one.
///
/// ```
/// use matchbench::counted::counted;
///
/// assert_eq!(counted(1, "pair"), "1 pair");
/// assert_eq!(counted(0, "putative match"), "0 putative matches");
/// ```
pub fn counted<N: Display + PartialEq + From<u8>>(number: N, noun: &str) -> String {
    let noun = of_number(&number, noun);
    format!("{number} {noun}")
}

/// The noun as it stands after the number.
pub fn of_number<N: PartialEq + From<u8>>(number: &N, noun: &str) -> String {
    if *number == N::from(1) {
        noun.to_owned()
    } else {
        plural(noun)
    }
}

fn plural(noun: &str) -> String {
    let mut letters = noun.chars().rev();
    match (letters.next(), letters.next()) {
        (Some('y'), Some(before)) if !"aeiou".contains(before) => {
            format!("{}ies", &noun[..noun.len() - 1])
        }
        (Some('s' | 'x'), _) | (Some('h'), Some('c' | 's')) => format!("{noun}es"),
        _ => format!("{noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_one_and_all_else_are_many() {
        for (noun, many) in [
            ("pair", "pairs"),
            ("match", "matches"),
            ("homography", "homographies"),
            ("entry", "entries"),
            ("key", "keys"),
            ("box", "boxes"),
            (
                "putative and selected match",
                "putative and selected matches",
            ),
        ] {
            assert_eq!(counted(1_usize, noun), format!("1 {noun}"));
            assert_eq!(counted(0_u64, noun), format!("0 {many}"));
            assert_eq!(counted(21_u32, noun), format!("21 {many}"));
        }
    }
}
