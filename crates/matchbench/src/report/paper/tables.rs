//! Tables 1 to 3 as sheets: what was found here, and beside it what the paper prints.

use crate::counted::counted;
use crate::metrics::StageQuartiles;

use super::super::Content;
use super::super::latex::sequence_numbers;
use super::super::names::title;
use super::super::numbers::{count, milliseconds, ratio};
use super::super::overview::Overview;
use super::published::{MATCHERS, SEQUENCES, SHORT};
use super::{PaperTimes, Sheet, SheetCell, SheetRow};

fn cell(ours: Option<String>, published: &str) -> SheetCell {
    SheetCell {
        ours,
        published: (!published.is_empty()).then(|| published.to_owned()),
        ..SheetCell::default()
    }
}

/// Table 1: the sequences.
pub(super) fn datasets(content: &Content) -> Sheet {
    let names: Vec<&str> = content.datasets.iter().map(|d| &*d.name).collect();
    let numbers = sequence_numbers(&names);
    let row = |published: &super::published::Sequence| {
        let place = numbers.iter().position(|number| number == published.number);
        let facts = place.map(|place| &content.datasets[place]);
        let run = facts.and_then(|facts| content.scored_pairs(&facts.name));
        let pairs = facts.map(|facts| match run {
            Some(run) if run != facts.pairs => format!("{run} of {}", facts.pairs),
            _ => facts.pairs.to_string(),
        });
        let size = facts.and_then(|facts| facts.resolution);
        SheetRow {
            label: format!("{}-{}", published.number, published.name),
            is_baseline: false,
            cells: vec![
                cell(
                    facts.map(|facts| facts.frames.to_string()),
                    published.images,
                ),
                cell(pairs, published.pairs),
                cell(
                    size.map(|(columns, rows)| format!("{columns} x {rows}")),
                    published.resolution,
                ),
                cell(
                    facts.map(|facts| facts.property.clone()),
                    published.property,
                ),
            ],
        }
    };
    Sheet {
        name: "table1",
        caption: "Table 1: the sequences. Resolutions are columns by rows; the paper prints rows by columns but \
                  for castle's."
            .to_owned(),
        groups: Vec::new(),
        heads: ["Sequence", "Images", "Pairs", "Resolution", "Property"]
            .map(str::to_owned)
            .to_vec(),
        under: None,
        rows: SEQUENCES.iter().map(row).collect(),
        notes: vec![
            "By the paper's own rule 01 has 2410 pairs and 02 has 2244, as its published results do; 04 has \
             4541 images."
                .to_owned(),
        ],
    }
}

/// Table 2: AUC.
pub(super) fn auc(content: &Content) -> Sheet {
    let overview = Overview::new(&content.summaries);
    let numbers = sequence_numbers(&overview.datasets);
    let column = |number: &str| numbers.iter().position(|own| own == number);
    let row = |published: &super::published::Matcher| {
        let own = overview.rows.iter().find(|row| row.matcher == published.id);
        let cells = (SEQUENCES.iter().zip(published.auc)).map(|(sequence, auc)| {
            let found = own.and_then(|row| row.cells[column(sequence.number)?].as_ref());
            let auc = if auc > 0.0 { ratio(auc) } else { String::new() };
            SheetCell {
                rank: found.and_then(|cell| cell.rank),
                is_above: found.is_some_and(|cell| cell.above_baseline),
                ..cell(found.map(|cell| ratio(cell.auc.value)), &auc)
            }
        });
        SheetRow {
            label: title(published.id),
            is_baseline: published.id == "sift",
            cells: cells.collect(),
        }
    };
    let pairs = (SEQUENCES.iter())
        .map(|sequence| {
            let scored = scored_pairs(content, sequence.number);
            cell(scored.map(|pairs| pairs.to_string()), sequence.pairs)
        })
        .collect();
    let estimators = overview.footnote(title);
    let mut notes: Vec<String> = lacking(content).into_iter().collect();
    notes.extend(estimators.iter().map(|note| format!("{note}.")));
    notes.push(
        "FREAK describes SURF's keypoints in the paper's text and SIFT's in its authors' program; both rows have \
         the published numbers beside them."
            .to_owned(),
    );
    Sheet {
        name: "table2",
        caption: "Table 2: the AUC of matchers. The best three of each sequence in red, green and blue; above \
                  SIFT in bold."
            .to_owned(),
        groups: vec![
            ("short-baseline portion".to_owned(), SHORT),
            ("wide-baseline portion".to_owned(), SEQUENCES.len() - SHORT),
        ],
        heads: std::iter::once("Matcher".to_owned())
            .chain(SEQUENCES.iter().map(|sequence| sequence.number.to_owned()))
            .collect(),
        under: Some(SheetRow {
            label: "Pairs".to_owned(),
            is_baseline: false,
            cells: pairs,
        }),
        rows: MATCHERS.iter().map(row).collect(),
        notes,
    }
}

/// How many pairs were scored of the paper's sequence of this number.
fn scored_pairs(content: &Content, number: &str) -> Option<usize> {
    let overview = Overview::new(&content.summaries);
    let numbers = sequence_numbers(&overview.datasets);
    let place = numbers.iter().position(|own| own == number)?;
    content.scored_pairs(overview.datasets[place])
}

/// What the run lacks of the paper's sequences, in sentences; `None` if it has all of their pairs.
pub(super) fn lacking(content: &Content) -> Option<String> {
    let (mut fewer, mut none) = (Vec::new(), Vec::new());
    for sequence in &SEQUENCES {
        let published = sequence.pairs.parse().expect("it is a number");
        match scored_pairs(content, sequence.number) {
            Some(scored) if scored < published => {
                fewer.push(format!("{} ({scored} of {published})", sequence.number));
            }
            Some(_) => {}
            None => none.push(sequence.number),
        }
    }
    let mut parts = Vec::new();
    if !fewer.is_empty() {
        parts.push(format!(
            "fewer pairs than published of {}",
            fewer.join(", ")
        ));
    }
    if !none.is_empty() {
        parts.push(format!("nothing of {}", none.join(", ")));
    }
    if parts.is_empty() {
        return None;
    }
    let chosen = content.plan().map(|plan| plan.settings);
    let is_quick = chosen.is_some_and(|chosen| chosen.sample.or(chosen.limit).is_some());
    let what = if is_quick {
        "A quick look"
    } else {
        "Incomplete"
    };
    Some(format!(
        "{what}: {}. Published scores are of whole sequences, and are not to be compared with scores of parts of them.",
        parts.join("; ")
    ))
}

/// Table 3: features and times.
pub(super) fn speed(times: &PaperTimes) -> Sheet {
    let row = |published: &super::published::Matcher| {
        let own = (times.rows.iter()).find(|row| row.matcher == published.id);
        let stages = own.map_or_else(StageQuartiles::default, |row| row.stages);
        let milliseconds = |spread: Option<crate::metrics::Quartiles>| {
            spread.map(|spread| milliseconds(spread.mean))
        };
        let ours = [
            stages.features.map(|spread| count(spread.mean)),
            milliseconds(stages.extract),
            milliseconds(stages.search),
            milliseconds(stages.select),
        ];
        SheetRow {
            label: title(published.id),
            is_baseline: false,
            cells: (ours.into_iter().zip(published.times))
                .map(|(ours, published)| cell(ours, published))
                .collect(),
        }
    };
    let measured = if times.rows.is_empty() {
        "Nothing was measured.".to_owned()
    } else {
        let (pairs, sequence) = (times.pairs, &times.sequence);
        format!(
            "Here: means over the first {} of {sequence}, {}.",
            counted(pairs, "pair"),
            times.machine
        )
    };
    Sheet {
        name: "table3",
        caption: "Table 3: features of an image, and milliseconds for detection and description of an image, \
                  matching and selection of a pair."
            .to_owned(),
        groups: Vec::new(),
        heads: ["Matcher", "Features", "Detection (ms)", "Matching (ms)", "Selection (ms)"]
            .map(str::to_owned)
            .to_vec(),
        under: None,
        rows: MATCHERS.iter().map(row).collect(),
        notes: vec![
            measured,
            "Published: the first 200 pairs of 01 on an Intel i7-6700K, in brackets on an NVIDIA GTX 1080."
                .to_owned(),
        ],
    }
}
