//! Both ways of searching beside the definition.

use super::super::{Prepared, TwoNearest, complete, two_nearest_among, two_nearest_floats};
use super::candidates::Candidates;
use super::principal::Principal;
use super::searching::QUERIES;
use super::*;
use crate::seed::{Rng, Seed};

/// The definition.
fn defined(a: &[f32], b: &[f32], dim: usize) -> Vec<TwoNearest> {
    let all: Vec<u32> = (0..(b.len() / dim) as u32).collect();
    a.chunks_exact(dim)
        .map(|row| two_nearest_among(row, b, &all))
        .collect()
}

/// Rows more or less near to one of a few: like descriptors, much nearer to some than to most.
fn clustered(rng: &mut Rng, rows: usize, dim: usize, centres: &[f32]) -> Vec<f32> {
    let mut clustered = Vec::new();
    for _ in 0..rows {
        let centre = rng.below((centres.len() / dim) as u32) as usize;
        let width = 0.5 * rng.uniform() as f32;
        let centre = &centres[centre * dim..][..dim];
        clustered.extend(
            centre
                .iter()
                .map(|value| value + width * rng.normal() as f32),
        );
    }
    clustered
}

/// Rows as mixtures of a few directions, the first of them with most weight, and a little of all others:
/// like descriptors, whose values hang together.
fn mixed(rng: &mut Rng, rows: usize, dim: usize, directions: &[f32]) -> Vec<f32> {
    let mut mixed = Vec::new();
    for _ in 0..rows {
        let first = mixed.len();
        mixed.extend((0..dim).map(|_| 0.05 * rng.normal() as f32));
        for (number, direction) in directions.chunks_exact(dim).enumerate() {
            let weight = rng.normal() as f32 / (1.0 + number as f32).sqrt();
            for (value, direction) in mixed[first..].iter_mut().zip(direction) {
                *value += weight * direction;
            }
        }
    }
    mixed
}

/// So many rows of values drawn at random.
fn drawn(rng: &mut Rng, rows: usize, dim: usize) -> Vec<f32> {
    (0..rows * dim).map(|_| rng.normal() as f32).collect()
}

/// [`search`] in two steps if `is_large` and the rows allow it.
fn find<T>(
    a: &[f32],
    b: &[f32],
    dim: usize,
    is_large: bool,
    wanted: Wanted,
    result: impl FnMut(usize, Found) -> T,
) -> Vec<Option<T>> {
    if dim > MAX_DIM || !has_avx2_and_fma() {
        return (0..a.len() / dim).map(|_| None).collect();
    }
    // SAFETY: AVX2 and FMA were detected on this processor.
    unsafe {
        match Candidates::of(b, dim, is_wide(), is_large) {
            Some(candidates) => search([a, b], &candidates, wanted, result),
            None => (0..a.len() / dim).map(|_| None).collect(),
        }
    }
}

/// Checks that a ratio test keeps the same of what was found for it as of the definition.
fn check_below(found: &[TwoNearest], expected: &[TwoNearest], ratio: f32) {
    let is_kept = |best: &TwoNearest| best.nearest.sqrt() < ratio * best.second.sqrt();
    assert_eq!(found.len(), expected.len());
    for (row, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert_eq!(is_kept(found), is_kept(expected), "row {row} at {ratio}");
        if is_kept(expected) {
            assert_eq!(found, expected, "row {row} at {ratio}");
        }
        let are_finite = [found, expected].map(|best| best.nearest.is_finite());
        assert_eq!(are_finite[0], are_finite[1], "row {row} at {ratio}");
    }
}

/// The search for a ratio test, in two steps if `is_large`.
fn below(a: &[f32], b: &[f32], dim: usize, is_large: bool, ratio: f32) -> Vec<TwoNearest> {
    let count = a.len() / dim;
    let found = if has_avx2_and_fma() {
        // SAFETY: AVX2 and FMA were detected on this processor.
        let candidates = unsafe { Candidates::of(b, dim, is_wide(), is_large) }.expect("bytes");
        super::found([a, b], dim, &candidates, Wanted::Below(ratio))
    } else {
        vec![None; count]
    };
    complete(found, |missing| {
        let all = defined(a, b, dim);
        missing.iter().map(|&row| all[row]).collect()
    })
}

/// Compares both ways of searching with the definition; returns for how many rows bytes were enough
/// in one step and in two.
fn compare(a: &[f32], b: &[f32], dim: usize) -> [usize; 2] {
    let expected = defined(a, b, dim);
    // The first search finds nothing prepared.
    let prepared = Prepared::default();
    for _ in 0..2 {
        let found = two_nearest_floats(a, b, dim, &prepared, None);
        assert_eq!(found, expected, "{dim} values");
        for ratio in [0.4, 0.8] {
            let found = two_nearest_floats(a, b, dim, &prepared, Some(ratio));
            check_below(&found, &expected, ratio);
        }
    }
    [false, true].map(|is_large| {
        let found = find(
            a,
            b,
            dim,
            is_large,
            Wanted::Near(None),
            two_nearest_of([a, b], dim),
        );
        let mut count = 0;
        for (row, (found, expected)) in found.iter().zip(&expected).enumerate() {
            if let Some(Some(found)) = found {
                assert_eq!(found, expected, "row {row} of {dim} values, {is_large}");
                count += 1;
            }
        }
        count
    })
}

/// Checks rows drawn around 60 places, with all values changed by `change(value, column)`; returns
/// for how many rows bytes were enough.
fn check(rows: usize, dim: usize, change: impl Fn(f32, usize) -> f32) -> usize {
    let mut rng = Seed(3).rng();
    let centres = drawn(&mut rng, 60, dim);
    let [a, b] = [rows, WORTH.div_ceil(dim).max(900)].map(|rows| -> Vec<f32> {
        let values = clustered(&mut rng, rows, dim, &centres);
        changed(&values, dim, &change)
    });
    let [one_step, two_steps] = compare(&a, &b, dim);
    assert_eq!(one_step == 0, two_steps == 0, "{dim} values");
    one_step
}

/// The same of mixed rows; returns for how many rows two steps were enough.
fn check_mixed(rows: usize, dim: usize, change: impl Fn(f32, usize) -> f32) -> usize {
    let mut rng = Seed(4).rng();
    let directions = drawn(&mut rng, 20, dim);
    let [a, b] = [rows, 1_500].map(|rows| -> Vec<f32> {
        let values = mixed(&mut rng, rows, dim, &directions);
        changed(&values, dim, &change)
    });
    compare(&a, &b, dim)[1]
}

fn changed(values: &[f32], dim: usize, change: impl Fn(f32, usize) -> f32) -> Vec<f32> {
    let values = values.iter().zip((0..dim).cycle());
    values
        .map(|(&value, column)| change(value, column))
        .collect()
}

/// Checks rows of each of these lengths, more than a tile of them, and that bytes were enough for all.
fn check_that_all_are_found(dims: [usize; 4], check: impl Fn(usize, usize) -> usize) {
    let rows = QUERIES + 40;
    for dim in dims {
        InstructionSet::for_each(|set| {
            let found = check(rows, dim);
            assert!(
                found == rows || !has_avx2_and_fma(),
                "{found} of {rows} rows of {dim} with {set:?}"
            );
        });
    }
}

#[test]
fn components_are_enough_for_rows_whose_values_hang_together() {
    check_that_all_are_found([33, 64, 128, 203], |rows, dim| {
        check_mixed(rows, dim, |value, _| value)
    });
}

#[test]
fn offsets_and_sizes_of_columns_change_no_result_of_components() {
    InstructionSet::for_each(|_| {
        check_mixed(200, 128, |value, column| value + 1e4 * column as f32);
        check_mixed(
            200,
            128,
            |value, column| if column == 7 { 1e5 * value } else { value },
        );
        // Values in other columns than a few are rounded away, or lie at a few places.
        check_mixed(
            200,
            128,
            |value, column| if column < 5 { value } else { 1e-6 * value },
        );
        check_mixed(
            200,
            128,
            |value, column| if column < 5 { value } else { 3.0 },
        );
        check_mixed(200, 128, |value, _| value.round());
        check_mixed(200, 128, |value, _| 1e3 + 1e-3 * value);
        check_mixed(200, 32, |value, _| value);
    });
}

#[test]
fn rows_far_from_all_others_change_no_result_of_components() {
    let mut rng = Seed(8).rng();
    let dim = 96;
    let directions = drawn(&mut rng, 20, dim);
    let mut b = mixed(&mut rng, 2_500, dim, &directions);
    // Of these rows none is in the sample, so their directions are no components.
    for (row, size) in [(1, 40.0), (3, 1e3), (2_499, 1e6)] {
        b[row * dim + 5] += size;
    }
    let a = b[..300 * dim]
        .iter()
        .map(|value| value + 0.01)
        .collect::<Vec<f32>>();
    for candidates in [&b[..1_500 * dim], &b] {
        InstructionSet::for_each(|_| {
            compare(&a, candidates, dim);
            compare(candidates, &a, dim);
        });
    }
}

#[test]
fn what_is_no_number_is_left_to_the_definition() {
    for other in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        for place in [3, 128 * 1_499 + 127] {
            let mut rng = Seed(9).rng();
            let directions = drawn(&mut rng, 20, 128);
            let mut b = mixed(&mut rng, 1_500, 128, &directions);
            let a = b[..40 * 128].to_vec();
            b[place] = other;
            assert_eq!(compare(&a, &b, 128), [0; 2], "{other}");
            assert_eq!(compare(&b, &a, 128), [0; 2], "{other}");
        }
    }
    let same = vec![2.5; 500 * 128];
    assert_eq!(compare(&same[..40 * 128], &same, 128), [0; 2]);
}

#[test]
fn all_within_the_bound_are_found_where_two_must_be_apart() {
    let mut rng = Seed(10).rng();
    let dim = 128;
    let directions = drawn(&mut rng, 20, dim);
    let [a, b] = [100, 1_500].map(|rows| mixed(&mut rng, rows, dim, &directions));
    let apart = |i: u32, j: u32| (i / 500) != (j / 500);
    let distances = |row: &[f32]| -> Vec<f32> {
        let nearest = |index| two_nearest_among(row, &b, &[index]).nearest;
        (0..1_500).map(nearest).collect()
    };
    InstructionSet::for_each(|_| {
        for is_large in [false, true] {
            let indices = |_, found: Found| match found {
                Found::Near { near, .. } => near.iter().map(|&(index, _)| index).collect(),
                Found::Above { .. } | Found::Below => panic!("no ratio is wanted"),
            };
            let wanted = Wanted::Near(Some(&apart));
            let near: Vec<Option<Vec<u32>>> = find(&a, &b, dim, is_large, wanted, indices);
            let are_all = near.iter().all(Option::is_some) || !is_large || !has_avx2_and_fma();
            assert!(are_all);
            for (row, near) in a.chunks_exact(dim).zip(near) {
                let Some(near) = near else { continue };
                let distances = distances(row);
                let least = |places: &[f32]| places.iter().copied().fold(f32::INFINITY, f32::min);
                let mut of_places: Vec<f32> = distances.chunks(500).map(least).collect();
                of_places.sort_by(f32::total_cmp);
                assert!(near.is_sorted());
                for (index, &distance) in (0..).zip(&distances) {
                    assert!(distance > of_places[1] || near.contains(&index));
                }
            }
        }
    });
}

/// Whole numbers as those of SIFT.
fn whole(values: &[f32]) -> Vec<f32> {
    let whole = |value: &f32| (8.0 * value + 100.0).round().clamp(0.0, 255.0);
    values.iter().map(whole).collect()
}

#[test]
fn for_a_ratio_test_few_are_looked_at_and_the_same_are_kept() {
    let mut rng = Seed(14).rng();
    let dim = 128;
    let directions = drawn(&mut rng, 20, dim);
    let b = mixed(&mut rng, 1_500, dim, &directions);
    // Some that have a near one, by different amounts, and some that have none.
    let mut a = mixed(&mut rng, 100, dim, &directions);
    for (number, row) in b.chunks_exact(dim).step_by(7).enumerate() {
        let width = 0.02 * (number % 40) as f32;
        a.extend((row.iter()).map(|value| value + width * rng.normal() as f32));
    }
    for [a, b] in [[whole(&a), whole(&b)], [a, b]] {
        let expected = defined(&a, &b, dim);
        InstructionSet::for_each(|set| {
            for (is_large, ratio) in [(false, 0.8), (true, 0.8), (true, 0.6), (true, 0.95)] {
                let mut counts = [0; 3];
                let kind = |_, found: Found| {
                    let kind = match found {
                        Found::Near { .. } => 0,
                        Found::Above { .. } => 1,
                        Found::Below => 2,
                    };
                    counts[kind] += 1;
                };
                find(&a, &b, dim, is_large, Wanted::Below(ratio), kind);
                if has_avx2_and_fma() && ratio <= MAX_RATIO {
                    let name = set.name();
                    assert!(counts.iter().all(|&count| count > 20), "{counts:?}, {name}");
                }
                let found = below(&a, &b, dim, is_large, ratio);
                check_below(&found, &expected, ratio);
            }
        });
    }
}

#[test]
fn where_components_rule_out_too_little_all_values_are_compared() {
    // Groups differ in what is no component: it is not in the sample, every second row.
    let (dim, groups) = (128, 40);
    let mut rng = Seed(12).rng();
    let directions: Vec<f32> = (0..3 * dim).map(|_| 0.2 * rng.normal() as f32).collect();
    let places = drawn(&mut rng, groups, dim);
    let [a, b] = [2 * QUERIES, 2_000].map(|rows| -> Vec<f32> {
        let mut values = mixed(&mut rng, rows, dim, &directions);
        let odd = values.chunks_exact_mut(dim).skip(1).step_by(2);
        for (number, row) in odd.enumerate() {
            let place = places.chunks_exact(dim).nth(number % groups);
            for (value, place) in row.iter_mut().zip(place.expect("one of them")) {
                *value += place;
            }
        }
        values
    });
    if has_avx2_and_fma() {
        // SAFETY: AVX2 and FMA were detected on this processor.
        assert!(unsafe { Principal::of(&b, dim) }.is_some());
        assert_eq!(compare(&a, &b, dim)[1], 2 * QUERIES);
    }
}

#[test]
fn bytes_are_enough_for_rows_like_descriptors() {
    check_that_all_are_found([63, 64, 128, 200], |rows, dim| {
        check(rows, dim, |value, _| value)
    });
}

#[test]
fn offsets_and_sizes_of_columns_change_no_result() {
    InstructionSet::for_each(|_| {
        check(200, 65, |value, column| value + 1e4 * column as f32);
        check(
            200,
            65,
            |value, column| if column == 7 { 1e5 * value } else { value },
        );
        check(
            200,
            65,
            |value, column| if column == 7 { value } else { 1e-6 * value },
        );
        check(200, 3, |value, _| (8.0 * value).round());
    });
}

#[test]
fn bytes_that_hold_fractions_exactly_tell_no_distances() {
    // A range of 127.5 makes bytes of halves, which lose nothing.
    let (dim, mut rng) = (128, Seed(15).rng());
    let mut b: Vec<f32> = (0..400 * dim)
        .map(|_| rng.below(256) as f32 / 2.0)
        .collect();
    [b[0], b[dim]] = [0.0, 127.5];
    let near = |value: &f32| (value + rng.below(3) as f32 / 2.0).min(127.5);
    let a: Vec<f32> = b[..60 * dim].iter().map(near).collect();
    InstructionSet::for_each(|_| {
        compare(&a, &b, dim);
    });
}

#[test]
fn rows_that_differ_by_a_rounding_error_are_found() {
    // On a grid of even numbers that lose nothing the bytes of query and candidates are the same, and of odd length.
    let (dim, mut rng) = (128, Seed(16).rng());
    let mut b: Vec<f32> = (0..520 * dim).map(|_| 2.0 * rng.below(50) as f32).collect();
    for row in b.chunks_exact_mut(dim) {
        row[0] = 2.0 * rng.below(255) as f32 - 254.0;
    }
    [b[2 * dim], b[3 * dim]] = [-254.0, 256.0];
    for column in 1..dim {
        [b[column], b[dim + column]] = [0.0; 2];
    }
    [b[0], b[dim]] = [100.0; 2];
    let mut a = b[..dim].to_vec();
    a[0] = a[0].next_up();
    InstructionSet::for_each(|_| {
        compare(&a, &b, dim);
    });
}

#[test]
fn fractions_that_an_offset_hides_are_seen() {
    let (dim, mut rng) = (128, Seed(17).rng());
    let mut b: Vec<f32> = (0..400 * dim)
        .map(|_| rng.below(202) as f32 - 100.0)
        .collect();
    for column in 0..dim {
        [b[column], b[dim + column]] = [-100.0, 101.0];
    }
    // Of the query 100 + 2^-17 less -100 is rounded to 200; two candidates are as far from 100, but not from it.
    let (first, second) = (5 * dim, 6 * dim);
    b.copy_within(first..first + dim, second);
    [b[first], b[second]] = [99.0, 101.0];
    let mut a = b[first..][..dim].to_vec();
    a[0] = 100.000_01;
    assert!(a[0] > 100.0 && a[0] + 100.0 == 200.0);
    InstructionSet::for_each(|_| {
        compare(&a, &b, dim);
    });
}

#[test]
fn a_column_whose_sum_is_infinite_changes_no_result() {
    // Few rows, of which each query may have all.
    let (dim, mut rng) = (1_000, Seed(14).rng());
    let mut rows = drawn(&mut rng, 70, dim);
    for row in rows.chunks_exact_mut(dim) {
        row[7] = 1e37;
    }
    let queries: Vec<f32> = rows[..20 * dim].iter().map(|value| 0.9 * value).collect();
    InstructionSet::for_each(|_| {
        compare(&rows, &rows, dim);
        compare(&queries, &rows, dim);
    });
}

#[test]
fn rows_too_much_alike_are_left_to_the_definition() {
    InstructionSet::for_each(|_| {
        // A few values far out make the grid too coarse for the others.
        let alike = |value: f32, _| if value > 4.0 { 1e3 * value } else { value };
        assert_eq!(check(QUERIES + 40, 128, alike), 0);
    });
}

#[test]
fn what_bytes_cannot_hold_is_left_to_the_definition() {
    InstructionSet::for_each(|_| {
        for factor in [0.0, 1e-18, 1e15] {
            assert_eq!(
                check(30, 16, |value, _| factor * value),
                0,
                "times {factor}"
            );
        }
        for other in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let change = |value: f32, column: usize| {
                if column == 3 && value > 2.0 {
                    other
                } else {
                    value
                }
            };
            assert_eq!(check(30, 16, change), 0, "{other}");
        }
        assert_eq!(check(7, MAX_DIM + 1, |value, _| value), 0);
    });
}

#[test]
fn whole_numbers_are_compared_by_the_definition() {
    let mut rng = Seed(31).rng();
    for (dim, rows) in [
        (128, 1100),
        (64, 700),
        (61, 700),
        (130, 500),
        (258, 200),
        (259, 200),
    ] {
        // Alike in pairs, as descriptors are, and many at the same distance.
        let mut draw = |rows: usize, most: u32| -> Vec<f32> {
            (0..rows * dim).map(|_| rng.below(most) as f32).collect()
        };
        for most in [2, 256] {
            let b = draw(rows, most);
            let mut a = draw(rows / 7, most);
            a.extend(b.iter().map(|&value| (value - 1.0).max(0.0)));
            let expected = defined(&a, &b, dim);
            InstructionSet::for_each(|set| {
                let found = two_nearest_floats(&a, &b, dim, &Prepared::default(), None);
                assert_eq!(found, expected, "{dim} values below {most}, {}", set.name());
            });
        }
    }
}

#[test]
fn differences_whose_squares_have_few_digits_lose_no_candidate() {
    // The nearest by the definition is not the one by sums in another order: squares are a few of the smallest numbers.
    let (dim, tiny) = (128, f32::from_bits((127 - 75) << 23));
    let mut rng = Seed(18).rng();
    let mut b: Vec<f32> = (0..420 * dim).map(|_| rng.uniform() as f32).collect();
    for row in b.chunks_exact_mut(dim) {
        for column in [0, 1, 2, 33] {
            row[column] = 0.0;
        }
    }
    let a = b[..dim].to_vec();
    for row in [1, 2] {
        b.copy_within(..dim, row * dim);
    }
    for row in [0, 1] {
        b[row * dim..][..3].copy_from_slice(&[1.5 * tiny, tiny, 1.5 * tiny]);
    }
    for (column, value) in [(0, 1.5 * tiny), (1, 1.5 * tiny), (33, tiny)] {
        b[2 * dim + column] = value;
    }
    InstructionSet::for_each(|_| {
        compare(&a, &b, dim);
    });
}
