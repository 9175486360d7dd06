//! Distances and norms of short real vectors.

multiversioned! {
    /// Squared Euclidean distance of two vectors of equal length, summed in eight lanes that are
    /// added as a tree, then the rest one by one.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
        assert_eq!(a.len(), b.len(), "vectors of one length");
        let (a_lanes, a_rest) = a.as_chunks::<8>();
        let (b_lanes, b_rest) = b.as_chunks::<8>();
        let mut sums = [0.0_f32; 8];
        for (a, b) in a_lanes.iter().zip(b_lanes) {
            for lane in 0..8 {
                let difference = a[lane] - b[lane];
                sums[lane] = difference.mul_add(difference, sums[lane]);
            }
        }
        let halves: [f32; 4] = std::array::from_fn(|i| sums[i] + sums[i + 4]);
        let mut sum = (halves[0] + halves[2]) + (halves[1] + halves[3]);
        for (a, b) in a_rest.iter().zip(b_rest) {
            sum += (a - b) * (a - b);
        }
        sum
    }

    /// Clips values of at least 0 at `clip` times their Euclidean norm, scales the result to the
    /// norm `norm`, and rounds to integers, at most 255.
    pub fn normalize_to_bytes(values: &mut [f32; 128], clip: f32, norm: f32) {
        let limit = clip * euclidean_norm(values);
        for value in values.iter_mut() {
            *value = if *value < limit { *value } else { limit };
        }
        let scale = norm / euclidean_norm(values).max(f32::EPSILON);
        for value in values.iter_mut() {
            let rounded = (*value * scale).round_ties_even();
            *value = if rounded < 255.0 { rounded } else { 255.0 };
        }
    }
}

#[inline(always)]
fn euclidean_norm(values: &[f32; 128]) -> f32 {
    let mut sums = [0.0_f32; 8];
    for chunk in values.as_chunks::<8>().0 {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum = value.mul_add(*value, *sum);
        }
    }
    sums.iter().sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_of_integers_is_exact() {
        let a: Vec<f32> = (0..131).map(|i| ((i * 37) % 256) as f32).collect();
        let b: Vec<f32> = (0..131).map(|i| ((i * 91) % 256) as f32).collect();
        let expected: f64 = a
            .iter()
            .zip(&b)
            .map(|(&a, &b)| f64::from(a - b).powi(2))
            .sum();
        assert_eq!(f64::from(squared_distance(&a, &b)), expected);
    }

    #[test]
    fn clipped_normalised_rounded() {
        let mut values = [0.0; 128];
        (values[0], values[1], values[2]) = (100.0, 1.0, 0.0);
        normalize_to_bytes(&mut values, 0.2, 512.0);
        // 100 is clipped to 20.001; 512 / sqrt(20.001^2 + 1) = 25.567.
        assert_eq!(values[..3], [255.0, 26.0, 0.0]);
        let mut black = [0.0; 128];
        normalize_to_bytes(&mut black, 0.2, 512.0);
        assert_eq!(black, [0.0; 128]);
    }
}
