//! What scores and names of estimators mean, in words.

use crate::metrics::{Detail, GROUP_LEVEL_NOTE, Model, NO_LETTERS_NOTE, ScoreKind, Summary};
use crate::protocols::{PROTOCOLS, Protocol};

/// The definitions of the `shown` scores in a table of this detail: the column heads that share a definition,
/// and the definition.
pub(super) fn definitions(
    shown: &[&'static ScoreKind],
    detail: Detail,
) -> Vec<(String, &'static str)> {
    let mut definitions: Vec<(String, &'static str)> = Vec::new();
    for kind in shown.iter().filter(|kind| kind.detail <= detail) {
        match definitions.last_mut() {
            Some((heads, text)) if *text == kind.definition => {
                heads.push_str(", ");
                heads.push_str(kind.heading);
            }
            _ => definitions.push((kind.heading.to_owned(), kind.definition)),
        }
    }
    definitions
}

/// The protocols under which poses were estimated, in the order of [`PROTOCOLS`].
pub(super) fn protocols(summaries: &[Summary]) -> impl Iterator<Item = &'static Protocol> {
    let of =
        |model: Model, id: &str| (summaries.iter()).any(|s| s.model == model && s.protocol == id);
    (PROTOCOLS.iter().copied()).filter(move |protocol| of(Model::Pose, protocol.id))
}

/// What the names of estimators under a protocol mean, one sentence per protocol.
pub(super) fn protocol_notes(summaries: &[Summary]) -> Vec<String> {
    protocols(summaries)
        .filter(|protocol| !protocol.is_ours())
        .map(|protocol| {
            let (id, summary) = (protocol.id, protocol.summary);
            format!(
                "@{id}: poses are estimated by the protocol {id} ({summary}); its own scores: matchbench eval RUN \
                 --protocol {id}"
            )
        })
        .collect()
}

/// What the letters of groups mean, and why there are none; `None` if nothing was compared.
pub(super) fn group_note(summaries: &[Summary]) -> Option<String> {
    let has_letters = |summary: &Summary| !summary.group.is_empty();
    let notes = [
        (summaries.iter().any(has_letters), GROUP_LEVEL_NOTE),
        (summaries.iter().any(|s| s.beyond_letters), NO_LETTERS_NOTE),
    ];
    let notes: Vec<&str> = (notes.into_iter())
        .filter_map(|(applies, note)| applies.then_some(note))
        .collect();
    (!notes.is_empty()).then(|| notes.join(" "))
}

#[cfg(test)]
mod tests {
    use crate::metrics::SCORES;

    use super::*;

    #[test]
    fn every_score_that_is_shown_is_defined_once() {
        let all: Vec<&ScoreKind> = SCORES.iter().collect();
        for detail in [Detail::Glance, Detail::Complete] {
            let heads: Vec<String> = (definitions(&all, detail).into_iter())
                .flat_map(|(heads, _)| heads.split(", ").map(str::to_owned).collect::<Vec<_>>())
                .collect();
            let shown = SCORES.iter().filter(|kind| kind.detail <= detail);
            assert_eq!(heads, shown.map(|kind| kind.heading).collect::<Vec<_>>());
        }
        assert!(definitions(&all, Detail::Complete).len() < SCORES.len());
    }
}
