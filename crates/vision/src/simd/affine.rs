//! Costs of pairs of candidates, for GAIM: how far the affine frame of one node's candidate takes the place of
//! another node from the place of its candidate.
//!
//! Candidates of a node are stored in blocks of eight, so that the costs of eight pairs are computed side by side.

/// Numbers of a candidate: its place (x, y), and its frame row after row.
pub const CANDIDATE: usize = 6;
/// Candidates of a node are stored in whole blocks of this many.
pub const CANDIDATES_AT_ONCE: usize = 8;

/// What costs of pairs depend on beside the candidates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairLimits {
    /// Candidates whose squared distance is smaller collide.
    pub squared_collision: f64,
    /// The cost of that.
    pub collision: i64,
    /// The largest error that counts.
    pub truncation: f64,
    /// The cost of an error of 1.
    pub unit: f64,
}

/// The other nodes about a node, and what they chose.
#[derive(Clone, Copy, Debug)]
pub struct Others<'a> {
    /// From the node to each of them (x, y).
    pub apart: [&'a [f64]; 2],
    /// The chosen place of each (x, y).
    pub at: [&'a [f64]; 2],
    /// Where the chosen frame of each takes `apart` (x, y).
    pub taken: [&'a [f64]; 2],
}

multiversioned! {
    #![avx512]

    /// The first of the nearest places to `place`, and its squared distance; 0 and infinity if there is
    /// none at a finite distance.
    ///
    /// # Panics
    /// If `x` and `y` are not whole blocks of one length.
    pub fn nearest_place(x: &[f64], y: &[f64], place: [f64; 2]) -> (usize, f64) {
        const L: usize = CANDIDATES_AT_ONCE;
        let (x, y) = (x.as_chunks::<L>(), y.as_chunks::<L>());
        assert!(x.1.is_empty() && y.1.is_empty() && x.0.len() == y.0.len(), "whole blocks");
        let (mut least, mut blocks) = ([f64::INFINITY; L], [0_u64; L]);
        for (block, (x, y)) in (0_u64..).zip(x.0.iter().zip(y.0)) {
            for i in 0..L {
                let (dx, dy) = (x[i] - place[0], y[i] - place[1]);
                let squared = dx * dx + dy * dy;
                let less = squared < least[i];
                least[i] = if less { squared } else { least[i] };
                blocks[i] = if less { block } else { blocks[i] };
            }
        }
        let mut best = (0, f64::INFINITY);
        for i in 0..L {
            let index = L * blocks[i] as usize + i;
            if least[i] < best.1 || (least[i] == best.1 && least[i].is_finite() && index < best.0) {
                best = (index, least[i]);
            }
        }
        best
    }

    /// Adds to `sums` for each of a node's candidates how far the nearest of the `others`, candidates of
    /// a node `apart` from it, is from where the frame predicts one, in distances of the nodes, at most
    /// `truncation`.
    ///
    /// # Panics
    /// If slices of one node's candidates are not whole blocks of one length.
    pub fn add_prediction_errors(
        candidates: [&[f64]; CANDIDATE],
        apart: [f64; 2],
        others: [&[f64]; 2],
        truncation: f64,
        sums: &mut [f64],
    ) {
        const L: usize = CANDIDATES_AT_ONCE;
        assert!(
            sums.len().is_multiple_of(L) && candidates.iter().all(|numbers| numbers.len() == sums.len()),
            "whole blocks"
        );
        let squared_apart = (apart[0] * apart[0] + apart[1] * apart[1]).max(f64::MIN_POSITIVE);
        for (first, sums) in (0..).step_by(L).zip(sums.as_chunks_mut::<L>().0) {
            let [x, y, xx, xy, yx, yy] = blocks::<L>(&candidates, first);
            let (mut to_x, mut to_y) = ([0.0; L], [0.0; L]);
            for i in 0..L {
                to_x[i] = x[i] + (xx[i] * apart[0] + xy[i] * apart[1]);
                to_y[i] = y[i] + (yx[i] * apart[0] + yy[i] * apart[1]);
            }
            let mut least = [f64::INFINITY; L];
            for (&x, &y) in others[0].iter().zip(others[1]) {
                for i in 0..L {
                    let (dx, dy) = (x - to_x[i], y - to_y[i]);
                    let squared = dx * dx + dy * dy;
                    least[i] = if squared < least[i] { squared } else { least[i] };
                }
            }
            for i in 0..L {
                let error = (least[i] / squared_apart).sqrt();
                sums[i] += if error < truncation { error } else { truncation };
            }
        }
    }

    /// Costs of a node's `own` candidate beside what the `others` chose; see [`pair_costs`].
    ///
    /// # Panics
    /// If a slice is shorter than `costs`.
    pub fn costs_beside(
        own: [f64; CANDIDATE],
        others: Others<'_>,
        limits: PairLimits,
        costs: &mut [i64],
    ) {
        let n = costs.len();
        let mut first = 0;
        while first + 8 <= n {
            beside::<8>(&own, others, limits, first, costs);
            first += 8;
        }
        while first < n {
            beside::<1>(&own, others, limits, first, costs);
            first += 1;
        }
    }

    /// Costs of pairs of nodes, the second `apart` from the first, having the candidates `from` and `to`: how
    /// far the better of the two frames takes the other node from its place, in distances of the nodes.
    ///
    /// # Panics
    /// If a slice is shorter than `costs`.
    pub fn pair_costs(
        from: [&[f64]; CANDIDATE],
        to: [&[f64]; CANDIDATE],
        apart: [&[f64]; 2],
        limits: PairLimits,
        costs: &mut [i64],
    ) {
        let n = costs.len();
        let mut first = 0;
        while first + 8 <= n {
            pairs::<8>(&from, &to, apart, limits, first, costs);
            first += 8;
        }
        while first < n {
            pairs::<1>(&from, &to, apart, limits, first, costs);
            first += 1;
        }
    }
}

#[inline(always)]
fn beside<const L: usize>(
    own: &[f64; CANDIDATE],
    others: Others<'_>,
    limits: PairLimits,
    first: usize,
    costs: &mut [i64],
) {
    let [x, y, xx, xy, yx, yy] = *own;
    let [apart_x, apart_y] = others.apart.map(|v| block::<L>(v, first));
    let [at_x, at_y] = others.at.map(|v| block::<L>(v, first));
    let [taken_x, taken_y] = others.taken.map(|v| block::<L>(v, first));
    let costs = costs[first..]
        .first_chunk_mut::<L>()
        .expect("a whole block");
    for i in 0..L {
        let apart = [apart_x[i], apart_y[i]];
        let moved = [at_x[i] - x, at_y[i] - y];
        let by_own = take([xx, xy, yx, yy], apart);
        costs[i] = cost(apart, moved, by_own, [taken_x[i], taken_y[i]], limits);
    }
}

#[inline(always)]
fn pairs<const L: usize>(
    from: &[&[f64]; CANDIDATE],
    to: &[&[f64]; CANDIDATE],
    apart: [&[f64]; 2],
    limits: PairLimits,
    first: usize,
    costs: &mut [i64],
) {
    let (from, to) = (blocks::<L>(from, first), blocks::<L>(to, first));
    let [apart_x, apart_y] = apart.map(|v| block::<L>(v, first));
    let costs = costs[first..]
        .first_chunk_mut::<L>()
        .expect("a whole block");
    for i in 0..L {
        let apart = [apart_x[i], apart_y[i]];
        let moved = [to[0][i] - from[0][i], to[1][i] - from[1][i]];
        let taken =
            |by: &[&[f64; L]; CANDIDATE]| take([by[2][i], by[3][i], by[4][i], by[5][i]], apart);
        costs[i] = cost(apart, moved, taken(&from), taken(&to), limits);
    }
}

/// The values from place `first` on.
#[inline(always)]
fn block<const L: usize>(values: &[f64], first: usize) -> &[f64; L] {
    values[first..].first_chunk().expect("a whole block")
}

/// The same of each number. (`map` is not always compiled into its caller, nor for its instructions.)
#[inline(always)]
fn blocks<'a, const L: usize>(
    numbers: &[&'a [f64]; CANDIDATE],
    first: usize,
) -> [&'a [f64; L]; CANDIDATE] {
    let [x, y, xx, xy, yx, yy] = numbers;
    [
        block(x, first),
        block(y, first),
        block(xx, first),
        block(xy, first),
        block(yx, first),
        block(yy, first),
    ]
}

/// A frame times a vector.
#[inline(always)]
fn take([xx, xy, yx, yy]: [f64; 4], [x, y]: [f64; 2]) -> [f64; 2] {
    [xx * x + xy * y, yx * x + yy * y]
}

/// The cost of a pair: its nodes are `apart`, its candidates `moved`, and the two frames take it `by`.
#[inline(always)]
fn cost(
    apart: [f64; 2],
    moved: [f64; 2],
    by: [f64; 2],
    or_by: [f64; 2],
    limits: PairLimits,
) -> i64 {
    /// Costs are below this, so that they are whole numbers of 64 bits.
    const LARGEST: f64 = (1_u64 << 62) as f64;
    let squared_length = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
    let smaller = |a: f64, b: f64| if a < b { a } else { b };
    let error = |by: [f64; 2]| squared_length([moved[0] - by[0], moved[1] - by[1]]);
    let squared = squared_length(apart);
    let error = (smaller(error(by), error(or_by)) / squared).sqrt();
    let cost = smaller(error, limits.truncation) * limits.unit;
    let cost = if cost > 0.0 { cost } else { 0.0 };
    // SAFETY: the value is a number from 0 to 2^62.
    let cost: i64 = unsafe { smaller(cost, LARGEST).to_int_unchecked() };
    let collide = squared_length(moved) < limits.squared_collision;
    let cost = if collide { limits.collision } else { cost };
    if squared == 0.0 { 0 } else { cost }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Rng, Seed};
    use crate::simd::InstructionSet;

    fn columns<const N: usize>(count: usize, rng: &mut Rng) -> [Vec<f64>; N] {
        std::array::from_fn(|_| (0..count).map(|_| rng.normal()).collect())
    }

    fn slices<const N: usize>(columns: &[Vec<f64>; N]) -> [&[f64]; N] {
        columns.each_ref().map(|column| &column[..])
    }

    const LIMITS: PairLimits = PairLimits {
        squared_collision: 0.3,
        collision: 777_777,
        truncation: 3.0,
        unit: 10_000.0,
    };

    #[test]
    fn the_first_of_the_nearest_places_is_found() {
        let far = f64::INFINITY;
        let mut x = [
            5.0, 2.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 2.0, far, far, far, far,
        ];
        let y = [0.0; 16];
        assert_eq!(nearest_place(&x, &y, [3.0, 2.0]), (1, 5.0));
        x[1] = 8.5;
        assert_eq!(nearest_place(&x, &y, [3.0, 2.0]), (11, 5.0));
        x[8] = 2.0;
        assert_eq!(nearest_place(&x, &y, [3.0, 2.0]), (8, 5.0));
        assert_eq!(nearest_place(&[far; 8], &[0.0; 8], [3.0, 2.0]), (0, far));
        assert_eq!(nearest_place(&[], &[], [3.0, 2.0]), (0, far));
    }

    #[test]
    fn errors_are_those_of_the_nearest_other() {
        let mut rng = Seed(5).rng();
        let (own, others) = (columns::<6>(16, &mut rng), columns::<2>(13, &mut rng));
        let mut sums = [1.0; 16];
        add_prediction_errors(slices(&own), [0.6, -0.8], slices(&others), 0.7, &mut sums);
        let mut cut = 0;
        for (i, &sum) in sums.iter().enumerate() {
            let v = own.each_ref().map(|column| column[i]);
            let (x, y) = (
                v[0] + 0.6 * v[2] - 0.8 * v[3],
                v[1] + 0.6 * v[4] - 0.8 * v[5],
            );
            let distances = others[0]
                .iter()
                .zip(&others[1])
                .map(|(a, b)| libm::hypot(a - x, b - y));
            let least = distances.fold(f64::INFINITY, f64::min);
            assert!((sum - 1.0 - least.min(0.7)).abs() < 1e-12, "{sum} {least}");
            cut += u32::from(least > 0.7);
        }
        assert!((1..16).contains(&cut), "{cut} are cut off");
    }

    #[test]
    fn candidates_collide_agree_or_do_not() {
        // Twice as large, turned by a quarter: (1, 0) becomes (0, 2).
        let double = [0.0, -2.0, 2.0, 0.0];
        let same = [1.0, 0.0, 0.0, 1.0];
        let of = |at: [f64; 2], by: [f64; 4]| [at[0], at[1], by[0], by[1], by[2], by[3]];
        let cost = |from: [f64; 6], to: [f64; 6], apart: [f64; 2]| {
            let mut costs = [0];
            let [from, to] = [&from, &to].map(|v| v.each_ref().map(std::slice::from_ref));
            pair_costs(
                from,
                to,
                apart.each_ref().map(std::slice::from_ref),
                LIMITS,
                &mut costs,
            );
            costs[0]
        };
        assert_eq!(
            cost(of([5.0, 5.0], double), of([5.0, 9.0], same), [2.0, 0.0]),
            0
        );
        assert_eq!(
            cost(of([5.0, 5.0], same), of([5.0, 9.0], double), [2.0, 0.0]),
            0
        );
        assert_eq!(
            cost(of([5.0, 5.0], double), of([5.0, 10.0], double), [2.0, 0.0]),
            5_000
        );
        assert_eq!(
            cost(of([5.0, 5.0], double), of([5.0, 90.0], double), [2.0, 0.0]),
            30_000
        );
        assert_eq!(
            cost(of([5.0, 5.0], double), of([5.5, 5.0], double), [2.0, 0.0]),
            777_777
        );
        assert_eq!(
            cost(of([5.0, 5.0], double), of([5.5, 5.0], double), [0.0, 0.0]),
            0
        );
    }

    #[test]
    fn all_sets_of_instructions_and_both_kernels_give_the_same_costs() {
        let mut rng = Seed(6).rng();
        for n in [1, 7, 8, 45] {
            let (to, apart) = (columns::<6>(n, &mut rng), columns::<2>(n, &mut rng));
            let own: [f64; 6] = std::array::from_fn(|_| rng.normal());
            let from = own.map(|v| vec![v; n]);
            let taken: [Vec<f64>; 2] = [0, 1].map(|row| {
                let by =
                    |i: usize| take([2, 3, 4, 5].map(|k| to[k][i]), [apart[0][i], apart[1][i]]);
                (0..n).map(|i| by(i)[row]).collect()
            });
            let mut all = Vec::new();
            InstructionSet::for_each(|_| {
                let mut costs = [vec![0; n], vec![0; n]];
                let [pairs, beside] = &mut costs;
                pair_costs(slices(&from), slices(&to), slices(&apart), LIMITS, pairs);
                let others = Others {
                    apart: slices(&apart),
                    at: [&to[0], &to[1]],
                    taken: slices(&taken),
                };
                costs_beside(own, others, LIMITS, beside);
                let places = [&to[0][..n / 8 * 8], &to[1][..n / 8 * 8]];
                all.push((costs, nearest_place(places[0], places[1], [0.1, 0.2])));
            });
            assert!(all.iter().all(|found| *found == all[0]), "{n} pairs");
            assert_eq!(all[0].0[0], all[0].0[1]);
        }
    }
}
