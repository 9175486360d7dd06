//! `text`: a folder of `<a>_<b>.txt`, one for each pair, a match a line: x and y in a, x and y in
//! b, and perhaps a score, higher is better. White space or commas separate; `#` begins a comment.
//! It says nothing about the centre of the first pixel.

use std::io;
use std::path::{Path, PathBuf};

use super::names::PairName;
use super::probe::{Content, Probe};
use super::{Contents, ExchangeError, Format, Rating, RawMatches, ReadOptions, Source};
use crate::arrays::{Element, Kind, MAX_BYTES};
use crate::counted::counted;
use crate::files::{LONGEST_LINE, LineError, open_file, read_lines};
use crate::matchers::MAX_MATCHES;

/// The most numbers of a line that are counted.
const MAX_NUMBERS: usize = 20;

pub(super) const TEXT: Format = Format {
    id: "text",
    layout: "a folder of <a>_<b>.txt, lines `x_a y_a x_b y_b [score]`, higher scores are better",
    pixel_center: None,
    resized: false,
    recognises: |probe| matches!(probe.content, Content::Text),
    open,
    write: None,
};

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    Ok(Contents {
        pairs: (probe.files.iter())
            .map(|path| PairName::of_file(path))
            .collect(),
        source: Box::new(Text { files: probe.files }),
    })
}

struct Text {
    files: Vec<PathBuf>,
}

impl Source for Text {
    fn file(&self, index: usize) -> &Path {
        &self.files[index]
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let path = &self.files[index];
        let unreadable = |error| ExchangeError::unreadable(path, error);
        let wrong = |(line, what)| {
            ExchangeError::new(path, what, "write x_a y_a x_b y_b [score]")
                .at(format!("line {line}"))
        };
        let length = open_file(path).and_then(|file| Ok(file.metadata()?.len()));
        if length.map_err(unreadable)? > MAX_BYTES {
            return Err(ExchangeError::damaged(path, "it is larger than 1 GiB"));
        }
        let bytes = read_lines(path, LONGEST_LINE).map_err(|error| match error {
            LineError::Io(error) if error.kind() == io::ErrorKind::InvalidData => {
                ExchangeError::new(path, error, "save it as text in UTF-8")
            }
            LineError::Io(error) => unreadable(error),
            LineError::TooLong { line, what } => wrong((line, what)),
        })?;
        parse(&String::from_utf8_lossy(&bytes), MAX_MATCHES).map_err(wrong)
    }
}

/// The matches of a file, `most` of them, or the line (from 1) that is none and why.
fn parse(text: &str, most: usize) -> Result<RawMatches, (usize, String)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let (mut a, mut b, mut scores) = (Vec::new(), Vec::new(), Vec::new());
    for (line, row) in (1..).zip(text.lines()) {
        let row = row.split('#').next().unwrap_or_default();
        let words = row
            .split([' ', '\t', ',', ';', '\r'])
            .filter(|word| !word.is_empty());
        // A line may be all of the file. One number too many is enough to know that it is no match.
        let numbers = (words.take(MAX_NUMBERS + 1).map(|word| {
            let number: Result<f64, _> = word.parse();
            number.map_err(|_| {
                let word: String = word.chars().take(40).collect();
                (line, format!("`{word}` is no number"))
            })
        }))
        .collect::<Result<Vec<_>, _>>()?;
        match numbers[..] {
            [] => {}
            [x_a, y_a, x_b, y_b, ref score @ ..] if score.len() < 2 => {
                if (scores.len() == a.len()) != (score.len() == 1) && !a.is_empty() {
                    return Err((line, "some lines have a score and some have none".into()));
                }
                a.push([x_a, y_a]);
                b.push([x_b, y_b]);
                scores.extend_from_slice(score);
            }
            _ if numbers.len() > MAX_NUMBERS => {
                return Err((line, format!("more than {MAX_NUMBERS} numbers, not 4 or 5")));
            }
            _ => {
                let count = counted(numbers.len(), "number");
                return Err((line, format!("{count}, not 4 or 5")));
            }
        }
        if a.len() > most {
            return Err((line, format!("more than {most} matches")));
        }
    }
    Ok(RawMatches {
        rating: if scores.is_empty() {
            Rating::None
        } else {
            Rating::Score(scores)
        },
        a,
        b,
        turns: None,
        growths: None,
        element: Element::new(Kind::Float, 4, false).expect("float32 exists"),
        keypoints: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_matches_with_or_without_scores() {
        let raw = parse("# x y x y\r\n1 2 3 4\n\n5.5,6,7,8 # last", 4).unwrap();
        assert_eq!(
            (raw.a, raw.b),
            (vec![[1.0, 2.0], [5.5, 6.0]], vec![[3.0, 4.0], [7.0, 8.0]])
        );
        assert!(matches!(raw.rating, Rating::None));
        let raw = parse("\u{feff}1 2 3 4 0.5\n1 2 3 4 0.25\n", 4).unwrap();
        assert!(matches!(raw.rating, Rating::Score(scores) if scores == [0.5, 0.25]));
        assert!(parse("", 4).unwrap().a.is_empty());
    }

    #[cfg(unix)] // holes of files take no room
    #[test]
    fn a_line_without_an_end_is_named_before_the_rest_is_read() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "1 2 3 4\n").unwrap();
        file.as_file().set_len(MAX_BYTES).unwrap();
        let files = vec![file.path().to_owned()];
        let error = Text { files }.read(0).err().unwrap().to_string();
        assert!(
            error.contains("line 2: the line has more than 1048576 bytes"),
            "{error}"
        );
    }

    #[test]
    fn a_line_that_is_no_match_is_named() {
        for (text, line, named) in [
            ("1 2 3 4\n1 2 3", 2, "3 numbers"),
            ("1 2 3 4 5 6", 1, "6 numbers"),
            ("1 2 x 4", 1, "`x`"),
            ("1 2 3 4\n\n1 2 3 4 5", 3, "some have none"),
            ("1 2 3 4 5\n1 2 3 4", 2, "some have none"),
            (&"1 ".repeat(1 << 20), 1, "more than 20 numbers"),
            (&"1 1 1 1\n".repeat(9), 5, "more than 4 matches"),
        ] {
            let (at, what) = parse(text, 4).unwrap_err();
            assert_eq!(at, line, "{text}");
            assert!(what.contains(named), "{what}");
        }
    }
}
