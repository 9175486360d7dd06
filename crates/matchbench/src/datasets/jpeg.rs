//! Whether a JPEG is all there.
//!
//! Decoders fill what is missing with gray and say nothing, so half a file shows half an image, and a
//! small one may claim any size. Two things are asked here:
//!
//! - Do the scans bring every coefficient of every component to its last bit? A progressive file that
//!   was cut between two scans and given an end marker shows a blurred image.
//! - Does the last scan hold as many bits as its pixels need? The decoder is given the file again with
//!   [`FILL`] in the place of the end marker: pixels that change had no data of their own, and a
//!   decoder that asks for still more found the end of it.
//!
//! Decoding twice costs time, so large baseline images are decoded once, with the fill alone behind
//! them: the decoder reads ahead by 8 bytes at most, and asks for more only where data are missing. Of
//! those the last 8 bytes may be missing unnoticed.

/// What stands in for missing data: no marker, no repetition.
pub(super) const FILL: [u8; 8] = [0x5a, 0x91, 0x2c, 0xe3, 0x47, 0xb8, 0x0d, 0x76];

/// The frame of a JPEG, as its markers tell it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Frame {
    /// Where the end marker of the image is.
    pub(super) end: usize,
    /// Whether it comes in several scans.
    pub(super) progressive: bool,
}

/// Walks from marker to marker; `None` where the file ends before its image does, or a coefficient is
/// in no scan.
pub(super) fn frame(bytes: &[u8]) -> Option<Frame> {
    let mut at = 2; // behind the marker that every file begins with
    let mut progressive = false;
    let mut components: Vec<u8> = Vec::new();
    // How many low bits of each of the 64 coefficients of each component are missing still.
    let mut missing: Vec<[u8; 64]> = Vec::new();
    loop {
        while *bytes.get(at)? != 0xff {
            at += 1;
        }
        while *bytes.get(at)? == 0xff {
            at += 1;
        }
        let marker = bytes[at];
        at += 1;
        match marker {
            0xd9 => {
                let whole = missing.iter().flatten().all(|&bits| bits == 0);
                let end = at - 2;
                return (whole && !missing.is_empty()).then_some(Frame { end, progressive });
            }
            // Escaped data, restarts and others without a length.
            0x00 | 0x01 | 0xd0..=0xd8 => continue,
            _ => {}
        }
        let length = usize::from(u16::from_be_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]));
        let segment = bytes.get(at + 2..at + length.max(2))?;
        match marker {
            0xc0..=0xc2 => {
                progressive = marker == 0xc2;
                components = segment.get(6..)?.chunks(3).map(|chunk| chunk[0]).collect();
                missing = vec![[u8::MAX; 64]; components.len()];
            }
            0xda => {
                let count = usize::from(*segment.first()?);
                let [from, to, bits] = *segment.get(1 + 2 * count..)?.first_chunk()?;
                for id in segment[1..].chunks(2).take(count) {
                    let component = components.iter().position(|other| *other == id[0])?;
                    let of_scan = missing[component].get_mut(from.into()..=to.into())?;
                    of_scan.fill(bits & 0x0f);
                }
            }
            _ => {}
        }
        at += length.max(2);
    }
}
