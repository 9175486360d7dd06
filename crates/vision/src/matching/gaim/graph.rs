//! Which nodes are neighbours: each and those nearest to it.

use nalgebra::Vector2;

/// For each place, the indices of its `count` nearest places and of the places for which it is one of the
/// nearest, in ascending order. Of equally near places, those with lower indices are taken.
pub(super) fn neighbours(places: &[Vector2<f64>], count: usize) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); places.len()];
    let mut others: Vec<(f64, u32)> = Vec::with_capacity(places.len());
    for (p, place) in places.iter().enumerate() {
        others.clear();
        others.extend(
            (places.iter().zip(0..))
                .filter(|&(_, q)| q != p as u32)
                .map(|(other, q)| ((other - place).norm_squared(), q)),
        );
        let order = |i: &(f64, u32), j: &(f64, u32)| i.0.total_cmp(&j.0).then(i.1.cmp(&j.1));
        if count < others.len() {
            others.select_nth_unstable_by(count, order);
            others.truncate(count);
        }
        for &(_, q) in &others {
            neighbours[p].push(q);
            neighbours[q as usize].push(p as u32);
        }
    }
    for own in &mut neighbours {
        own.sort_unstable();
        own.dedup();
    }
    neighbours
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_the_nearest_and_mutual() {
        let places: Vec<_> = [0.0, 1.0, 2.5, 9.0].map(|x| Vector2::new(x, 0.0)).to_vec();
        assert_eq!(
            neighbours(&places, 1),
            [vec![1], vec![0, 2], vec![1, 3], vec![2]]
        );
        assert_eq!(neighbours(&places, 9)[0], [1, 2, 3]);
        assert_eq!(neighbours(&places[..1], 35), [Vec::<u32>::new()]);
        assert!(neighbours(&[], 35).is_empty());
    }
}
