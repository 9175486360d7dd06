//! Approximate nearest neighbours by a forest of randomised kd-trees, searched together.
//!
//! C. Silpa-Anan, R. Hartley: "Optimised KD-trees for fast image descriptor matching", CVPR 2008.
//! M. Muja, D. G. Lowe: "Fast Approximate Nearest Neighbors with Automatic Algorithm Configuration",
//! VISAPP 2009; "Scalable Nearest Neighbor Algorithms for High Dimensional Data", IEEE Transactions
//! on Pattern Analysis and Machine Intelligence 36(11), 2014 (FLANN), section 3.1.
//!
//! # How it works
//! 1. Each tree halves the descriptors of `b` again and again, down to single ones: at the mean of a
//!    dimension that is drawn at random among the five of greatest variance. So each tree cuts
//!    elsewhere, and what one has parted another holds together.
//! 2. A query descends every tree to a leaf. At each node the side not taken goes into *one* queue
//!    for all trees, ordered by the squared distance to it: the sum over the cuts in between.
//! 3. The nearest side in the queue is descended next, until `checks` different descriptors have
//!    been found. The two nearest of these are the answer.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`KdForestParams::trees`] | 4 | FLANN as in OpenCV and in the paper's evaluation |
//! | - | [`KdForestParams::checks`] | 32 | the same |
//! | N_D | `CANDIDATES` | 5 | Muja and Lowe 2014, section 3.1 |
//! | - | `SAMPLE` | 100 | the same |
//!
//! # Choices that the papers leave open
//! Mean and variance are those of a sample. Where the sample does not vary, or its mean parts
//! nothing, the descriptors are halved in the order in which they stand, so that copies cannot
//! make a tree deep. The distance to a side adds up cuts of one dimension too, as FLANN's does, and is
//! then too large: it decides the order of the search and excludes nothing, so that with at least
//! as many checks as descriptors the search is exact. Descriptors that are not finite are left out.
//!
//! The forest is drawn from a constant seed: equal descriptors have equal matches.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

use super::{Correspondence, Correspondences, Search};
use crate::features::{Descriptors, Features, FloatRows};
use crate::params::ParamError;
use crate::seed::{Rng, Seed};
use crate::simd::two_nearest_among;

/// A dimension is drawn among this many dimensions of greatest variance.
const CANDIDATES: usize = 5;
/// Most descriptors that are used for a mean and a variance.
const SAMPLE: usize = 100;
/// A bit that is set in links to descriptors, and not in links to nodes.
const LEAF: u32 = 1 << 31;

/// Parameters of [`KdForest`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct KdForestParams {
    /// Number of trees, 1 to 64.
    pub trees: usize,
    /// Number of descriptors that are compared with each query, at least 2.
    pub checks: usize,
}

impl Default for KdForestParams {
    fn default() -> Self {
        Self {
            trees: 4,
            checks: 32,
        }
    }
}

/// Approximate search for the nearest neighbours of real-valued descriptors.
#[derive(Clone, Copy, Debug)]
pub struct KdForest {
    params: KdForestParams,
}

impl KdForest {
    /// A search with these parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: KdForestParams) -> Result<Self, ParamError> {
        let KdForestParams { trees, checks } = params;
        ParamError::unless((1..=64).contains(&trees), "trees", trees, "1 to 64")?;
        ParamError::unless(checks >= 2, "checks", checks, "at least 2")?;
        Ok(Self { params })
    }

    /// For each descriptor of `a`, the nearest that was found in `b`, and the distance to the second nearest
    /// that was found, in the order of `a`. Empty if `b` is empty.
    ///
    /// # Panics
    /// If the descriptors differ in length, or if the number of finite descriptors of `b` times that of the trees is
    /// 2^31 or more.
    pub fn two_nearest(&self, a: &FloatRows, b: &FloatRows) -> Correspondences {
        assert_eq!(a.dim(), b.dim(), "descriptors of one length");
        let forest = Forest::grow(b, self.params.trees);
        let mut walk = Walk::new(&forest, b.len(), self.params.checks);
        let correspondence = |a_index: u32| {
            let query = a.row(a_index as usize);
            let chosen = walk.choose(query);
            let best = two_nearest_among(query, b.data(), chosen);
            best.nearest.is_finite().then(|| Correspondence {
                a: a_index,
                b: best.index,
                distance: best.nearest.sqrt(),
                second: best.second.sqrt(),
            })
        };
        (0..a.len() as u32).filter_map(correspondence).collect()
    }
}

impl Search for KdForest {
    /// # Panics
    /// If the descriptors are not of one kind, or binary.
    fn search(&self, a: &Features, b: &Features) -> Correspondences {
        match (&a.descriptors, &b.descriptors) {
            (Descriptors::Float(a), Descriptors::Float(b)) => self.two_nearest(a, b),
            _ => panic!("kd-trees need real-valued descriptors"),
        }
    }
}

/// A split along one dimension. Links are indices of nodes, or [`LEAF`] and the index of a row.
#[derive(Clone, Copy)]
struct Node {
    dimension: u32,
    threshold: f32,
    /// The link for values below the threshold, and the link for all others.
    sides: [u32; 2],
}

/// Rows that are still to be split: a range of their order, and the side of the node that leads to them.
struct Branch {
    range: Range<usize>,
    parent: Option<(usize, usize)>,
}

/// All trees.
struct Forest {
    nodes: Vec<Node>,
    /// One link per tree; empty if there is no descriptor.
    roots: Vec<u32>,
}

impl Forest {
    fn grow(rows: &FloatRows, trees: usize) -> Self {
        let finite = |&index: &u32| rows.row(index as usize).iter().all(|x| x.is_finite());
        let mut order: Vec<u32> = (0..rows.len() as u32).filter(finite).collect();
        assert!(
            order.len() * trees < LEAF as usize,
            "the links of a forest have 31 bits"
        );
        let mut forest = Self {
            nodes: Vec::with_capacity(order.len() * trees),
            roots: Vec::with_capacity(trees),
        };
        for tree in 0..trees {
            let mut rng = Seed(0).child("kdforest").number(tree as u64).rng();
            // The first rows of a part are its sample.
            rng.shuffle(&mut order);
            forest.grow_tree(rows, &mut order, &mut rng);
        }
        forest
    }

    /// Adds a tree of the rows in `order`, which is reordered.
    fn grow_tree(&mut self, rows: &FloatRows, order: &mut [u32], rng: &mut Rng) {
        if order.is_empty() {
            return;
        }
        self.roots.push(self.next_link(order));
        let mut variances = Variances::new(rows.dim());
        // On the heap, since the tree may be deeper than the stack of a thread.
        let mut branches = vec![Branch {
            range: 0..order.len(),
            parent: None,
        }];
        while let Some(Branch { range, parent }) = branches.pop() {
            let part = &mut order[range.clone()];
            if let Some((node, side)) = parent {
                self.nodes[node].sides[side] = self.next_link(part);
            }
            if part.len() < 2 {
                continue;
            }
            variances.measure(rows, &part[..part.len().min(SAMPLE)]);
            let (dimension, threshold) = variances.draw(rng);
            let below = |&index: &u32| rows.row(index as usize)[dimension] < threshold;
            let mut count = split(part, below);
            if count == 0 || count == part.len() {
                count = part.len() / 2;
            }
            let node = self.nodes.len();
            self.nodes.push(Node {
                dimension: dimension as u32,
                threshold,
                sides: [LEAF; 2],
            });
            let middle = range.start + count;
            for (range, side) in [(middle..range.end, 1), (range.start..middle, 0)] {
                let parent = Some((node, side));
                branches.push(Branch { range, parent });
            }
        }
    }

    /// The link to the next part: its only row, or the node that will split it.
    fn next_link(&self, part: &[u32]) -> u32 {
        match part {
            [row] => LEAF | row,
            _ => self.nodes.len() as u32,
        }
    }
}

/// Moves the rows for which `below` is true to the front; returns their number.
fn split(part: &mut [u32], below: impl Fn(&u32) -> bool) -> usize {
    let mut count = 0;
    for index in 0..part.len() {
        if below(&part[index]) {
            part.swap(count, index);
            count += 1;
        }
    }
    count
}

/// Variances of each dimension in a sample.
struct Variances {
    means: Vec<f32>,
    /// Sums of squared deviations, which are the variances times a common factor.
    squares: Vec<f32>,
}

impl Variances {
    fn new(dim: usize) -> Self {
        Self {
            means: vec![0.0; dim],
            squares: vec![0.0; dim],
        }
    }

    fn measure(&mut self, rows: &FloatRows, sample: &[u32]) {
        self.means.fill(0.0);
        for &index in sample {
            for (mean, x) in self.means.iter_mut().zip(rows.row(index as usize)) {
                *mean += x;
            }
        }
        let count = sample.len() as f32;
        self.means.iter_mut().for_each(|mean| *mean /= count);
        self.squares.fill(0.0);
        for &index in sample {
            let row = rows.row(index as usize);
            for ((square, x), mean) in self.squares.iter_mut().zip(row).zip(&self.means) {
                *square += (x - mean) * (x - mean);
            }
        }
    }

    /// One of the dimensions of greatest variance, and its mean. If nothing varies (or sums overflow), it is
    /// any dimension, and the mean separates nothing.
    fn draw(&self, rng: &mut Rng) -> (usize, f32) {
        let mut best = [(0.0, 0); CANDIDATES];
        let mut found = 0;
        for (dimension, &square) in self.squares.iter().enumerate() {
            if square > best[CANDIDATES - 1].0 {
                let place = best.partition_point(|&(other, _)| other >= square);
                best[place..].rotate_right(1);
                best[place] = (square, dimension);
                found = CANDIDATES.min(found + 1);
            }
        }
        let (_, dimension) = best[rng.below(found.max(1) as u32) as usize];
        (dimension, self.means[dimension])
    }
}

/// The state of the search, used for one query after the other.
struct Walk<'a> {
    forest: &'a Forest,
    checks: usize,
    /// Sides that were not taken: the bits of their distance, and their link. Distances are not negative, so
    /// their bits are ordered in the same way.
    queue: BinaryHeap<Reverse<(u32, u32)>>,
    /// For each row, the last query that found it, counted from 1.
    found_by: Vec<u32>,
    query: u32,
    chosen: Vec<u32>,
}

impl<'a> Walk<'a> {
    fn new(forest: &'a Forest, rows: usize, checks: usize) -> Self {
        Self {
            forest,
            checks,
            queue: BinaryHeap::new(),
            found_by: vec![0; rows],
            query: 0,
            chosen: Vec::new(),
        }
    }

    /// The rows that are compared with the next `query`, in ascending order.
    fn choose(&mut self, query: &[f32]) -> &[u32] {
        self.queue.clear();
        self.chosen.clear();
        self.query += 1;
        if query.iter().all(|x| x.is_finite()) {
            for &root in &self.forest.roots {
                self.descend(query, root, 0.0);
            }
            while self.chosen.len() < self.checks
                && let Some(Reverse((distance, link))) = self.queue.pop()
            {
                self.descend(query, link, f32::from_bits(distance));
            }
        }
        self.chosen.sort_unstable();
        &self.chosen
    }

    /// Goes from a link at a squared `distance` down to a row, and queues the other sides.
    fn descend(&mut self, query: &[f32], mut link: u32, distance: f32) {
        while link & LEAF == 0 {
            let node = &self.forest.nodes[link as usize];
            let offset = query[node.dimension as usize] - node.threshold;
            let [near, far] = match node.sides {
                [below, above] if offset < 0.0 => [below, above],
                [below, above] => [above, below],
            };
            // If sums overflowed, the threshold is infinite or NaN, and such a side comes last.
            let far_distance = (distance + offset * offset).min(f32::INFINITY);
            self.queue.push(Reverse((far_distance.to_bits(), far)));
            link = near;
        }
        let row = link & !LEAF;
        if self.found_by[row as usize] != self.query && self.chosen.len() < self.checks {
            self.found_by[row as usize] = self.query;
            self.chosen.push(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matching::two_nearest;

    fn search(trees: usize, checks: usize, a: &FloatRows, b: &FloatRows) -> Correspondences {
        let params = KdForestParams { trees, checks };
        KdForest::new(params).unwrap().two_nearest(a, b)
    }

    fn exact(a: &FloatRows, b: &FloatRows) -> Correspondences {
        two_nearest(
            &Descriptors::Float(a.clone()),
            &Descriptors::Float(b.clone()),
        )
    }

    /// Two sets of `count` rows about common centres, as descriptors of two images of a scene.
    fn clustered(count: usize, dim: usize) -> [FloatRows; 2] {
        let mut rng = Seed(11).rng();
        let centres: Vec<f32> = (0..count / 4 * dim)
            .map(|_| rng.normal() as f32 * 10.0)
            .collect();
        [(); 2].map(|()| {
            let mut rows = FloatRows::new(dim);
            for _ in 0..count {
                let centre = rng.below((count / 4) as u32) as usize;
                let row = centres[centre * dim..][..dim].iter();
                rows.push(
                    &row.map(|x| x + 6.0 * rng.normal() as f32)
                        .collect::<Vec<_>>(),
                );
            }
            rows
        })
    }

    fn found(approximate: &[Correspondence], exact: &[Correspondence]) -> f64 {
        assert_eq!(approximate.len(), exact.len());
        let pairs = approximate.iter().zip(exact);
        pairs.filter(|(x, y)| x.b == y.b).count() as f64 / exact.len() as f64
    }

    #[test]
    fn more_checks_and_more_trees_find_more_true_neighbours() {
        let [a, b] = clustered(2000, 32);
        let exact = exact(&a, &b);
        let share = |trees, checks| found(&search(trees, checks, &a, &b), &exact);
        let (few, usual, many, one_tree) = (share(4, 4), share(4, 32), share(4, 256), share(1, 32));
        assert!((0.6..0.85).contains(&usual), "{usual}");
        assert!(
            few < usual - 0.1 && usual < many && many > 0.97,
            "{few} {many}"
        );
        assert!(one_tree < usual, "{one_tree} {usual}");
    }

    #[test]
    fn with_as_many_checks_as_rows_the_search_is_exact() {
        for (count, dim) in [(8, 1), (40, 3), (500, 64)] {
            let [a, b] = clustered(count, dim);
            for trees in [1, 4] {
                assert_eq!(search(trees, b.len(), &a, &b), exact(&a, &b));
            }
        }
    }

    #[test]
    fn few_checks_are_not_exact_and_the_same_each_time() {
        let [a, b] = clustered(400, 16);
        let found = search(4, 8, &a, &b);
        assert_eq!(search(4, 8, &a, &b), found);
        assert_ne!(found, exact(&a, &b));
    }

    #[test]
    fn ties_go_to_the_lowest_index() {
        let b = FloatRows::from_vec(2, [1.0, 2.0].repeat(300));
        let a = FloatRows::from_vec(2, vec![1.0, 2.5]);
        let [found] = search(4, 300, &a, &b)[..] else {
            panic!("one match")
        };
        assert_eq!((found.b, found.distance, found.second), (0, 0.5, 0.5));
    }

    #[test]
    fn few_rows_and_none() {
        let none = FloatRows::new(3);
        let one = FloatRows::from_vec(3, vec![1.0, 2.0, 3.0]);
        assert_eq!(search(4, 32, &one, &none), []);
        assert_eq!(search(4, 32, &none, &one), []);
        let [found] = search(4, 32, &one, &one)[..] else {
            panic!("one match")
        };
        assert_eq!((found.distance, found.second), (0.0, f32::INFINITY));
    }

    #[test]
    fn two_hundred_thousand_copies_make_no_deep_tree() {
        let b = FloatRows::from_vec(2, [3.0, 4.0].repeat(200_000));
        let forest = Forest::grow(&b, 1);
        assert_eq!(forest.nodes.len(), 199_999);
        let a = FloatRows::from_vec(2, vec![3.0, 5.0, 0.0, 0.0]);
        let distances: Vec<f32> = search(4, 32, &a, &b).iter().map(|m| m.distance).collect();
        assert_eq!(distances, [1.0, 5.0]);
    }

    #[test]
    fn what_is_not_finite_is_never_found_and_finds_nothing() {
        let b = [f32::NAN, 0.0, 5.0, 1.0, f32::INFINITY, 2.0, 5.5, 1.0];
        let a = [5.0, 1.0, f32::NAN, 1.0, f32::INFINITY, 0.0];
        let [a, b] = [&a[..], &b[..]].map(|data| FloatRows::from_vec(2, data.to_vec()));
        assert_eq!(search(2, 8, &a, &b), exact(&a, &b));
        assert_eq!(search(2, 8, &a, &b).len(), 1);
    }

    /// Sums overflow, means are infinite or not a number; nothing is lost.
    #[test]
    fn huge_values_are_found_too() {
        let mut rng = Seed(2).rng();
        let huge = (0..200).map(|_| (rng.uniform() as f32 - 0.5) * f32::MAX);
        let b = FloatRows::from_vec(2, huge.collect());
        let matches = search(4, 100, &b, &b);
        assert_eq!(matches, exact(&b, &b));
        assert!(matches.iter().all(|m| m.a == m.b && m.distance == 0.0));
    }

    #[test]
    fn parameters_out_of_range_are_refused_by_name() {
        for (trees, checks, name) in [(0, 32, "trees"), (65, 32, "trees"), (4, 1, "checks")] {
            let refused = KdForest::new(KdForestParams { trees, checks }).unwrap_err();
            assert!(refused.0.contains(name), "{refused}");
        }
    }
}
