//! The nearest by Euclidean distance, with products of bytes.
//!
//! *How it works.*
//! 1. Values become bytes (see [`Grid`](grid::Grid)). By the triangle inequality, the distance of two rows of bytes
//!    differs from the scaled distance of the rows by at most the rounding of one row plus that of the other (as
//!    lengths of vectors).
//! 2. With `|a - b|^2 = |a|^2 + |b|^2 - 2 a.b` each instruction multiplies and adds 32 pairs of
//!    bytes, or 64.
//! 3. A candidate is rejected if even the lower bound of its distance exceeds the second smallest distance so
//!    far. For the few others the distance is computed in full, which may lower that second smallest.
//! 4. The first few hundred candidates are compared by the bytes of all values at once. The second smallest of their
//!    distances is a bound, so only those that are within it are looked at one by one, and few of those that follow.
//! 5. Large searches look first only at the first principal components, a quarter of the bytes of SIFT: of 85,000
//!    candidates these leave about one in 160 (ASIFT, castle, AVX-512). Queries that are near to each other see the
//!    candidates near to them first, so small distances are known from the start.
//! 6. The candidates that are left, mostly the two nearest themselves, are compared by the definition of the
//!    distance. So the results are those of the search by definition. With AVX-512 bytes hold whole numbers exactly,
//!    such as those of SIFT, and distances from such bytes are those of the definition.
//! 7. For a ratio test most searches need not find the second nearest. Where the two nearest so far fail the test, only
//!    a candidate nearer than the ratio times the nearest can make it pass; all others are skipped from then on. The few
//!    rows that pass in the end are searched for again, since their second nearest may be among what was skipped.
//! 8. What is computed from candidates alone is computed once for all searches among them (see [`Kept`]).
//! 9. Where bytes are exact and the processor multiplies tiles of them, [all products](exact) are computed: steps 3
//!    to 7 are not needed.

mod candidates;
mod exact;
mod grid;
mod keep;
mod panels;
mod principal;
mod searching;
#[cfg(test)]
mod tests;
mod tile;
mod within;

use std::sync::Arc;

use self::candidates::Candidates;
use self::grid::MAX_DIM;
use self::panels::Bounds;
use self::searching::{Found, search};
use self::tile::{Apart, Wanted};
use super::{TwoNearest, two_nearest_among};
use crate::simd::{InstructionSet, tiles::Tiles};

pub(super) use self::candidates::{Kept, most_bytes};

/// Values of `b` from which on bytes are worth the work of making them: with fewer, too many of the
/// candidates are measured.
pub(super) const WORTH: usize = 40_000;

/// Ratios above this are searched for as if there were none. It was not measured from where on skipping pays.
const MAX_RATIO: f32 = 0.9;

/// For each row of `a` the rows of `b` that may be nearest, in ascending order, where bytes help to find these. Among
/// them are all that are, by the definition, at most as far as the farther of any two that are `apart`: without it of any
/// two, so all that are no farther than the second nearest.
///
/// There are no rows where `b` is small, some value is not finite or of extreme size, rows are very
/// long, or the processor lacks AVX2; and not after rows whose candidates are too much alike.
pub(super) fn near_rows(
    a: &[f32],
    b: &[f32],
    dim: usize,
    kept: &Kept,
    apart: Option<Apart>,
) -> Vec<Option<Vec<u32>>> {
    let rows_of = |_, found: Found| match found {
        Found::Near { near, .. } => near.iter().map(|&(index, _)| index).collect(),
        Found::Above { .. } | Found::Below => unreachable!("no ratio is wanted"),
    };
    match prepared([a, b], dim, kept) {
        // SAFETY: AVX2 and FMA were detected on this processor.
        Some(candidates) => unsafe { search([a, b], &candidates, Wanted::Near(apart), rows_of) },
        None => none(a, dim),
    }
}

/// For each row of `a` its two nearest of `b`, where bytes help to find these: see [`near_rows`]. With a `ratio`, those
/// whose distances have no ratio below it may be others of which the same is true.
pub(super) fn two_nearest(
    a: &[f32],
    b: &[f32],
    dim: usize,
    kept: &Kept,
    ratio: Option<f32>,
) -> Vec<Option<TwoNearest>> {
    let Some(candidates) = prepared([a, b], dim, kept) else {
        return none(a, dim);
    };
    if candidates.are_for_all_products() {
        // SAFETY: AVX2 and FMA were detected on this processor.
        let bounds = unsafe { candidates.bounds_of(a) };
        if let Some(bounds) = bounds.filter(Bounds::are_exact) {
            // SAFETY: what is in use was detected on this processor, and this thread uses tiles nowhere else meanwhile.
            let best = unsafe { exact::two_nearest(&bounds, &mut Tiles::of_this_thread()) };
            return best.into_iter().map(Some).collect();
        }
    }
    let wanted = match ratio {
        Some(ratio) if ratio <= MAX_RATIO => Wanted::Below(ratio),
        _ => Wanted::Near(None),
    };
    found([a, b], dim, &candidates, wanted)
}

/// [`two_nearest`] by bounds. Where the ratio is [`Wanted`], candidates that do not decide on it are skipped, and rows of
/// `a` whose two nearest may be among these are searched for once more.
fn found(
    [a, b]: [&[f32]; 2],
    dim: usize,
    candidates: &Candidates,
    wanted: Wanted<'_>,
) -> Vec<Option<TwoNearest>> {
    let result = two_nearest_of([a, b], dim);
    // SAFETY: AVX2 and FMA were detected on this processor.
    let found = unsafe { search([a, b], candidates, wanted, result) };
    let (mut again, mut rows) = (Vec::new(), Vec::new());
    for (row, found) in found.iter().enumerate() {
        if matches!(found, Some(None)) {
            again.push(row);
            rows.extend_from_slice(&a[row * dim..][..dim]);
        }
    }
    let mut best: Vec<Option<TwoNearest>> = found.into_iter().map(Option::flatten).collect();
    if again.is_empty() {
        return best;
    }
    let result = two_nearest_of([&rows, b], dim);
    // SAFETY: as before.
    let found = unsafe { search([&rows, b], candidates, Wanted::Near(None), result) };
    for (row, found) in again.into_iter().zip(found) {
        best[row] = found.flatten();
    }
    best
}

/// The two nearest among those that were found for a row of `a`; `None` where others may be nearer.
fn two_nearest_of(
    [a, b]: [&[f32]; 2],
    dim: usize,
) -> impl FnMut(usize, Found) -> Option<TwoNearest> {
    let mut chosen = Vec::new();
    move |row, found| match found {
        Found::Near {
            near,
            are_exact: true,
        } => {
            let mut best = TwoNearest::none(f32::INFINITY);
            for &(index, squared) in near {
                best.offer(squared, index);
            }
            Some(best)
        }
        Found::Near { near, .. } => {
            chosen.clear();
            chosen.extend(near.iter().map(|&(index, _)| index));
            Some(two_nearest_among(&a[row * dim..][..dim], b, &chosen))
        }
        Found::Above {
            index,
            squared: [nearest, second],
        } => Some(TwoNearest {
            nearest,
            second,
            index,
        }),
        Found::Below => None,
    }
}

/// The candidates `b`, where bytes help.
fn prepared([a, b]: [&[f32]; 2], dim: usize, kept: &Kept) -> Option<Arc<Candidates>> {
    let is_worth_it = (1..=MAX_DIM).contains(&dim) && b.len() >= WORTH && has_avx2_and_fma();
    is_worth_it.then(|| kept.for_search(b, dim, a.len() / dim))?
}

/// Nothing for each row of `a`.
fn none<T>(a: &[f32], dim: usize) -> Vec<Option<T>> {
    (0..a.len() / dim).map(|_| None).collect()
}

fn has_avx2_and_fma() -> bool {
    InstructionSet::in_use() >= InstructionSet::Avx2
}

/// Whether tiles of bytes are in use.
fn has_tiles() -> bool {
    InstructionSet::in_use() == InstructionSet::Amx
}

/// Whether AVX-512 with products of bytes is in use.
fn is_wide() -> bool {
    InstructionSet::in_use() >= InstructionSet::Avx512
}
