//! The cut: which shard does which pairs.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::super::{DatasetPlan, Plan};

/// How the pairs of all datasets are shared out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// The pairs of each dataset, in the order of the plan.
    pub datasets: Vec<Stretches>,
    /// What each shard has to do, beginning with shard 1.
    pub parts: Vec<Part>,
}

/// What a shard has to do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its pairs.
    pub pairs: u64,
    /// The images of these, which each matcher extracts.
    pub images: u64,
    /// Hash of its pairs.
    pub hash: String,
}

/// The pairs of a dataset in their order, as whose they are; in JSON the text `1*250 2*31 1*7`: 250 pairs
/// of shard 1, then 31 of shard 2.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Stretches(Vec<Stretch>);

/// Pairs that stand one after the other and belong to one shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// Number of the shard, from 1.
    pub shard: u32,
    /// How many pairs.
    pub pairs: u64,
}

impl Stretches {
    /// The stretches of pairs that belong to these `shards`.
    pub fn of(shards: impl IntoIterator<Item = u32>) -> Self {
        let mut stretches: Vec<Stretch> = Vec::new();
        for shard in shards {
            match stretches.last_mut() {
                Some(last) if last.shard == shard => last.pairs += 1,
                _ => stretches.push(Stretch { shard, pairs: 1 }),
            }
        }
        Self(stretches)
    }

    /// One after the other.
    pub fn iter(&self) -> impl Iterator<Item = Stretch> {
        self.0.iter().copied()
    }

    /// The shard of each pair.
    pub fn shards(&self) -> impl Iterator<Item = u32> {
        (self.iter()).flat_map(|stretch| (0..stretch.pairs).map(move |_| stretch.shard))
    }

    /// How many pairs a shard has.
    pub fn pairs_of(&self, shard: u32) -> u64 {
        let own = self.iter().filter(|stretch| stretch.shard == shard);
        own.map(|stretch| stretch.pairs).sum()
    }
}

impl From<Stretches> for String {
    fn from(stretches: Stretches) -> Self {
        let mut text = Self::new();
        for Stretch { shard, pairs } in stretches.iter() {
            let space = if text.is_empty() { "" } else { " " };
            write!(text, "{space}{shard}*{pairs}").expect("a string takes all");
        }
        text
    }
}

impl TryFrom<String> for Stretches {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let stretch = |word: &str| {
            let (shard, pairs) = word.split_once('*')?;
            let (shard, pairs) = (shard.parse().ok()?, pairs.parse().ok()?);
            (pairs > 0).then_some(Stretch { shard, pairs })
        };
        (text.split_ascii_whitespace())
            .map(|word| stretch(word).ok_or_else(|| format!("`{word}` is not SHARD*PAIRS")))
            .collect::<Result<_, _>>()
            .map(Self)
    }
}

impl Cut {
    /// Whether this shares out the pairs of a plan, all of them and no others.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub(super) fn check(&self, plan: &Plan) -> Result<(), String> {
        let mut found = vec![0_u64; self.parts.len()];
        if self.datasets.len() != plan.datasets.len() {
            return Err("it does not cut every dataset".into());
        }
        for (stretches, dataset) in self.datasets.iter().zip(&plan.datasets) {
            let mut pairs = 0_u64;
            for stretch in stretches.iter() {
                let part =
                    (stretch.shard.checked_sub(1)).and_then(|index| found.get_mut(index as usize));
                let part = part.ok_or_else(|| format!("it has no shard {}", stretch.shard))?;
                pairs = pairs.saturating_add(stretch.pairs);
                *part = part.saturating_add(stretch.pairs);
            }
            if pairs != planned_pairs(dataset, plan) {
                return Err(format!(
                    "it does not share out the pairs of {}",
                    dataset.name
                ));
            }
        }
        let planned = self.parts.iter().map(|part| part.pairs);
        if found.is_empty() || !planned.eq(found) {
            return Err("its shards have other numbers of pairs".into());
        }
        Ok(())
    }
}

/// How many pairs of a dataset are run.
fn planned_pairs(dataset: &DatasetPlan, plan: &Plan) -> u64 {
    let limit = plan.settings.limit.unwrap_or(usize::MAX);
    dataset.pairs.min(limit) as u64
}

/// What of the items, one for each pair in their order, belongs to a shard.
pub(crate) fn part_of<T: Copy>(items: &[T], stretches: &Stretches, shard: u32) -> Vec<T> {
    let shards = items.iter().zip(stretches.shards());
    (shards.filter(|&(_, whose)| whose == shard))
        .map(|(item, _)| *item)
        .collect()
}

/// Hash of pairs of frames of several datasets, which are added one by one.
#[derive(Clone, Debug, Default)]
pub(crate) struct PairsHash(blake3::Hasher);

impl PairsHash {
    /// Adds the pair of these frames of the dataset with this index.
    pub(crate) fn add(&mut self, dataset: usize, a: u32, b: u32) {
        let dataset = u32::try_from(dataset).unwrap_or(u32::MAX);
        for number in [dataset, a, b] {
            self.0.update(&number.to_le_bytes());
        }
    }

    /// The hash of all of them.
    pub(crate) fn text(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_survive_their_text_and_other_text_is_refused() {
        let shards = [1, 1, 2, 2, 2, 1];
        let stretches = Stretches::of(shards);
        let text = String::from(stretches.clone());
        assert_eq!(text, "1*2 2*3 1*1");
        let again = Stretches::try_from(text).unwrap();
        assert_eq!(again, stretches);
        assert!(again.shards().eq(shards));
        assert_eq!((again.pairs_of(1), again.pairs_of(3)), (3, 0));
        assert_eq!(
            part_of(&['a', 'b', 'c', 'd', 'e', 'f'], &again, 1),
            ['a', 'b', 'f']
        );
        for wrong in ["1", "1*", "1*0", "*2", "1*-1", "1*2,2*3"] {
            assert!(Stretches::try_from(wrong.to_owned()).is_err(), "{wrong}");
        }
    }
}
