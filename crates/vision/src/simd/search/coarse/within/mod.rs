//! Which candidates of a panel may be within the bounds of a block of queries.
//!
//! *How it works.* With `|a - b|^2 = |a|^2 + |b|^2 - 2 a.b` a candidate is within the bound of a query if the
//! products of their bytes sum up to enough. Sums start at minus half of the candidate's part of the distance, so
//! each has only to be compared with one number of its query. A panel has as many lanes as sums of a whole block fit
//! into the registers of AVX-512. So each value of a query that is loaded serves all lanes, and each vector of a
//! panel serves all queries; the units that multiply do not have to wait. AVX2 has half as many registers of half the
//! size, and takes a quarter of the lanes at a time.

pub(super) mod avx2;
pub(super) mod avx512;
#[cfg(test)]
mod tests;

/// The bytes of candidates, and what their sums of products start at.
pub(super) type Panel<'a> = (&'a [[i32; LANES]], &'a [i32; LANES]);

/// Candidates of a panel: four vectors of sixteen, or eight of eight.
pub(super) const LANES: usize = 64;

/// Queries of a block: with four vectors each, 24 of 32 registers hold sums; of AVX2, with two vectors
/// each, twelve of sixteen.
pub(super) const ROWS: usize = 6;

/// Looks at the queries block by block; `width` is that of their rows.
#[inline(always)]
fn by_blocks(
    rows: &[i32],
    least: &[[i32; ROWS]],
    width: usize,
    within: &mut [[u64; ROWS]],
    block: impl Fn(&[i32], &[i32; ROWS]) -> [u64; ROWS],
) {
    let blocks = rows.chunks_exact(ROWS * width);
    for ((within, least), rows) in within.iter_mut().zip(least).zip(blocks) {
        *within = block(rows, least);
    }
}

/// The second largest.
#[inline(always)]
fn second_of(values: &[i32]) -> i32 {
    let (mut most, mut next) = (i32::MIN, i32::MIN);
    for &value in values {
        next = next.max(most.min(value));
        most = most.max(value);
    }
    next
}

/// The rows of a block.
#[inline]
fn rows(quads: &[i32], width: usize) -> [&[i32]; ROWS] {
    let mut rows = [quads; ROWS];
    for (number, row) in rows.iter_mut().enumerate() {
        *row = &quads[number * width..][..width];
    }
    rows
}
