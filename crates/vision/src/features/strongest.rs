//! The strongest of many features.

/// The indices of the `limit` of `count` features whose response is strongest, ascending; of equal ones the first.
pub(crate) fn strongest(count: usize, limit: usize, response: impl Fn(usize) -> f32) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..count).collect();
    if limit < count {
        indices.sort_by(|&i, &j| response(j).total_cmp(&response(i)));
        indices.truncate(limit);
        indices.sort_unstable();
    }
    indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_keep_their_order_and_of_equal_ones_the_first_are_kept() {
        let responses = [2.0, 9.0, 5.0, 5.0, 1.0, 5.0];
        let of = |limit| strongest(responses.len(), limit, |index| responses[index]);
        assert_eq!(of(3), [1, 2, 3]);
        assert_eq!(of(1), [1]);
        assert_eq!(of(6), [0, 1, 2, 3, 4, 5]);
        assert_eq!(of(9), of(6));
        assert!(of(0).is_empty());
    }
}
