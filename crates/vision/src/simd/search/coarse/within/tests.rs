//! Both kernels beside the definition.

use super::super::{has_avx2_and_fma, is_wide};
use super::{LANES, Panel, ROWS, avx2, avx512};
use crate::seed::{Rng, Seed};
use crate::simd::InstructionSet;
use crate::simd::search::pack;

/// So many quads of bytes from `least` to `most`.
fn quads(rng: &mut Rng, count: usize, least: i32, most: i32) -> Vec<i32> {
    let mut byte = || (least + rng.below((most - least + 1) as u32) as i32) as u8;
    let quads = (0..count).map(|_| [(); 4].map(|()| byte()));
    quads.map(i32::from_le_bytes).collect()
}

/// The definition: the sum of products of bytes and a start.
fn sum(query: &[i32], candidate: &[i32], start: i32) -> i32 {
    let bytes = |quad: &i32| quad.to_le_bytes();
    let products = (query.iter().flat_map(bytes))
        .zip(candidate.iter().flat_map(bytes))
        .map(|(query, candidate)| i32::from(query) * i32::from(candidate as i8));
    products.sum::<i32>() + start
}

/// Checks blocks of queries and two panels of candidates, of rows of `width` quads, with starts up to `far` from 0.
fn check(width: usize, far: i32) {
    let mut rng = Seed(width as u64).rng();
    let (blocks, panels) = (3, 2);
    let queries = quads(&mut rng, blocks * ROWS * width, 0, 254);
    // So that sums fit 16 bits.
    let most = (32_700 / (254 * 4 * width as i32)).min(126);
    let candidates = quads(&mut rng, panels * LANES * width, -most, most);
    let starts: Vec<i32> = (0..panels * LANES)
        .map(|_| rng.below(2 * far as u32 + 1) as i32 - far)
        .collect();
    let sums: Vec<Vec<i32>> = (queries.chunks(width))
        .map(|query| {
            let candidates = candidates.chunks(width).zip(&starts);
            candidates
                .map(|(candidate, &start)| sum(query, candidate, start))
                .collect()
        })
        .collect();
    // Each query's limit is one of its sums, or far from all of them.
    let least: Vec<i32> = (sums.iter().enumerate())
        .map(|(query, sums)| match query {
            0 => i32::MIN,
            1 => i32::MAX,
            _ => sums[rng.below(sums.len() as u32) as usize],
        })
        .collect();
    let least = least.as_chunks().0;
    let mut packed: Vec<[i32; LANES]> = pack(&candidates, width);
    let mut factors = queries.clone();
    if !is_wide() {
        packed.chunks_exact_mut(width).for_each(avx2::arrange);
        factors = avx2::twice(&queries);
    }
    let starts = starts.as_chunks().0;
    for panel in 0..panels {
        let (quads, starts) = (&packed[panel * width..][..width], &starts[panel]);
        let mut found = vec![[0; ROWS]; blocks];
        // SAFETY: what is in use was detected on this processor.
        unsafe {
            if is_wide() {
                avx512::within(&factors, least, quads, starts, &mut found);
            } else {
                avx2::within(&factors, least, quads, starts, &mut found);
            }
        }
        let (found, least) = (found.as_flattened(), least.as_flattened());
        for (query, (&found, &least)) in found.iter().zip(least).enumerate() {
            for (lane, &sum) in sums[query][panel * LANES..][..LANES].iter().enumerate() {
                let is_within = found >> lane & 1 == 1;
                let limits = [sum, least].map(|value| value.clamp(-32_768, 32_767));
                let told = if is_wide() {
                    sum >= least
                } else {
                    limits[0] >= limits[1]
                };
                assert_eq!(
                    is_within, told,
                    "query {query}, lane {lane} of {width} quads"
                );
                assert!(is_within || sum < least, "query {query}, lane {lane}");
            }
        }
    }
    // With the second largest sum as the limit two are within, or more that are equal.
    let all: Vec<Panel> = packed.chunks_exact(width).zip(starts).collect();
    let mut found = vec![vec![[0; ROWS]; blocks]; panels];
    let seconds: Vec<i32> = (sums.iter())
        .map(|sums| {
            let mut sums = sums.clone();
            sums.sort_unstable();
            sums[sums.len() - 2]
        })
        .collect();
    let least = |query: usize, second: i32| {
        assert_eq!(second, seconds[query], "query {query} of {width} quads");
        second
    };
    // SAFETY: as before.
    unsafe {
        if is_wide() {
            avx512::within_first(&factors, &all, least, &mut found);
        } else {
            avx2::within_first(&factors, &all, least, &mut found);
        }
    }
    for (query, sums) in sums.iter().enumerate() {
        for (candidate, &sum) in sums.iter().enumerate() {
            let found = found[candidate / LANES].as_flattened()[query];
            let is_within = found >> (candidate % LANES) & 1 == 1;
            assert_eq!(
                is_within,
                sum >= seconds[query],
                "query {query}, {candidate}"
            );
        }
    }
}

#[test]
fn candidates_are_within_by_the_sums_of_their_products() {
    InstructionSet::for_each(|_| {
        if has_avx2_and_fma() {
            for width in [1, 7, 8, 32, 50] {
                for far in [0, 9_000, 40_000, 65_000] {
                    check(width, far);
                }
            }
        }
    });
}
