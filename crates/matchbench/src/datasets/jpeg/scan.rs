//! Reads one scan of a JPEG: every block that it must have, bit by bit.

use std::ops::RangeInclusive;

use super::bits::{Bits, Codes};
use super::{JpegError, damaged};

/// Side of a block.
const BLOCK: usize = 8;

/// A component of the frame: one colour channel.
pub(super) struct Component {
    pub(super) id: u8,
    /// Blocks of this component in one unit of a scan of several components, across and down.
    pub(super) unit: [usize; 2],
    /// Blocks that hold its own pixels, across and down.
    blocks: [usize; 2],
    /// Units of several components in the frame, across and down.
    units: [usize; 2],
    /// For each block of all units, row by row, which coefficients are known not to be zero, since a refinement
    /// scan has a bit for each of these. Made by the first progressive scan.
    nonzero: Vec<u64>,
}

impl Component {
    /// The components of a frame of this `size`, from three bytes each; `None` if these are invalid.
    pub(super) fn of_frame(size: [usize; 2], stated: &[[u8; 3]]) -> Option<Vec<Self>> {
        let unit_of = |sampling: u8| [sampling >> 4, sampling & 0x0f].map(usize::from);
        let units: Vec<[usize; 2]> = stated.iter().map(|&[_, s, _]| unit_of(s)).collect();
        if size.contains(&0) || !units.iter().flatten().all(|side| (1..=4).contains(side)) {
            return None;
        }
        let largest = [0, 1].map(|axis| units.iter().map(|unit| unit[axis]).max().unwrap_or(1));
        let component = |(&[id, ..], &unit): (&[u8; 3], &[usize; 2])| Self {
            id,
            unit,
            blocks: [0, 1].map(|axis| {
                (size[axis] * unit[axis])
                    .div_ceil(largest[axis])
                    .div_ceil(BLOCK)
            }),
            units: [0, 1].map(|axis| size[axis].div_ceil(BLOCK * largest[axis])),
            nonzero: Vec::new(),
        };
        Some(stated.iter().zip(&units).map(component).collect())
    }

    /// Number of blocks in one row of all units.
    fn stride(&self) -> usize {
        self.units[0] * self.unit[0]
    }

    fn make_nonzero(&mut self) {
        if self.nonzero.is_empty() {
            self.nonzero = vec![0; self.stride() * self.units[1] * self.unit[1]];
        }
    }
}

/// A component in a scan.
pub(super) struct ScanComponent {
    /// Its index in the frame.
    pub(super) place: usize,
    /// Which table has the codes of first coefficients.
    pub(super) first: usize,
    /// Which table has the codes of all others.
    pub(super) others: usize,
}

/// The description of a scan.
pub(super) struct Scan<'a> {
    pub(super) components: &'a [ScanComponent],
    pub(super) tables: &'a [[Option<Codes>; 4]; 2],
    pub(super) progressive: bool,
    /// The coefficients that it contains.
    pub(super) band: RangeInclusive<usize>,
    /// Whether it adds a bit to coefficients of earlier scans.
    pub(super) refines: bool,
    /// Units between two restarts; 0 without restarts.
    pub(super) restart: usize,
}

impl Scan<'_> {
    /// Reads the `data` and returns their length in bytes.
    pub(super) fn walk(&self, frame: &mut [Component], data: &[u8]) -> Result<usize, JpegError> {
        let mut bits = Bits::new(data);
        let units = match self.components {
            [only] => frame[only.place].blocks,
            _ => frame[0].units,
        };
        if self.progressive {
            for component in self.components {
                frame[component.place].make_nonzero();
            }
        }
        let walks = (self.components.iter())
            .map(|component| self.walk_of(component))
            .collect::<Result<Vec<_>, _>>()?;
        let (mut run, mut since_restart, mut restarts) = (0, 0, 0);
        for y in 0..units[1] {
            for x in 0..units[0] {
                if self.restart > 0 && since_restart == self.restart {
                    bits.restart(restarts)?;
                    restarts = (restarts + 1) % 8;
                    (run, since_restart) = (0, 0);
                }
                since_restart += 1;
                if let ([only], [walk]) = (self.components, &walks[..]) {
                    let component = &mut frame[only.place];
                    let place = y * component.stride() + x;
                    walk.block(component.nonzero.get_mut(place), &mut run, &mut bits)?;
                    continue;
                }
                for (part, walk) in self.components.iter().zip(&walks) {
                    let component = &mut frame[part.place];
                    let [across, down] = component.unit;
                    for row in y * down..(y + 1) * down {
                        for column in x * across..(x + 1) * across {
                            let place = row * component.stride() + column;
                            walk.block(component.nonzero.get_mut(place), &mut run, &mut bits)?;
                        }
                    }
                }
            }
        }
        if run > 0 {
            return Err(damaged("runs of blocks"));
        }
        bits.end()
    }

    /// How the blocks of a component are read.
    fn walk_of(&self, component: &ScanComponent) -> Result<Walk<'_>, JpegError> {
        let table = |class: usize, place: usize| {
            let table = self.tables[class].get(place).and_then(Option::as_ref);
            table.ok_or_else(|| damaged("Huffman codes"))
        };
        let first_alone = *self.band.end() == 0;
        Ok(match (self.progressive, first_alone, self.refines) {
            (false, ..) => Walk::Sequential {
                first: table(0, component.first)?,
                others: table(1, component.others)?,
            },
            (true, true, false) => Walk::First(table(0, component.first)?),
            (true, true, true) => Walk::FirstRefined,
            (true, false, false) => Walk::Band(table(1, component.others)?, self.band.clone()),
            (true, false, true) => {
                Walk::BandRefined(table(1, component.others)?, self.band.clone())
            }
        })
    }
}

/// What a block contains in this scan.
enum Walk<'a> {
    /// All its coefficients.
    Sequential { first: &'a Codes, others: &'a Codes },
    /// The upper bits of the first coefficient.
    First(&'a Codes),
    /// Another bit of the first coefficient.
    FirstRefined,
    /// The upper bits of other coefficients.
    Band(&'a Codes, RangeInclusive<usize>),
    /// Another bit of other coefficients.
    BandRefined(&'a Codes, RangeInclusive<usize>),
}

impl Walk<'_> {
    /// Reads a block. `run` is the number of blocks that have no more coefficients, including this one.
    fn block(
        &self,
        nonzero: Option<&mut u64>,
        run: &mut u32,
        bits: &mut Bits<'_>,
    ) -> Result<(), JpegError> {
        let none = &mut 0;
        let nonzero = nonzero.unwrap_or(none);
        match self {
            Self::Sequential { first, others } => {
                first_coefficient(first, bits)?;
                bits.coefficients(others)
            }
            Self::First(codes) => first_coefficient(codes, bits),
            Self::FirstRefined => bits.number(1).map(drop),
            Self::Band(codes, band) => upper_bits(codes, band, nonzero, run, bits),
            Self::BandRefined(codes, band) => another_bit(codes, band, nonzero, run, bits),
        }
    }
}

fn first_coefficient(codes: &Codes, bits: &mut Bits<'_>) -> Result<(), JpegError> {
    let size = bits.symbol(codes)?;
    if size > 15 {
        return Err(damaged("coefficients"));
    }
    bits.number(size.into()).map(drop)
}

/// The upper bits of a `band`: T.81, figure G.3.
fn upper_bits(
    codes: &Codes,
    band: &RangeInclusive<usize>,
    nonzero: &mut u64,
    run: &mut u32,
    bits: &mut Bits<'_>,
) -> Result<(), JpegError> {
    if *run > 0 {
        *run -= 1;
        return Ok(());
    }
    let mut at = *band.start();
    while at <= *band.end() {
        let symbol = bits.symbol(codes)?;
        match (usize::from(symbol >> 4), u32::from(symbol & 0x0f)) {
            (15, 0) => at += 16,
            (zeros, 0) => {
                *run = (1 << zeros) + bits.number(zeros as u32)? - 1;
                return Ok(());
            }
            (zeros, size) => {
                at += zeros;
                bits.number(size)?;
                if at > *band.end() {
                    return Err(damaged("coefficients"));
                }
                *nonzero |= 1 << at;
                at += 1;
            }
        }
    }
    Ok(())
}

/// Another bit of a `band`: T.81, figure G.7. Coefficients that are not zero have a bit each, between those
/// that become nonzero.
fn another_bit(
    codes: &Codes,
    band: &RangeInclusive<usize>,
    nonzero: &mut u64,
    run: &mut u32,
    bits: &mut Bits<'_>,
) -> Result<(), JpegError> {
    let mut at = *band.start();
    let before = *nonzero;
    while *run == 0 && at <= *band.end() {
        let symbol = bits.symbol(codes)?;
        let (mut zeros, size) = (u32::from(symbol >> 4), symbol & 0x0f);
        match size {
            0 if zeros < 15 => {
                *run = (1 << zeros) + bits.number(zeros)?;
                break;
            }
            0 => {}
            1 => bits.skip(1)?,
            _ => return Err(damaged("coefficients")),
        }
        while at <= *band.end() {
            if before >> at & 1 == 1 {
                bits.skip(1)?;
            } else if zeros == 0 {
                break;
            } else {
                zeros -= 1;
            }
            at += 1;
        }
        if size == 1 {
            if at > *band.end() {
                return Err(damaged("coefficients"));
            }
            *nonzero |= 1 << at;
        }
        at += 1;
    }
    if *run > 0 {
        let rest = (at..=*band.end()).filter(|&at| before >> at & 1 == 1);
        bits.skip(rest.count() as u32)?;
        *run -= 1;
    }
    Ok(())
}
