//! Minimum cuts by maximum flow.
//!
//! E. A. Dinic: "Algorithm for Solution of a Problem of Maximum Flow in Networks with Power
//! Estimation", Soviet Mathematics Doklady 11, 1970: as long as the sink can be reached, flow is
//! sent along shortest paths until each of them is blocked.
//!
//! The source and the sink are not stored: a node holds an excess of what comes from the source
//! over what may go to the sink.

use std::collections::VecDeque;

/// A node without a level: it cannot be reached.
const UNREACHED: u32 = u32::MAX;
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Arc {
    to: u32,
    /// The next arc that leaves the same node.
    next: u32,
    capacity: i64,
}

/// A network with capacities. Arcs come in pairs: `i ^ 1` is the reverse of arc `i`.
#[derive(Clone, Debug)]
pub(super) struct Network {
    first: Vec<u32>,
    excess: Vec<i64>,
    arcs: Vec<Arc>,
}

impl Network {
    /// `nodes` nodes and room for `pairs` pairs of arcs.
    pub(super) fn new(nodes: usize, pairs: usize) -> Self {
        Self {
            first: vec![NONE; nodes],
            excess: vec![0; nodes],
            arcs: Vec::with_capacity(2 * pairs),
        }
    }

    /// An arc from the source to `node`, or to the sink if `capacity` is negative.
    pub(super) fn add_terminal(&mut self, node: usize, capacity: i64) {
        self.excess[node] += capacity;
    }

    /// An arc of non-negative `capacity`.
    pub(super) fn add_arc(&mut self, from: usize, to: usize, capacity: i64) {
        for (from, to, capacity) in [(from, to, capacity), (to, from, 0)] {
            self.arcs.push(Arc {
                to: to as u32,
                next: self.first[from],
                capacity,
            });
            self.first[from] = self.arcs.len() as u32 - 1;
        }
    }

    /// Finds a maximum flow; says of each node whether it lies on the source's side of the
    /// smallest minimum cut.
    pub(super) fn cut(mut self) -> Vec<bool> {
        loop {
            let (levels, sink_reached) = self.levels();
            if !sink_reached {
                return levels.iter().map(|&level| level != UNREACHED).collect();
            }
            self.block(levels);
        }
    }

    /// Arcs from the source to each node, and whether the sink can be reached.
    fn levels(&self) -> (Vec<u32>, bool) {
        let mut levels = vec![UNREACHED; self.first.len()];
        let mut queue = VecDeque::new();
        for (node, level) in levels.iter_mut().enumerate() {
            if self.excess[node] > 0 {
                *level = 0;
                queue.push_back(node);
            }
        }
        let mut sink = UNREACHED;
        while let Some(node) = queue.pop_front() {
            if self.excess[node] < 0 {
                sink = sink.min(levels[node]);
            }
            // Beyond the sink no shortest path goes on; when none reaches it all must be seen.
            if levels[node] >= sink {
                continue;
            }
            let mut next = self.first[node];
            while next != NONE {
                let arc = self.arcs[next as usize];
                if arc.capacity > 0 && levels[arc.to as usize] == UNREACHED {
                    levels[arc.to as usize] = levels[node] + 1;
                    queue.push_back(arc.to as usize);
                }
                next = arc.next;
            }
        }
        (levels, sink != UNREACHED)
    }

    /// Sends flow along arcs from one level to the next until every such path is blocked.
    fn block(&mut self, mut levels: Vec<u32>) {
        let mut current = self.first.clone();
        let mut path: Vec<u32> = Vec::new();
        for source in 0..self.first.len() {
            path.clear();
            let mut node = source;
            while self.excess[source] > 0 {
                if self.excess[node] < 0 {
                    node = self.send(source, node, &mut path);
                    continue;
                }
                let next = current[node];
                if next != NONE {
                    let arc = self.arcs[next as usize];
                    if arc.capacity > 0 && levels[arc.to as usize] == levels[node] + 1 {
                        path.push(next);
                        node = arc.to as usize;
                    } else {
                        current[node] = arc.next;
                    }
                    continue;
                }
                // Nothing leads on from here.
                levels[node] = UNREACHED;
                let Some(last) = path.pop() else { break };
                node = self.arcs[last as usize ^ 1].to as usize;
            }
        }
    }

    /// Sends what `path` can carry from `source` to `sink`, a node with a deficit, and gives up
    /// the path from its first full arc on; the node where it now ends.
    fn send(&mut self, source: usize, sink: usize, path: &mut Vec<u32>) -> usize {
        let carried = (path.iter())
            .map(|&arc| self.arcs[arc as usize].capacity)
            .fold(self.excess[source].min(-self.excess[sink]), i64::min);
        self.excess[source] -= carried;
        self.excess[sink] += carried;
        for &arc in path.iter() {
            self.arcs[arc as usize].capacity -= carried;
            self.arcs[arc as usize ^ 1].capacity += carried;
        }
        let full = (path.iter()).position(|&arc| self.arcs[arc as usize].capacity == 0);
        let Some(full) = full else { return sink };
        let node = self.arcs[path[full] as usize ^ 1].to as usize;
        path.truncate(full);
        node
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn cuts_are_minimal() {
        for trial in 0..300 {
            let mut rng = Seed(9).number(trial).rng();
            let nodes = 1 + rng.below(7) as usize;
            let terminals: Vec<i64> = (0..nodes).map(|_| i64::from(rng.below(21)) - 10).collect();
            let arcs: Vec<(usize, usize, i64)> = (0..rng.below(20))
                .map(|_| {
                    let mut node = || rng.below(nodes as u32) as usize;
                    (node(), node(), i64::from(rng.below(8)))
                })
                .collect();
            let mut network = Network::new(nodes, arcs.len());
            for (node, &capacity) in terminals.iter().enumerate() {
                network.add_terminal(node, capacity);
            }
            for &(from, to, capacity) in &arcs {
                network.add_arc(from, to, capacity);
            }
            let value = |side: &dyn Fn(usize) -> bool| -> i64 {
                let terminal = |node: usize| {
                    if side(node) {
                        (-terminals[node]).max(0)
                    } else {
                        terminals[node].max(0)
                    }
                };
                let cut = arcs.iter().filter(|arc| side(arc.0) && !side(arc.1));
                (0..nodes).map(terminal).sum::<i64>() + cut.map(|arc| arc.2).sum::<i64>()
            };
            let least = (0..1_usize << nodes).map(|set| value(&|node| set >> node & 1 == 1));
            let sides = network.cut();
            assert_eq!(value(&|node| sides[node]), least.min().unwrap());
        }
    }

    #[test]
    fn no_nodes_have_no_cut() {
        assert!(Network::new(0, 0).cut().is_empty());
    }
}
