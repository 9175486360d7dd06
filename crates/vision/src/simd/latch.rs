//! Comparisons of small patches, for LATCH.

/// Side of the square of pixels that [`compare_patches`] reads.
pub const WINDOW: usize = 64;
/// Patches are at most this wide and high.
pub const WIDEST: usize = 7;
/// Pixels of a row that are read at once.
const LANES: usize = 8;
/// Pixels from the first of a patch to the last that is read for it.
const SPAN: usize = (WIDEST - 1) * WINDOW + LANES;
/// Adding this leaves the integer in the mantissa, quicker than a cast, which looks for NaN.
const INTEGER: f32 = (1 << 23) as f32;

multiversioned! {
    /// Turns places to a direction (cosine and sine), cuts their coordinates off to whole pixels, no
    /// further than `reach` from 0, and gives their index in a window whose pixel `origin` is the
    /// place (0, 0).
    ///
    /// # Panics
    /// If `x`, `y` and `indices` differ in length.
    pub fn turn_places(
        x: &[f32],
        y: &[f32],
        direction: [f32; 2],
        reach: u8,
        origin: u16,
        indices: &mut [u32],
    ) {
        assert!(x.len() == indices.len() && y.len() == indices.len(), "an index for each place");
        let [cos, sin] = direction;
        let (reach, origin) = (f32::from(reach), f32::from(origin) + INTEGER);
        for i in 0..indices.len() {
            let column = (x[i] * cos - y[i] * sin).trunc().clamp(-reach, reach);
            let row = (x[i] * sin + y[i] * cos).trunc().clamp(-reach, reach);
            indices[i] = (row * WINDOW as f32 + column + origin).to_bits() & 0x7f_ffff;
        }
    }

    /// One bit for each triplet of patches in `window`, given by their first pixels: whether the sum of
    /// squared differences of the first two is less than that of the first and third. The patches are
    /// `width` pixels wide and high. Bits are added from the lowest of each word on.
    ///
    /// # Panics
    /// If there are not 64 triplets for each word, `width` is above [`WIDEST`], or a patch lies outside
    /// the window.
    pub fn compare_patches(
        window: &[i16; WINDOW * WINDOW],
        triplets: &[[u32; 3]],
        width: usize,
        words: &mut [u64],
    ) {
        assert!(
            triplets.len() == 64 * words.len() && width <= WIDEST,
            "patches for each bit"
        );
        for (word, triplets) in words.iter_mut().zip(triplets.as_chunks::<64>().0) {
            *word = 0;
            for (i, triplet) in triplets.iter().enumerate() {
                let patches = triplet.map(|start| {
                    let patch = window[start as usize..].first_chunk::<SPAN>();
                    patch.expect("a patch in the window")
                });
                // SAFETY: every x86-64 processor has SSE2.
                #[cfg(target_arch = "x86_64")]
                let difference = unsafe { sse2::difference(patches, width) };
                #[cfg(not(target_arch = "x86_64"))]
                let difference = difference_scalar(patches, width);
                *word |= u64::from(difference < 0) << i;
            }
        }
    }
}

/// The definition: the sum of `(a - b)^2 - (a - c)^2 = (c - b)(2 a - b - c)` over three patches.
#[cfg(any(test, not(target_arch = "x86_64")))]
fn difference_scalar(patches: [&[i16; SPAN]; 3], width: usize) -> i32 {
    let mut sum = 0;
    for row in 0..width {
        for at in row * WINDOW..row * WINDOW + width {
            let [a, b, c] = patches.map(|patch| i32::from(patch[at]));
            sum += (c - b) * (2 * a - b - c);
        }
    }
    sum
}

/// *Benefit*: one instruction multiplies and adds the pixels of a row; 4 times the speed of the
/// portable code, in which the compiler does not see it.
#[cfg(target_arch = "x86_64")]
mod sse2 {
    use std::arch::x86_64::{
        __m128i, _mm_add_epi16, _mm_add_epi32, _mm_and_si128, _mm_cvtsi128_si32, _mm_madd_epi16,
        _mm_setzero_si128, _mm_shuffle_epi32, _mm_sub_epi16,
    };
    use std::mem::transmute;

    use super::{LANES, SPAN, WINDOW};

    #[inline]
    #[target_feature(enable = "sse2")]
    pub(super) fn difference(patches: [&[i16; SPAN]; 3], width: usize) -> i32 {
        let vector = |lanes: [i16; LANES]| {
            // SAFETY: sixteen bytes either way, and every pattern of bits is valid.
            unsafe { transmute::<[i16; LANES], __m128i>(lanes) }
        };
        let inside = vector(std::array::from_fn(|i| if i < width { -1 } else { 0 }));
        let mut sums = _mm_setzero_si128();
        for row in 0..width {
            let [a, b, c] = patches.map(|patch| {
                let pixels = patch[row * WINDOW..].first_chunk();
                vector(*pixels.expect("the span has all rows"))
            });
            let along = _mm_and_si128(_mm_sub_epi16(c, b), inside);
            let across = _mm_sub_epi16(_mm_add_epi16(a, a), _mm_add_epi16(b, c));
            sums = _mm_add_epi32(sums, _mm_madd_epi16(along, across));
        }
        let halves = _mm_add_epi32(sums, _mm_shuffle_epi32::<0b_11_10>(sums));
        _mm_cvtsi128_si32(_mm_add_epi32(halves, _mm_shuffle_epi32::<0b_01>(halves)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn bits_follow_the_definition() {
        let mut rng = Seed(9).rng();
        let window = std::array::from_fn(|_| rng.below(256) as i16);
        for width in [1, 3, 7] {
            let triplets: Vec<[u32; 3]> = (0..128)
                .map(|_| std::array::from_fn(|_| rng.below(57) * 64 + rng.below(57)))
                .collect();
            let mut words = [0; 2];
            compare_patches(&window, &triplets, width, &mut words);
            let mut set = 0;
            for (i, triplet) in triplets.iter().enumerate() {
                let distance = |other: u32| {
                    let mut sum = 0;
                    for row in 0..width {
                        for column in 0..width {
                            let pixel = |first: u32| {
                                i32::from(window[first as usize + row * WINDOW + column])
                            };
                            sum += (pixel(triplet[0]) - pixel(other)).pow(2);
                        }
                    }
                    sum
                };
                let expected = distance(triplet[1]) < distance(triplet[2]);
                assert_eq!(words[i / 64] >> (i % 64) & 1 == 1, expected, "{i}");
                set += u32::from(expected);
            }
            assert!((32..96).contains(&set), "{set}");
        }
    }

    #[test]
    fn places_are_turned_clockwise_and_cut_off() {
        let (x, y) = ([10.0, 24.0, -24.0], [0.0, 24.0, 3.9]);
        let mut indices = [0; 3];
        let origin = 32 * 64 + 32;
        turn_places(&x, &y, [0.6, 0.8], 24, origin as u16, &mut indices);
        // (6, 8); (-4.8, 33.6); (-17.52, -16.86)
        let places: [[i32; 2]; 3] = [[6, 8], [-4, 24], [-17, -16]];
        assert_eq!(
            indices,
            places.map(|[x, y]| (64 * (y + 32) + x + 32) as u32)
        );
    }

    #[test]
    fn vectors_are_the_definition_up_to_the_largest_differences() {
        let mut rng = Seed(10).rng();
        for grey in [[0, 255, 0], [0, 0, 255], [255, 0, 255], [128, 3, 77]] {
            let noise = rng.below(3) as i16;
            let patches = grey.map(|grey: i16| {
                std::array::from_fn::<i16, SPAN, _>(|i| (grey + noise * (i % 5) as i16).min(255))
            });
            for width in 0..=WIDEST {
                let mut window = [0; WINDOW * WINDOW];
                let starts = [0, 512, 1024];
                for (patch, start) in patches.iter().zip(starts) {
                    window[start..start + SPAN].copy_from_slice(patch);
                }
                let mut word = [0];
                let triplet = starts.map(|start| start as u32);
                compare_patches(&window, &[triplet; 64], width, &mut word);
                let less = difference_scalar(patches.each_ref(), width) < 0;
                assert_eq!(word[0], if less { u64::MAX } else { 0 }, "{grey:?} {width}");
            }
        }
    }
}
