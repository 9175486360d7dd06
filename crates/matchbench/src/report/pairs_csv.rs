//! Every result of every pair as comma-separated values, full precision; angles in degrees.

use super::content::Content;
use super::csv::{field, number};
use super::words::outcome;
use crate::metrics::Angle;

/// A header line and one line per pair, matcher, estimator and repetition.
pub(super) fn render(content: &Content) -> String {
    let mut text = String::from(
        "dataset,matcher,estimator,a,b,repetition,baseline,view_angle,overlap,pose_error,\
         rotation_error,translation_error,correspondences,putative,selected,outcome\n",
    );
    for set in &content.results {
        let geometry = content.geometry.get(&set.dataset);
        let names = [&set.dataset, &set.matcher, &set.estimator]
            .map(|name| field(name))
            .join(",");
        for pair in &set.pairs {
            let known = geometry.and_then(|geometry| geometry.get(&(pair.a, pair.b)));
            let count = |value: Option<u32>| value.map_or_else(String::new, |n| n.to_string());
            let cells = [
                names.clone(),
                pair.a.to_string(),
                pair.b.to_string(),
                pair.repetition.to_string(),
                number(known.map(|known| known.baseline)),
                number(known.map(|known| known.view_angle)),
                number(known.map(|known| known.overlap)),
                number(pair.error(Angle::Pose)),
                number(pair.error(Angle::Rotation)),
                number(pair.error(Angle::Translation)),
                pair.correspondences.to_string(),
                count(pair.counts.map(|counts| counts.putative)),
                count(pair.counts.map(|counts| counts.selected)),
                outcome(pair).to_owned(),
            ];
            text.push_str(&cells.join(","));
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::tests::content;
    use super::*;

    #[test]
    fn every_row_has_a_field_for_every_head() {
        let text = render(&content(&[("ro,om", "sift", 6)]));
        let heads = text.lines().next().map(|line| line.split(',').count());
        assert_eq!(heads, Some(16));
        assert_eq!(text.lines().count(), 11);
        let row = text.lines().nth(1).expect("ten pairs");
        assert_eq!(
            row.replace("\"ro,om\"", "room").split(',').count(),
            16,
            "{row}"
        );
        assert!(
            text.lines()
                .last()
                .is_some_and(|row| row.ends_with(",no support"))
        );
    }
}
