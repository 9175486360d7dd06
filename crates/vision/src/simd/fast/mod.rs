//! The segment test of FAST on rows of pixels, and the maxima of its scores.
//!
//! 32 or 64 columns are tested side by side.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use super::InstructionSet;

/// Columns looked at together; twice as many where vectors hold them.
const LANES: usize = 32;

/// The circle of radius 3, clockwise from its top: column relative to the centre plus 3, and row.
const CIRCLE: [(usize, usize); 16] = [
    (3, 0),
    (4, 0),
    (5, 1),
    (6, 2),
    (6, 3),
    (6, 4),
    (5, 5),
    (4, 6),
    (3, 6),
    (2, 6),
    (1, 5),
    (0, 4),
    (0, 3),
    (0, 2),
    (1, 1),
    (2, 0),
];

multiversioned! {
    #![avx512]

    /// FAST scores of the middle one of seven rows of equal length. The score of a pixel is the
    /// largest `t` for which nine neighbours in a row on the circle of radius 3 all differ from it
    /// by more than `t`, in the same direction; it is written where it is at least `threshold`,
    /// and 0 elsewhere, as in the first and last three columns.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn segment_scores(rows: [&[u8]; 7], threshold: u8, scores: &mut [u8]) {
        let width = scores.len();
        assert!(rows.iter().all(|row| row.len() == width), "rows of one length");
        // All between is overwritten.
        let (last, edge) = (width.saturating_sub(3), width.min(3));
        scores[..edge].fill(0);
        scores[last..].fill(0);
        let mut x = 0;
        if InstructionSet::in_use() >= InstructionSet::Avx512 {
            while x + 2 * LANES + 6 <= width {
                let block = score_block::<{ 2 * LANES }>(rows, x, threshold);
                scores[x + 3..][..2 * LANES].copy_from_slice(&block);
                x += 2 * LANES;
            }
        }
        while x + LANES + 6 <= width {
            scores[x + 3..][..LANES].copy_from_slice(&score_block::<LANES>(rows, x, threshold));
            x += LANES;
        }
        if x + 6 < width && LANES + 6 <= width {
            // The last block again makes some of what is made.
            x = width - 6;
            scores[x + 3 - LANES..][..LANES].copy_from_slice(&score_block::<LANES>(rows, x - LANES, threshold));
        }
        while x + 6 < width {
            scores[x + 3..][..1].copy_from_slice(&score_block::<1>(rows, x, threshold));
            x += 1;
        }
    }
}

/// How a maximum compares with the largest of its neighbours.
#[derive(Clone, Copy, Debug)]
enum Bar {
    Above,
    AtLeast,
}

/// Appends to `found` the columns where `rows[1]` is larger than all eight neighbours.
///
/// # Panics
/// If the lengths differ.
pub fn strict_maxima(rows: [&[u8]; 3], found: &mut Vec<usize>) {
    maxima(rows, 1, Bar::Above, found);
}

/// Appends to `found` the columns where `rows[1]` is at least `least`, and at least as large as
/// all eight neighbours.
///
/// # Panics
/// If the lengths differ, or `least` is 0.
pub fn weak_maxima(rows: [&[u8]; 3], least: u8, found: &mut Vec<usize>) {
    assert!(least > 0, "0 is no score");
    maxima(rows, least, Bar::AtLeast, found);
}

/// Appends to `found` the columns where a pixel is at least `least` and compares with the largest of its neighbours
/// as wanted.
fn maxima(rows: [&[u8]; 3], least: u8, bar: Bar, found: &mut Vec<usize>) {
    #[cfg(target_arch = "x86_64")]
    {
        let set = InstructionSet::in_use();
        if set >= InstructionSet::Avx512 {
            // SAFETY: what is in use was detected on this processor.
            return unsafe { avx512::maxima(rows, least, bar, found) };
        }
        if set >= InstructionSet::Avx2 && rows[1].len() >= avx2::COLUMNS + 2 {
            // SAFETY: as before.
            return unsafe { avx2::maxima(rows, least, bar, found) };
        }
    }
    maxima_of_blocks(rows, least, bar, found);
}

/// The definition of [`maxima`].
fn maxima_of_blocks(rows: [&[u8]; 3], least: u8, bar: Bar, found: &mut Vec<usize>) {
    let width = rows[1].len();
    assert!(
        rows.iter().all(|row| row.len() == width),
        "rows of one length"
    );
    let mut x = 1;
    while x + LANES < width {
        push_columns(maxima_block::<LANES>(rows, x, least, bar), x, found);
        x += LANES;
    }
    while x + 1 < width {
        push_columns(maxima_block::<1>(rows, x, least, bar), x, found);
        x += 1;
    }
}

/// Appends to `found` the columns from `x` on whose bits are set.
#[inline(always)]
fn push_columns(mut bits: u64, x: usize, found: &mut Vec<usize>) {
    while bits != 0 {
        found.push(x + bits.trailing_zeros() as usize);
        bits &= bits - 1;
    }
}

/// An array of results, call by call: a loop is not always unrolled, and these results belong into
/// registers.
macro_rules! unrolled {
    ($call:expr; $($i:literal)*) => { [$($call($i)),*] };
}

/// Scores of the pixels `x + 3 .. x + 3 + L`.
///
/// The least difference from the centre over an arc is that of the arc's least point, so arcs are
/// searched for their points alone and the centre is subtracted once.
#[inline(always)]
fn score_block<const L: usize>(rows: [&[u8]; 7], x: usize, threshold: u8) -> [u8; L] {
    let centre = lanes::<L>(rows[3], x + 3);
    let point = |k: usize| lanes::<L>(rows[CIRCLE[k].1], x + CIRCLE[k].0);
    let score = |bright: &[u8; L], dark: &[u8; L]| {
        let brighter = zip(bright, centre, u8::saturating_sub);
        zip(&brighter, &zip(centre, dark, u8::saturating_sub), u8::max)
    };

    // Nine of sixteen in a row contain two neighbours among the four that lie on the axes.
    let axes = unrolled!(point; 0 8 4 12);
    let most = score(
        &axes_reach(&axes, u8::min, u8::max),
        &axes_reach(&axes, u8::max, u8::min),
    );
    if zip(&most, &[threshold; L], u8::saturating_sub) == [0; L] {
        return [0; L];
    }
    let points = unrolled!(point; 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);
    let most = score(
        &best_arc(&points, u8::min, u8::max),
        &best_arc(&points, u8::max, u8::min),
    );
    zip(&most, &[threshold; L], |most, threshold| {
        if most > threshold { most - 1 } else { 0 }
    })
}

/// The best value that two neighbours among four points on the axes both reach.
#[inline(always)]
fn axes_reach<const L: usize>(
    axes: &[&[u8; L]; 4],
    worse: impl Fn(u8, u8) -> u8,
    better: impl Fn(u8, u8) -> u8 + Copy,
) -> [u8; L] {
    let vertical = zip(axes[0], axes[1], better);
    let horizontal = zip(axes[2], axes[3], better);
    zip(&vertical, &horizontal, worse)
}

/// The best value that nine points in a row all reach. The arcs that start at an even point and
/// at the next one share eight points, so the worst of these is taken once.
#[inline(always)]
fn best_arc<const L: usize>(
    points: &[&[u8; L]; 16],
    worse: impl Fn(u8, u8) -> u8 + Copy,
    better: impl Fn(u8, u8) -> u8 + Copy,
) -> [u8; L] {
    let two = |i: usize| zip(points[2 * i + 1], points[(2 * i + 2) % 16], worse);
    let two = unrolled!(two; 0 1 2 3 4 5 6 7);
    let four = |i: usize| zip(&two[i], &two[(i + 1) % 8], worse);
    let four = unrolled!(four; 0 1 2 3 4 5 6 7);
    let mut best = [0; L];
    for i in 0..8 {
        let eight = zip(&four[i], &four[(i + 2) % 8], worse);
        let either_end = zip(points[2 * i], points[(2 * i + 9) % 16], better);
        let arc = zip(&eight, &either_end, worse);
        best = if i == 0 {
            arc
        } else {
            zip(&best, &arc, better)
        };
    }
    best
}

/// A bit for each pixel of `x .. x + L` that is at least `least` and compares with the largest of its neighbours as
/// wanted.
#[inline(always)]
fn maxima_block<const L: usize>(rows: [&[u8]; 3], x: usize, least: u8, bar: Bar) -> u64 {
    let here = lanes::<L>(rows[1], x);
    // Most of a picture is without corners.
    if zip(here, &[least - 1; L], u8::saturating_sub) == [0; L] {
        return 0;
    }
    let mut most = zip::<L>(lanes(rows[1], x - 1), lanes(rows[1], x + 1), u8::max);
    for row in [rows[0], rows[2]] {
        for x in [x - 1, x, x + 1] {
            most = zip(&most, lanes(row, x), u8::max);
        }
    }
    let mut bits = 0;
    for i in 0..L {
        let is_maximum = match bar {
            Bar::Above => here[i] > most[i],
            Bar::AtLeast => here[i] >= most[i],
        };
        bits |= u64::from(is_maximum && here[i] >= least) << i;
    }
    bits
}

#[inline(always)]
fn lanes<const L: usize>(row: &[u8], x: usize) -> &[u8; L] {
    row[x..]
        .first_chunk::<L>()
        .expect("blocks lie inside the rows")
}

/// `f` lane by lane. A loop, since the closures of the library's array functions are compiled
/// without the wider instruction sets.
#[inline(always)]
fn zip<const L: usize>(a: &[u8; L], b: &[u8; L], f: impl Fn(u8, u8) -> u8) -> [u8; L] {
    let mut out = [0; L];
    for i in 0..L {
        out[i] = f(a[i], b[i]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    /// The definition, word by word.
    fn score(rows: &[Vec<u8>], x: usize, threshold: u8) -> u8 {
        let centre = i32::from(rows[3][x]);
        let differences: Vec<i32> = CIRCLE
            .iter()
            .map(|&(dx, y)| i32::from(rows[y][x + dx - 3]) - centre)
            .collect();
        let passes = |t: i32| {
            [1, -1].iter().any(|sign| {
                (0..16).any(|start| (start..start + 9).all(|k| sign * differences[k % 16] > t))
            })
        };
        let best = (0..256).take_while(|&t| passes(t)).last();
        best.filter(|&best| best >= i32::from(threshold))
            .map_or(0, |best| best as u8)
    }

    #[test]
    fn scores_follow_the_definition() {
        for (width, seed, levels) in [
            (6, 1, 256),
            (7, 2, 256),
            (38, 3, 2),
            (77, 4, 256),
            (200, 5, 3),
        ] {
            let mut rng = Seed(seed).rng();
            let rows: Vec<Vec<u8>> = (0..7)
                .map(|_| {
                    (0..width)
                        .map(|_| (rng.below(levels) * 255 / (levels - 1)) as u8)
                        .collect()
                })
                .collect();
            for threshold in [0, 20, 100, 255] {
                let mut scores = vec![9; width];
                let slices = std::array::from_fn(|y| &rows[y][..]);
                segment_scores(slices, threshold, &mut scores);
                for (x, &found) in scores.iter().enumerate() {
                    let inside = x >= 3 && x + 3 < width;
                    let expected = if inside {
                        score(&rows, x, threshold)
                    } else {
                        0
                    };
                    assert_eq!(
                        found, expected,
                        "column {x} of {width}, threshold {threshold}"
                    );
                }
            }
        }
    }

    #[test]
    fn maxima_are_the_same_in_all_sets() {
        let mut rng = Seed(7).rng();
        for width in (0..140).chain([200, 333]) {
            for levels in [2, 5, 256] {
                let rows: Vec<Vec<u8>> = (0..3)
                    .map(|_| (0..width).map(|_| rng.below(levels) as u8).collect())
                    .collect();
                let rows = std::array::from_fn(|y| &rows[y][..]);
                for (least, bar) in [(1, Bar::Above), (1, Bar::AtLeast), (4, Bar::AtLeast)] {
                    let expected: Vec<usize> = (1..width.max(1) - 1)
                        .filter(|&x| {
                            let here = rows[1][x];
                            let most = (0..9).filter(|&i| i != 4);
                            let most = most.map(|i| rows[i / 3][x + i % 3 - 1]).max();
                            let most = most.expect("eight neighbours");
                            let reached = match bar {
                                Bar::Above => here > most,
                                Bar::AtLeast => here >= most,
                            };
                            here >= least && reached
                        })
                        .collect();
                    InstructionSet::for_each(|set| {
                        let mut found = Vec::new();
                        maxima(rows, least, bar, &mut found);
                        assert_eq!(found, expected, "{set:?}, {width} columns, {bar:?}");
                    });
                }
            }
        }
    }

    #[test]
    fn equal_neighbours_are_weak_maxima_only() {
        let mut row = vec![0; 80];
        for (x, value) in [(1, 5), (10, 7), (11, 7), (33, 9), (40, 3), (78, 2), (79, 1)] {
            row[x] = value;
        }
        // The last block has this column again.
        row[60] = 8;
        let mut above = vec![0; 80];
        above[41] = 4;
        let mut found = Vec::new();
        strict_maxima([&above, &row, &[0; 80]], &mut found);
        assert_eq!(found, [1, 33, 60, 78]);
        found.clear();
        weak_maxima([&above, &row, &[0; 80]], 5, &mut found);
        assert_eq!(found, [1, 10, 11, 33, 60]);
    }
}
