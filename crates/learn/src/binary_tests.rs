//! Chooses the binary tests of ORB, FREAK and LATCH again, by the rules of their papers.
//!
//! - ORB (Rublee et al., ICCV 2011, section 4.3): tests compare two places. Tests whose answer is "yes" for
//!   nearly half of the patches are chosen greedily; a test that is correlated with a chosen one is skipped.
//! - FREAK (Alahi et al., CVPR 2012, section 4.2): the same for the 903 pairs of receptive fields. The paper
//!   finds that coarse fields are chosen first.
//! - LATCH (Levi, Hassner, WACV 2016, section 3.3): tests are random triplets of small patches. Tests that give
//!   the same answer for most patches of one point, and different answers for most patches of two points, are
//!   chosen greedily; correlated ones are skipped again.
//!
//! The limit of the correlation is raised until there are enough tests, as in all three papers.
//!
//! *Differs from the papers*: the patches are those of the set, which are upright patches of SIFT's keypoints.
//! For ORB and LATCH only a random sample of all tests is considered.

use std::collections::BTreeSet;

use anyhow::{Result, ensure};
use indicatif::ProgressBar;
use matchbench_vision::features::{BinaryRows, Freak, Latch, Orb, binboost, dlco};
use matchbench_vision::image::{GrayImage, Size, gaussian_blur_u8};
use matchbench_vision::seed::Seed;

use crate::pairs::shuffled;
use crate::patches::PatchSet;

/// Limit of the correlation at first, below which tests count as different, and the factor by which it is
/// raised.
const CORRELATION: (f64, f64) = (0.2, 1.1);

/// A descriptor that consists of binary tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Kind {
    Orb,
    Freak,
    Latch,
}

/// A test as the tables hold it: places as signed bytes x, y; for FREAK, numbers of fields.
type Test = Vec<u8>;

fn bytes(places: &[i8]) -> Test {
    places.iter().map(|place| place.cast_unsigned()).collect()
}

impl Kind {
    /// The table in the library.
    pub(crate) fn in_tree(self) -> Vec<Test> {
        match self {
            Self::Orb => Orb::tests().map(|test| bytes(&test)).collect(),
            Self::Freak => Freak::tests().map(Test::from).collect(),
            Self::Latch => Latch::tests().map(|test| bytes(&test)).collect(),
        }
    }

    /// The tests to choose from.
    fn candidates(self, count: usize, seed: Seed) -> Vec<Test> {
        let mut rng = seed.child("candidates").rng();
        let mut places = |number: usize, reach: i32| -> Test {
            (0..2 * number)
                .map(|_| (rng.below(2 * reach as u32 + 1) as i32 - reach) as i8 as u8)
                .collect()
        };
        let tests: BTreeSet<Test> = match self {
            Self::Orb => (0..count).map(|_| places(2, 13)).collect(),
            Self::Latch => (0..count).map(|_| places(3, 24)).collect(),
            Self::Freak => (0..FIELDS)
                .flat_map(|a| (a + 1..FIELDS).map(move |b| vec![a, b]))
                .collect(),
        };
        tests.into_iter().collect()
    }

    /// The part of a patch that the tests use: pixels, or means of fields.
    fn view(self, set: &PatchSet, patch: usize) -> Vec<u8> {
        let image =
            |side, pixels: &[u8]| GrayImage::from_vec(Size::new(side, side), pixels.to_vec());
        match self {
            Self::Orb => gaussian_blur_u8(&image(binboost::SIDE, set.small(patch)), 3, 2.0)
                .data()
                .to_vec(),
            Self::Freak => means(set.large(patch)),
            Self::Latch => gaussian_blur_u8(&image(dlco::SIDE, set.large(patch)), 1, 2.0)
                .data()
                .to_vec(),
        }
    }

    /// The answer of a test.
    fn answer(self, test: &[u8], view: &[u8]) -> bool {
        let at = |place: usize, side: usize| {
            let axis =
                |i: usize| (side / 2).wrapping_add_signed(isize::from(test[2 * place + i] as i8));
            axis(1) * side + axis(0)
        };
        match self {
            Self::Orb => view[at(0, binboost::SIDE)] < view[at(1, binboost::SIDE)],
            Self::Freak => view[usize::from(test[0])] >= view[usize::from(test[1])],
            Self::Latch => {
                const HALF: usize = 3;
                let [anchor, first, second] =
                    [0, 1, 2].map(|place| at(place, dlco::SIDE) - HALF * (dlco::SIDE + 1));
                let mut difference = 0;
                for y in 0..=2 * HALF {
                    let row = |start: usize| &view[start + y * dlco::SIDE..][..=2 * HALF];
                    for ((&a, &b), &c) in row(anchor).iter().zip(row(first)).zip(row(second)) {
                        let [to_b, to_c] = [b, c].map(|v| i32::from(a) - i32::from(v));
                        difference += to_b * to_b - to_c * to_c;
                    }
                }
                difference < 0
            }
        }
    }
}

/// Number of FREAK's receptive fields.
const FIELDS: u8 = 43;

/// Means of FREAK's fields; the pattern is as large as the patch allows.
fn means(patch: &[u8]) -> Vec<u8> {
    let scale = 0.5 * dlco::SIDE as f64 - 2.0;
    let middle = 0.5 * (dlco::SIDE as f64 - 1.0);
    // Radii of the rings, in 21sts of the distance between the outermost and the innermost ring.
    let radii = [0.0, 6.0, 11.0, 15.0, 18.0, 20.0, 21.0]
        .map(|spaces| scale * (2.0 / 3.0 - spaces / 21.0 * (2.0 / 3.0 - 1.0 / 12.0)));
    (0..usize::from(FIELDS))
        .map(|field| {
            let ring = (field / 6).min(6);
            let radius = if field < 42 { radii[ring] } else { 0.0 };
            // Every second ring is turned by half the angle between two fields.
            let turn = (2 * (field % 6) + ring % 2) as f64 / 12.0;
            let angle = core::f64::consts::TAU * turn;
            let half = 0.5 * radii[ring];
            let range = |centre: f64| {
                let [first, last] =
                    [centre - half, centre + half].map(|v| (v + 0.5).floor() as usize);
                first..last.max(first + 1)
            };
            let columns = range(middle + radius * libm::cos(angle));
            let rows = range(middle + radius * libm::sin(angle));
            let count = (columns.len() * rows.len()) as u32;
            let sum: u32 = rows
                .flat_map(|y| &patch[y * dlco::SIDE..][columns.clone()])
                .map(|&v| u32::from(v))
                .sum();
            (sum / count) as u8
        })
        .collect()
}

/// The answers of a test to many patches.
struct Column {
    bits: Vec<u64>,
    yes: f64,
}

impl Column {
    fn new(answers: impl Iterator<Item = bool>, count: usize) -> Self {
        let mut bits = vec![0; count.div_ceil(64)];
        for (n, answer) in answers.enumerate() {
            bits[n / 64] |= u64::from(answer) << (n % 64);
        }
        let yes: u32 = bits.iter().map(|word: &u64| word.count_ones()).sum();
        Self {
            bits,
            yes: f64::from(yes),
        }
    }

    fn at(&self, n: usize) -> bool {
        self.bits[n / 64] >> (n % 64) & 1 == 1
    }

    /// Absolute correlation with another test over `count` patches.
    fn correlation(&self, other: &Self, count: usize) -> f64 {
        let n = count as f64;
        let both = self.bits.iter().zip(&other.bits);
        let both: u32 = both.map(|(a, b)| (a & b).count_ones()).sum();
        let spread = |yes: f64| yes * (n - yes);
        let scale = (spread(self.yes) * spread(other.yes)).sqrt();
        ((n * f64::from(both) - self.yes * other.yes) / scale.max(1.0)).abs()
    }
}

/// The chosen tests.
pub(crate) struct Chosen {
    pub(crate) tests: Vec<Test>,
    /// The limit of the correlation at the end.
    pub(crate) limit: f64,
}

/// Chooses as many tests as the table of the library has, with the first `triplets` of `set` in random order.
pub(crate) fn choose(
    kind: Kind,
    set: &PatchSet,
    triplets: usize,
    candidates: usize,
    seed: Seed,
    bar: &ProgressBar,
) -> Result<Chosen> {
    ensure!(!set.triplets.is_empty(), "the set has no triplets");
    let wanted = kind.in_tree().len();
    let tests = kind.candidates(candidates, seed);
    ensure!(
        tests.len() >= wanted,
        "fewer candidates than the {wanted} tests wanted"
    );
    let order = shuffled(set.triplets.len(), seed);
    let views: Vec<[Vec<u8>; 3]> = (order.iter().take(triplets))
        .map(|&index| {
            let triplet = set.triplets[index];
            [triplet.anchor, triplet.positive, triplet.negative]
                .map(|patch| kind.view(set, patch as usize))
        })
        .collect();
    let count = 3 * views.len();
    bar.set_length(tests.len() as u64);
    let columns: Vec<Column> = (tests.iter())
        .map(|test| {
            bar.inc(1);
            let answers = views
                .as_flattened()
                .iter()
                .map(|view| kind.answer(test, view));
            Column::new(answers, count)
        })
        .collect();
    // A lower cost is better.
    let cost = |column: &Column| match kind {
        Kind::Orb | Kind::Freak => (column.yes / count as f64 - 0.5).abs(),
        Kind::Latch => {
            let right = |t: usize| {
                let [anchor, positive, negative] = [0, 1, 2].map(|i| column.at(3 * t + i));
                u32::from(anchor == positive) + u32::from(anchor != negative)
            };
            -f64::from((0..views.len()).map(right).sum::<u32>())
        }
    };
    let costs: Vec<f64> = columns.iter().map(cost).collect();
    let mut order: Vec<usize> = (0..tests.len()).collect();
    order.sort_by(|&i, &j| costs[i].total_cmp(&costs[j]));

    let mut limit = CORRELATION.0;
    loop {
        let mut chosen: Vec<usize> = Vec::with_capacity(wanted);
        for &candidate in &order {
            let column = &columns[candidate];
            let different = |&other: &usize| column.correlation(&columns[other], count) < limit;
            if chosen.len() < wanted && chosen.iter().all(different) {
                chosen.push(candidate);
            }
        }
        if chosen.len() == wanted {
            let tests = chosen.into_iter().map(|i| tests[i].clone()).collect();
            return Ok(Chosen { tests, limit });
        }
        limit *= CORRELATION.1;
    }
}

/// The descriptors of all patches of a set.
pub(crate) fn describe(kind: Kind, tests: &[Test], set: &PatchSet) -> BinaryRows {
    let words = (0..set.len()).flat_map(|patch| {
        let view = kind.view(set, patch);
        Column::new(
            tests.iter().map(|test| kind.answer(test, &view)),
            tests.len(),
        )
        .bits
    });
    BinaryRows::from_vec(tests.len(), words.collect())
}

/// Mean distance from a half of the share of "yes" of each test, and mean absolute correlation of two tests.
pub(crate) fn spread(rows: &BinaryRows, bits: usize) -> (f64, f64) {
    let columns: Vec<Column> = (0..bits)
        .map(|bit| {
            let answers = (0..rows.len()).map(|i| rows.row(i)[bit / 64] >> (bit % 64) & 1 == 1);
            Column::new(answers, rows.len())
        })
        .collect();
    let half = |column: &Column| (column.yes / rows.len() as f64 - 0.5).abs();
    let shares = columns.iter().map(half).sum::<f64>() / bits as f64;
    let pairs = columns.iter().enumerate();
    let correlations: f64 = pairs
        .flat_map(|(i, a)| {
            columns[..i]
                .iter()
                .map(move |b| a.correlation(b, rows.len()))
        })
        .sum();
    (shares, correlations / (bits * (bits - 1) / 2) as f64)
}

/// How many tests of `chosen` are also in `table`, whatever the order of the two things that they compare.
pub(crate) fn shared(kind: Kind, chosen: &[Test], table: &[Test]) -> usize {
    let swapped = |test: &Test| -> Test {
        let unit = if kind == Kind::Freak { 1 } else { 2 };
        let (rest, second) = test.split_at(test.len() - unit);
        let (anchor, first) = rest.split_at(rest.len() - unit);
        [anchor, second, first].concat()
    };
    (chosen.iter())
        .filter(|test| table.contains(test) || table.contains(&swapped(test)))
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlation_is_that_of_answers() {
        let column = |answers: [bool; 4]| Column::new(answers.into_iter(), 4);
        let first = column([true, true, false, false]);
        assert_eq!(first.correlation(&first, 4), 1.0);
        assert_eq!(
            first.correlation(&column([false, false, true, true]), 4),
            1.0
        );
        assert_eq!(
            first.correlation(&column([true, false, true, false]), 4),
            0.0
        );
        assert_eq!(first.correlation(&column([true; 4]), 4), 0.0);
    }

    #[test]
    fn answers_follow_the_pixels() {
        // Brighter to the right.
        let ramp =
            |side: usize| -> Vec<u8> { (0..side * side).map(|i| (3 * (i % side)) as u8).collect() };
        let test = |places: &[i8]| -> Test { places.iter().map(|v| v.cast_unsigned()).collect() };
        let small = ramp(binboost::SIDE);
        assert!(Kind::Orb.answer(&test(&[-5, 3, 6, -13]), &small));
        assert!(!Kind::Orb.answer(&test(&[6, -13, -5, 3]), &small));
        let large = ramp(dlco::SIDE);
        assert!(Kind::Latch.answer(&test(&[0, 0, 2, 24, 10, -24]), &large));
        assert!(!Kind::Latch.answer(&test(&[0, 0, -24, 5, 10, 5]), &large));
        let means = means(&large);
        assert_eq!(means.len(), usize::from(FIELDS));
        // Field 0 is the rightmost of the outermost ring, field 3 the opposite one.
        assert!(Kind::Freak.answer(&[0, 3], &means) && !Kind::Freak.answer(&[3, 0], &means));
    }

    #[test]
    fn a_test_is_found_again_with_its_places_swapped() {
        let table = vec![vec![1, 2, 3, 4]];
        assert_eq!(
            shared(Kind::Orb, &[vec![3, 4, 1, 2], vec![1, 2, 4, 3]], &table),
            1
        );
        let table = vec![vec![1, 2, 3, 4, 5, 6]];
        assert_eq!(shared(Kind::Latch, &[vec![1, 2, 5, 6, 3, 4]], &table), 1);
        assert_eq!(shared(Kind::Freak, &[vec![7, 9]], &[vec![9, 7]]), 1);
    }

    #[test]
    fn the_tables_of_the_library_can_be_read() {
        let sizes = [Kind::Orb, Kind::Freak, Kind::Latch].map(|kind| kind.in_tree().len());
        assert_eq!(sizes, [256, 512, 256]);
    }
}
