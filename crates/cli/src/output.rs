//! The output of the program. A closed or full standard error loses no result, a file called `-` is standard
//! output, and text from files of others reaches the terminal without control characters.

use std::fmt::{self, Write as _};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use matchbench::files::write_whole;
use matchbench::report::{check_target, shell_word};

/// Longest word that a message repeats, in characters.
const LONGEST_WORD: usize = 300;

/// Longest message, in characters. Of a longer one the beginning and the end are shown; the end says what to
/// do.
const LONGEST_MESSAGE: usize = 20_000;

/// Prints to standard error, as `eprintln` does, and continues if it is closed.
macro_rules! say {
    ($($what:tt)*) => { $crate::output::say_line(format_args!($($what)*)) };
}
pub(crate) use say;

pub(crate) fn say_line(what: fmt::Arguments<'_>) {
    let text = plain(&what.to_string());
    let _ = writeln!(io::stderr(), "{text}");
}

/// Writes a result to a file, completely, which is none of a run or of a dataset, or to standard output if the file is called `-` or `/dev/stdout`.
pub(crate) fn write_result(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if is_standard_output(path) {
        let mut out = io::stdout();
        let written = out.write_all(bytes).and_then(|()| out.flush());
        return written.map_err(of_standard_output);
    }
    check_target(path)?;
    write_whole(path, bytes)
}

/// Says before long work whether [`write_result`] will refuse one of its `files`.
pub(crate) fn check_results<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> io::Result<()> {
    let mut files = files.into_iter().filter(|path| !is_standard_output(path));
    files.try_for_each(|path| check_target(path))
}

/// Standard output for lines of text, which are made [`harmless`].
pub(crate) fn stdout() -> impl Write {
    Harmless(io::stdout())
}

/// Prints a help text or the version, coloured for a terminal, to standard output.
pub(crate) fn print_help(help: &clap::Error) -> io::Result<()> {
    let printed = help.print().and_then(|()| io::stdout().flush());
    printed.map_err(of_standard_output)
}

/// The error with the place that it is about; a reader that left is told from it.
fn of_standard_output(error: io::Error) -> io::Error {
    match error.kind() {
        io::ErrorKind::BrokenPipe => error,
        kind => io::Error::new(kind, format!("standard output: {error}")),
    }
}

struct Harmless(io::Stdout);

impl Write for Harmless {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(bytes);
        (self.0.write_all(harmless(&text).as_bytes())).map_err(of_standard_output)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush().map_err(of_standard_output)
    }
}

/// Whether a file is `-`, or the name that Unix systems give standard output.
pub(crate) fn is_standard_output(path: &Path) -> bool {
    path == Path::new("-") || path == Path::new("/dev/stdout")
}

/// A path as it is typed: in quotes if a shell would split it, and never mistaken for an option.
pub(crate) fn typed(path: &Path) -> String {
    let word = path.display().to_string();
    let dashed = word.starts_with('-').then(|| format!("./{word}"));
    shell_word(&dashed.unwrap_or(word))
}

/// The text without characters that control a terminal, since results hold names that others chose. They are
/// written as JSON escapes them, so that JSON stays what it is.
pub(crate) fn harmless(text: &str) -> String {
    let mut harmless = String::with_capacity(text.len());
    for c in text.chars() {
        if !matches!(c, '\n' | '\t') && (c.is_control() || turns_the_text(c)) {
            // All of them are of four digits at most.
            let _ = write!(harmless, "\\u{:04x}", u32::from(c));
        } else {
            harmless.push(c);
        }
    }
    harmless
}

/// The same, with very long words shortened: messages repeat parts of files, and these may hold anything.
pub fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len().min(1 << 16));
    for part in text.split_inclusive(['\n', ' ']) {
        let kept = part.char_indices().nth(LONGEST_WORD);
        let (shown, cut) = part.split_at(kept.map_or(part.len(), |(at, _)| at));
        plain += &harmless(shown);
        if !cut.is_empty() {
            plain.extend([
                "... (",
                &cut.chars().count().to_string(),
                " characters more)",
            ]);
            plain.extend(part.chars().next_back().filter(|c| " \n".contains(*c)));
        }
    }
    let place = |count| plain.char_indices().nth(count).map(|(at, _)| at);
    let left_out = plain.chars().count().saturating_sub(LONGEST_MESSAGE);
    match [LONGEST_MESSAGE / 2, LONGEST_MESSAGE / 2 + left_out].map(place) {
        [Some(from), Some(to)] if left_out > 0 => format!(
            "{}... ({left_out} characters more) ...{}",
            &plain[..from],
            &plain[to..]
        ),
        _ => plain,
    }
}

/// Whether a character changes the direction of text, so that names would be displayed as other names.
fn turns_the_text(c: char) -> bool {
    matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_typed_as_a_shell_needs_it() {
        for (path, word) in [
            ("runs/first", "runs/first"),
            ("my runs/first", "'my runs/first'"),
            ("it's", r"'it'\''s'"),
            ("-x", "./-x"),
        ] {
            assert_eq!(typed(Path::new(path)), word);
        }
    }

    #[test]
    fn a_terminal_is_not_obeyed_to_a_file() {
        let shown = plain("a.txt:3: `\u{1b}[2J\u{1b}]0;x\u{7}\r\u{202e}` is no number\nnext");
        assert_eq!(
            shown,
            "a.txt:3: `\\u001b[2J\\u001b]0;x\\u0007\\u000d\\u202e` is no number\nnext"
        );
        assert_eq!(plain("ünïcode – 数"), "ünïcode – 数");
    }

    #[test]
    fn of_a_long_message_the_beginning_and_the_end_are_shown() {
        let words = "wörd ".repeat(4000);
        assert_eq!(plain(&words), words);
        let shown = plain(&format!("a.txt: {}: correct it", "wörd ".repeat(300_000)));
        assert!(shown.chars().count() < LONGEST_MESSAGE + 100);
        assert!(shown.starts_with("a.txt: wörd ") && shown.ends_with("wörd : correct it"));
        assert!(
            shown.contains("... (1480019 characters more) ..."),
            "{}",
            &shown[19_900..]
        );
    }

    #[test]
    fn a_long_word_is_cut() {
        let word = "x".repeat(100_000);
        let shown = plain(&format!("`{word}` is no number\nnext"));
        assert!(shown.len() < 400, "{}", shown.len());
        assert!(
            shown.ends_with("characters more) is no number\nnext"),
            "{shown}"
        );
    }
}
