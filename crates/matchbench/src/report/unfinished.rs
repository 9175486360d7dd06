//! What a report says of a run that is not finished: every score in it may change.

use super::latex::comment;
use super::markdown::escape;
use super::{Format, command_line};
use crate::counted::counted;
use crate::metrics::Unfinished;
use crate::records::{Plan, RunFolder};

/// What the run of a report lacks, and the command that goes on with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lacking {
    /// What is missing.
    pub what: Unfinished,
    /// The command that goes on, if one command can; it is given where the datasets are, and the folder of the run.
    pub command: Option<String>,
}

impl Lacking {
    /// Of a run, if it is not finished.
    pub(super) fn of(run: &RunFolder, what: Option<Unfinished>) -> Option<Self> {
        let (what, plan) = (what?, run.plan());
        let name = run.path().file_name().map(|name| name.to_string_lossy());
        Some(Self {
            what,
            command: name.and_then(|name| goes_on(plan, &name)),
        })
    }

    /// How much is missing, without the methods: `70 of 220 planned results are missing`.
    pub(super) fn extent(&self) -> String {
        let Unfinished {
            missing, planned, ..
        } = self.what;
        match missing {
            0 => "its records are not those that it planned".to_owned(),
            1 => format!("1 of {} is missing", counted(planned, "planned result")),
            _ => format!(
                "{missing} of {} are missing",
                counted(planned, "planned result")
            ),
        }
    }

    /// What is missing and what follows, in sentences.
    pub(super) fn sentences(&self) -> String {
        let follows = match self.what.wrong {
            0 => {
                "Scores are of what each method has recorded. A method that lacks results that others have is not ranked, and not \
                 compared with them; one without any is not shown"
            }
            _ => "Missing results count as wrong; a method without any results is not shown",
        };
        format!(
            "This run is not finished: {} ({}). {follows}",
            self.extent(),
            self.what.sentences.join("; ")
        )
    }

    /// The table of a report with a note above it.
    pub(super) fn above(&self, format: Format, table: String) -> String {
        let text = self.sentences();
        match format {
            Format::Latex => format!("% {}.\n{table}", comment(&text)),
            Format::Markdown => format!("> {}.\n\n{table}", escape(&text)),
            Format::Table | Format::Csv | Format::Json => table,
        }
    }
}

fn goes_on(plan: &Plan, folder: &str) -> Option<String> {
    let datasets: Vec<_> = plan.datasets.iter().collect();
    let line = command_line::whole(plan, &datasets, &command_line::folder(folder))?;
    Some(line.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::tests::content;
    use super::super::{Content, bundle, dataset_table, html, method};
    use super::*;

    fn stopped() -> Content {
        let mut content = content(&[("room", "sift", 6)]);
        content.lacking = Some(Lacking {
            what: Unfinished {
                missing: 30,
                planned: 40,
                wrong: 0,
                sentences: vec!["orb_2 with best on room: 0 of 20 planned tasks recorded".into()],
            },
            command: Some("matchbench run room --matchers sift,orb_2 --out first".into()),
        });
        content
    }

    #[test]
    fn an_unfinished_run_does_not_look_finished() {
        let finished = content(&[("room", "sift", 6)]);
        let stopped = stopped();
        let what = "30 of 40 planned results are missing (orb_2 with best on room: 0 of 20 planned tasks recorded)";
        let page = html::render(&stopped);
        assert!(page.contains(what) && !html::render(&finished).contains("not finished"));
        assert!(
            page.contains("<code>matchbench run room --matchers sift,orb_2 --out first</code>")
        );
        let bundled = bundle::bundled(&stopped).expect("it is small");
        assert!(bundled.contains(what));
        for (format, begin) in [
            (Format::Latex, "% This run"),
            (Format::Markdown, "> This run"),
        ] {
            let table = |content: &Content| content.noted(format, "table\n".into());
            assert!(table(&stopped).starts_with(begin) && table(&stopped).ends_with("table\n"));
            assert_eq!(table(&finished), "table\n");
        }
        assert!(dataset_table::latex(&stopped).starts_with("% This run"));
        let claim = "Failed and missing pairs stay in every denominator.";
        assert!(method::plain(&finished).contains(claim));
        let text = method::plain(&stopped);
        assert!(!text.contains(claim), "{text}");
        assert!(text.contains("the run is not finished: 30 of 40 planned results are missing"));
    }
}
