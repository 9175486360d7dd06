//! Distances between short real vectors.

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
}
