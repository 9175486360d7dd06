//! Cuts a run into shards, such that images are extracted as rarely as possible.
//!
//! All shards have equally many pairs, so their costs differ only by their images, which every shard
//! extracts anew. A square of the table of all images with all images has many pairs of few images. So the
//! pairs are halved again and again, by their first image or by their second, whichever leaves fewer images
//! in both halves together. This gives tiles where all images are matched with all, and runs of neighbours
//! where images follow each other.

use super::{Contender, Dataset, RunError, plan, refuse_tuned};
use crate::counted::counted;
use crate::datasets::{DatasetError, Sequence, Unpaired};
use crate::records::shards::{Asked, Cut, PairsHash, Part, ShardPlan, Stretches, part_of};
use crate::records::{KeepMatches, Plan, RunSettings, ShardError, Tuned};

/// Which part of a run is done.
#[derive(Clone, Copy, Debug)]
pub struct Shard<'a> {
    /// The plan of all shards.
    pub plan: &'a ShardPlan,
    /// The number of this one, from 1.
    pub number: u32,
}

/// The plan to run all `contenders` on all `datasets` in so many `shards`; `asked` is how the contenders
/// were made, for whoever does a shard.
///
/// # Errors
/// [`RunError::Contradiction`] as [`plan`]; if there are fewer pairs than shards, none or too many of
/// them; if a dataset has a pair twice, which two shards could not share; if only a sample of the pairs is
/// asked for; if a dataset has matchers of its own.
pub fn plan_shards(
    datasets: &[Dataset],
    contenders: &[Contender],
    settings: RunSettings,
    shards: u32,
    asked: Asked,
    keep_matches: KeepMatches,
    tuned: &[Tuned],
) -> Result<ShardPlan, RunError> {
    if settings.sample.is_some() {
        let reason = "a sample of the pairs is not cut into shards; list its pairs in a dataset of their own";
        return Err(RunError::Contradiction(reason.into()));
    }
    let plan = plan(datasets, contenders, settings)?;
    if let Some(dataset) = plan
        .datasets
        .iter()
        .find(|dataset| dataset.matchers.is_some())
    {
        let name = &dataset.name;
        let reason = format!(
            "not all matchers are run on {name}: cut datasets with other matchers into shards apart"
        );
        return Err(RunError::Contradiction(reason));
    }
    refuse_tuned(tuned, &plan, datasets)?;
    let cut = cut(datasets, settings, shards)?;
    Ok(ShardPlan::new(
        plan,
        asked,
        keep_matches,
        tuned.to_vec(),
        cut,
    ))
}

/// How many images have to be extracted by one machine, for each matcher.
pub fn images_of_one(datasets: &[Dataset], settings: RunSettings) -> u64 {
    Images::of(datasets).count(&items(datasets, settings))
}

impl Shard<'_> {
    /// A dataset of the plan with the pairs of this shard alone: of millions of others none is ever held.
    ///
    /// # Errors
    /// If its pairs cannot be read.
    pub fn part(self, dataset: Unpaired) -> Result<Dataset, DatasetError> {
        let planned = self.plan.plan().datasets.iter();
        let place = planned.zip(&self.plan.cut().datasets);
        let stretches = place
            .filter(|(planned, _)| planned.name == dataset.name())
            .map(|(_, stretches)| stretches)
            .next();
        let mut shards = stretches.into_iter().flat_map(Stretches::shards);
        let folder = dataset.folder();
        let path = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
        let (sequence, whole) = dataset.part(|_| shards.next() == Some(self.number))?;
        Ok(Dataset {
            path,
            sequence,
            matchers: None,
            whole: Some(whole),
            pair_frames: None,
        })
    }

    /// The plan of this part of the run that `plan` is of, and the pairs that belong to it.
    ///
    /// # Errors
    /// If something else was planned, or there is no such shard; if the datasets are parts of another.
    pub(super) fn of(
        self,
        mut plan: Plan,
        datasets: &[Dataset],
    ) -> Result<(Plan, Vec<Dataset>), RunError> {
        self.plan.check(&plan)?;
        plan.shard = Some(self.plan.shard(self.number)?);
        let parts = datasets.iter().zip(&self.plan.cut().datasets);
        let parts: Vec<Dataset> = (parts)
            .map(|(dataset, stretches)| self.cut(dataset, stretches))
            .collect();
        let mut hash = PairsHash::default();
        for (index, part) in parts.iter().enumerate() {
            (part.sequence.pairs.iter()).for_each(|pair| hash.add(index, pair.a, pair.b));
        }
        if hash.text() != self.plan.cut().parts[self.number as usize - 1].hash {
            let difference = format!("the pairs are not those of shard {}", self.number);
            return Err(ShardError::NotAsPlanned { difference }.into());
        }
        Ok((plan, parts))
    }

    /// The pairs of this shard, of a dataset that has either all pairs or these.
    fn cut(self, dataset: &Dataset, stretches: &Stretches) -> Dataset {
        if dataset.whole.is_some() {
            return dataset.clone();
        }
        let Sequence {
            name,
            frames,
            pairs,
        } = &dataset.sequence;
        Dataset {
            path: dataset.path.clone(),
            sequence: Sequence {
                name: name.clone(),
                frames: frames.clone(),
                pairs: part_of(pairs, stretches, self.number),
            },
            matchers: dataset.matchers.clone(),
            whole: Some(dataset.sequence.whole()),
            pair_frames: None,
        }
    }
}

/// A pair and where it stands.
#[derive(Clone, Copy)]
struct Item {
    dataset: u32,
    a: u32,
    b: u32,
    index: u32,
}

fn items(datasets: &[Dataset], settings: RunSettings) -> Vec<Item> {
    let limit = settings.limit.unwrap_or(usize::MAX);
    let mut items = Vec::new();
    for (dataset, number) in datasets.iter().zip(0..) {
        let pairs = dataset.pair_frames().take(limit).zip(0..);
        items.extend(pairs.map(|((a, b), index)| Item {
            dataset: number,
            a,
            b,
            index,
        }));
    }
    items
}

/// Shares the pairs out.
fn cut(datasets: &[Dataset], settings: RunSettings, shards: u32) -> Result<Cut, RunError> {
    let contradiction = |reason: String| Err(RunError::Contradiction(reason));
    let mut items = items(datasets, settings);
    if shards == 0 || shards as usize > items.len() {
        let pairs = items.len();
        return contradiction(format!(
            "{} cannot be cut into {shards} shards; give from 1 to {pairs}",
            counted(pairs, "pair")
        ));
    }
    let by_a = |item: &Item| (item.dataset, item.a, item.b);
    items.sort_unstable_by_key(by_a);
    if let Some(twice) = items.windows(2).find(|two| by_a(&two[0]) == by_a(&two[1])) {
        let Item { dataset, a, b, .. } = twice[0];
        let name = &datasets[dataset as usize].sequence.name;
        return contradiction(format!(
            "dataset `{name}` has the pair {a} {b} twice; leave one out"
        ));
    }
    let mut images = Images::of(datasets);
    let mut halving = Halving {
        images: &mut images,
        shard_of: (datasets.iter())
            .map(|dataset| vec![0; dataset.pair_frames().count()])
            .collect(),
        parts: Vec::new(),
    };
    halving.split(&mut items, shards);
    let (shard_of, mut parts) = (halving.shard_of, halving.parts);
    let mut hashes = vec![PairsHash::default(); parts.len()];
    let mut stretches = Vec::new();
    let limit = settings.limit.unwrap_or(usize::MAX);
    for (index, (dataset, shards)) in datasets.iter().zip(&shard_of).enumerate() {
        for ((a, b), shard) in dataset.pair_frames().zip(shards).take(limit) {
            hashes[*shard as usize - 1].add(index, a, b);
        }
        stretches.push(Stretches::of(shards.iter().copied().take(limit)));
    }
    for (part, hash) in parts.iter_mut().zip(&hashes) {
        part.hash = hash.text();
    }
    Ok(Cut {
        datasets: stretches,
        parts,
    })
}

/// Pairs on their way to their shards.
struct Halving<'a> {
    images: &'a mut Images,
    /// Of each dataset, the shard of each pair.
    shard_of: Vec<Vec<u32>>,
    /// The shards that are known so far.
    parts: Vec<Part>,
}

impl Halving<'_> {
    /// Shares `items` out among the next so many `shards`.
    fn split(&mut self, items: &mut [Item], shards: u32) {
        if shards == 1 {
            self.parts.push(Part {
                pairs: items.len() as u64,
                images: self.images.count(items),
                hash: String::new(),
            });
            let number = u32::try_from(self.parts.len()).expect("as many as were asked for");
            for item in items {
                self.shard_of[item.dataset as usize][item.index as usize] = number;
            }
            return;
        }
        let left = shards / 2;
        // Both factors have at most 32 bits.
        let middle = (items.len() as u64 * u64::from(left) / u64::from(shards)) as usize;
        let by_a = |item: &Item| (item.dataset, item.a, item.b);
        let by_b = |item: &Item| (item.dataset, item.b, item.a);
        items.select_nth_unstable_by_key(middle, by_b);
        let of_b = self.images.count(&items[..middle]) + self.images.count(&items[middle..]);
        items.select_nth_unstable_by_key(middle, by_a);
        let of_a = self.images.count(&items[..middle]) + self.images.count(&items[middle..]);
        if of_b < of_a {
            items.select_nth_unstable_by_key(middle, by_b);
        }
        let (first, second) = items.split_at_mut(middle);
        self.split(first, left);
        self.split(second, shards - left);
    }
}

/// Counts the images of pairs.
struct Images {
    /// Where the frames of each dataset begin.
    begins: Vec<usize>,
    /// When each was last seen.
    seen: Vec<u64>,
    now: u64,
}

impl Images {
    fn of(datasets: &[Dataset]) -> Self {
        let mut begins = Vec::new();
        let mut frames = 0;
        for dataset in datasets {
            begins.push(frames);
            frames += dataset.sequence.frames.len();
        }
        Self {
            begins,
            seen: vec![0; frames],
            now: 0,
        }
    }

    fn count(&mut self, items: &[Item]) -> u64 {
        self.now += 1;
        let mut count = 0;
        for item in items {
            for frame in [item.a, item.b] {
                let seen = &mut self.seen[self.begins[item.dataset as usize] + frame as usize];
                count += u64::from(*seen < self.now);
                *seen = self.now;
            }
        }
        count
    }
}
