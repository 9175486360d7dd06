//! The two passes of a separable filter: weighted sums of rows (vertical), and weighted sums along a row
//! (horizontal).

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;
use super::prefetch::prefetch_at;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

/// Rows that [`weigh_rows`] makes at most, so that a row is loaded once for several sums.
pub const ROWS_AT_ONCE: usize = 8;
/// As many as sixteen registers have sums for.
const FEWER_ROWS: usize = 4;
/// The rows about a single place.
const ROWS_ABOUT: usize = 3;

/// How many rows it is best to ask for: with vectors of 64 bytes there are registers for the sums of eight rows, whose
/// inputs lie in the second-level cache and are loaded half as often. Halved vectors gain nothing. Whoever makes rows that
/// a blur reads makes as many at a time, so that neither gets ahead of the other.
pub fn rows_together() -> usize {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use_unless_halved() >= InstructionSet::Avx512 {
        return ROWS_AT_ONCE;
    }
    FEWER_ROWS
}

/// The vertical pass: `out[r][x]` is the sum over k of `taps[k] * rows[r + k][x]`, for
/// neighbouring rows.
///
/// # Panics
/// If there are not `taps.len() + out.len() - 1` rows, or if one is shorter than an output.
pub fn weigh_rows(rows: &[&[f32]], taps: &[f32], out: &mut [&mut [f32]]) {
    assert_eq!(rows.len() + 1, taps.len() + out.len(), "a row for each tap");
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx512 {
        let made = weigh_rows_avx512(rows, taps, out);
        return weigh_some_rows(&rows[made..], taps, &mut out[made..]);
    }
    weigh_some_rows(rows, taps, out);
}

/// Makes the first rows of `out`, as far as there are kernels for them, and returns their number.
#[cfg(target_arch = "x86_64")]
fn weigh_rows_avx512(rows: &[&[f32]], taps: &[f32], out: &mut [&mut [f32]]) -> usize {
    // Zen 4, which halves vectors, guesses what is read next.
    let is_halved = InstructionSet::in_use_unless_halved() < InstructionSet::Avx512;
    let mut made = 0;
    loop {
        let (rows, out) = (&rows[made..], &mut out[made..]);
        let most = out.len().min(taps.len());
        // SAFETY: what is in use was detected on this processor.
        made += unsafe {
            match (most >= ROWS_AT_ONCE, most >= FEWER_ROWS, is_halved) {
                (true, _, false) => avx512::weigh_rows::<ROWS_AT_ONCE, 2, true>(rows, taps, out),
                (_, true, false) => avx512::weigh_rows::<FEWER_ROWS, 4, true>(rows, taps, out),
                (_, true, true) => avx512::weigh_rows::<FEWER_ROWS, 4, false>(rows, taps, out),
                _ if most == ROWS_ABOUT => {
                    avx512::weigh_rows::<ROWS_ABOUT, 2, false>(rows, taps, out)
                }
                _ => return made,
            }
        };
    }
}

/// The horizontal pass with symmetric taps: `out[x]` is the sum over k of
/// `taps[k] * padded[x + k]`, from the outermost pair of taps to the middle.
///
/// # Panics
/// If the number of taps is even, or `padded` not `taps.len() - 1` longer than `out`.
pub fn weigh_symmetric(padded: &[f32], taps: &[f32], out: &mut [f32]) {
    assert!(taps.len() % 2 == 1, "one tap in the middle");
    assert_eq!(
        padded.len() + 1,
        out.len() + taps.len(),
        "padding for the taps"
    );
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx512 && taps.len() / 2 <= avx512::MAX_RADIUS {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { avx512::weigh_symmetric(padded, taps, out) };
    }
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() == InstructionSet::Avx2 {
        // SAFETY: as before.
        let made = unsafe { avx2::weigh_symmetric(padded, taps, out) };
        return weigh_with_symmetric(&padded[made..], taps, &mut out[made..]);
    }
    weigh_with_symmetric(padded, taps, out);
}

multiversioned! {
    #![avx512]

    /// The definition of [`weigh_rows`].
    fn weigh_some_rows(rows: &[&[f32]], taps: &[f32], out: &mut [&mut [f32]]) -> () {
        let mut first = 0;
        while first < out.len() {
            let (rows, out) = (&rows[first..], &mut out[first..]);
            first += match out.len().min(taps.len()) {
                FEWER_ROWS.. => rows_pass::<FEWER_ROWS>(rows, taps, out),
                ROWS_ABOUT.. => rows_pass::<ROWS_ABOUT>(rows, taps, out),
                _ => rows_pass::<1>(rows, taps, out),
            };
        }
    }

    /// The definition of [`weigh_symmetric`].
    fn weigh_with_symmetric(padded: &[f32], taps: &[f32], out: &mut [f32]) -> () {
        const LANES: usize = 64;
        let mut x = 0;
        while x + LANES <= out.len() {
            symmetric_block::<LANES>(padded, taps, out, x);
            x += LANES;
        }
        while x + 8 <= out.len() {
            symmetric_block::<8>(padded, taps, out, x);
            x += 8;
        }
        while x < out.len() {
            symmetric_block::<1>(padded, taps, out, x);
            x += 1;
        }
    }
}

/// Makes the first `R` rows of `out` and returns their number.
#[inline(always)]
fn rows_pass<const R: usize>(rows: &[&[f32]], taps: &[f32], out: &mut [&mut [f32]]) -> usize {
    const LANES: usize = 16;
    let rows = &rows[..taps.len() + R - 1];
    let out = out.first_chunk_mut::<R>().expect("rows were counted");
    let width = out[0].len();
    let mut x = 0;
    while x + LANES <= width {
        rows_block::<R, LANES>(rows, taps, out, x);
        x += LANES;
    }
    while x < width {
        rows_block::<R, 1>(rows, taps, out, x);
        x += 1;
    }
    R
}

/// Columns `x..x + L` of `R` output rows. The first and the last `R - 1` input rows meet only
/// some of the outputs. Zen 3 gains from asking for the next blocks; Zen 4 is as fast without.
#[inline(always)]
fn rows_block<const R: usize, const L: usize>(
    rows: &[&[f32]],
    taps: &[f32],
    out: &mut [&mut [f32]; R],
    x: usize,
) {
    /// Blocks that are asked for ahead.
    const AHEAD: usize = 2;
    let count = taps.len();
    let mut sums = [[0.0_f32; L]; R];
    for (j, row) in rows[..R - 1].iter().enumerate() {
        let values = lanes::<L>(row, x);
        prefetch_at(row, x + AHEAD * L);
        for (r, sum) in sums.iter_mut().enumerate() {
            if r <= j {
                add_scaled(sum, values, taps[j - r]);
            }
        }
    }
    for (row, taps) in rows[R - 1..count].iter().zip(taps.windows(R)) {
        let values = lanes::<L>(row, x);
        prefetch_at(row, x + AHEAD * L);
        for (r, sum) in sums.iter_mut().enumerate() {
            add_scaled(sum, values, taps[R - 1 - r]);
        }
    }
    for (i, row) in rows[count..].iter().enumerate() {
        let values = lanes::<L>(row, x);
        prefetch_at(row, x + AHEAD * L);
        for (r, sum) in sums.iter_mut().enumerate() {
            if r > i {
                add_scaled(sum, values, taps[count + i - r]);
            }
        }
    }
    for (out, sum) in out.iter_mut().zip(&sums) {
        out[x..x + L].copy_from_slice(sum);
    }
}

#[inline(always)]
fn symmetric_block<const L: usize>(padded: &[f32], taps: &[f32], out: &mut [f32], x: usize) {
    let radius = taps.len() / 2;
    let mut sum = [0.0_f32; L];
    for (k, &tap) in taps[..radius].iter().enumerate() {
        let left = lanes::<L>(padded, x + k);
        let right = lanes::<L>(padded, x + 2 * radius - k);
        for i in 0..L {
            sum[i] = tap.mul_add(left[i] + right[i], sum[i]);
        }
    }
    add_scaled(&mut sum, lanes::<L>(padded, x + radius), taps[radius]);
    out[x..x + L].copy_from_slice(&sum);
}

#[inline(always)]
fn lanes<const L: usize>(row: &[f32], x: usize) -> &[f32; L] {
    row[x..].first_chunk::<L>().expect("rows of one width")
}

#[inline(always)]
fn add_scaled<const L: usize>(sum: &mut [f32; L], values: &[f32; L], scale: f32) {
    for i in 0..L {
        sum[i] = values[i].mul_add(scale, sum[i]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    fn random_row(width: usize, seed: u64) -> Vec<f32> {
        let mut rng = Seed(seed).rng();
        (0..width).map(|_| rng.uniform() as f32 * 255.0).collect()
    }

    #[test]
    fn rows_at_once_are_the_same_bits_as_one_by_one() {
        for (width, count, at_once) in [
            (1, 5, 4),
            (15, 3, 8),
            (33, 4, 5),
            (70, 11, 8),
            (70, 11, 3),
            (70, 9, 7),
            (41, 11, 1),
        ] {
            let taps = random_row(count, 9);
            let rows: Vec<_> = (0..count + at_once - 1)
                .map(|y| random_row(width, y as u64))
                .collect();
            let rows: Vec<&[f32]> = rows.iter().map(Vec::as_slice).collect();
            let mut some = vec![0.0; at_once * width];
            weigh_rows(
                &rows,
                &taps,
                &mut some.chunks_mut(width).collect::<Vec<_>>(),
            );
            for (y, some) in some.chunks(width).enumerate() {
                let expected: Vec<f32> = (0..width)
                    .map(|x| {
                        (0..count).fold(0.0_f32, |sum, k| rows[y + k][x].mul_add(taps[k], sum))
                    })
                    .collect();
                assert_eq!(some, expected, "{width} columns, {count} taps, row {y}");
            }
        }
    }

    #[test]
    fn all_sets_of_instructions_give_the_same_bits() {
        for (width, radius) in [(1, 1), (15, 5), (64, 13), (80, 16), (147, 8), (203, 17)] {
            let taps = random_row(2 * radius + 1, 4);
            let padded = random_row(width + 2 * radius, 5);
            let rows: Vec<_> = (0..taps.len() + ROWS_AT_ONCE - 1)
                .map(|y| random_row(width, y as u64))
                .collect();
            let rows: Vec<&[f32]> = rows.iter().map(Vec::as_slice).collect();
            let mut all = Vec::new();
            InstructionSet::for_each(|_| {
                let mut out = vec![0.0; (1 + ROWS_AT_ONCE) * width];
                let mut parts: Vec<_> = out.chunks_mut(width).collect();
                weigh_symmetric(&padded, &taps, parts[0]);
                weigh_rows(&rows, &taps, &mut parts[1..]);
                all.push(out);
            });
            assert!(all.iter().all(|out| *out == all[0]), "{width}, {radius}");
        }
    }

    #[test]
    fn blocks_and_single_pixels_are_the_same_bits() {
        let taps = [0.1, 0.2, 0.4, 0.2, 0.1];
        let padded = random_row(61 + 4, 3);
        let mut out = vec![0.0; 61];
        weigh_symmetric(&padded, &taps, &mut out);
        for (x, &value) in out.iter().enumerate() {
            let p = &padded[x..];
            let outer = taps[0].mul_add(p[0] + p[4], 0.0);
            let inner = taps[1].mul_add(p[1] + p[3], outer);
            assert_eq!(value, p[2].mul_add(taps[2], inner));
        }
    }
}
