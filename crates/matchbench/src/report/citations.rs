//! The papers that took part in a run, as BibTeX.
//!
//! The entries of matchers and estimators give their papers as text: authors, the title in quotes, the venue,
//! the year. Several papers are separated by `;`. This file parses that text. The entries of the paper of the
//! benchmark and of this tool are below.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::metrics::Summary;

use super::names::references;

/// The benchmark and this tool.
const OURS: &str = r"@misc{matchbench-paper,
  author = {JiaWang Bian and Ruihan Yang and Yun Liu and Le Zhang and Ming-Ming Cheng and Ian Reid and WenHai Wu},
  title = {{MatchBench: An Evaluation of Feature Matchers}}
}

";

/// Key of the paper that defines the benchmark.
pub(super) const BENCHMARK: &str = "matchbench-paper";
/// Key of this tool.
pub(super) const TOOL: &str = "matchbench-tool";

/// One paper.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Citation {
    /// First author and year: `lowe2004`, with the first word of the title.
    pub(super) key: String,
    authors: Vec<String>,
    title: String,
    venue: String,
    year: String,
}

/// The papers in the text of an entry. Text that does not have this form is left out.
pub(super) fn citations(reference: &str) -> Vec<Citation> {
    reference.split("; ").filter_map(citation).collect()
}

fn citation(text: &str) -> Option<Citation> {
    let (authors, rest) = text.split_once('"')?;
    let (title, place) = rest.split_once('"')?;
    let authors: Vec<String> = (authors.split(','))
        .map(|author| author.trim().to_owned())
        .filter(|author| !author.is_empty())
        .collect();
    let place = place.trim_matches([',', ' ', '.', ':']);
    let is_year = |word: &&str| word.len() == 4 && word.bytes().all(|byte| byte.is_ascii_digit());
    let mut words = place.split(|c: char| !c.is_ascii_alphanumeric());
    let year = words.rfind(is_year)?;
    let at = place.rfind(year)?;
    let venue = place[..at].trim_end_matches([',', ' ']).to_owned();
    let family = authors.first()?.split(' ').next_back()?;
    let word = title
        .split(|c: char| !c.is_alphanumeric())
        .find(|word| word.len() > 2)?;
    let plain = |text: &str| -> String {
        let letters = text.chars().filter(char::is_ascii_alphanumeric);
        letters.collect::<String>().to_ascii_lowercase()
    };
    Some(Citation {
        key: format!("{}{year}{}", plain(family), plain(word)),
        authors,
        title: title.trim_end_matches(',').to_owned(),
        venue,
        year: year.to_owned(),
    })
}

/// The paper as a BibTeX entry: an article if its venue has a volume, a book if there is no venue, else a paper
/// in proceedings.
fn bibtex(citation: &Citation) -> String {
    let volume = citation
        .venue
        .rsplit_once(' ')
        .and_then(|(journal, numbers)| {
            let (volume, number) = numbers.trim_end_matches(')').split_once('(')?;
            let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
            (digits(volume) && digits(number)).then_some((journal, volume, number))
        });
    let kind = match volume {
        Some(_) => "article",
        None if citation.venue.is_empty() => "book",
        None => "inproceedings",
    };
    let mut text = format!("@{kind}{{{},\n", citation.key);
    let mut line = |name: &str, value: &str| {
        // Braces and line ends would end the value.
        let plain = value.replace(['{', '}'], "").replace(char::is_control, " ");
        let _ = writeln!(text, "  {name} = {{{plain}}},");
    };
    line("author", &citation.authors.join(" and "));
    line("title", &citation.title);
    match volume {
        Some((journal, volume, number)) => {
            line("journal", journal);
            line("volume", volume);
            line("number", number);
        }
        None if citation.venue.is_empty() => {}
        None => line("booktitle", &citation.venue),
    }
    line("year", &citation.year);
    text.push_str("}\n\n");
    text
}

/// Every paper that took part, each once, in the order of their keys, after the benchmark and this tool.
pub(super) fn render(summaries: &[Summary]) -> String {
    let papers: BTreeMap<String, Citation> = (summaries.iter())
        .flat_map(|summary| references(&summary.matcher, &summary.estimator))
        .flatten()
        .flat_map(citations)
        .map(|citation| (citation.key.clone(), citation))
        .collect();
    let mut text = OURS.to_owned();
    let _ = writeln!(
        text,
        "@software{{{TOOL},\n  title = {{matchbench}},\n  version = {{{}}}\n}}\n",
        env!("CARGO_PKG_VERSION")
    );
    text.extend(papers.values().map(bibtex));
    text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::tests::summary;
    use super::*;
    use crate::estimators::ESTIMATORS;
    use crate::matchers::MATCHERS;

    #[test]
    fn every_reference_is_understood() {
        let matchers = MATCHERS.iter().map(|entry| entry.reference());
        for reference in matchers.chain(ESTIMATORS.iter().map(|entry| entry.reference())) {
            let papers = citations(reference);
            assert_eq!(papers.len(), reference.split("; ").count(), "{reference}");
            for paper in papers {
                assert!(!paper.authors.is_empty(), "{reference}");
                assert!(
                    paper.key.is_ascii() && !paper.title.contains('"'),
                    "{reference}"
                );
            }
        }
    }

    #[test]
    fn a_paper_is_an_article_where_it_has_a_volume() {
        let sift = "D. G. Lowe, \"Distinctive Image Features\", Int. Journal 60(2), 2004";
        let text: String = citations(sift).iter().map(bibtex).collect();
        let expected = "@article{lowe2004distinctive,\n  author = {D. G. Lowe},\n  \
                        title = {Distinctive Image Features},\n  journal = {Int. Journal},\n  \
                        volume = {60},\n  number = {2},\n  year = {2004},\n}\n\n";
        assert_eq!(text, expected);
        let gms = "J. Bian, W.-Y. Lin, \"GMS: Grid\", CVPR 2017";
        let text: String = citations(gms).iter().map(bibtex).collect();
        assert!(
            text.starts_with("@inproceedings{bian2017gms,\n  author = {J. Bian and W.-Y. Lin},")
        );
        assert!(text.contains("booktitle = {CVPR},\n"), "{text}");
    }

    #[test]
    fn each_paper_stands_once() {
        let summaries = [
            summary("a", "freak", 4),
            summary("b", "freak-sift", 4),
            summary("a", "mine", 4),
        ];
        let text = render(&summaries);
        let keys: Vec<&str> = (text.lines())
            .filter_map(|line| line.strip_prefix('@')?.split_once('{'))
            .map(|(_, key)| key)
            .collect();
        assert_eq!(keys.len(), keys.iter().collect::<BTreeSet<_>>().len());
        assert_eq!(
            keys.iter().filter(|key| key.starts_with("alahi")).count(),
            1
        );
        assert_eq!(text.matches('{').count(), text.matches('}').count());
    }
}
