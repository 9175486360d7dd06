//! FPR95 of descriptors on the patches of a set: the false positive rate at a recall of 95 %.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use matchbench_vision::features::binboost::{BinBoost, BinBoostParams, BinBoostTable};
use matchbench_vision::features::dlco::{Dlco, DlcoParams, DlcoTable};
use matchbench_vision::features::{BinaryRows, FloatRows};
use matchbench_vision::seed::Seed;

use anyhow::Result;

use crate::lbgm::LbgmTable;
use crate::pairs::{Negatives, fpr95, stranger};
use crate::patches::PatchSet;

/// The descriptors of all patches of a set.
pub(crate) enum Described {
    Float(FloatRows),
    Binary(BinaryRows),
}

impl Described {
    /// The SIFT descriptors that are stored with the patches.
    pub(crate) fn sift(set: &PatchSet) -> Self {
        let values = (0..set.len())
            .flat_map(|i| set.sift(i))
            .map(|&v| f32::from(v));
        Self::Float(FloatRows::from_vec(128, values.collect()))
    }

    /// DLCO with a table.
    pub(crate) fn dlco(set: &PatchSet, table: &DlcoTable, dimensions: usize) -> Result<Self> {
        let params = DlcoParams {
            dimensions,
            ..DlcoParams::default()
        };
        let describer = Dlco::with_table(params, table)?;
        let rows = describer.describe_patches(set.len(), |i, patch| {
            patch.copy_from_slice(set.large(i));
        });
        Ok(Self::Float(rows))
    }

    /// BinBoost with a table.
    pub(crate) fn binboost(set: &PatchSet, table: &BinBoostTable) -> Result<Self> {
        let describer = BinBoost::with_table(BinBoostParams::default(), table.clone())?;
        let rows = describer.describe_patches(set.len(), |i, patch| {
            patch.copy_from_slice(set.small(i));
        });
        Ok(Self::Binary(rows))
    }

    /// LBGM with a table.
    pub(crate) fn lbgm(set: &PatchSet, table: &LbgmTable) -> Result<Self> {
        Ok(Self::Float(table.describe(set)?))
    }

    fn distance(&self, i: usize, j: usize) -> f32 {
        match self {
            Self::Float(rows) => {
                let differences = rows.row(i).iter().zip(rows.row(j)).map(|(x, y)| x - y);
                differences.map(|d| d * d).sum()
            }
            Self::Binary(rows) => {
                let words = rows.row(i).iter().zip(rows.row(j));
                words.map(|(x, y)| (x ^ y).count_ones()).sum::<u32>() as f32
            }
        }
    }

    /// FPR95 on the triplets whose source `wanted` accepts.
    pub(crate) fn fpr95(
        &self,
        set: &PatchSet,
        negatives: Negatives,
        wanted: impl Fn(u32) -> bool,
    ) -> Option<f64> {
        let (mut same, mut different) = (Vec::new(), Vec::new());
        let triplets = set.triplets.iter().enumerate();
        for (index, triplet) in triplets.filter(|(_, triplet)| wanted(triplet.source)) {
            let anchor = triplet.anchor as usize;
            let other = match negatives {
                Negatives::Hard => triplet.negative as usize,
                Negatives::Random => stranger(set, index, Seed(0)),
            };
            same.push(self.distance(anchor, triplet.positive as usize));
            different.push(self.distance(anchor, other));
        }
        fpr95(same, &different)
    }
}

/// A table of FPR95 in percent, for random and hard negatives: a row for each source, and one for all.
pub(crate) fn report(set: &PatchSet, described: &[(String, Described)]) -> String {
    let mut text = format!("{:<28} {:>8}", "FPR95, % (random / hard)", "triplets");
    for (name, _) in described {
        let _ = write!(text, " {name:>15}");
    }
    let used: BTreeSet<u32> = set.triplets.iter().map(|triplet| triplet.source).collect();
    for source in used.into_iter().map(Some).chain([None]) {
        let wanted = |s: u32| source.is_none_or(|source| source == s);
        let name = source.map_or("all", |source| &set.sources[source as usize]);
        let count = set.triplets.iter().filter(|t| wanted(t.source)).count();
        let _ = write!(text, "\n{name:<28} {count:>8}");
        for (_, described) in described {
            let [random, hard] = [Negatives::Random, Negatives::Hard]
                .map(|negatives| described.fpr95(set, negatives, wanted).unwrap_or(f64::NAN));
            let _ = write!(text, " {:>7.2} /{:>6.2}", 100.0 * random, 100.0 * hard);
        }
    }
    text
}
