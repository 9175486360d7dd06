//! Comparisons of small patches, for LATCH.

/// Side of the square of pixels that [`compare_patches`] reads.
pub const WINDOW: usize = 64;
/// Patches are at most this wide and high.
pub const WIDEST: usize = 7;
/// Bytes from the first pixel of a patch to the end of the eight that are read of its last row.
const SPAN: usize = (WIDEST - 1) * WINDOW + 8;

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
        reach: i32,
        origin: i32,
        indices: &mut [u32],
    ) {
        assert!(x.len() == indices.len() && y.len() == indices.len(), "an index for each place");
        let [cos, sin] = direction;
        for i in 0..indices.len() {
            let column = ((x[i] * cos - y[i] * sin) as i32).max(-reach).min(reach);
            let row = ((x[i] * sin + y[i] * cos) as i32).max(-reach).min(reach);
            indices[i] = (row * WINDOW as i32 + column + origin) as u32;
        }
    }

    /// One bit for each triplet of patches in `window`, given by their first pixels: whether the
    /// sum of squared differences of the first two is less than that of the first and third. The
    /// patches are `width` pixels wide and high. Bits are added from the lowest of each word on.
    ///
    /// # Panics
    /// If there are not 64 triplets for each word, `width` is above [`WIDEST`], or a patch lies
    /// outside the window.
    pub fn compare_patches(
        window: &[u8; WINDOW * WINDOW],
        triplets: &[[u32; 3]],
        width: usize,
        words: &mut [u64],
    ) {
        assert!(triplets.len() == 64 * words.len() && width <= WIDEST, "patches for each bit");
        let mask: [i32; 8] = std::array::from_fn(|i| if i < width { -1 } else { 0 });
        for (word, triplets) in words.iter_mut().zip(triplets.as_chunks::<64>().0) {
            let mut bits = 0;
            for (i, triplet) in triplets.iter().enumerate() {
                let [anchor, first, second] = triplet.map(|index| {
                    window[index as usize..].first_chunk::<SPAN>().expect("a patch in the window")
                });
                let mut sums = [0_i32; 8];
                for row in 0..width {
                    let at = row * WINDOW;
                    for k in 0..8 {
                        let a = i32::from(anchor[at + k]);
                        let (b, c) = (i32::from(first[at + k]), i32::from(second[at + k]));
                        // (a - b)^2 - (a - c)^2
                        sums[k] += ((c - b) & mask[k]) * (a - b + a - c);
                    }
                }
                let less = sums.iter().sum::<i32>() < 0;
                bits |= u64::from(less) << i;
            }
            *word = bits;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn bits_follow_the_definition() {
        let mut rng = Seed(9).rng();
        let window = std::array::from_fn(|_| rng.below(256) as u8);
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
        turn_places(&x, &y, [0.6, 0.8], 24, origin, &mut indices);
        // (6, 8); (-4.8, 33.6); (-17.52, -16.86)
        let places: [[i32; 2]; 3] = [[6, 8], [-4, 24], [-17, -16]];
        assert_eq!(
            indices,
            places.map(|[x, y]| (64 * (y + 32) + x + 32) as u32)
        );
    }
}
