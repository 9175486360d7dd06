//! The paper's Table 1 as LaTeX: the datasets by portion (short or wide baselines), with their images, pairs,
//! resolution and property.

use std::fmt::Write as _;

use crate::metrics::Portion;

use super::dataset_facts::DatasetFacts;
use super::latex::escape;

/// A complete `tabular`, the short-baseline portion first.
pub(super) fn latex(datasets: &[DatasetFacts]) -> String {
    let mut text = String::from(
        "\\begin{tabular}{c|lrrll}\n\\hline\nType & Sequences & Images & Pairs & Resolution & Property \\\\\n\\hline\n",
    );
    for portion in Portion::ALL {
        let mut kind = match portion {
            Portion::Short => "Short",
            Portion::Wide => "Wide",
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
        let text = latex(&[dataset("05", Portion::Wide), dataset("04", Portion::Short)]);
        let short = text.find("Short & 04 & 30 & 435 & $3072 \\times 2048$ & Strecha \\& others");
        let wide = text.find("Wide & 05");
        assert!(short.is_some() && short < wide, "{text}");
        assert_eq!(text.matches("\\hline").count(), 4);
    }
}
