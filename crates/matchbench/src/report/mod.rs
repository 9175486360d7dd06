//! Reports: turns [`Summary`]s (scores) into text. Each format has its own file.
//!
//! [`render`] gives one table in one format. [`of_run`] writes the report of a run, a folder that can be read
//! and mailed ([`write_report`] does the same for other [`Content`]). Every exporter is a pure function: the
//! same scores give the same bytes. Names from data are escaped for the format in which they are written.

mod advantage;
mod again;
mod booktabs;
mod bundle;
mod by_estimator;
mod citations;
mod command_line;
mod content;
mod converted;
mod csv;
mod dataset_facts;
mod dataset_table;
mod difference;
mod difference_files;
mod figures;
mod file_names;
mod folder;
mod html;
mod json;
mod latex;
mod leaderboard;
mod leaderboard_files;
mod markdown;
mod method;
mod names;
mod numbers;
mod of_results;
mod of_run;
mod outside;
mod overview;
mod pages;
mod pair_homography;
mod pair_table;
mod pair_time;
mod pair_view;
mod pair_words;
mod pairs_csv;
mod paper;
mod parquet;
mod picture;
mod pictures;
mod protocol_table;
mod score_words;
mod svg;
mod table;
mod target;
mod time_table;
mod unfinished;
mod vega;
mod verdict;
mod words;

use std::str::FromStr;

use crate::metrics::Summary;

pub use advantage::{advantage, leads_in_words, units};
pub use bundle::{MAX_BUNDLED, bundled, write_bundle};
pub use command_line::shell_word;
pub use content::{Content, RunFacts};
pub use dataset_facts::DatasetFacts;
pub use difference::{Duel, Side};
pub use difference_files::write_differences;
pub use folder::{write_inner_report, write_report};
pub use leaderboard::{Errors, Group, Leaderboard, Refused, Row, Source, leaderboard};
pub use leaderboard_files::write_leaderboard;
pub use numbers::{fixed, p_value, signed};
pub use of_results::of_results;
pub use of_run::{ReportError, ReportOptions, Reported, content_of_run, of_run, paper_of_run};
pub(crate) use pair_view::agrees_below;
pub use pair_view::{
    EpipolarLines, MatchView, PairPoses, PairView, Points, Tally, Thumbnail, epipolar_lines,
    evenly, match_views,
};
pub use pair_words::sentence;
pub use pairs_csv::render_pairs;
pub use paper::{PaperTimes, check_paper_folder, write_paper};
pub use picture::{picture_png, picture_svg};
pub use pictures::view;
pub use protocol_table::{render_protocols, render_protocols_with_intervals};
pub use target::check_target;
pub use time_table::{MatcherTimes, times_as_csv, times_as_latex};
pub use unfinished::Lacking;
pub use verdict::verdicts;
pub use words::names_or_count;

/// The format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Aligned text for a terminal.
    Table,
    /// Comma-separated values, full precision, one row per dataset, matcher and estimator.
    Csv,
    /// A JSON array of everything that is known, full precision.
    Json,
    /// Markdown tables as GitHub and similar sites render them.
    Markdown,
    /// A complete `tabular` like the paper's Table 2.
    Latex,
}

impl Format {
    /// All formats, in the order of their names in help texts.
    pub const ALL: [Self; 5] = [
        Self::Table,
        Self::Csv,
        Self::Json,
        Self::Markdown,
        Self::Latex,
    ];

    /// The name by which a user chooses it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Table => "table",
            Self::Csv => "csv",
            Self::Json => "json",
            Self::Markdown => "markdown",
            Self::Latex => "latex",
        }
    }
}

impl FromStr for Format {
    type Err = UnknownFormat;

    fn from_str(name: &str) -> Result<Self, UnknownFormat> {
        (Self::ALL.into_iter())
            .find(|format| format.name() == name)
            .ok_or_else(|| UnknownFormat(name.to_owned()))
    }
}

/// A name that no [`Format`] has.
#[derive(Debug, thiserror::Error)]
#[error("unknown format '{0}'; choose table, csv, json, markdown or latex")]
pub struct UnknownFormat(String);

/// The scores as text, ending in a line end.
pub fn render(format: Format, summaries: &[Summary]) -> String {
    match format {
        Format::Table => table::render(summaries),
        Format::Csv => csv::render(summaries),
        Format::Json => json::render(summaries),
        Format::Markdown => markdown::render(summaries),
        Format::Latex => latex::render(summaries),
    }
}

/// The same, with the 95 % interval behind each AUC of the table of matchers by datasets: `0.456 [0.386, 0.528]`. `None` of
/// formats that have no such table.
pub fn render_with_intervals(format: Format, summaries: &[Summary]) -> Option<String> {
    match format {
        Format::Markdown => Some(markdown::render_with(summaries, numbers::bracketed)),
        Format::Latex => Some(latex::render_with(summaries, numbers::bracketed)),
        Format::Table | Format::Csv | Format::Json => None,
    }
}

/// The same as [`render`], with the mean over all datasets: a last row `mean` in CSV, a line below the table in the terminal
/// format. The other formats are as [`render`] gives them.
pub fn render_with_mean(format: Format, summaries: &[Summary]) -> String {
    match format {
        Format::Table => table::render_with_mean(summaries),
        Format::Csv => csv::render_with_mean(summaries),
        Format::Json | Format::Markdown | Format::Latex => render(format, summaries),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{AngularError, Deviation, Failure, Model, PairResult, ResultSet};
    use crate::records::{ByDepth, Counts, Repeated};

    /// Results of one matcher with as many right pairs, in ten, as its AUC is to have tenths.
    pub(super) fn results(dataset: &str, matcher: &str, tenths: u32) -> ResultSet {
        let pairs = (0..10)
            .map(|a| {
                let mut pair = PairResult::failed(a, a + 1, Failure::NoSupport);
                if a < tenths {
                    pair.outcome = Ok(Deviation::Pose(AngularError {
                        rotation: 0.1,
                        translation: Some(0.2),
                    }));
                    pair.correspondences = Some(100 + a);
                }
                pair
            })
            .collect();
        ResultSet {
            dataset: dataset.to_owned(),
            matcher: matcher.to_owned(),
            estimator: "ransac-e".to_owned(),
            repetitions: 1,
            pairs,
            ignored: 0,
            lacking: 0,
        }
    }

    /// Scores of such results.
    pub(super) fn summary(dataset: &str, matcher: &str, tenths: u32) -> Summary {
        Summary::new(&results(dataset, matcher, tenths))
    }

    /// Scores of homographies that are off by 0, 1, ... 9 pixels.
    pub(super) fn homographies(dataset: &str, matcher: &str) -> Summary {
        let results = homography_results(dataset, matcher, 1.0);
        Summary::new(&results)
    }

    /// Homographies that are off by 0, 1, ... 9 times so many pixels.
    pub(super) fn homography_results(dataset: &str, matcher: &str, pixels: f64) -> ResultSet {
        let mut results = results(dataset, matcher, 0);
        results.estimator = "best-h".to_owned();
        for (error, pair) in (0_u8..).zip(&mut results.pairs) {
            pair.model = Model::Homography;
            pair.outcome = Ok(Deviation::Corners(Some(pixels * f64::from(error))));
            pair.correspondences = Some(50);
            pair.correct = Some([10, 20, 30, 40, 50, 50, 50, 50, 50, 50]);
            pair.found_again = Some((200, 90));
            pair.by_depth = Some(Box::new(ByDepth {
                overlap: Some(0.4),
                judged: 80,
                within: [20, 30, 40, 50, 50, 50, 50, 50, 50, 50],
                repeated: Some(Repeated {
                    visible: [200, 300],
                    within: [90; 10],
                }),
            }));
            pair.counts = Some(Counts {
                selected: 100,
                ..Counts::default()
            });
        }
        results
    }

    /// A report on such results.
    pub(super) fn content(sets: &[(&str, &str, u32)]) -> Content {
        let sets =
            (sets.iter()).map(|&(dataset, matcher, tenths)| results(dataset, matcher, tenths));
        Content::new(sets.collect(), RunFacts::default())
    }

    #[test]
    fn formats_are_chosen_by_name() {
        for format in Format::ALL {
            assert_eq!(format.name().parse::<Format>().ok(), Some(format));
        }
        let error = "xml"
            .parse::<Format>()
            .expect_err("there is no such format");
        assert!(error.to_string().contains("markdown"));
    }

    #[test]
    fn intervals_stand_behind_the_scores_of_tables_for_papers() {
        let summaries = [summary("room", "sift", 6)];
        for format in Format::ALL {
            let with = render_with_intervals(format, &summaries);
            assert_eq!(
                with.is_some(),
                [Format::Markdown, Format::Latex].contains(&format)
            );
            let Some(with) = with else { continue };
            let interval = summaries[0].auc().interval.expect("enough images");
            let shown = format!("0.600 [{:.3}, {:.3}]", interval.low, interval.high);
            assert!(with.contains(&shown), "{shown}: {with}");
            assert!(!render(format, &summaries).contains(" [0."));
        }
    }

    #[test]
    fn every_format_takes_none_one_and_undefined_scores() {
        let mut undefined = summary("room", "sift", 0);
        for kind in crate::metrics::SCORES {
            undefined.scores.get_mut(kind.id).value = None;
        }
        for summaries in [vec![], vec![summary("room", "sift", 7)], vec![undefined]] {
            for format in Format::ALL {
                let text = render(format, &summaries);
                assert!(text.ends_with('\n'), "{format:?}");
                let numbers = format == Format::Csv || !text.contains("NaN");
                assert!(numbers, "{format:?}: {text}");
                assert_eq!(text, render(format, &summaries));
            }
        }
    }
}
