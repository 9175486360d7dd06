//! What the searches by bytes compute from their candidates, and when.
//!
//! *How it works.* All of it is computed from the candidates alone, so it is computed once and kept beside them: an
//! image is matched with many others. Bytes are made by the first search. Principal components take longer, and pay
//! only in one large search or in many searches. They are made as soon as all searches so far together had as many
//! pairs as one search must have for them to pay. So never more than about twice the least possible time is spent,
//! whatever comes (the ski rental problem: rent until the rent has reached the price, then buy).

use std::sync::{Arc, Mutex, PoisonError};

use super::panels::{Bounds, Panels};
use super::principal::{self, Principal, Projected};
use super::within::LANES;
use super::{WORTH, has_tiles, is_wide};

/// Pairs from which on principal components are worth the work of finding them: with AVX2 SIFT's 4,000 x 4,000 are up to a
/// fifth faster with them, 3,000 x 3,000 between a tenth slower and a twentieth faster, 2,000 x 2,000 slower (Zen 3).
const PAIRS: usize = 12_000_000;

/// The same with AVX-512: SIFT's 6,000 x 6,000 take 0.98 of their time with them, and 0.85 with a ratio test; 5,500 x 5,500
/// 1.02 and 0.89, 5,000 x 5,000 1.07 and 0.95, 4,000 x 4,000 1.28 and 1.14 (Intel).
const PAIRS_AVX512: usize = 25_000_000;

/// Candidates from which on principal components that are there help: among 1,000 of SIFT a search for 1,000 takes 3 %
/// longer with them, among 2,000 one for 2,000 a tenth less (AVX-512).
const MIN_CANDIDATES: usize = 2_000;

/// Candidates that are prepared and kept.
#[derive(Default)]
pub(in crate::simd::search) struct Kept(Mutex<State>);

#[derive(Default)]
struct State {
    /// Pairs of all searches so far.
    pairs: usize,
    made: Option<Made>,
}

/// What was made, and for what.
struct Made {
    rows: usize,
    dim: usize,
    is_wide: bool,
    /// Whether principal components were tried.
    in_two_steps: bool,
    /// `None` where bytes cannot be made.
    candidates: Option<Arc<Candidates>>,
}

impl Made {
    /// See [`Candidates::are_for_all_products`].
    fn is_for_all_products(&self) -> bool {
        (self.candidates.as_ref()).is_some_and(|candidates| candidates.are_for_all_products())
    }
}

impl Kept {
    /// The candidates `b` for a search of so many `queries`, prepared now or before; `None` where that cannot be done.
    ///
    /// What is kept must have been made of the same rows. The processor has AVX2 and FMA.
    pub(super) fn for_search(
        &self,
        b: &[f32],
        dim: usize,
        queries: usize,
    ) -> Option<Arc<Candidates>> {
        let (rows, is_wide) = (b.len() / dim, is_wide());
        let worth = if is_wide { PAIRS_AVX512 } else { PAIRS };
        // What is made is replaced as a whole, so it is good even after a panic.
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        state.pairs = state.pairs.saturating_add(queries.saturating_mul(rows));
        let in_two_steps = rows >= MIN_CANDIDATES && state.pairs >= worth;
        let serves = |made: &&Made| {
            (made.rows, made.dim, made.is_wide) == (rows, dim, is_wide)
                && (made.in_two_steps >= in_two_steps || made.is_for_all_products())
        };
        if let Some(made) = state.made.as_ref().filter(serves) {
            return made.candidates.clone();
        }
        // SAFETY: the caller says so.
        let candidates = unsafe { Candidates::of(b, dim, is_wide, in_two_steps) }.map(Arc::new);
        state.made = Some(Made {
            rows,
            dim,
            is_wide,
            in_two_steps,
            candidates: candidates.clone(),
        });
        candidates
    }
}

/// Candidates, ready for searches.
pub(super) struct Candidates {
    pub(super) dim: usize,
    /// In which they are looked at.
    pub(super) order: Vec<u32>,
    /// All their values.
    pub(super) whole: Panels,
    pub(super) components: Option<Components>,
}

impl Candidates {
    /// `None` where bytes cannot be made of the rows; principal components are tried for searches `in_two_steps`,
    /// unless [all products](super::exact) are made anyway.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn of(rows: &[f32], dim: usize, is_wide: bool, in_two_steps: bool) -> Option<Self> {
        if in_two_steps && has_tiles() {
            let one_step = Self::of(rows, dim, is_wide, false)?;
            if one_step.are_for_all_products() {
                return Some(one_step);
            }
        }
        let components = if in_two_steps {
            Components::of(rows, dim, is_wide)
        } else {
            None
        };
        let (order, components) = match components {
            Some((order, components)) => (order, Some(components)),
            None => ((0..(rows.len() / dim) as u32).collect(), None),
        };
        Some(Self {
            whole: Panels::of(rows, &order, dim, is_wide)?,
            dim,
            order,
            components,
        })
    }

    /// Whether [all products](super::exact) with queries like these are made: principal components would not help.
    pub(super) fn are_for_all_products(&self) -> bool {
        has_tiles() && self.components.is_none() && self.whole.are_exact()
    }

    /// Bounds of the queries `rows` in their own order; `None` where bytes cannot be made of these.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn bounds_of(&self, rows: &[f32]) -> Option<Bounds<'_>> {
        let order: Vec<u32> = (0..(rows.len() / self.dim) as u32).collect();
        Bounds::of(&self.whole, rows, &order)
    }
}

/// About how many bytes are kept beside so many rows, at most: each value as a byte twice, and the components.
pub(in crate::simd::search) fn most_bytes(rows: usize, dim: usize) -> usize {
    const OF_COMPONENTS: usize = 128;
    if rows * dim < WORTH {
        return 0;
    }
    rows.next_multiple_of(LANES) * (2 * dim.next_multiple_of(4) + OF_COMPONENTS)
}

/// Candidates along their principal components.
pub(super) struct Components {
    principal: Principal,
    pub(super) panels: Panels,
    /// See [`Projected::rounding`].
    pub(super) rounding: f32,
    /// The mean of each panel.
    pub(super) means: Vec<[f32; principal::COMPONENTS]>,
}

impl Components {
    /// Candidates in an order in which those that are near to each other are near.
    #[target_feature(enable = "avx2,fma")]
    fn of(rows: &[f32], dim: usize, is_wide: bool) -> Option<(Vec<u32>, Self)> {
        let principal = Principal::of(rows, dim)?;
        let Projected { rows, rounding } = principal.project(rows)?;
        let order = principal::order(&rows);
        let means = order.chunks(LANES);
        let means = means.map(|chosen| principal::mean_of(&rows, chosen));
        let components = Self {
            means: means.collect(),
            panels: Panels::of(&rows, &order, principal::COMPONENTS, is_wide)?,
            principal,
            rounding,
        };
        Some((order, components))
    }

    /// Queries along the components; `None` where a value is not finite.
    pub(super) fn project(&self, queries: &[f32]) -> Option<Projected> {
        self.principal.project(queries)
    }

    /// See [`Principal::stretch`].
    pub(super) fn stretch(&self) -> f32 {
        self.principal.stretch
    }
}

#[cfg(test)]
mod tests {
    use super::super::has_avx2_and_fma;
    use super::*;
    use crate::seed::Seed;

    /// Rows that lie along few directions.
    fn rows(count: usize, dim: usize) -> Vec<f32> {
        let mut rng = Seed(21).rng();
        let directions: Vec<f32> = (0..6 * dim).map(|_| rng.normal() as f32).collect();
        let mut rows = Vec::new();
        for _ in 0..count {
            let weights: Vec<f32> = (0..6).map(|_| rng.normal() as f32).collect();
            rows.extend((0..dim).map(|k| {
                let parts = weights.iter().zip(directions[k..].iter().step_by(dim));
                parts.map(|(weight, value)| weight * value).sum::<f32>()
            }));
        }
        rows
    }

    #[test]
    fn components_are_made_once_searches_had_enough_pairs() {
        if !has_avx2_and_fma() {
            return;
        }
        let (rows, dim) = (rows(MIN_CANDIDATES, 64), 64);
        let worth = if is_wide() { PAIRS_AVX512 } else { PAIRS };
        let kept = Kept::default();
        let mut searches = 0;
        let first = kept.for_search(&rows, dim, 5_000).expect("bytes");
        assert!(first.components.is_none());
        while kept
            .for_search(&rows, dim, 5_000)
            .expect("bytes")
            .components
            .is_none()
        {
            searches += 1;
            assert!(
                searches * 5_000 * MIN_CANDIDATES < worth,
                "{searches} searches"
            );
        }
        assert!((searches + 2) * 5_000 * MIN_CANDIDATES >= worth);
        // And not again, even for one query.
        let made = kept.for_search(&rows, dim, 1).expect("bytes");
        let again = kept.for_search(&rows, dim, 5_000).expect("bytes");
        assert!(Arc::ptr_eq(&made, &again));
        // Among few candidates they are no help.
        let few = &rows[dim..];
        let kept = Kept::default();
        let candidates = kept.for_search(few, dim, worth).expect("bytes");
        assert!(candidates.components.is_none());
    }

    #[test]
    fn what_all_products_are_made_of_is_prepared_once() {
        if !has_tiles() {
            return;
        }
        let rows: Vec<f32> = (0..MIN_CANDIDATES * 64)
            .map(|i| (i * i % 251) as f32)
            .collect();
        let kept = Kept::default();
        let [few, many] = [1, PAIRS].map(|queries| kept.for_search(&rows, 64, queries));
        let (few, many) = (few.expect("bytes"), many.expect("bytes"));
        assert!(many.are_for_all_products() && Arc::ptr_eq(&few, &many));
    }

    #[test]
    fn what_cannot_be_prepared_is_tried_once() {
        if !has_avx2_and_fma() {
            return;
        }
        let mut rows = rows(MIN_CANDIDATES, 64);
        rows[70] = f32::NAN;
        let kept = Kept::default();
        for queries in [1, PAIRS, 1] {
            assert!(kept.for_search(&rows, 64, queries).is_none());
        }
        let state = kept.0.lock().expect("no panic");
        assert!(state.made.as_ref().is_some_and(|made| made.in_two_steps));
    }

    #[test]
    fn bytes_kept_are_no_more_than_told() {
        if !has_avx2_and_fma() {
            return;
        }
        for (count, dim) in [(MIN_CANDIDATES, 64), (MIN_CANDIDATES + 37, 130)] {
            let rows = rows(count, dim);
            // SAFETY: AVX2 and FMA were detected on this processor.
            let candidates = unsafe { Candidates::of(&rows, dim, is_wide(), true) };
            let candidates = candidates.expect("bytes");
            let components = candidates.components.as_ref().expect("few directions");
            let all = size_of_val(&candidates.order[..])
                + candidates.whole.bytes()
                + components.panels.bytes()
                + size_of_val(&components.means[..]);
            assert!(all <= most_bytes(count, dim), "{all}");
            assert!(2 * all > most_bytes(count, dim), "{all}");
        }
    }
}
