//! Lines of a stream from another process: their length is bounded, whatever the other side writes.

use std::io::{self, BufRead};

/// The next line of a stream.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Line {
    /// A line, without its end.
    Whole,
    /// So many bytes without an end that no more are read.
    TooLong,
    /// There are no more.
    End,
}

/// Reads a line of at most `longest` bytes into `line`, which is emptied first. A line ends at `\n`, at
/// `\r` (progress bars overwrite themselves), or with the stream.
pub(super) fn read_line(
    stream: &mut impl BufRead,
    longest: usize,
    line: &mut Vec<u8>,
) -> io::Result<Line> {
    line.clear();
    loop {
        let ahead = match stream.fill_buf() {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            ahead => ahead?,
        };
        if ahead.is_empty() {
            let end = line.is_empty();
            return Ok(if end { Line::End } else { Line::Whole });
        }
        let end = ahead.iter().position(|&byte| matches!(byte, b'\n' | b'\r'));
        let length = end.unwrap_or(ahead.len());
        if line.len() + length > longest {
            return Ok(Line::TooLong);
        }
        line.extend_from_slice(&ahead[..length]);
        stream.consume(length + usize::from(end.is_some()));
        if end.is_some() {
            return Ok(Line::Whole);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::BufReader;

    use super::*;

    #[test]
    fn lines_end_at_either_end_and_have_a_longest() {
        // A buffer of three bytes: lines cross its edges.
        let mut stream = BufReader::with_capacity(3, &b"one\r\n10%\r\ntwelve\nlast"[..]);
        let mut line = Vec::new();
        let mut next = || {
            let read = read_line(&mut stream, 5, &mut line).unwrap();
            (read, String::from_utf8(line.clone()).unwrap())
        };
        for expected in ["one", "", "10%", ""] {
            assert_eq!(next(), (Line::Whole, expected.into()));
        }
        assert_eq!(next().0, Line::TooLong);
        let mut stream = BufReader::with_capacity(3, &b"last"[..]);
        assert_eq!(read_line(&mut stream, 5, &mut line).unwrap(), Line::Whole);
        assert_eq!(line, b"last");
        assert_eq!(read_line(&mut stream, 5, &mut line).unwrap(), Line::End);
    }
}
