//! Minimum cuts by maximum flow.
//!
//! E. A. Dinic: "Algorithm for Solution of a Problem of Maximum Flow in Networks with Power
//! Estimation", Soviet Mathematics Doklady 11, 1970: as long as the sink can be reached, flow is
//! sent along shortest paths until each of them is blocked.
//!
//! The source and the sink are not stored: a node holds an excess of what comes from the source
//! over what may go to the sink. The arcs of a node lie side by side.

/// A node without a level: it cannot be reached.
const UNREACHED: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, Default)]
struct Arc {
    to: u32,
    /// Its reverse.
    back: u32,
    capacity: i64,
}

/// A network with capacities. Its buffers are used again for the next network.
#[derive(Clone, Debug, Default)]
pub(super) struct Network {
    excess: Vec<i64>,
    /// Start, end and capacity of each added arc.
    added: Vec<(u32, u32, i64)>,
    /// Where the arcs of each node begin, and the end of the last.
    starts: Vec<u32>,
    arcs: Vec<Arc>,
    levels: Vec<u32>,
    queue: Vec<u32>,
    /// The next arc to try of each node.
    current: Vec<u32>,
    path: Vec<u32>,
}

impl Network {
    /// Removes everything, and starts with `nodes` nodes without arcs.
    pub(super) fn restart(&mut self, nodes: usize) {
        self.excess.clear();
        self.excess.resize(nodes, 0);
        self.added.clear();
    }

    /// Adds an arc from the source to `node`, or from `node` to the sink if `capacity` is negative.
    pub(super) fn add_terminal(&mut self, node: usize, capacity: i64) {
        self.excess[node] += capacity;
    }

    /// Adds an arc of non-negative `capacity`.
    pub(super) fn add_arc(&mut self, from: usize, to: usize, capacity: i64) {
        self.added.push((from as u32, to as u32, capacity));
    }

    /// Finds a maximum flow. Then [`Self::is_source`] gives the minimum cut.
    pub(super) fn cut(&mut self) {
        self.place_arcs();
        while self.find_levels() {
            self.block();
        }
    }

    /// Whether `node` is on the source side of the smallest minimum cut, after [`Self::cut`].
    pub(super) fn is_source(&self, node: usize) -> bool {
        self.levels[node] != UNREACHED
    }

    /// Stores the added arcs and their reverses, grouped by node.
    fn place_arcs(&mut self) {
        let nodes = self.excess.len();
        self.starts.clear();
        self.starts.resize(nodes + 1, 0);
        for &(from, to, _) in &self.added {
            self.starts[from as usize + 1] += 1;
            self.starts[to as usize + 1] += 1;
        }
        for node in 0..nodes {
            self.starts[node + 1] += self.starts[node];
        }
        self.current.clear();
        self.current.extend_from_slice(&self.starts[..nodes]);
        self.arcs.clear();
        self.arcs.resize(2 * self.added.len(), Arc::default());
        for &(from, to, capacity) in &self.added {
            let mut next = |node: u32| {
                let place = &mut self.current[node as usize];
                *place += 1;
                *place - 1
            };
            let (there, back) = (next(from), next(to));
            self.arcs[there as usize] = Arc { to, back, capacity };
            self.arcs[back as usize] = Arc {
                to: from,
                back: there,
                capacity: 0,
            };
        }
    }

    /// Computes the number of arcs from the source to each node. Returns whether the sink can be reached.
    fn find_levels(&mut self) -> bool {
        self.levels.clear();
        self.levels.resize(self.excess.len(), UNREACHED);
        self.queue.clear();
        for (node, level) in self.levels.iter_mut().enumerate() {
            if self.excess[node] > 0 {
                *level = 0;
                self.queue.push(node as u32);
            }
        }
        let mut sink = UNREACHED;
        let mut first = 0;
        while let Some(&node) = self.queue.get(first) {
            first += 1;
            let node = node as usize;
            let level = self.levels[node];
            if self.excess[node] < 0 {
                sink = sink.min(level);
            }
            // No shortest path continues after the sink. If none reaches it, all nodes must be visited.
            if level >= sink {
                continue;
            }
            let arcs = self.starts[node] as usize..self.starts[node + 1] as usize;
            for arc in &self.arcs[arcs] {
                let to = &mut self.levels[arc.to as usize];
                if arc.capacity > 0 && *to == UNREACHED {
                    *to = level + 1;
                    self.queue.push(arc.to);
                }
            }
        }
        sink != UNREACHED
    }

    /// Sends flow along arcs from one level to the next until every such path is blocked.
    fn block(&mut self) {
        let nodes = self.excess.len();
        self.current.clear();
        self.current.extend_from_slice(&self.starts[..nodes]);
        for source in 0..nodes {
            self.path.clear();
            let mut node = source;
            while self.excess[source] > 0 {
                if self.excess[node] < 0 {
                    node = self.send(source, node);
                    continue;
                }
                let next = self.current[node];
                if next < self.starts[node + 1] {
                    let arc = self.arcs[next as usize];
                    if arc.capacity > 0 && self.levels[arc.to as usize] == self.levels[node] + 1 {
                        self.path.push(next);
                        node = arc.to as usize;
                    } else {
                        self.current[node] = next + 1;
                    }
                    continue;
                }
                // No path continues from here.
                self.levels[node] = UNREACHED;
                let Some(last) = self.path.pop() else { break };
                node = self.start_of(last);
            }
        }
    }

    /// Sends as much flow as the path can carry from `source` to `sink`, a node with a deficit. Drops the path
    /// from its first full arc on, and returns the node where it now ends.
    fn send(&mut self, source: usize, sink: usize) -> usize {
        let carried = (self.path.iter())
            .map(|&arc| self.arcs[arc as usize].capacity)
            .fold(self.excess[source].min(-self.excess[sink]), i64::min);
        self.excess[source] -= carried;
        self.excess[sink] += carried;
        for &arc in &self.path {
            let back = self.arcs[arc as usize].back;
            self.arcs[arc as usize].capacity -= carried;
            self.arcs[back as usize].capacity += carried;
        }
        let full = (self.path.iter()).position(|&arc| self.arcs[arc as usize].capacity == 0);
        let Some(full) = full else { return sink };
        let node = self.start_of(self.path[full]);
        self.path.truncate(full);
        node
    }

    /// The node that an arc leaves.
    fn start_of(&self, arc: u32) -> usize {
        self.arcs[self.arcs[arc as usize].back as usize].to as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn cuts_are_minimal() {
        let mut network = Network::default();
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
            network.restart(nodes);
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
            network.cut();
            assert_eq!(value(&|node| network.is_source(node)), least.min().unwrap());
        }
    }

    #[test]
    fn an_empty_network_does_not_panic() {
        Network::default().cut();
    }
}
