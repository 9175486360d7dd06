//! Bits of entropy-coded data, and the codes of Huffman that are made of them.

use super::{JpegError, damaged};

/// Codes of at most so many bits are looked up at once.
const QUICK: u32 = 11;

/// A table of Huffman codes: from bits to symbols.
pub(super) struct Codes {
    /// For the next [`QUICK`] bits: length of the code and its symbol; length 0 where it is longer.
    quick: Box<[(u8, u8); 1 << QUICK]>,
    /// The same where the symbols are those of a sequential block's coefficients behind the first.
    steps: Box<[Step; 1 << QUICK]>,
    /// For each length: the first code that is too large for it, in the upper of 16 bits.
    ends: [u32; 17],
    /// For each length: what leads from a code to the place of its symbol.
    offsets: [i32; 17],
    symbols: Vec<u8>,
}

/// What a symbol means in a sequential block.
#[derive(Clone, Copy)]
struct Step {
    /// Bits of its code and of the coefficient behind it; 0 where the code is longer than what was looked up.
    bits: u8,
    /// Coefficients that it brings, most of them zeros; 0 where all others are zeros.
    coefficients: u8,
}

impl Step {
    /// Of a symbol whose code has this `length`.
    fn of(length: u8, symbol: u8) -> Self {
        let (zeros, size) = (symbol >> 4, symbol & 0x0f);
        let ends = size == 0 && zeros < 15;
        Self {
            bits: length + size,
            coefficients: if ends { 0 } else { zeros + 1 },
        }
    }
}

impl Codes {
    /// The codes with so many symbols of each length from 1 to 16; `None` if there are more than so many
    /// bits can tell apart.
    pub(super) fn new(counts: &[u8; 16], symbols: &[u8]) -> Option<Self> {
        let mut codes = Self {
            quick: Box::new([(0, 0); 1 << QUICK]),
            steps: Box::new(
                [Step {
                    bits: 0,
                    coefficients: 0,
                }; 1 << QUICK],
            ),
            ends: [0; 17],
            offsets: [0; 17],
            symbols: symbols.to_vec(),
        };
        let (mut code, mut place) = (0_u32, 0_usize);
        for (length, &count) in (1_u32..).zip(counts) {
            codes.offsets[length as usize] = place as i32 - code as i32;
            for &symbol in &symbols[place..place + usize::from(count)] {
                if length <= QUICK {
                    let first = (code << (QUICK - length)) as usize;
                    let same = first..first + (1 << (QUICK - length));
                    let length = length as u8;
                    codes.quick.get_mut(same.clone())?.fill((length, symbol));
                    codes.steps[same].fill(Step::of(length, symbol));
                }
                code += 1;
            }
            if code > 1 << length {
                return None;
            }
            place += usize::from(count);
            codes.ends[length as usize] = code << (16 - length);
            code <<= 1;
        }
        Some(codes)
    }
}

/// Reads the bits of one scan, without the zeros that are stuffed behind each `ff`.
pub(super) struct Bits<'a> {
    data: &'a [u8],
    /// Behind the last byte that was taken.
    at: usize,
    /// The next bits, from the highest on.
    next: u64,
    /// How many there are.
    count: u32,
}

impl<'a> Bits<'a> {
    pub(super) fn new(data: &'a [u8]) -> Self {
        Self {
            data,
            at: 0,
            next: 0,
            count: 0,
        }
    }

    /// The next byte of data, if a marker or the end of the file is not there.
    fn byte(&mut self) -> Option<u8> {
        match *self.data.get(self.at..)? {
            [0xff, 0x00, ..] => {
                self.at += 2;
                Some(0xff)
            }
            [0xff, ..] | [] => None,
            [byte, ..] => {
                self.at += 1;
                Some(byte)
            }
        }
    }

    /// Takes bytes until there are more bits than a code and what belongs to it can have, if there are.
    fn fill(&mut self) {
        if let Some(bytes) = self.data.get(self.at..).and_then(<[u8]>::first_chunk) {
            let word = u64::from_be_bytes(*bytes);
            // Whether a byte of it is ff: one of its complement is 0.
            let ones = u64::MAX / 255;
            if (!word).wrapping_sub(ones) & word & (ones << 7) == 0 {
                let taken = (64 - self.count) / 8;
                self.next |= word.unbounded_shr(self.count);
                self.count += 8 * taken;
                self.next &= u64::MAX.unbounded_shl(64 - self.count);
                self.at += taken as usize;
                return;
            }
        }
        while self.count <= 56 {
            let Some(byte) = self.byte() else { break };
            self.next |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    /// The next `count` bits, at most 16, as a number.
    pub(super) fn number(&mut self, count: u32) -> Result<u32, JpegError> {
        if self.count < count {
            self.fill();
            if self.count < count {
                return Err(JpegError::Truncated);
            }
        }
        if count == 0 {
            return Ok(0);
        }
        let number = (self.next >> (64 - count)) as u32;
        self.next <<= count;
        self.count -= count;
        Ok(number)
    }

    /// Passes over any number of bits.
    pub(super) fn skip(&mut self, mut count: u32) -> Result<(), JpegError> {
        while count > 0 {
            let now = count.min(16);
            self.number(now)?;
            count -= now;
        }
        Ok(())
    }

    /// The symbol of the next code.
    pub(super) fn symbol(&mut self, codes: &Codes) -> Result<u8, JpegError> {
        if self.count < 32 {
            self.fill();
        }
        let (mut length, mut symbol) = codes.quick[(self.next >> (64 - QUICK)) as usize];
        if length == 0 {
            (length, symbol) = self.long_code(codes)?;
        }
        self.pass(length)?;
        Ok(symbol)
    }

    /// Passes over the coefficients of a sequential block behind its first.
    pub(super) fn coefficients(&mut self, codes: &Codes) -> Result<(), JpegError> {
        let mut at = 1;
        while at < 64 {
            // A code and its coefficient have at most 31.
            if self.count < 32 {
                self.fill();
            }
            let mut step = codes.steps[(self.next >> (64 - QUICK)) as usize];
            if step.bits == 0 {
                let (length, symbol) = self.long_code(codes)?;
                step = Step::of(length, symbol);
            }
            self.pass(step.bits)?;
            if step.coefficients == 0 {
                return Ok(());
            }
            at += step.coefficients;
        }
        if at > 64 {
            return Err(damaged("coefficients"));
        }
        Ok(())
    }

    /// Passes over some bits of those that are there.
    #[inline]
    fn pass(&mut self, bits: u8) -> Result<(), JpegError> {
        if u32::from(bits) > self.count {
            return Err(JpegError::Truncated);
        }
        self.next <<= bits;
        self.count -= u32::from(bits);
        Ok(())
    }

    /// The length and the symbol of a code that is longer than those of the table.
    #[cold]
    fn long_code(&self, codes: &Codes) -> Result<(u8, u8), JpegError> {
        let next = (self.next >> 48) as u32;
        let found = (QUICK + 1..=16).find(|&length| next < codes.ends[length as usize]);
        // Zeros stand for what is not there.
        let found = found.ok_or_else(|| {
            if self.count < 16 {
                JpegError::Truncated
            } else {
                damaged("codes")
            }
        })?;
        let code = (next >> (16 - found)) as i32;
        let place = code + codes.offsets[found as usize];
        Ok((found as u8, codes.symbols[place as usize]))
    }

    /// Goes on behind the restart marker of this number, before which only filling may be left.
    pub(super) fn restart(&mut self, number: u8) -> Result<(), JpegError> {
        self.end()?;
        while self.data.get(self.at + 1) == Some(&0xff) {
            self.at += 1;
        }
        match self.data.get(self.at..) {
            Some([0xff, marker, ..]) if *marker == 0xd0 + number => {
                self.at += 2;
                Ok(())
            }
            Some([0xff, 0xd0..=0xd7, ..]) => Err(damaged("restarts")),
            _ => Err(JpegError::Truncated),
        }
    }

    /// Ends the data here: where the next marker begins. What is left may only fill up.
    pub(super) fn end(&mut self) -> Result<usize, JpegError> {
        self.skip(self.count % 8)?;
        loop {
            if self.count == 0 {
                self.fill();
                if self.count == 0 {
                    return Ok(self.at);
                }
            }
            if !matches!(self.number(8)?, 0x00 | 0xff) {
                return Err(damaged("data behind its pixels"));
            }
        }
    }
}
