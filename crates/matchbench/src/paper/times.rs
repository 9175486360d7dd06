//! Measures the times of the paper's Table 3, matcher by matcher; finished measurements are kept.

use std::path::Path;

use crate::files::{read_text, write_whole};
use crate::report::{MatcherTimes, PaperTimes};
use crate::run::{Cancel, Dataset};
use crate::study::Prepared;
use crate::time::{machine, time};

use super::PaperError;

/// Times of all matchers of a study on the first `pairs` of its first sequence (01 in the paper), kept in
/// `file`. `tell` is called with each matcher before it is measured. `None` if the measurement was stopped.
/// Entries in `file` that come from another machine, version, sequence or number of pairs are measured again.
///
/// # Errors
/// If a measurement fails, or if the file cannot be written.
pub fn times(
    study: &Prepared,
    file: &Path,
    pairs: usize,
    cancel: &Cancel,
    tell: &dyn Fn(&str),
) -> Result<Option<PaperTimes>, PaperError> {
    let Some(dataset) = study.datasets.first() else {
        return Ok(Some(PaperTimes::default()));
    };
    // Table 3 has the slow matchers too, which are not run on short baselines.
    let dataset = &Dataset {
        matchers: None,
        ..dataset.clone()
    };
    let sequence = &dataset.sequence;
    let mut times = PaperTimes {
        machine: format!(
            "matchbench {}, {}, 1 thread",
            env!("CARGO_PKG_VERSION"),
            machine()
        ),
        sequence: sequence.name.clone(),
        pairs: pairs.min(sequence.pairs.len()),
        rows: Vec::new(),
    };
    let earlier = read_text(file).ok();
    let earlier = earlier.and_then(|text| serde_json::from_str::<PaperTimes>(&text).ok());
    if let Some(earlier) = earlier.filter(|earlier| earlier.is_like(&times)) {
        times.rows = earlier.rows;
    }
    for contender in &study.contenders {
        let id = contender.source.id();
        if times.rows.iter().any(|row| row.matcher == id) {
            continue;
        }
        tell(id);
        let Some(timing) = time(dataset, contender, pairs, cancel)? else {
            return Ok(None);
        };
        times.rows.push(MatcherTimes {
            matcher: id.to_owned(),
            stages: timing.stages,
        });
        let text = serde_json::to_string_pretty(&times).expect("times are plain JSON");
        write_whole(file, format!("{text}\n").as_bytes())?;
    }
    Ok(Some(times))
}
