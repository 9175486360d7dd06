//! Where the proposals come from that are fused into a choice of candidates.
//!
//! Alpha expansion proposes one label to all nodes; with some 50 candidates for each node and
//! different ones, nearly all of such moves help nobody. Proposals that agree with themselves do:
//!
//! 1. *Support* of a candidate: for each neighbour of its node, how near some candidate of that
//!    comes to where the frame predicts it. The first choice is the best by support and descriptor.
//! 2. *Spread*: the affine frame of one node's candidate is taken to hold around it, and
//!    proposes to each node there its candidate nearest to the predicted place.
//! 3. *Rank*: every node's k-th candidate, for each k.

use nalgebra::Vector2;

use super::energy::{Problem, UNIT};
use super::fusion::Fusion;

/// Nodes that a spreading frame reaches at most.
const REACHED: usize = 150;

/// Candidates of each node, best supported first, whose frames are spread.
const SPREAD: usize = 3;

/// A choice of one candidate for each node, of low cost.
pub(super) fn solve(problem: &Problem, rounds: usize) -> Vec<usize> {
    let support = supports(problem);
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
    for round in 0..rounds {
        let mut any = false;
        for &p in &seeds {
            let current = fusion.choice[p];
            any |= fusion.fuse(&spread(problem, p, current));
            if round == 0 {
                for &label in by_support[p].iter().take(SPREAD) {
                    any |= fusion.fuse(&spread(problem, p, label));
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

/// For each candidate its cost by descriptor and by how well its frame predicts a candidate of
/// each neighbour.
fn supports(problem: &Problem) -> Vec<Vec<i64>> {
    (0..problem.nodes.len())
        .map(|p| {
            let support = |label: &super::energy::Label| {
                let pairs = problem.neighbours[p].iter().map(|&q| {
                    let q = q as usize;
                    let apart = problem.nodes[q] - problem.nodes[p];
                    let (_, squared) = nearest(problem, q, label.at + label.b_from_a * apart);
                    let error = (squared / apart.norm_squared().max(f64::MIN_POSITIVE)).sqrt();
                    error.min(problem.truncation)
                });
                label.unary + (pairs.sum::<f64>() * UNIT) as i64
            };
            problem.labels[p].iter().map(support).collect()
        })
        .collect()
}

/// What `label` of node `p` proposes to the nodes around `p`, itself included.
fn spread(problem: &Problem, p: usize, label: usize) -> Vec<(usize, usize)> {
    let from = problem.labels[p][label];
    let mut proposal = vec![(p, label)];
    for q in around(problem, p) {
        let apart = problem.nodes[q] - problem.nodes[p];
        let (nearest, squared) = nearest(problem, q, from.at + from.b_from_a * apart);
        if squared <= problem.truncation * problem.truncation * apart.norm_squared() {
            proposal.push((q, nearest));
        }
    }
    proposal
}

/// The neighbours of `p`, then theirs.
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

/// The candidate of node `q` nearest to `place`, and the squared distance.
fn nearest(problem: &Problem, q: usize, place: Vector2<f64>) -> (usize, f64) {
    let mut best = (0, f64::INFINITY);
    for (index, label) in problem.labels[q].iter().enumerate() {
        let squared = (label.at - place).norm_squared();
        if squared < best.1 {
            best = (index, squared);
        }
    }
    best
}
