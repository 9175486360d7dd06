//! Exact search for the two nearest of many descriptors.
//!
//! *How it works.* The candidates are packed into panels: one vector lane holds one candidate, and value `k` of 16 or
//! 32 candidates lies in one row. A kernel walks down a panel with a block of queries at once. So each load serves
//! the whole block, every lane sums its own distance in the order of the values, and no vector is ever summed across.
//! Finished distances stay in registers. They are looked at one by one only when one of them beats the second best so
//! far, which becomes rare quickly. Tiles of queries or of panels are sized for the second-level cache, and no matrix
//! of distances is ever stored.
//!
//! There are three variants. Bits are counted with tables, in [`two_nearest_bits`]. Real values are first compared as
//! bytes, which rules out most candidates (`coarse`). Processors that multiply tiles of bytes compare all candidates
//! in full, for bits and for values that bytes hold exactly (`by_tiles`).

mod among;
mod bits;
#[cfg(target_arch = "x86_64")]
mod by_tiles;
#[cfg(target_arch = "x86_64")]
mod coarse;
mod float;
mod prepared;

pub use among::{nearest_bits_among, two_nearest_among};
pub use bits::two_nearest_bits;
pub use float::{complete, near_rows, two_nearest_floats};
pub use prepared::Prepared;

/// Bytes of the operand that is walked again and again: a part of any second-level cache.
const TILE_BYTES: usize = 128 << 10;

/// The two nearest of the candidates seen so far, and which one the nearest is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoNearest<D = f32> {
    /// Distance to the nearest; infinite where no candidate has a finite distance.
    pub nearest: D,
    /// Distance to the second nearest; infinite where there is none.
    pub second: D,
    /// Index of the nearest: the lowest of those at that distance.
    pub index: u32,
}

impl<D: Copy + PartialOrd> TwoNearest<D> {
    /// No candidate yet; only distances below `unreachable` will count.
    const fn none(unreachable: D) -> Self {
        Self {
            nearest: unreachable,
            second: unreachable,
            index: 0,
        }
    }

    /// Takes the next candidate. Every comparison is strict, so the first of equals stays and NaN
    /// never wins. Written without branches, whose outcome nobody could predict.
    #[inline(always)]
    fn offer(&mut self, distance: D, index: u32) {
        let wins = distance < self.nearest;
        let loser = if wins { self.nearest } else { distance };
        self.second = if loser < self.second {
            loser
        } else {
            self.second
        };
        self.nearest = if wins { distance } else { self.nearest };
        self.index = if wins { index } else { self.index };
    }

    /// Takes the next candidates, `first` and those that follow it; lanes from `count` on are
    /// padding.
    #[inline(always)]
    fn offer_lanes<const LANES: usize>(
        &mut self,
        distances: &[D; LANES],
        first: usize,
        count: usize,
    ) {
        if !self.loses_to_one(distances) {
            return;
        }
        let (groups, rest) = distances.as_chunks::<16>();
        debug_assert!(rest.is_empty(), "lanes come in groups of 16");
        for (group, first) in groups.iter().zip((first..).step_by(16)) {
            if self.loses_to_one(group) {
                for (&distance, index) in group.iter().zip(first..count) {
                    self.offer(distance, index as u32);
                }
            }
        }
    }

    /// Whether one of `distances` beats the second nearest; without branches, for vectors.
    #[inline(always)]
    fn loses_to_one<const LANES: usize>(&self, distances: &[D; LANES]) -> bool {
        distances
            .iter()
            .map(|&distance| distance < self.second)
            .fold(false, |any, wins| any | wins)
    }
}

/// Turns rows of `width` values into panels of `width` lane rows; lanes without a row are zero.
fn pack<T: Copy + Default, const LANES: usize>(rows: &[T], width: usize) -> Vec<[T; LANES]> {
    let panels = (rows.len() / width).div_ceil(LANES);
    let mut packed = vec![[T::default(); LANES]; panels * width];
    for (index, row) in rows.chunks_exact(width).enumerate() {
        let panel = &mut packed[index / LANES * width..][..width];
        for (lanes, &value) in panel.iter_mut().zip(row) {
            lanes[index % LANES] = value;
        }
    }
    packed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_of_equals_stays_and_is_also_the_second() {
        let mut best = TwoNearest::none(f32::INFINITY);
        let mut lanes = [9.0; 32];
        [lanes[0], lanes[1], lanes[2]] = [f32::NAN, 3.0, 3.0];
        best.offer_lanes(&lanes, 4, 40);
        [lanes[16], lanes[17], lanes[20]] = [3.0, f32::INFINITY, 1.0];
        best.offer_lanes(&lanes, 36, 36 + 20); // lane 20 is padding
        assert_eq!((best.index, best.nearest, best.second), (5, 3.0, 3.0));
    }

    #[test]
    fn rows_are_packed_lane_by_lane() {
        let packed = pack::<u8, 2>(&[1, 2, 3, 4, 5, 6], 2);
        assert_eq!(packed, [[1, 3], [2, 4], [5, 0], [6, 0]]);
    }
}
