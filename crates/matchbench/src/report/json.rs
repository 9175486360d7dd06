//! All that is known, as a JSON array of [`Summary`] objects. Undefined values are `null`.

use crate::metrics::Summary;

/// Indented, full precision.
pub(super) fn render(summaries: &[Summary]) -> String {
    let mut text =
        serde_json::to_string_pretty(summaries).expect("names and numbers can be written");
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::super::tests::summary;
    use super::*;

    #[test]
    fn undefined_is_null() {
        let mut summary = summary("room", "sift", 0);
        summary.scores.get_mut("sp10").value = None;
        let value: serde_json::Value =
            serde_json::from_str(&render(&[summary])).expect("it was just written");
        assert!(value[0]["sp10"].is_null() && value[0]["ap5"]["value"].is_null());
        assert_eq!(value[0]["sp"].as_array().map(Vec::len), Some(15));
        assert_eq!(value[0]["failures"]["no_support"], 10);
    }
}
