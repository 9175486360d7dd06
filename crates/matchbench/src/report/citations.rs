//! The papers that took part in a run, as BibTeX.
//!
//! The entries of matchers, estimators and sources of data give their papers as text: authors, the title in quotes,
//! the venue, the year. Words before the authors and a colon say what a paper has to do with the entry. Several papers
//! are separated by `;`. This file parses that text. The entries of the paper of the benchmark and of this tool are
//! below.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use deunicode::deunicode;

use crate::metrics::Model;
use crate::protocols::SUPERGLUE;

use super::content::Content;
use super::dataset_facts::DatasetFacts;
use super::names::references;

/// The paper of the benchmark.
const PAPER: &str = r"@misc{matchbench-paper,
  author = {JiaWang Bian and Ruihan Yang and Yun Liu and Le Zhang and Ming-Ming Cheng and Ian Reid and WenHai Wu},
  title = {{MatchBench: An Evaluation of Feature Matchers}},
  year = {2018},
}

";

/// What this tool is called where it is cited.
const TITLE: &str = "matchbench: which feature matcher should I use?";
/// The year of this version.
const YEAR: &str = "2026";

/// Key of the paper that defines the benchmark.
pub(super) const BENCHMARK: &str = "matchbench-paper";
/// Key of this tool.
pub(super) const TOOL: &str = "matchbench-tool";

/// A paper that judges homographies by the mean distance of the four corners, as is done here.
pub(super) const CORNER_ERROR: &str = "D. DeTone, T. Malisiewicz, A. Rabinovich, \"SuperPoint: Self-Supervised \
                                       Interest Point Detection and Description\", CVPR Workshops 2018";
/// The paper by which intervals take pairs that share an image as dependent.
pub(super) const INTERVALS: &str = "P. M. Aronow, C. Samii, V. A. Assenova, \"Cluster-Robust Variance Estimation for \
                                    Dyadic Data\", Political Analysis 23(4), 2015";
/// A paper whose score is the area under recall over this error.
pub(super) const CORNER_AUC: &str = SUPERGLUE.reference;

/// One paper.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Citation {
    /// First author and year: `lowe2004`, with the first word of the title.
    pub(super) key: String,
    /// What the paper has to do with what names it, if that is not its method itself.
    pub(super) role: Option<String>,
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
    let (role, authors) = match authors.split_once(": ") {
        Some((role, authors)) => (Some(role.to_owned()), authors),
        None => (None, authors),
    };
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
    Some(Citation {
        key: format!("{}{year}{}", plain(family), plain(word)),
        role,
        authors,
        title: title.trim_end_matches(',').to_owned(),
        venue,
        year: year.to_owned(),
    })
}

/// The letters and digits of a word of a key, in lower case and without accents.
fn plain(text: &str) -> String {
    let letters = deunicode(text).into_bytes().into_iter();
    let kept = letters.filter(u8::is_ascii_alphanumeric);
    kept.map(|letter| char::from(letter.to_ascii_lowercase()))
        .collect()
}

/// Journal, volume and number, where a venue is `Journal 60(2)`, or `Journal 60` without a number.
fn volume(venue: &str) -> Option<(&str, &str, Option<&str>)> {
    let (journal, numbers) = venue.rsplit_once(' ')?;
    let (volume, number) = match numbers.strip_suffix(')') {
        Some(both) => both
            .split_once('(')
            .map(|(volume, number)| (volume, Some(number)))?,
        None => (numbers, None),
    };
    let digits =
        |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit() || b == b'-');
    (digits(volume) && number.is_none_or(digits)).then_some((journal, volume, number))
}

/// The paper as a BibTeX entry: an article if its venue has a volume, a book if that is a press or if there is none,
/// else a paper in proceedings.
fn bibtex(citation: &Citation) -> String {
    let volume = volume(&citation.venue);
    let is_book = citation.venue.is_empty() || citation.venue.ends_with(" Press");
    let kind = match volume {
        Some(_) => "article",
        None if is_book => "book",
        None => "inproceedings",
    };
    let mut text = format!("@{kind}{{{},\n", citation.key);
    let mut line = |name: &str, value: &str| {
        let _ = writeln!(text, "  {name} = {{{}}},", whole(value));
    };
    line("author", &citation.authors.join(" and "));
    line("title", &citation.title);
    match volume {
        Some((journal, volume, number)) => {
            line("journal", journal);
            line("volume", volume);
            if let Some(number) = number {
                line("number", number);
            }
        }
        None if citation.venue.is_empty() => {}
        None if is_book => line("publisher", &citation.venue),
        None => line("booktitle", &citation.venue),
    }
    line("year", &citation.year);
    text.push_str("}\n\n");
    text
}

/// A value of an entry without what would end it: braces and line ends.
fn whole(value: &str) -> String {
    value.replace(['{', '}'], "").replace(char::is_control, " ")
}

/// Every paper that took part, each once, in the order of their keys, after the benchmark (which has poses alone) and
/// this tool.
pub(super) fn render(content: &Content) -> String {
    let summaries = &content.summaries;
    let of = |model| summaries.iter().any(|summary| summary.model == model);
    let of_methods = (summaries.iter())
        .flat_map(|summary| references(&summary.matcher, &summary.estimator))
        .flatten();
    let of_data = (content.datasets.iter()).filter_map(DatasetFacts::reference);
    let of_errors = [CORNER_ERROR, CORNER_AUC]
        .into_iter()
        .filter(|_| of(Model::Homography));
    let of_intervals = (content.summaries.iter())
        .flat_map(|summary| summary.scores.iter())
        .any(|(_, score)| score.interval.is_some());
    let of_intervals = [INTERVALS].into_iter().filter(|_| of_intervals);
    let papers: BTreeMap<String, Citation> = (of_methods.chain(of_data).chain(of_errors))
        .chain(of_intervals)
        .flat_map(citations)
        .map(|citation| (citation.key.clone(), citation))
        .collect();
    let mut text = String::new();
    if of(Model::Pose) {
        text.push_str(PAPER);
    }
    // Most styles of BibTeX know neither `@software` nor its version.
    let _ = writeln!(
        text,
        "@misc{{{TOOL},\n  author = {{{{{}}}}},\n  title = {{{{{TITLE}}}}},\n  note = {{Version {}}},\n  \
         year = {{{YEAR}}},\n  url = {{{}}},\n}}\n",
        env!("CARGO_PKG_AUTHORS"),
        whole(&content.version()),
        env!("CARGO_PKG_REPOSITORY"),
    );
    text.extend(papers.values().map(bibtex));
    text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::tests::{content, homographies};
    use super::*;
    use crate::datasets::{KINDS, reference};
    use crate::estimators::ESTIMATORS;
    use crate::matchers::MATCHERS;
    use crate::protocols::{MATCHBENCH, PROTOCOLS};

    #[test]
    fn every_reference_is_understood() {
        let mut known: BTreeMap<String, String> = BTreeMap::new();
        for reference in all() {
            let papers = citations(reference);
            assert_eq!(papers.len(), reference.split("; ").count(), "{reference}");
            for paper in papers {
                assert!(
                    paper.key.is_ascii() && !paper.title.contains('"'),
                    "{reference}"
                );
                let initial =
                    |author: &String| author.split(' ').count() > 1 && author.contains('.');
                assert!(
                    !paper.authors.is_empty() && paper.authors.iter().all(initial),
                    "{reference}"
                );
                let short = ["PAMI", "CACM", "CVIU", "IJCV", "JASA", "TPAMI", "IJRR"];
                let journal = paper.venue.split(' ').next().unwrap_or_default();
                assert!(!short.contains(&journal), "{reference}");
                // One paper has one entry, whatever names it.
                let entry = bibtex(&paper);
                let same = known.entry(paper.key).or_insert_with(|| entry.clone());
                assert_eq!(*same, entry);
            }
        }
    }

    /// Every reference that this program has.
    fn all() -> impl Iterator<Item = &'static str> {
        let of_data = (KINDS.iter()).filter_map(|kind| reference(&[kind.id.to_owned()], ""));
        (MATCHERS.iter().map(|entry| entry.reference()))
            .chain(ESTIMATORS.iter().map(|entry| entry.reference()))
            .chain(
                PROTOCOLS
                    .iter()
                    .filter(|known| !known.is_ours())
                    .map(|known| known.reference),
            )
            .chain([CORNER_ERROR, CORNER_AUC, INTERVALS])
            .chain(of_data)
    }

    #[test]
    fn keys_have_no_accents() {
        for (name, key) in [
            ("D. Nistér", "nister"),
            ("G. Bökman", "bokman"),
            ("M. Müller", "muller"),
            ("K. Åström", "astrom"),
            ("J. Sørensen", "sorensen"),
            ("M. Nießner", "niessner"),
        ] {
            let text = format!("{name}, \"Some Title\", CVPR 2004");
            assert_eq!(citations(&text)[0].key, format!("{key}2004some"));
        }
        let rich = "in place of that of: W.-Y. Lin, \"RepMatch\", ECCV 2016";
        let [paper] = &citations(rich)[..] else {
            panic!("it is one paper")
        };
        assert_eq!(paper.key, "lin2016repmatch");
        assert_eq!(paper.role.as_deref(), Some("in place of that of"));
    }

    #[test]
    fn this_tool_and_its_benchmark_are_cited_by_what_the_repository_says_of_them() {
        let text = render(&content(&[("a", "sift", 4)]));
        let version = env!("CARGO_PKG_VERSION");
        let expected = format!(
            "@misc{{matchbench-tool,\n  author = {{{{The matchbench authors}}}},\n  \
             title = {{{{matchbench: which feature matcher should I use?}}}},\n  note = {{Version {version}}},\n  \
             year = {{2026}},\n  url = {{https://github.com/matchbench/matchbench}},\n}}\n"
        );
        assert!(text.contains(&expected), "{text}");
        assert!(
            text.contains("@misc{matchbench-paper") && text.contains("  year = {2018},"),
            "{text}"
        );
        assert!(MATCHBENCH.reference.ends_with(", 2018"));
        // The files are not in the package.
        let file = |name: &str| {
            std::fs::read_to_string(format!("{}/../../{name}", env!("CARGO_MANIFEST_DIR")))
        };
        if let (Ok(about), Ok(license)) = (file("CITATION.cff"), file("LICENSE-MIT")) {
            assert!(about.contains(&format!("title: \"{TITLE}\"")), "{about}");
            let authors = env!("CARGO_PKG_AUTHORS");
            assert!(
                license.contains(&format!("(c) {YEAR} {authors}")),
                "{license}"
            );
            assert!(about.contains(env!("CARGO_PKG_REPOSITORY")) && about.contains(authors));
        }
    }

    #[test]
    fn homographies_have_papers_of_their_own() {
        let mut content = content(&[("a", "sift", 4)]);
        assert!(!render(&content).contains("superpoint"));
        content.summaries = vec![homographies("a", "sift")];
        let text = render(&content);
        assert!(!text.contains("matchbench-paper"), "{text}");
        assert!(text.contains("detone2018superpoint") && text.contains("sarlin2020superglue"));
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
        let of = |text: &str| citations(text).iter().map(bibtex).collect::<String>();
        let book =
            of("R. Hartley, \"Multiple View Geometry\", Cambridge University Press, 2004, sec. 2");
        assert!(
            book.starts_with("@book") && book.contains("publisher = {Cambridge University Press}"),
            "{book}"
        );
        let volume = of("D. Mishkin, \"MODS: Fast\", Computer Vision 141, 2015");
        assert!(
            volume.contains("volume = {141}") && !volume.contains("number"),
            "{volume}"
        );
    }

    #[test]
    fn each_paper_stands_once() {
        let text = render(&content(&[
            ("a", "freak", 4),
            ("b", "freak-sift", 4),
            ("a", "mine", 4),
        ]));
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
