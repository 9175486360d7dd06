//! The cost of a choice of candidates: the distances of their descriptors, and how badly the affine frames of
//! neighbours agree.
//!
//! Costs are integers, with [`UNIT`] for 1. So sums do not depend on their order, and it is known for certain
//! whether a move lowers the cost.

use nalgebra::{Matrix2, Vector2};

use crate::simd::{CANDIDATE, CANDIDATES_AT_ONCE, PairLimits};

use super::GaimParams;
use super::graph::neighbours;
use crate::features::Features;
use crate::matching::Correspondence;

/// The integer that represents a cost of 1.
pub(super) const UNIT: f64 = 10_000.0;

/// A candidate of a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Label {
    /// Its place in the other image.
    pub(super) at: Vector2<f64>,
    /// The map of directions around the node to directions around its place.
    pub(super) b_from_a: Matrix2<f64>,
    /// Cost by descriptors.
    pub(super) unary: i64,
    /// Index of its correspondence.
    pub(super) index: usize,
}

/// Nodes, their candidates, and which nodes are neighbours.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    /// Places of the nodes.
    pub(super) nodes: Vec<Vector2<f64>>,
    /// Candidates of each node, at least one.
    pub(super) labels: Vec<Vec<Label>>,
    /// Neighbours of each node. The relation is symmetric.
    pub(super) neighbours: Vec<Vec<u32>>,
    /// Largest cost of a pair that does not collide.
    pub(super) truncation: f64,
    /// Two nodes must not come nearer to each other than this.
    pub(super) collision: f64,
}

/// Cost of a collision.
const COLLISION: i64 = 1000 * UNIT as i64;

/// Largest cost by descriptor: as much as very many collisions, and so little that sums of all nodes do not overflow.
const MAX_UNARY: f64 = 1e6 * COLLISION as f64;

impl Problem {
    /// The problem of choosing one of the `candidates` of each node, which are sorted by node. Candidates whose
    /// place or frame is not finite are left out.
    pub(super) fn new(
        a: &Features,
        b: &Features,
        candidates: &[Correspondence],
        params: &GaimParams,
        pixel: f64,
    ) -> Self {
        let (mut nodes, mut labels) = (Vec::new(), Vec::new());
        let mut first = 0;
        for of_node in candidates.chunk_by(|i, j| i.a == j.a) {
            let node: Vector2<f64> = a.keypoints[of_node[0].a as usize].at.cast().coords;
            let inverse = matrix(a.frame(of_node[0].a as usize)).try_inverse();
            let own: Vec<Label> = (of_node.iter().zip(first..))
                .filter_map(|(m, index)| {
                    let unary = params.unary_weight * f64::from(m.distance) * UNIT;
                    let label = Label {
                        at: b.keypoints[m.b as usize].at.cast().coords,
                        b_from_a: matrix(b.frame(m.b as usize)) * inverse?,
                        unary: unary.min(MAX_UNARY) as i64,
                        index,
                    };
                    let sum = node.sum() + label.at.sum() + label.b_from_a.sum();
                    sum.is_finite().then_some(label)
                })
                .collect();
            if !own.is_empty() {
                nodes.push(node);
                labels.push(own);
            }
            first += of_node.len();
        }
        Self {
            neighbours: neighbours(&nodes, params.neighbours),
            nodes,
            labels,
            truncation: params.truncation,
            collision: params.collision_px * pixel,
        }
    }

    /// The limits of the costs of pairs, for the kernels.
    pub(super) fn limits(&self) -> PairLimits {
        PairLimits {
            squared_collision: self.collision * self.collision,
            collision: COLLISION,
            truncation: self.truncation,
            unit: UNIT,
        }
    }

    /// Cost of the candidates `i` and `j` for the neighbours `p` and `q`: the distance between the place to
    /// which the frame of one maps the other and its place, in units of the distance of the nodes. This defines
    /// what the kernels compute for many pairs at once.
    #[cfg(test)]
    pub(super) fn pair(&self, (p, i): (usize, usize), (q, j): (usize, usize)) -> i64 {
        let (from, to) = (&self.labels[p][i], &self.labels[q][j]);
        let moved = to.at - from.at;
        let apart = self.nodes[q] - self.nodes[p];
        let squared = apart.norm_squared();
        if squared == 0.0 {
            return 0;
        }
        if moved.norm_squared() < self.collision * self.collision {
            return COLLISION;
        }
        let error = |label: &Label| (moved - label.b_from_a * apart).norm_squared();
        let error = (error(from).min(error(to)) / squared).sqrt();
        (error.min(self.truncation) * UNIT) as i64
    }

    /// Cost of a choice of one candidate for each node.
    #[cfg(test)]
    pub(super) fn cost(&self, choice: &[usize]) -> i64 {
        let mut cost = 0;
        for (p, &i) in choice.iter().enumerate() {
            cost += self.labels[p][i].unary;
            for q in self.neighbours[p].iter().map(|&q| q as usize) {
                if p < q {
                    cost += self.pair((p, i), (q, choice[q]));
                }
            }
        }
        cost
    }
}

impl Label {
    /// Its numbers in the form of the kernels: the place, then the frame row after row.
    pub(super) fn numbers(&self) -> [f64; CANDIDATE] {
        let frame = &self.b_from_a;
        let [xx, xy, yx, yy] = [frame.m11, frame.m12, frame.m21, frame.m22];
        [self.at.x, self.at.y, xx, xy, yx, yy]
    }
}

/// The numbers of all candidates, one array per kind of number, so that kernels can read them in order.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    /// Index where the candidates of each node begin, and the end of the last. Each node has whole blocks.
    starts: Vec<usize>,
    numbers: [Vec<f64>; CANDIDATE],
}

impl Columns {
    pub(super) fn new(labels: &[Vec<Label>]) -> Self {
        let mut columns = Self {
            starts: vec![0],
            numbers: Default::default(),
        };
        for own in labels {
            let end = columns.starts[columns.starts.len() - 1]
                + own.len().next_multiple_of(CANDIDATES_AT_ONCE);
            for label in own {
                for (column, number) in columns.numbers.iter_mut().zip(label.numbers()) {
                    column.push(number);
                }
            }
            // Filler of a block is infinitely far away.
            let filler = [f64::INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0];
            for (column, number) in columns.numbers.iter_mut().zip(filler) {
                column.resize(end, number);
            }
            columns.starts.push(end);
        }
        columns
    }

    /// The numbers of the candidates of node `p`, followed by filler.
    pub(super) fn of(&self, p: usize) -> [&[f64]; CANDIDATE] {
        let range = self.starts[p]..self.starts[p + 1];
        self.numbers.each_ref().map(|column| &column[range.clone()])
    }
}

fn matrix(frame: [f32; 4]) -> Matrix2<f64> {
    Matrix2::from_row_slice(&frame.map(f64::from))
}
