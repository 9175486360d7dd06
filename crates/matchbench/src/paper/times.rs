//! Measures the times of the paper's Table 3, matcher by matcher; finished measurements are kept.

use std::path::Path;
use std::slice;

use crate::files::{read_text, write_whole};
use crate::records::RunSettings;
use crate::report::{MatcherTimes, PaperTimes};
use crate::run::{Cancel, Dataset, plan};
use crate::study::Prepared;
use crate::time::{TimeError, machine, time};

use super::PaperError;

/// Times of all matchers of a study on the first `pairs` of its first sequence (01 in the paper), kept in
/// `file`. `tell` is called with a sentence before each matcher is measured, and where pairs of it broke: such a
/// matcher is left out, and measured again at the next start. `None` if the measurement was stopped.
/// Entries in `file` that come from another machine, version, sequence, number of pairs or other parameters are
/// measured again.
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
    let planned = plan(
        slice::from_ref(dataset),
        &study.contenders,
        RunSettings::default(),
    );
    let planned = planned.map_err(TimeError::from)?;
    let sequence = &dataset.sequence;
    let mut times = PaperTimes {
        machine: format!(
            "matchbench {}, {}, 1 thread",
            env!("CARGO_PKG_VERSION"),
            machine()
        ),
        sequence: sequence.name.clone(),
        pairs: pairs.min(sequence.pairs.len()),
        fingerprint: planned.datasets[0].fingerprint.clone(),
        ..PaperTimes::default()
    };
    let earlier = read_text(file).ok();
    let earlier = earlier.and_then(|text| serde_json::from_str::<PaperTimes>(&text).ok());
    if let Some(earlier) = earlier.filter(|earlier| earlier.is_like(&times)) {
        let measured = earlier.rows.into_iter().zip(earlier.plans);
        let same = measured.filter(|(_, its)| planned.matchers.contains(its));
        (times.rows, times.plans) = same.unzip();
    }
    for (contender, its) in study.contenders.iter().zip(planned.matchers) {
        let id = contender.source.id();
        if times.plans.contains(&its) {
            continue;
        }
        tell(&format!("timing {id}"));
        let Some(timing) = time(dataset, contender, pairs, cancel)? else {
            return Ok(None);
        };
        if let Some(breakage) = timing.breakage() {
            tell(&format!("warning: {id} has no times: {breakage}"));
            continue;
        }
        times.rows.push(MatcherTimes {
            matcher: id.to_owned(),
            stages: timing.stages,
        });
        times.plans.push(its);
        let text = serde_json::to_string_pretty(&times).expect("times are plain JSON");
        write_whole(file, format!("{text}\n").as_bytes())?;
    }
    Ok(Some(times))
}
