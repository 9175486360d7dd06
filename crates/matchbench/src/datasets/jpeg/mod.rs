//! Checks that a JPEG file is complete.
//!
//! Decoders fill missing data with grey and report nothing. So half a file gives half an image, and a small
//! file may claim any size. Here the file is read from marker to marker, and the data of each scan (`scan`)
//! symbol by symbol (`bits`), without computing pixels:
//!
//! - Each scan must have every bit of every block that its frame promises, and nothing more except padding. So
//!   the end of the data is known to the bit, whatever follows.
//! - The scans together must contain every coefficient of every component to its last bit. Without this check,
//!   a progressive file that was cut between two scans and given an end marker would show a blurred image.
//!
//! The decoder gives wrong pixels, or panics, for some files that the format allows and hardly any program writes: those
//! whose first channel has fewer samples than another, and sequential ones whose channels are in separate scans though
//! one has several samples in a unit. They are refused.
//!
//! The format is that of ITU-T T.81: Huffman codes, sequential and progressive, 8 bits. It is not checked that
//! the coefficients make a sensible picture. If bits of a file were changed and still are valid codes, it is a
//! different image, and nothing in the format shows that.

mod bits;
mod scan;

use bits::Codes;
use scan::{Component, Scan, ScanComponent};

/// Most scans of a file, the same limit as in the decoder: each scan costs time in proportion to the size that
/// is claimed.
const MAX_SCANS: usize = 100;

/// What the decoder must be told of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling {
    /// Whether its units are two blocks high and one wide (4:4:0): the decoder gives right pixels only if all channels
    /// are asked for.
    pub(super) is_tall: bool,
}

/// Checks that the image is complete, up to its end marker.
///
/// # Errors
/// If data are missing or invalid, or not decoded correctly.
pub(super) fn check(bytes: &[u8]) -> Result<Sampling, JpegError> {
    let mut file = File::default();
    let mut at = 2; // behind the marker that every file begins with
    loop {
        while *bytes.get(at).ok_or(JpegError::Truncated)? != 0xff {
            // After a scan there would be data that no scan has read.
            if file.scans > 0 {
                return Err(damaged("data behind its pixels"));
            }
            at += 1;
        }
        while *bytes.get(at).ok_or(JpegError::Truncated)? == 0xff {
            at += 1;
        }
        let marker = bytes[at];
        at += 1;
        match marker {
            0xd9 => return file.complete(),
            // Markers without a length, which have no meaning here.
            0x00 | 0x01 | 0xd0..=0xd8 => continue,
            _ => {}
        }
        let (segment, rest) = segment(bytes, at).ok_or(JpegError::Truncated)?;
        at = rest;
        match marker {
            0xc4 => file.codes(segment)?,
            0xc0..=0xc2 => file.frame(segment, marker == 0xc2)?,
            0xdd => {
                let [high, low] = *segment.first_chunk().ok_or_else(|| damaged("restarts"))?;
                file.restart = usize::from(u16::from_be_bytes([high, low]));
            }
            0xda => at += file.scan(segment, &bytes[at..])?,
            _ => {}
        }
    }
}

/// Why a file is not a complete image.
#[derive(Debug)]
pub(super) enum JpegError {
    /// Data are missing.
    Truncated,
    /// It has invalid parts of this kind.
    Damaged(&'static str),
    /// It has this, which is not decoded correctly.
    Unsupported(&'static str),
}

fn damaged(what: &'static str) -> JpegError {
    JpegError::Damaged(what)
}

/// The content of the segment whose length is at `at`, and the position after it.
fn segment(bytes: &[u8], at: usize) -> Option<(&[u8], usize)> {
    let length = u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?);
    let end = at + usize::from(length).max(2);
    Some((bytes.get(at + 2..end)?, end))
}

/// What the segments so far have defined.
#[derive(Default)]
struct File {
    progressive: bool,
    components: Vec<Component>,
    /// How many low bits of each of the 64 coefficients of each component are still missing.
    missing: Vec<[u8; 64]>,
    /// Codes of first coefficients, then of all others.
    tables: [[Option<Codes>; 4]; 2],
    /// Units of a scan between two restarts; 0 without restarts.
    restart: usize,
    scans: usize,
}

impl File {
    fn complete(&self) -> Result<Sampling, JpegError> {
        let whole = self.missing.iter().flatten().all(|&bits| bits == 0);
        let whole = whole && !self.missing.is_empty();
        let is_tall = self.largest_unit() == [1, 2];
        (whole.then_some(Sampling { is_tall })).ok_or(JpegError::Truncated)
    }

    /// The most blocks of any component in a unit, across and down.
    fn largest_unit(&self) -> [usize; 2] {
        let largest = |axis: usize| self.components.iter().map(|one| one.unit[axis]).max();
        [0, 1].map(|axis| largest(axis).unwrap_or(1))
    }

    /// Huffman codes: one segment may hold any number of tables.
    fn codes(&mut self, mut segment: &[u8]) -> Result<(), JpegError> {
        let none = || damaged("Huffman codes");
        while let Some((&place, rest)) = segment.split_first() {
            let (counts, rest) = rest.split_first_chunk::<16>().ok_or_else(none)?;
            let symbols = counts.iter().map(|&count| usize::from(count)).sum();
            let (symbols, rest) = rest.split_at_checked(symbols).ok_or_else(none)?;
            let class = self.tables.get_mut(usize::from(place >> 4));
            let table = class.and_then(|class| class.get_mut(usize::from(place & 0x0f)));
            *table.ok_or_else(none)? = Some(Codes::new(counts, symbols).ok_or_else(none)?);
            segment = rest;
        }
        Ok(())
    }

    fn frame(&mut self, segment: &[u8], progressive: bool) -> Result<(), JpegError> {
        let none = || damaged("frames");
        let (&[_, h0, h1, w0, w1, count], rest) = segment.split_first_chunk().ok_or_else(none)?;
        let [height, width] = [[h0, h1], [w0, w1]].map(u16::from_be_bytes);
        let stated = rest.as_chunks::<3>().0;
        if !self.components.is_empty() || stated.len() != usize::from(count) || count > 4 {
            return Err(none());
        }
        self.components =
            Component::of_frame([width, height].map(usize::from), stated).ok_or_else(none)?;
        if self.components.len() > 1 && self.components[0].unit != self.largest_unit() {
            return Err(JpegError::Unsupported(
                "a first channel that has fewer samples than another",
            ));
        }
        self.missing = vec![[u8::MAX; 64]; self.components.len()];
        self.progressive = progressive;
        Ok(())
    }

    /// Reads the data of a scan and returns their length in bytes.
    fn scan(&mut self, segment: &[u8], data: &[u8]) -> Result<usize, JpegError> {
        let none = || damaged("scans");
        self.scans += 1;
        if self.scans > MAX_SCANS {
            return Err(none());
        }
        let (&count, rest) = segment.split_first().ok_or_else(none)?;
        let (stated, rest) = (rest.split_at_checked(2 * usize::from(count))).ok_or_else(none)?;
        let &[from, to, bits] = rest.first_chunk().ok_or_else(none)?;
        let (high, low) = (bits >> 4, bits & 0x0f);
        let band = usize::from(from)..=usize::from(to);
        let sequential = !self.progressive && (from, to, bits) == (0, 63, 0);
        let progressive = self.progressive
            && band.start() <= band.end()
            && *band.end() < 64
            && (from > 0 || to == 0)
            && (from == 0 || count == 1)
            && (high == 0 || high == low + 1);
        if !(sequential || progressive) || !(1..=4).contains(&count) {
            return Err(none());
        }
        let mut components = Vec::new();
        for &[id, tables] in stated.as_chunks::<2>().0 {
            let place = self.components.iter().position(|other| other.id == id);
            let place = place.ok_or_else(none)?;
            if components
                .iter()
                .any(|other: &ScanComponent| other.place == place)
            {
                return Err(none());
            }
            // A refinement scan adds one bit to what an earlier scan defined.
            let missing = &mut self.missing[place][band.clone()];
            if high > 0 && missing.iter().any(|&bits| bits != high) {
                return Err(none());
            }
            missing.fill(low);
            components.push(ScanComponent {
                place,
                first: usize::from(tables >> 4),
                others: usize::from(tables & 0x0f),
            });
        }
        if !self.progressive && components.len() < self.components.len() {
            let is_several =
                |component: &ScanComponent| self.components[component.place].unit[0] > 1;
            let across = components.len() > 1 && components.iter().any(is_several);
            if across || self.largest_unit()[1] > 1 {
                return Err(JpegError::Unsupported(
                    "channels of unlike sizes in separate scans",
                ));
            }
        }
        let scan = Scan {
            components: &components,
            tables: &self.tables,
            progressive: self.progressive,
            band,
            refines: high > 0,
            restart: self.restart,
        };
        scan.walk(&mut self.components, data)
    }
}
