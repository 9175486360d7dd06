//! Proposals: other choices of candidates, which `fusion` mixes into the present one.
//!
//! Alpha expansion, the usual move, proposes one label to all nodes. Here each node has some 50 candidates,
//! different from those of the others, so nearly all of such moves help nobody. Proposals whose candidates
//! agree with each other do help:
//!
//! 1. *Support* of a candidate: for each neighbour of its node, how near some candidate of that
//!    comes to where the frame predicts it. The first choice is the best by support and descriptor.
//! 2. *Spread*: the affine frame of one node's candidate is taken to hold around it, and
//!    proposes to each node there its candidate nearest to the predicted place.
//! 3. *Rank*: every node's k-th candidate, for each k.

use super::energy::{Columns, Label, Problem, UNIT};
use super::fusion::Fusion;
use crate::simd::{add_prediction_errors, nearest_place};

/// Largest number of nodes to which a frame is spread.
const REACHED: usize = 150;

/// Number of candidates of each node, best supported first, whose frames are spread.
const SPREAD: usize = 3;

/// A choice of one candidate for each node, of low cost.
pub(super) fn solve(problem: &Problem, rounds: usize) -> Vec<usize> {
    let columns = Columns::new(&problem.labels);
    let support = supports(problem, &columns);
    let by_support: Vec<Vec<usize>> = (support.iter())
        .map(|costs| {
            let mut order: Vec<usize> = (0..costs.len()).collect();
            order.sort_by_key(|&i| (costs[i], i));
            order
        })
        .collect();
    let first = by_support.iter().map(|order| order[0]).collect();
    let mut fusion = Fusion::new(problem, first);
    let mut seeds: Vec<usize> = (0..problem.nodes.len()).collect();
    seeds.sort_by_key(|&p| (support[p][by_support[p][0]], p));
    // For each node, its candidates that were spread without success, and when.
    let mut in_vain = vec![Vec::new(); problem.nodes.len()];
    for round in 0..rounds {
        let mut any = false;
        for &p in &seeds {
            let spread_best = if round == 0 { SPREAD } else { 0 };
            let best = by_support[p].iter().copied().take(spread_best);
            let around = around(problem, p);
            for label in std::iter::once(fusion.choice[p]).chain(best) {
                let proposal = spread(problem, &columns, &around, (p, label));
                // If nothing has changed since, it would fail again.
                let is_vain = |&(other, time)| other == label && fusion.is_as_at(time, &proposal);
                if in_vain[p].iter().any(is_vain) {
                    continue;
                }
                if fusion.fuse(&proposal) {
                    any = true;
                } else {
                    in_vain[p].push((label, fusion.time()));
                }
            }
        }
        let most = problem.labels.iter().map(Vec::len).max().unwrap_or(0);
        for rank in 0..most {
            let proposal: Vec<(usize, usize)> = (0..problem.nodes.len())
                .filter(|&p| rank < problem.labels[p].len())
                .map(|p| (p, rank))
                .collect();
            any |= fusion.fuse(&proposal);
        }
        if !any {
            break;
        }
    }
    fusion.choice
}

/// For each candidate, its cost by descriptor and by how well its frame predicts a candidate of each neighbour.
fn supports(problem: &Problem, columns: &Columns) -> Vec<Vec<i64>> {
    let mut errors = Vec::new();
    let support = |(p, labels): (usize, &Vec<Label>)| {
        let own = columns.of(p);
        errors.clear();
        errors.resize(own[0].len(), 0.0);
        for q in problem.neighbours[p].iter().map(|&q| q as usize) {
            let apart = (problem.nodes[q] - problem.nodes[p]).into();
            let [x, y, ..] = columns.of(q);
            add_prediction_errors(own, apart, [x, y], problem.truncation, &mut errors);
        }
        let costs = labels.iter().zip(&errors);
        let costs = costs.map(|(label, error)| label.unary + (error * UNIT) as i64);
        costs.collect()
    };
    problem.labels.iter().enumerate().map(support).collect()
}

/// The proposal of a label of node `p`: candidates for the nodes `around` it and for itself.
fn spread(
    problem: &Problem,
    columns: &Columns,
    around: &[usize],
    (p, label): (usize, usize),
) -> Vec<(usize, usize)> {
    let from = problem.labels[p][label];
    let mut proposal = vec![(p, label)];
    for &q in around {
        let apart = problem.nodes[q] - problem.nodes[p];
        let [x, y, ..] = columns.of(q);
        let (nearest, squared) = nearest_place(x, y, (from.at + from.b_from_a * apart).into());
        if squared <= problem.truncation * problem.truncation * apart.norm_squared() {
            proposal.push((q, nearest));
        }
    }
    proposal
}

/// The neighbours of `p`, then the neighbours of these.
fn around(problem: &Problem, p: usize) -> Vec<usize> {
    let mut around: Vec<usize> = problem.neighbours[p].iter().map(|&q| q as usize).collect();
    let direct = around.len();
    let mut seen = vec![false; problem.nodes.len()];
    seen[p] = true;
    for &q in &around {
        seen[q] = true;
    }
    for index in 0..direct {
        for &q in &problem.neighbours[around[index]] {
            if around.len() >= REACHED {
                return around;
            }
            if !std::mem::replace(&mut seen[q as usize], true) {
                around.push(q as usize);
            }
        }
    }
    around
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use nalgebra::{Matrix2, Vector2};

    use super::super::graph::neighbours;
    use super::*;

    /// Nodes on a grid, each with a candidate at a place of its own and one that moved by an affine map like all others.
    fn grid(side: usize, count: usize) -> Problem {
        let map = Matrix2::new(0.9, 0.2, -0.1, 1.1);
        let nodes: Vec<Vector2<f64>> = (0..side * side)
            .map(|i| Vector2::new(10.0 * (i % side) as f64, 10.0 * (i / side) as f64))
            .collect();
        let label = |at, b_from_a| Label {
            at,
            b_from_a,
            unary: 0,
            index: 0,
        };
        let labels = (nodes.iter().enumerate())
            .map(|(p, node)| {
                let alone = Vector2::new(0.0, 1e4 * (1.0 + p as f64));
                vec![label(alone, map), label(map * node, map)]
            })
            .collect();
        Problem {
            neighbours: neighbours(&nodes, count),
            nodes,
            labels,
            truncation: 0.4,
            collision: 1.0,
        }
    }

    #[test]
    fn a_frame_proposes_what_it_predicts_and_nothing_that_is_far_from_there() {
        let mut problem = grid(7, 8);
        let (p, near, far) = (24, 25, 31);
        // At a distance of 10: 3.9 from the predicted place is near enough, and 4.1 is not.
        problem.labels[near][1].at.y += 3.9;
        problem.labels[far][1].at.x -= 4.1;
        let around = around(&problem, p);
        let columns = Columns::new(&problem.labels);
        let mut expected = vec![(p, 1)];
        expected.extend(around.iter().filter(|&&q| q != far).map(|&q| (q, 1)));
        assert_eq!(spread(&problem, &columns, &around, (p, 1)), expected);
        assert_eq!(spread(&problem, &columns, &around, (p, 0)), [(p, 0)]);
    }

    #[test]
    fn a_frame_reaches_the_neighbours_and_theirs_each_once() {
        for count in [3, 8, 40] {
            let problem = grid(16, count);
            let of = |p: usize| problem.neighbours[p].iter().map(|&q| q as usize);
            for p in [0, 17, 120, 255] {
                let found = around(&problem, p);
                let direct: Vec<usize> = of(p).collect();
                assert_eq!(found[..direct.len()], direct);
                let mut reached: BTreeSet<usize> = direct.iter().flat_map(|&q| of(q)).collect();
                reached.extend(&direct);
                reached.remove(&p);
                let distinct: BTreeSet<usize> = found.iter().copied().collect();
                assert!(distinct.is_subset(&reached), "{p}");
                assert_eq!(found.len(), reached.len().min(REACHED), "{p}");
                assert_eq!(distinct.len(), found.len(), "{p}");
            }
        }
    }
}
