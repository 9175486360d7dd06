//! Fusion: the best mixture of a choice and a proposal, as far as it can be computed.
//!
//! V. Lempitsky, C. Rother, S. Roth, A. Blake: "Fusion Moves for Markov Random Field
//! Optimization", IEEE Transactions on Pattern Analysis and Machine Intelligence 32(8), 2010.
//!
//! For each node the fusion decides whether it keeps its candidate (0) or takes the proposed one (1).
//! [`quadratic`](super::quadratic) decides some of the nodes. The decided nodes never make the cost worse,
//! whatever the others do; the others keep what they have.
//!
//! The costs of what nodes keep, beside each neighbour, are remembered. So a proposal only computes costs in
//! which something proposed takes part.

use super::energy::Problem;
use super::quadratic::Quadratic;
use crate::simd::{CANDIDATE, Others, costs_beside, pair_costs};

/// Merges proposals into a choice.
pub(super) struct Fusion<'a> {
    problem: &'a Problem,
    /// The candidate of each node.
    pub(super) choice: Vec<usize>,
    kept: Kept,
    /// Index of each node in the current proposal.
    places: Vec<u32>,
    /// Number of changes of the choice so far, and for each node the number at the last change of it or of a
    /// neighbour.
    time: u64,
    touched: Vec<u64>,
    /// For each place, the cost of the proposed candidate of the node with the candidate that the neighbour
    /// keeps.
    beside: Vec<i64>,
    pairs: Pairs,
    cut: Quadratic,
}

/// Not in the proposal.
const ABSENT: u32 = u32::MAX;

/// For each node, its neighbours side by side and what they keep: one place per direction of each pair.
struct Kept {
    /// Index where the places of each node begin, and the end of the last.
    starts: Vec<usize>,
    neighbour: Vec<u32>,
    /// The place of the other direction.
    back: Vec<u32>,
    /// Vector from the node to the neighbour.
    apart: [Vec<f64>; 2],
    /// Position of the candidate of the neighbour, and the vector to which its frame maps `apart`.
    at: [Vec<f64>; 2],
    taken: [Vec<f64>; 2],
    /// The cost of the candidates that both keep.
    costs: Vec<i64>,
}

impl Kept {
    fn new(problem: &Problem) -> Self {
        let mut starts = vec![0];
        let mut next = 0;
        for own in &problem.neighbours {
            next += own.len();
            starts.push(next);
        }
        let neighbour: Vec<u32> = problem.neighbours.concat();
        // Neighbours are in ascending order, so nodes are visited in the order of the places of each node.
        let mut back = vec![0; neighbour.len()];
        let mut places = starts.clone();
        for (place, &q) in neighbour.iter().enumerate() {
            back[place] = places[q as usize] as u32;
            places[q as usize] += 1;
        }
        let apart = [0, 1].map(|axis| {
            let from = |p: usize| {
                let others = &neighbour[starts[p]..starts[p + 1]];
                let place = |q: usize| problem.nodes[q][axis];
                others.iter().map(move |&q| place(q as usize) - place(p))
            };
            (0..problem.nodes.len()).flat_map(from).collect()
        });
        let zeros = || vec![0.0; neighbour.len()];
        Self {
            at: [zeros(), zeros()],
            taken: [zeros(), zeros()],
            costs: vec![0; neighbour.len()],
            starts,
            neighbour,
            back,
            apart,
        }
    }

    /// Updates the candidate of `p` in the places of its neighbours.
    fn tell(&mut self, p: usize, [x, y, xx, xy, yx, yy]: [f64; CANDIDATE]) {
        for place in self.starts[p]..self.starts[p + 1] {
            let apart = [-self.apart[0][place], -self.apart[1][place]];
            let back = self.back[place] as usize;
            self.at[0][back] = x;
            self.at[1][back] = y;
            self.taken[0][back] = xx * apart[0] + xy * apart[1];
            self.taken[1][back] = yx * apart[0] + yy * apart[1];
        }
    }

    /// The neighbours of node `p` and what they keep.
    fn others(&self, p: usize) -> Others<'_> {
        let range = self.starts[p]..self.starts[p + 1];
        Others {
            apart: self.apart.each_ref().map(|column| &column[range.clone()]),
            at: self.at.each_ref().map(|column| &column[range.clone()]),
            taken: self.taken.each_ref().map(|column| &column[range.clone()]),
        }
    }
}

/// Pairs of neighbours that are both in a proposal.
#[derive(Default)]
struct Pairs {
    /// Their indices in the proposal, and the index of the second among the neighbours of the first. The first
    /// `count` entries are in use.
    places: Vec<[u32; 3]>,
    count: usize,
    from: [Vec<f64>; CANDIDATE],
    to: [Vec<f64>; CANDIDATE],
    apart: [Vec<f64>; 2],
    /// The cost if both take the proposed candidates.
    costs: Vec<i64>,
}

impl Pairs {
    /// Makes room for more pairs.
    fn room_for(&mut self, more: usize) -> &mut [[u32; 3]] {
        if self.places.len() < self.count + more {
            self.places.resize(2 * (self.count + more), [0; 3]);
        }
        &mut self.places[self.count..]
    }
}

impl<'a> Fusion<'a> {
    /// Starts from `choice`.
    pub(super) fn new(problem: &'a Problem, choice: Vec<usize>) -> Self {
        let kept = Kept::new(problem);
        let mut fusion = Self {
            places: vec![ABSENT; choice.len()],
            time: 0,
            touched: vec![0; choice.len()],
            beside: vec![0; kept.neighbour.len()],
            pairs: Pairs::default(),
            cut: Quadratic::default(),
            problem,
            choice,
            kept,
        };
        let all: Vec<usize> = (0..fusion.choice.len()).collect();
        fusion.remember(&all);
        fusion
    }

    /// Number of changes of the choice so far.
    pub(super) fn time(&self) -> u64 {
        self.time
    }

    /// Whether nothing on which `proposal` depends was changed after `time`: none of its nodes and none of
    /// their neighbours.
    pub(super) fn is_as_at(&self, time: u64, proposal: &[(usize, usize)]) -> bool {
        proposal.iter().all(|&(node, _)| self.touched[node] <= time)
    }

    /// Accepts the parts of `proposal` that reduce the cost. `proposal` is a list of distinct nodes with
    /// candidates. Returns whether anything was changed.
    pub(super) fn fuse(&mut self, proposal: &[(usize, usize)]) -> bool {
        let problem = self.problem;
        let proposal: Vec<(usize, usize)> = (proposal.iter().copied())
            .filter(|&(node, label)| self.choice[node] != label)
            .collect();
        if proposal.is_empty() {
            return false;
        }
        let numbers: Vec<[f64; CANDIDATE]> = (proposal.iter())
            .map(|&(node, label)| problem.labels[node][label].numbers())
            .collect();
        for ((place, &(p, _)), own) in (0..).zip(&proposal).zip(&numbers) {
            self.places[p] = place;
            let beside = &mut self.beside[self.kept.starts[p]..self.kept.starts[p + 1]];
            costs_beside(*own, self.kept.others(p), problem.limits(), beside);
        }
        self.cut.restart(proposal.len());
        self.pairs.count = 0;
        for (place, &(p, new)) in proposal.iter().enumerate() {
            let labels = &problem.labels[p];
            let mut gain = labels[new].unary - labels[self.choice[p]].unary;
            let range = self.kept.starts[p]..self.kept.starts[p + 1];
            let pairs = self.pairs.room_for(range.len());
            let mut count = 0;
            let costs = (self.beside[range.clone()].iter()).zip(&self.kept.costs[range.clone()]);
            let neighbours = self.kept.neighbour[range.clone()].iter().zip(range);
            // It cannot be predicted which nodes are in the proposal, so there are no branches.
            for ((&q, at), (beside, kept)) in neighbours.zip(costs) {
                let other = self.places[q as usize];
                gain += if other == ABSENT { beside - kept } else { 0 };
                pairs[count] = [place as u32, other, at as u32];
                count += usize::from(other != ABSENT && p < q as usize);
            }
            self.pairs.count += count;
            self.cut.add_unary(place, gain);
        }
        self.add_pairs(&numbers);
        let mut taken = Vec::new();
        for (&(node, label), value) in proposal.iter().zip(self.cut.minimise()) {
            self.places[node] = ABSENT;
            if *value == Some(true) {
                self.choice[node] = label;
                taken.push(node);
            }
        }
        self.remember(&taken);
        !taken.is_empty()
    }

    /// Adds the costs of neighbours that are both in the proposal.
    fn add_pairs(&mut self, numbers: &[[f64; CANDIDATE]]) {
        let Pairs {
            places,
            count,
            from,
            to,
            apart,
            costs,
        } = &mut self.pairs;
        let places = &places[..*count];
        for (columns, end) in [(&mut *from, 0), (&mut *to, 1)] {
            for (k, column) in columns.iter_mut().enumerate() {
                column.clear();
                column.extend(places.iter().map(|place| numbers[place[end] as usize][k]));
            }
        }
        for (column, all) in apart.iter_mut().zip(&self.kept.apart) {
            column.clear();
            column.extend(places.iter().map(|place| all[place[2] as usize]));
        }
        costs.resize(places.len(), 0);
        pair_costs(
            from.each_ref().map(|column| &column[..]),
            to.each_ref().map(|column| &column[..]),
            apart.each_ref().map(|column| &column[..]),
            self.problem.limits(),
            costs,
        );
        for (&[p, q, at], &both) in places.iter().zip(&*costs) {
            let at = at as usize;
            let back = self.kept.back[at] as usize;
            let costs = [
                self.kept.costs[at],
                self.beside[back],
                self.beside[at],
                both,
            ];
            self.cut.add_pair(p as usize, q as usize, costs);
        }
    }

    /// Records the changed choices of some nodes.
    fn remember(&mut self, changed: &[usize]) {
        if changed.is_empty() {
            return;
        }
        self.time += 1;
        let own = |p: usize| self.problem.labels[p][self.choice[p]].numbers();
        for &p in changed {
            self.kept.tell(p, own(p));
        }
        for &p in changed {
            let range = self.kept.starts[p]..self.kept.starts[p + 1];
            let costs = &mut self.beside[range.clone()];
            costs_beside(own(p), self.kept.others(p), self.problem.limits(), costs);
            self.touched[p] = self.time;
            for at in range {
                self.kept.costs[at] = self.beside[at];
                self.kept.costs[self.kept.back[at] as usize] = self.beside[at];
                self.touched[self.kept.neighbour[at] as usize] = self.time;
            }
        }
    }
}
