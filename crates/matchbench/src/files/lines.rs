//! Reads the lines of a file that may be larger than memory, and parses them with all threads.
//!
//! The file is read in blocks. A block ends at the end of a line; the rest of the bytes that were read begins
//! the next block. The lines of a block are parsed by the threads of the current pool and returned in their
//! order. So the caller gets the same result for any number of threads.

use std::io::{self, Read};

use memchr::{memchr_iter, memrchr};
use rayon::prelude::*;

/// Bytes of a block: enough work for all threads, and little memory.
const BLOCK: u64 = 1 << 20;

/// Least number of lines that a thread parses at a time, so that it works more than it waits.
const MIN_LINES: usize = 64;

/// What a text in UTF-16 begins with, as some programs of Windows write it.
const UTF_16: [[u8; 2]; 2] = [[0xff, 0xfe], [0xfe, 0xff]];

/// Why lines cannot be read.
#[derive(Debug)]
pub(crate) enum LineError {
    /// The file cannot be read, or is not in UTF-8.
    Io(io::Error),
    /// A line is longer than allowed.
    TooLong {
        /// Its number, from 1.
        line: usize,
        /// How long it may be, in words.
        what: String,
    },
}

/// Complete lines, read one block after the other.
#[derive(Debug)]
pub(crate) struct LineBlocks<R> {
    reader: R,
    /// Longest line, in bytes.
    longest: usize,
    bytes: Vec<u8>,
    /// Number of bytes in the buffer that were returned already.
    seen: usize,
    /// Number of lines that were returned before.
    lines: usize,
    is_at_end: bool,
}

/// Lines of a file, each with its end.
#[derive(Debug)]
pub(crate) struct LineBlock<'a> {
    bytes: &'a [u8],
    /// Number of the first line, from 1.
    first: usize,
}

impl<R: Read> LineBlocks<R> {
    /// The lines of `reader`, of at most `longest` bytes each.
    pub(crate) fn new(reader: R, longest: usize) -> Self {
        Self {
            reader,
            longest,
            bytes: Vec::new(),
            seen: 0,
            lines: 0,
            is_at_end: false,
        }
    }

    /// The next block of lines that have an end; `None` if there are no more.
    ///
    /// # Errors
    /// If the file cannot be read, is in UTF-16, or a line is too long.
    pub(crate) fn next_block(&mut self) -> Result<Option<LineBlock<'_>>, LineError> {
        self.bytes.drain(..self.seen);
        self.seen = 0;
        let end = loop {
            let new = self.bytes.len();
            if !self.is_at_end {
                let mut part = (&mut self.reader).take(BLOCK);
                let read = part.read_to_end(&mut self.bytes).map_err(LineError::Io)?;
                self.is_at_end = read == 0;
            }
            if self.lines == 0 && UTF_16.iter().any(|mark| self.bytes.starts_with(mark)) {
                let what = "text in UTF-16, not in UTF-8";
                let error = io::Error::new(io::ErrorKind::InvalidData, what);
                return Err(LineError::Io(error));
            }
            if let Some(last) = memrchr(b'\n', &self.bytes[new..]) {
                break new + last + 1;
            }
            if self.bytes.len() > self.longest {
                return Err(too_long(self.lines + 1, self.longest));
            }
            if self.is_at_end {
                return Ok(None);
            }
        };
        self.seen = end;
        let block = LineBlock {
            bytes: &self.bytes[..end],
            first: self.lines + 1,
        };
        for (number, line) in block.lines() {
            if line.len() > self.longest {
                return Err(too_long(number, self.longest));
            }
            self.lines = number;
        }
        Ok(Some(block))
    }

    /// The text after the last line end, once all other lines were returned; `None` if there is none.
    pub(crate) fn rest(&self) -> Option<LineBlock<'_>> {
        let bytes = &self.bytes[self.seen..];
        (!bytes.is_empty()).then_some(LineBlock {
            bytes,
            first: self.lines + 1,
        })
    }
}

fn too_long(line: usize, longest: usize) -> LineError {
    let what = format!("the line has more than {longest} bytes");
    LineError::TooLong { line, what }
}

impl LineBlock<'_> {
    /// All its lines, as they stand in the file.
    pub(super) fn as_bytes(&self) -> &[u8] {
        self.bytes
    }

    /// Total length of its lines, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes.len()
    }

    /// Calls `parse` with the number (from 1) and the bytes of each line; returns the results, each with the
    /// number.
    pub(crate) fn parsed<T: Send>(
        &self,
        parse: impl Fn(usize, &[u8]) -> T + Sync,
    ) -> impl Iterator<Item = (usize, T)> {
        let lines: Vec<(usize, &[u8])> = self.lines().collect();
        let parsed: Vec<(usize, T)> = (lines.par_iter().with_min_len(MIN_LINES))
            .map(|&(number, line)| (number, parse(number, line)))
            .collect();
        parsed.into_iter()
    }

    /// Its lines with their numbers; the last may have no end.
    fn lines(&self) -> impl Iterator<Item = (usize, &[u8])> {
        let after_ends = memchr_iter(b'\n', self.bytes).map(|end| end + 1);
        let rest = (!self.bytes.ends_with(b"\n")).then_some(self.bytes.len());
        let mut start = 0;
        (after_ends.chain(rest).zip(self.first..)).map(move |(end, number)| {
            let line = &self.bytes[start..end];
            start = end;
            (number, line)
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A reader that returns few bytes at a time, as pipes do.
    struct Sips<'a>(&'a [u8], usize);

    impl Read for Sips<'_> {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            let (sip, rest) = self.0.split_at(self.0.len().min(self.1).min(to.len()));
            to[..sip.len()].copy_from_slice(sip);
            self.0 = rest;
            Ok(sip.len())
        }
    }

    proptest! {
        #[test]
        fn lines_are_what_they_are(text in "([a-c]{0,30}\n){0,20}[a-c]{0,30}", sip in 1_usize..50) {
            let text = text.as_bytes();
            let end = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
            let mut expected = (1..).zip(text[..end].split_inclusive(|&byte| byte == b'\n'));
            let mut blocks = LineBlocks::new(Sips(text, sip), 100);
            let mut bytes = 0;
            while let Some(block) = blocks.next_block().expect("short lines") {
                bytes += block.bytes();
                for (number, (told, line)) in block.parsed(|told, line| (told, line.to_vec())) {
                    prop_assert_eq!(expected.next(), Some((number, &*line)));
                    prop_assert_eq!(told, number);
                }
            }
            prop_assert_eq!(expected.next(), None);
            prop_assert_eq!(bytes, end);
            prop_assert_eq!(blocks.rest().map_or(&[][..], |rest| rest.bytes), &text[end..]);
        }
    }

    #[test]
    fn a_line_may_be_longer_than_a_block_and_not_longer_than_it_may_be() {
        let long = [vec![b'x'; 5 << 19], vec![b'\n'; 1]].concat();
        let text = [b"short\n".to_vec(), long.clone(), b"short\n".to_vec()].concat();
        let mut blocks = LineBlocks::new(&text[..], long.len());
        let mut lengths = Vec::new();
        while let Some(block) = blocks.next_block().expect("as long as it may be") {
            lengths.extend(block.parsed(|_, line| line.len()));
        }
        assert_eq!(lengths, [(1, 6), (2, long.len()), (3, 6)]);
        for reader in [&text[..], &text[..text.len() - 7]] {
            let mut blocks = LineBlocks::new(reader, long.len() - 2);
            let error = loop {
                match blocks.next_block() {
                    Ok(block) => assert!(block.is_some(), "the second line is too long"),
                    Err(error) => break error,
                }
            };
            assert!(
                matches!(error, LineError::TooLong { line: 2, .. }),
                "{error:?}"
            );
        }
        let mut endless = LineBlocks::new(io::repeat(b'1'), 1 << 20);
        assert!(matches!(
            endless.next_block(),
            Err(LineError::TooLong { line: 1, .. })
        ));
    }
}
