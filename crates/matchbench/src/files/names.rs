//! Names that become names of files.

/// Longest name, in bytes. File systems allow 255, including the ending that is added.
const LONGEST: usize = 200;

/// Checks that a name can be that of a file in a folder of ours, and is safe to print.
///
/// # Errors
/// What is wrong with it, as the rest of a sentence that begins with the name.
pub(crate) fn check_name(name: &str) -> Result<(), String> {
    if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\']) {
        return Err(
            "is empty, begins with a dot or has a slash, and is to be the name of a file".into(),
        );
    }
    if name.contains(char::is_control) {
        return Err("has characters that control a terminal or break lines".into());
    }
    if name.len() > LONGEST {
        return Err(format!("has {} bytes, more than {LONGEST}", name.len()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_plain_and_not_too_long() {
        for name in ["sift", "=cmd", "Straße 5", "数", &"x".repeat(200)] {
            assert_eq!(check_name(name), Ok(()), "{name}");
        }
        for name in [
            "",
            ".",
            "..",
            ".x",
            "a/b",
            "a\\b",
            "a\0b",
            "a\nb",
            "\u{1b}[2J",
            &"x".repeat(201),
        ] {
            assert!(check_name(name).is_err(), "{name:?}");
        }
    }
}
