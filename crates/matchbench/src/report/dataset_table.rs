//! The paper's Table 1 as LaTeX: the datasets by portion (pairs of fragments, or others), with their images, pairs,
//! resolution and property.

use std::fmt::Write as _;

use crate::metrics::Portion;

use super::dataset_facts::DatasetFacts;
use super::latex::escape;

/// A complete `tabular`, the fragments first.
pub(super) fn latex(datasets: &[DatasetFacts]) -> String {
    let mut text = String::from(
        "\\begin{tabular}{c|lrrll}\n\\hline\nType & Sequences & Images & Pairs & Resolution & Property \\\\\n\\hline\n",
    );
    for portion in Portion::ALL {
        let mut kind = match portion {
            Portion::Fragments => "Fragments",
            Portion::Other => "Other",
        };
        for dataset in datasets.iter().filter(|dataset| dataset.portion == portion) {
            let size = match dataset.resolution {
                Some((width, height)) => format!("${width} \\times {height}$"),
                None => "--".to_owned(),
            };
            let about = if dataset.property.is_empty() {
                &dataset.origin
            } else {
                &dataset.property
            };
            let _ = writeln!(
                text,
                "{kind} & {} & {} & {} & {size} & {} \\\\",
                escape(&dataset.name),
                dataset.frames,
                dataset.pairs,
                escape(about)
            );
            kind = "";
        }
        if kind.is_empty() {
            text.push_str("\\hline\n");
        }
    }
    text.push_str("\\end{tabular}\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn portions_stand_apart() {
        let dataset = |name: &str, portion| DatasetFacts {
            name: name.into(),
            portion,
            frames: 30,
            pairs: 435,
            resolution: Some((3072, 2048)),
            origin: "Strecha & others".into(),
            property: String::new(),
            import: Vec::new(),
            thumbnail: None,
        };
        let text = latex(&[
            dataset("05", Portion::Other),
            dataset("04", Portion::Fragments),
        ]);
        let fragments =
            text.find("Fragments & 04 & 30 & 435 & $3072 \\times 2048$ & Strecha \\& others");
        let others = text.find("Other & 05");
        assert!(fragments.is_some() && fragments < others, "{text}");
        assert_eq!(text.matches("\\hline").count(), 4);
    }
}
