//! The best mixture of a choice and a proposal, as far as it can be known.
//!
//! V. Lempitsky, C. Rother, S. Roth, A. Blake: "Fusion Moves for Markov Random Field
//! Optimization", IEEE Transactions on Pattern Analysis and Machine Intelligence 32(8), 2010.
//! V. Kolmogorov, C. Rother: "Minimizing Nonsubmodular Functions with Graph Cuts - A Review", IEEE
//! Transactions on Pattern Analysis and Machine Intelligence 29(7), 2007 (QPBO).
//!
//! Each node of a proposal may keep its candidate (0) or take the proposed one (1). Where costs of
//! neighbours are not submodular a cut gives the answer for some of the nodes only: the graph
//! holds each node and its opposite, and a node is decided if the cut parts the two. Whatever the
//! others do, the decided ones are never worse than before; the others keep what they have.

use super::energy::Problem;
use super::max_flow::Network;

/// Mixes proposals into a choice.
pub(super) struct Fusion<'a> {
    problem: &'a Problem,
    /// The candidate of each node.
    pub(super) choice: Vec<usize>,
    /// Place of each node in the proposal at work.
    places: Vec<usize>,
}

/// Not in the proposal.
const ABSENT: usize = usize::MAX;

impl<'a> Fusion<'a> {
    /// Starts from `choice`.
    pub(super) fn new(problem: &'a Problem, choice: Vec<usize>) -> Self {
        Self {
            places: vec![ABSENT; choice.len()],
            problem,
            choice,
        }
    }

    /// Takes what pays of `proposal`, pairs of distinct nodes and candidates; whether anything
    /// was taken.
    pub(super) fn fuse(&mut self, proposal: &[(usize, usize)]) -> bool {
        let proposal: Vec<(usize, usize)> = (proposal.iter().copied())
            .filter(|&(node, label)| self.choice[node] != label)
            .collect();
        for (place, &(node, _)) in proposal.iter().enumerate() {
            self.places[node] = place;
        }
        let mut cut = Quadratic::new(proposal.len());
        for (place, &(p, new)) in proposal.iter().enumerate() {
            let problem = self.problem;
            let old = self.choice[p];
            let mut gain = problem.labels[p][new].unary - problem.labels[p][old].unary;
            for q in problem.neighbours[p].iter().map(|&q| q as usize) {
                let (other, kept) = (self.places[q], self.choice[q]);
                if other == ABSENT {
                    gain += problem.pair((p, new), (q, kept)) - problem.pair((p, old), (q, kept));
                } else if p < q {
                    let taken = proposal[other].1;
                    let costs = [(old, kept), (old, taken), (new, kept), (new, taken)];
                    let costs = costs.map(|(i, j)| problem.pair((p, i), (q, j)));
                    cut.add_pair(place, other, costs);
                }
            }
            cut.add_unary(place, gain);
        }
        let mut any = false;
        for (&(node, label), taken) in proposal.iter().zip(cut.minimise()) {
            self.places[node] = ABSENT;
            if taken == Some(true) {
                self.choice[node] = label;
                any = true;
            }
        }
        any
    }
}

/// A quadratic function of variables that are 0 or 1.
pub(super) struct Quadratic {
    /// Cost of 1 over that of 0.
    unary: Vec<i64>,
    /// Arcs between nodes `2 p`, on the source's side if `p` is 0, and `2 p + 1`, its opposite.
    arcs: Vec<(usize, usize, i64)>,
}

impl Quadratic {
    pub(super) fn new(variables: usize) -> Self {
        Self {
            unary: vec![0; variables],
            arcs: Vec::new(),
        }
    }

    pub(super) fn add_unary(&mut self, p: usize, cost_of_1: i64) {
        self.unary[p] += cost_of_1;
    }

    /// Adds the costs of `(0, 0)`, `(0, 1)`, `(1, 0)` and `(1, 1)`.
    pub(super) fn add_pair(&mut self, p: usize, q: usize, [c00, c01, c10, c11]: [i64; 4]) {
        let mixed = c01 + c10 - c00 - c11;
        self.unary[q] += c11 - c10;
        if mixed >= 0 {
            // c00 + (c10 - c00) x + (c11 - c10) y + mixed (1 - x) y
            self.unary[p] += c10 - c00;
            self.arcs.push((2 * p, 2 * q, mixed));
            self.arcs.push((2 * q + 1, 2 * p + 1, mixed));
        } else {
            // The same in x and 1 - y: c01 + (c11 - c01) x + (c10 - c11) (1 - y)
            // - mixed (1 - x) (1 - y)
            self.unary[p] += c11 - c01;
            self.arcs.push((2 * p, 2 * q + 1, -mixed));
            self.arcs.push((2 * q, 2 * p + 1, -mixed));
        }
    }

    /// Values of a minimum, as far as they are known.
    pub(super) fn minimise(self) -> Vec<Option<bool>> {
        let variables = self.unary.len();
        let mut network = Network::new(2 * variables, self.arcs.len());
        for (p, &cost) in self.unary.iter().enumerate() {
            network.add_terminal(2 * p, cost);
            network.add_terminal(2 * p + 1, -cost);
        }
        for (from, to, capacity) in self.arcs {
            if capacity > 0 {
                network.add_arc(from, to, capacity);
            }
        }
        (network.cut().chunks_exact(2))
            .map(|sides| (sides[0] != sides[1]).then_some(sides[1]))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    /// Two variables and their costs together.
    type Pair = (usize, usize, [i64; 4]);

    /// A random function of few variables.
    fn random(trial: u64, submodular: bool) -> (Vec<i64>, Vec<Pair>) {
        let mut rng = Seed(11).number(trial).rng();
        let variables = 2 + rng.below(6) as usize;
        let unary = (0..variables).map(|_| i64::from(rng.below(21)) - 10);
        let unary = unary.collect();
        let mut pairs = Vec::new();
        for p in 0..variables {
            for q in p + 1..variables {
                let mut costs = [0; 4].map(|_: i64| i64::from(rng.below(9)));
                if submodular {
                    costs[3] = costs[3].min(costs[1] + costs[2] - costs[0]);
                }
                pairs.push((p, q, costs));
            }
        }
        (unary, pairs)
    }

    fn value(unary: &[i64], pairs: &[Pair], x: &[bool]) -> i64 {
        let ones = unary.iter().zip(x).filter(|(_, x)| **x).map(|(u, _)| u);
        let pairs = (pairs.iter()).map(|&(p, q, c)| c[2 * usize::from(x[p]) + usize::from(x[q])]);
        ones.sum::<i64>() + pairs.sum::<i64>()
    }

    fn minimise(unary: &[i64], pairs: &[Pair]) -> Vec<Option<bool>> {
        let mut quadratic = Quadratic::new(unary.len());
        for (p, &cost) in unary.iter().enumerate() {
            quadratic.add_unary(p, cost);
        }
        for &(p, q, costs) in pairs {
            quadratic.add_pair(p, q, costs);
        }
        quadratic.minimise()
    }

    fn assignments(variables: usize) -> impl Iterator<Item = Vec<bool>> {
        (0..1_usize << variables)
            .map(move |set| (0..variables).map(|p| set >> p & 1 == 1).collect())
    }

    #[test]
    fn decided_variables_improve_every_choice() {
        let (mut decided, mut all) = (0, 0);
        for trial in 0..300 {
            let (unary, pairs) = random(trial, false);
            let partial = minimise(&unary, &pairs);
            decided += partial.iter().flatten().count();
            all += partial.len();
            for x in assignments(unary.len()) {
                let mixed: Vec<bool> = (partial.iter().zip(&x))
                    .map(|(decided, &x)| decided.unwrap_or(x))
                    .collect();
                assert!(value(&unary, &pairs, &mixed) <= value(&unary, &pairs, &x));
            }
        }
        assert!(2 * decided > all, "{decided} of {all} are decided");
    }

    #[test]
    fn submodular_functions_are_minimised() {
        for trial in 0..300 {
            let (unary, pairs) = random(trial, true);
            // Ties may stay undecided; any value will do for them.
            let found: Vec<bool> = (minimise(&unary, &pairs).iter())
                .map(|decided| decided.unwrap_or(false))
                .collect();
            let least = assignments(unary.len()).map(|x| value(&unary, &pairs, &x));
            assert_eq!(value(&unary, &pairs, &found), least.min().unwrap());
        }
    }
}
