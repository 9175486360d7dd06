//! Normalisation of descriptors.

use super::truncated;

multiversioned! {
    /// Values of at least 0, clipped at `clip` times their Euclidean norm, scaled to the norm `norm` and
    /// rounded to integers, at most 255.
    pub fn normalize_to_bytes(values: &[f32; 128], clip: f32, norm: f32) -> [u8; 128] {
        let mut values = *values;
        let limit = clip * euclidean_norm(&values);
        for value in &mut values {
            *value = if *value < limit { *value } else { limit };
        }
        let scale = norm / euclidean_norm(&values).max(f32::EPSILON);
        let mut bytes = [0; 128];
        for (byte, value) in bytes.iter_mut().zip(&values) {
            let rounded = (*value * scale).round_ties_even();
            *byte = truncated(if rounded < 255.0 { rounded } else { 255.0 }) as u8;
        }
        bytes
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
        // 100 is clipped to 20.001; 512 / sqrt(20.001^2 + 1) = 25.567.
        let bytes = normalize_to_bytes(&values, 0.2, 512.0);
        assert_eq!(bytes[..3], [255, 26, 0]);
        assert_eq!(normalize_to_bytes(&[0.0; 128], 0.2, 512.0), [0; 128]);
    }
}
