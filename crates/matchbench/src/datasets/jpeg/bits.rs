//! Reads the bits of entropy-coded data, and decodes Huffman codes.

use super::{JpegError, damaged};

/// Codes of at most so many bits are found by one table look-up.
const QUICK: u32 = 11;

/// A table of Huffman codes: maps bits to symbols.
pub(super) struct Codes {
    /// For the next [`QUICK`] bits: length of the code and its symbol. The length is 0 if the code is longer.
    quick: Box<[(u8, u8); 1 << QUICK]>,
    /// The same for symbols of a sequential block, where they code all coefficients except the first.
    steps: Box<[Step; 1 << QUICK]>,
    /// For each length: the first code that is too large for this length, left-aligned in 16 bits.
    ends: [u32; 17],
    /// For each length: the number to add to a code to get the index of its symbol.
    offsets: [i32; 17],
    symbols: Vec<u8>,
}

/// What a symbol means in a sequential block.
#[derive(Clone, Copy)]
struct Step {
    /// Bits of its code and of the coefficient after it; 0 if the code is longer than the bits that were looked
    /// up.
    bits: u8,
    /// Number of coefficients that it stands for, most of them zeros; 0 if all others are zeros.
    coefficients: u8,
}

impl Step {
    /// The step of a symbol whose code has this `length`.
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
    /// The codes with so many symbols of each length from 1 to 16; `None` if there are more symbols than codes
    /// of this length.
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

/// Reads the bits of one scan, without the zero byte that follows each `ff`.
pub(super) struct Bits<'a> {
    data: &'a [u8],
    /// Position after the last byte that was read.
    at: usize,
    /// The next bits, starting at the highest.
    next: u64,
    /// Number of bits in `next`.
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

    /// The next byte of data; `None` at a marker or at the end of the file.
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

    /// Reads bytes until there are at least as many bits as a code and its coefficient can have, if the data go
    /// that far.
    fn fill(&mut self) {
        if let Some(bytes) = self.data.get(self.at..).and_then(<[u8]>::first_chunk) {
            let word = u64::from_be_bytes(*bytes);
            // Whether one of its bytes is ff: then a byte of its complement is 0.
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

    /// Skips any number of bits.
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

    /// Skips the coefficients of a sequential block after the first.
    pub(super) fn coefficients(&mut self, codes: &Codes) -> Result<(), JpegError> {
        let mut at = 1;
        while at < 64 {
            // A code and its coefficient have at most 31 bits.
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

    /// Skips some of the bits that were read.
    #[inline]
    fn pass(&mut self, bits: u8) -> Result<(), JpegError> {
        if u32::from(bits) > self.count {
            return Err(JpegError::Truncated);
        }
        self.next <<= bits;
        self.count -= u32::from(bits);
        Ok(())
    }

    /// The length and the symbol of a code that is longer than the codes in the table.
    #[cold]
    fn long_code(&self, codes: &Codes) -> Result<(u8, u8), JpegError> {
        let next = (self.next >> 48) as u32;
        let found = (QUICK + 1..=16).find(|&length| next < codes.ends[length as usize]);
        // Missing bits are taken as zeros.
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

    /// Continues after the restart marker with this number. Only padding bits may be left before it.
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

    /// Ends the data here: returns where the next marker begins. What is left before it may only be padding.
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
