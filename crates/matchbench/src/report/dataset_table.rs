//! The paper's Table 1 as LaTeX: the datasets by portion (pairs of fragments, or others), with their images, pairs,
//! resolution and property.

use std::fmt::Write as _;

use crate::metrics::Portion;

use super::Format;
use super::content::Content;
use super::latex::escape;

/// A complete `tabular`, the fragments first. Pairs are those that were scored.
pub(super) fn latex(content: &Content) -> String {
    let datasets = &content.datasets;
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
            let pairs = dataset.pairs_of(content.scored_pairs(&dataset.name));
            let property = match &*dataset.property {
                "" => "--".to_owned(),
                property => escape(property),
            };
            let _ = writeln!(
                text,
                "{kind} & {} & {} & {pairs} & {size} & {property} \\\\",
                escape(&dataset.name),
                dataset.frames,
            );
            kind = "";
        }
        if kind.is_empty() {
            text.push_str("\\hline\n");
        }
    }
    text.push_str("\\end{tabular}\n");
    content.noted(Format::Latex, text)
}

#[cfg(test)]
mod tests {
    use super::super::dataset_facts::DatasetFacts;
    use super::super::tests::content;
    use super::*;

    #[test]
    fn portions_stand_apart_with_the_pairs_that_were_scored() {
        let dataset = |name: &str, portion| DatasetFacts {
            name: name.into(),
            portion,
            frames: 30,
            pairs: 435,
            resolution: Some((3072, 2048)),
            origin: "Strecha et al. 2008, castle; pairs all".into(),
            property: "urban & wide".into(),
            import: Vec::new(),
            thumbnail: None,
        };
        let mut content = content(&[("05", "sift", 6), ("05", "orb", 2)]);
        content.datasets = vec![
            dataset("05", Portion::Other),
            dataset("04", Portion::Fragments),
        ];
        content.datasets[0].property = String::new();
        let text = latex(&content);
        let fragments =
            text.find("Fragments & 04 & 30 & 435 & $3072 \\times 2048$ & urban \\& wide");
        let others = text.find("Other & 05 & 30 & 10 of 435 & $3072 \\times 2048$ & -- \\\\");
        assert!(others.is_some(), "{text}");
        assert!(fragments.is_some() && fragments < others, "{text}");
        assert_eq!(text.matches("\\hline").count(), 4);
    }
}
