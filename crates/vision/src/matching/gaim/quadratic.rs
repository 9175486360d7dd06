//! Quadratic functions of variables that are 0 or 1, minimised as far as it can be computed.
//!
//! V. Kolmogorov, C. Rother: "Minimizing Nonsubmodular Functions with Graph Cuts - A Review", IEEE
//! Transactions on Pattern Analysis and Machine Intelligence 29(7), 2007 (QPBO).
//!
//! The network holds each variable and its opposite. A variable is decided if the smallest minimum cut
//! separates the two. That decides those variables that have the same whole value in every solution of the
//! linear relaxation (section 3 there), whatever the network.
//!
//! To make the network smaller, some variables are fixed beforehand: those with a value that is strictly
//! better whatever the others do. They have that value in every solution, and the solutions of the rest are
//! those of the whole. Fixing them may settle further variables, and mostly little is left to cut.

use super::max_flow::Network;

/// A quadratic function of binary variables. Its buffers are used again for the next function.
#[derive(Clone, Debug, Default)]
pub(super) struct Quadratic {
    /// Cost of value 1 minus cost of value 0, while all other variables are 0.
    unary: Vec<i64>,
    /// Two variables, and the additional cost if both are 1.
    pairs: Vec<(u32, u32, i64)>,
    values: Vec<Option<bool>>,
    /// The smallest and the largest difference between the costs of 1 and 0, over all values of the variables
    /// that are not fixed. Until the function is minimised, the offsets of these from `unary`.
    bounds: Vec<[i64; 2]>,
    /// Fixed variables whose pairs are not updated yet.
    fixed: Vec<u32>,
    /// Index where the pairs of each variable begin, and the end of the last; and the pairs.
    starts: Vec<u32>,
    of_variable: Vec<(u32, i64)>,
    /// Number of each variable among those that are not fixed.
    numbers: Vec<u32>,
    network: Network,
}

impl Quadratic {
    /// Removes everything, and starts with so many variables and the function 0.
    pub(super) fn restart(&mut self, variables: usize) {
        self.unary.clear();
        self.unary.resize(variables, 0);
        self.pairs.clear();
        self.bounds.clear();
        self.bounds.resize(variables, [0; 2]);
    }

    pub(super) fn add_unary(&mut self, p: usize, cost_of_1: i64) {
        self.unary[p] += cost_of_1;
    }

    /// Adds the costs of `(0, 0)`, `(0, 1)`, `(1, 0)` and `(1, 1)`. It may be called once for each two
    /// variables.
    pub(super) fn add_pair(&mut self, p: usize, q: usize, [c00, c01, c10, c11]: [i64; 4]) {
        self.unary[p] += c10 - c00;
        self.unary[q] += c01 - c00;
        let both = c11 - c10 - c01 + c00;
        if both != 0 {
            self.pairs.push((p as u32, q as u32, both));
            for variable in [p, q] {
                let [least, largest] = &mut self.bounds[variable];
                *least += both.min(0);
                *largest += both.max(0);
            }
        }
    }

    /// Values at a minimum, as far as they can be determined.
    pub(super) fn minimise(&mut self) -> &[Option<bool>] {
        self.fix_at_once();
        if self.fixed.len() < self.unary.len() {
            if !self.fixed.is_empty() {
                self.fix_in_turn();
            }
            self.cut();
        }
        &self.values
    }

    /// Fixes variables whose best value does not depend on the others.
    fn fix_at_once(&mut self) {
        self.values.clear();
        self.fixed.clear();
        for ((variable, bounds), cost) in (0..).zip(&mut self.bounds).zip(&self.unary) {
            *bounds = bounds.map(|beyond| beyond + cost);
            let value = value_within(*bounds);
            self.values.push(value);
            if value.is_some() {
                self.fixed.push(variable);
            }
        }
    }

    /// Updates the pairs of fixed variables, and fixes variables whose best value is then known.
    fn fix_in_turn(&mut self) {
        self.starts.clear();
        self.starts.resize(self.unary.len() + 2, 0);
        for &(p, q, _) in &self.pairs {
            self.starts[p as usize + 2] += 1;
            self.starts[q as usize + 2] += 1;
        }
        for variable in 2..self.starts.len() {
            self.starts[variable] += self.starts[variable - 1];
        }
        self.of_variable.clear();
        self.of_variable.resize(2 * self.pairs.len(), (0, 0));
        for &(p, q, both) in &self.pairs {
            for (variable, other) in [(p, q), (q, p)] {
                let place = &mut self.starts[variable as usize + 1];
                self.of_variable[*place as usize] = (other, both);
                *place += 1;
            }
        }
        while let Some(p) = self.fixed.pop() {
            let p = p as usize;
            let is_one = self.values[p] == Some(true);
            let pairs = self.starts[p] as usize..self.starts[p + 1] as usize;
            for &(q, both) in &self.of_variable[pairs] {
                let value = &mut self.values[q as usize];
                if value.is_some() {
                    continue;
                }
                let certain = if is_one { both } else { 0 };
                let bounds = &mut self.bounds[q as usize];
                bounds[0] += certain - both.min(0);
                bounds[1] += certain - both.max(0);
                self.unary[q as usize] += certain;
                *value = value_within(*bounds);
                if value.is_some() {
                    self.fixed.push(q);
                }
            }
        }
    }

    /// Decides the remaining variables by a minimum cut, as far as it can.
    fn cut(&mut self) {
        let mut left = 0;
        self.numbers.clear();
        self.numbers.extend(self.values.iter().map(|value| {
            left += u32::from(value.is_none());
            left.wrapping_sub(1)
        }));
        // Node `2 p` is on the source side if `p` is 0; node `2 p + 1` is its complement.
        self.network.restart(2 * left as usize);
        for &(p, q, both) in &self.pairs {
            let [p, q] = [p, q].map(|variable| variable as usize);
            if self.values[p].is_some() || self.values[q].is_some() {
                continue;
            }
            self.unary[q] += both;
            let [node_p, node_q] = [p, q].map(|variable| 2 * self.numbers[variable] as usize);
            if both < 0 {
                // both x y = both y - both (1 - x) y
                self.network.add_arc(node_p, node_q, -both);
                self.network.add_arc(node_q + 1, node_p + 1, -both);
            } else {
                // both x y = both (x + y - 1) + both (1 - x) (1 - y)
                self.unary[p] += both;
                self.network.add_arc(node_p, node_q + 1, both);
                self.network.add_arc(node_q, node_p + 1, both);
            }
        }
        for ((value, &number), &cost) in self.values.iter().zip(&self.numbers).zip(&self.unary) {
            if value.is_none() {
                self.network.add_terminal(2 * number as usize, cost);
                self.network.add_terminal(2 * number as usize + 1, -cost);
            }
        }
        self.network.cut();
        for (value, &number) in self.values.iter_mut().zip(&self.numbers) {
            if value.is_none() {
                let [here, opposite] =
                    [0, 1].map(|i| self.network.is_source(2 * number as usize + i));
                *value = (here != opposite).then_some(opposite);
            }
        }
    }
}

/// The better value if the cost of 1 exceeds that of 0 by at least and at most these differences; `None` if
/// that is open.
fn value_within([least, largest]: [i64; 2]) -> Option<bool> {
    (least > 0 || largest < 0).then_some(largest < 0)
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
        let mut quadratic = Quadratic::default();
        quadratic.restart(unary.len());
        for (p, &cost) in unary.iter().enumerate() {
            quadratic.add_unary(p, cost);
        }
        for &(p, q, costs) in pairs {
            quadratic.add_pair(p, q, costs);
        }
        quadratic.minimise().to_vec()
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
    fn what_is_fixed_beforehand_a_cut_would_decide_alike() {
        let (mut fixed, mut left) = (0, 0);
        for trial in 0..300 {
            let (mut unary, pairs) = random(trial, trial % 2 == 0);
            for cost in &mut unary {
                *cost *= 1 + trial as i64 % 5;
            }
            let mut quadratic = Quadratic::default();
            quadratic.restart(unary.len());
            for (p, &cost) in unary.iter().enumerate() {
                quadratic.add_unary(p, cost);
            }
            for &(p, q, costs) in &pairs {
                quadratic.add_pair(p, q, costs);
            }
            let mut by_cut = quadratic.clone();
            by_cut.fix_at_once();
            fixed += by_cut.fixed.len();
            left += unary.len() - by_cut.fixed.len();
            by_cut.values = vec![None; unary.len()];
            by_cut.cut();
            assert_eq!(quadratic.minimise(), by_cut.values, "trial {trial}");
        }
        assert!(fixed > 100 && left > 100, "{fixed} fixed, {left} left");
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
