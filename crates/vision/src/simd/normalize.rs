//! Normalisation of descriptors.

multiversioned! {
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
