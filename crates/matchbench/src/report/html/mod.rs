//! The page of a report: one HTML file with tables, curves and bars, which loads nothing else.
//!
//! The template escapes every value by itself. Only our own drawings, style and script are inserted unescaped.
//! What the page shows is computed here; what it looks like is defined in `page.html`, `style.css` and
//! `script.js`.

mod again;
mod auc_table;
mod difference;
mod difficulty;
mod failures;
mod hard_pairs;
mod leaderboard;
mod pair_list;
mod pair_pages;
mod reliability;
mod times;
mod warp;

pub(super) use difference::{Chapter, Shown, difference_page};
pub(super) use leaderboard::leaderboard_page;
pub(super) use pair_pages::pair_pages;

use std::collections::BTreeSet;
use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use matchbench_vision::robust::RIGHT_POSE;
use minijinja::syntax::SyntaxConfig;
use minijinja::{AutoEscape, Environment, HtmlEscape, Template, Value, context};

use crate::counted::counted;
use crate::metrics::{Angle, Detail, MIN_IMAGES, Model, Portion, ScoreKind, Summary, shown_scores};

use super::advantage::{leads_in_words, units};
use super::again::Again;
use super::by_estimator::estimator_figure;
use super::content::Content;
use super::figures::{
    accuracy_basis, accuracy_figure, ap_figure, ap_panel_figure, lead_figure, sp_figure,
    time_figure,
};
use super::method;
use super::numbers::{self, interval};
use super::overview::{Cell, Overview, Row, Subject};
use super::pair_time::about_times;
use super::score_words::{definitions, group_note};
use super::svg::{Target, data_url, legend_sample};
use super::words::names_or_count;

/// The three errors of a pose, as the page calls them.
const ANGLES: [(&str, Angle); 3] = [
    ("pose", Angle::Pose),
    ("rotation", Angle::Rotation),
    ("translation", Angle::Translation),
];

/// If there are more curves than this, the page first shows only those of one estimator.
const MAX_CURVES: usize = 12;

/// How much content goes into the page.
pub(super) struct Extent {
    /// Most results of pairs that are listed; a page with 150,000 is about 3 MB.
    pub(super) results: usize,
    /// Most bytes of pictures.
    pub(super) pictures: usize,
    /// Files that are embedded in the page, with their names. If there are none, the page is in a folder that
    /// has these files.
    pub(super) files: Vec<(&'static str, String)>,
}

impl Default for Extent {
    fn default() -> Self {
        Self {
            results: 150_000,
            pictures: 2_000_000,
            files: Vec::new(),
        }
    }
}

impl Extent {
    /// The file with all pairs: beside the page, or embedded in it.
    fn all_pairs(&self) -> Option<&'static str> {
        if self.files.is_empty() {
            return Some("tables/pairs.csv");
        }
        let mut embedded = self.files.iter().map(|(name, _)| *name);
        embedded.find(|name| *name == "pairs.csv")
    }
}

/// The page as text, for the folder of a report.
pub(super) fn render(content: &Content) -> String {
    render_extent(content, &Extent::default())
}

/// The page with this much content.
pub(super) fn render_extent(content: &Content, extent: &Extent) -> String {
    let (summaries, facts) = (&content.summaries[..], &content.facts);
    let overview = Overview::new(summaries);
    let shown = shown_scores(summaries);
    let environment = environment();
    let template = template(&environment, "page.html");
    let again = Again::of(content);
    let (difficulties, over) = difficulty::figures(content, &overview);
    let context = context! {
        again => again::commands(&again),
        anchors => again::anchors(&again),
        title => &facts.title,
        style => include_str!("style.css"),
        script => include_str!("script.js"),
        headlines => headlines(content, &overview),
        doubts => &content.doubts,
        enough => units(MIN_IMAGES),
        lacking => content.lacking.as_ref().map(|lacking| {
            context! { text => lacking.sentences(), command => &lacking.command }
        }),
        gallery => gallery(content),
        datasets => overview.datasets.len(),
        compared => compared(summaries),
        subject => overview.subject.head(),
        truth => overview.truth(),
        corner_auc => overview.has(Model::Homography),
        pairs => summaries.iter().map(|s| s.pairs).sum::<usize>(),
        results => summaries.len(),
        heads => (overview.datasets.iter().enumerate())
            .map(|(column, name)| context! { name => *name, pairs => overview.pairs(column) })
            .collect::<Vec<_>>(),
        overviews => ANGLES.map(|(name, angle)| {
            let rows = auc_table::rows(content, &Overview::of(summaries, angle), angle);
            context! { name, rows }
        }).to_vec(),
        legend => legend(&overview),
        presets => presets(&overview),
        curves => curves(&overview),
        panels => panels(&overview),
        bars => bars(&overview),
        accuracies => accuracies(&overview),
        leads => figures(&overview, |column| {
            lead_figure(content, &overview, column, Target::Page)
        }),
        verdicts => (leads_in_words(&content.leads).lines())
            .map(str::to_owned)
            .collect::<Vec<_>>(),
        difficulties,
        over,
        reliability => reliability::figures(content, &overview),
        right_pose => RIGHT_POSE.to_string(), // "10", not "10.0"
        has_baseline => overview.has_baseline(),
        hard_pairs => hard_pairs::rows(content, &overview, !extent.files.is_empty()),
        scatters => scatters(content, &overview),
        estimators => estimators(summaries, &overview),
        pair_list => Value::from_safe_string(pair_list::data(content, &overview, extent)),
        footnote => overview.footnote(str::to_owned),
        group_note => group_note(summaries),
        score_heads => score_heads(&shown),
        definitions => (definitions(&shown, Detail::Complete).into_iter())
            .map(|(heads, text)| context! { heads, text })
            .collect::<Vec<_>>(),
        scores => summaries.iter().map(|s| scores(s, &shown)).collect::<Vec<_>>(),
        failures => failures::table(summaries),
        times => times::times(content, &overview),
        outside => !content.outside.is_empty(),
        has_estimators => summaries.iter().any(|s| !s.estimator.is_empty()),
        facts => (facts.facts.iter())
            .map(|(name, value)| context! { name, value })
            .collect::<Vec<_>>(),
        files => (extent.files.iter())
            .map(|(name, text)| {
                let url = format!("data:text/plain;base64,{}", STANDARD.encode(text));
                context! { name => *name, url => Value::from_safe_string(url) }
            })
            .collect::<Vec<_>>(),
        method => (!summaries.is_empty()).then(|| method::plain(content)),
        plan => facts.plan.as_deref(),
    };
    template
        .render(context)
        .expect("the template only uses what it is given")
}

/// The templates, which escape every value by themselves.
fn environment() -> Environment<'static> {
    let mut environment = Environment::new();
    let syntax = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .keep_trailing_newline(true)
        .build()
        .expect("the delimiters are the usual ones");
    environment.set_syntax(syntax);
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_filter("counted", |number: u64, noun: &str| counted(number, noun));
    environment.add_filter("with_code", with_code);
    for (name, text) in [
        ("head.html", include_str!("head.html")),
        ("choices.html", include_str!("choices.html")),
        ("page.html", include_str!("page.html")),
        ("pair.html", include_str!("pair.html")),
        ("difference.html", include_str!("difference.html")),
        ("leaderboard.html", include_str!("leaderboard.html")),
    ] {
        environment
            .add_template(name, text)
            .expect("the templates are ours");
    }
    environment
}

/// A message as HTML: what stands between backticks is code.
fn with_code(message: &str) -> Value {
    let mut html = String::new();
    let mut rest = message;
    while let Some((before, (code, after))) =
        (rest.split_once('`')).and_then(|(before, rest)| Some((before, rest.split_once('`')?)))
    {
        let (before, code) = (HtmlEscape(before), HtmlEscape(code));
        let _ = write!(html, "{before}<code>{code}</code>");
        rest = after;
    }
    let _ = write!(html, "{}", HtmlEscape(rest));
    Value::from_safe_string(html)
}

fn template<'a>(environment: &'a Environment<'_>, name: &str) -> Template<'a, 'a> {
    environment.get_template(name).expect("it was added")
}

/// A sentence about the best matcher, which is the one that leads on most datasets. If there are both poses and
/// homographies, one sentence about each.
fn headlines(content: &Content, overview: &Overview<'_>) -> Vec<Value> {
    let models = [Model::Pose, Model::Homography];
    let both = models.iter().all(|&model| overview.has(model));
    let each = models.into_iter().filter_map(|model| {
        let of = match model {
            _ if !both => "",
            Model::Pose => " of poses",
            Model::Homography => " of homographies",
        };
        headline(content, overview, model, of)
    });
    each.collect()
}

/// The cells of a row of one model, with their columns.
fn cells_of<'o>(
    overview: &'o Overview<'_>,
    row: usize,
    model: Model,
) -> impl Iterator<Item = (usize, &'o Cell<'o>)> {
    let cells = overview.rows[row].cells.iter().enumerate();
    let cells = cells.filter_map(|(column, cell)| Some((column, cell.as_ref()?)));
    cells.filter(move |(_, cell)| cell.summary.model == model)
}

/// The rows that lead on the most datasets.
fn winners_of(overview: &Overview<'_>, model: Model) -> Vec<usize> {
    let wins = |row: usize| {
        let cells = cells_of(overview, row, model);
        cells.filter(|(_, cell)| cell.rank == Some(1)).count()
    };
    let wins: Vec<usize> = (0..overview.rows.len()).map(wins).collect();
    let most = wins.iter().copied().max().unwrap_or(0).max(1);
    (0..wins.len()).filter(|&row| wins[row] == most).collect()
}

/// The rows that lead on the most datasets; on how many of these the lead is shared, and on how many it is certain.
fn headline(content: &Content, overview: &Overview<'_>, model: Model, of: &str) -> Option<Value> {
    let cells = |i: usize| cells_of(overview, i, model);
    let rivals = || (0..overview.rows.len()).filter(|&i| cells(i).next().is_some());
    let winners = winners_of(overview, model);
    let first = |i: usize| cells(i).filter(|(_, cell)| cell.rank == Some(1));
    let most = first(*winners.first()?).count();
    let labels: Vec<&str> = (winners.iter().map(|&i| &*overview.rows[i].label)).collect();
    let names = names_or_count(&labels, rivals().count());
    let won: BTreeSet<usize> = (winners.iter())
        .flat_map(|&i| first(i).map(|(column, _)| column))
        .collect();
    let is_shared = |column: &&usize| {
        let leads = |i: &usize| first(*i).any(|(its, _)| its == **column);
        rivals().filter(leads).count() > 1
    };
    let is_certain = |column: &&usize| {
        let dataset = overview.datasets[**column];
        let mut leads = (content.leads.iter())
            .filter(|lead| lead.dataset == dataset && lead.model == model)
            .peekable();
        leads.peek().is_some() && leads.all(|lead| lead.difference.is_certain)
    };
    let (shared, certain) = (
        won.iter().filter(is_shared).count(),
        won.iter().filter(is_certain).count(),
    );
    let columns: BTreeSet<usize> = rivals().flat_map(cells).map(|(column, _)| column).collect();
    let only = columns.first().filter(|_| columns.len() == 1);
    let only = only.map(|&column| overview.datasets[column]);
    Some(context! {
        names, several => winners.len() > 1, of, most, datasets => columns.len(), only,
        won => won.len(), shared, certain,
    })
}

/// What is compared, counted or named: `8 matchers with 3 estimators`, `8 matchers with ransac-e`.
fn compared(summaries: &[Summary]) -> String {
    let count = |get: fn(&Summary) -> &str, what: &str| {
        let names: BTreeSet<&str> = summaries.iter().map(get).collect();
        match names.first() {
            Some(&only) if names.len() == 1 => (!only.is_empty()).then(|| only.to_owned()),
            _ => Some(format!("{} {what}", names.len())),
        }
    };
    let counts = [
        count(|s| &s.matcher, "matchers"),
        count(|s| &s.estimator, "estimators"),
    ];
    counts
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
        .join(" with ")
}

/// The switches, the highest mean AUC first.
fn legend(overview: &Overview<'_>) -> Vec<Value> {
    let mut rows: Vec<&Row<'_>> = overview.rows.iter().collect();
    let mean = |row: &Row<'_>| {
        let values: Vec<f64> = (row.cells.iter().flatten())
            .filter_map(|cell| cell.auc.value)
            .collect();
        values.iter().sum::<f64>() / values.len().max(1) as f64
    };
    rows.sort_by(|one, other| mean(other).total_cmp(&mean(one)));
    (rows.into_iter())
        .map(|row| {
            let sample = Value::from_safe_string(legend_sample(row.series));
            context! { label => &row.label, series => row.series, estimator => row.estimator, sample }
        })
        .collect()
}

/// If there are more curves than can be told apart: the estimators whose curves can be shown alone, and the one
/// that the page shows first, which is that of the headline.
fn presets(overview: &Overview<'_>) -> Option<Value> {
    if overview.subject != Subject::Both {
        return None;
    }
    let mut winners = [Model::Pose, Model::Homography].into_iter();
    let first = winners.find_map(|model| winners_of(overview, model).first().copied());
    let opening = first
        .filter(|_| overview.rows.len() > MAX_CURVES)
        .map(|row| overview.rows[row].estimator);
    let estimators: Vec<Value> = overview
        .estimators
        .iter()
        .map(|id| Value::from(*id))
        .collect();
    Some(context! { estimators, opening })
}

fn curves(overview: &Overview<'_>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .map(|(column, dataset)| {
            let panels: Vec<Value> = ANGLES
                .into_iter()
                .filter_map(|(name, angle)| {
                    let svg = sp_figure(overview, column, angle, Target::Page)?;
                    Some(context! { name, svg => Value::from_safe_string(svg) })
                })
                .collect();
            context! { dataset => *dataset, basis => overview.basis(column), panels }
        })
        .collect()
}

/// The datasets with their pictures.
fn gallery(content: &Content) -> Vec<Value> {
    (content.datasets.iter())
        .map(|dataset| {
            let image = dataset.thumbnail.as_ref().map(data_url);
            context! {
                name => &dataset.name,
                portion => dataset.portion.name(),
                frames => dataset.frames,
                pairs => dataset.pairs_of(content.scored_pairs(&dataset.name)),
                size => dataset.size(),
                origin => &dataset.origin,
                property => &dataset.property,
                image => image.map(Value::from_safe_string),
            }
        })
        .collect()
}

/// The paper's panels of AP bars, if there are several datasets.
fn panels(overview: &Overview<'_>) -> Vec<Value> {
    let several = overview.datasets.len() > 1;
    (Portion::ALL.into_iter())
        .filter(|_| several)
        .filter_map(|portion| {
            let svg = ap_panel_figure(overview, portion, portion.name(), Target::Page)?;
            let name = match portion {
                Portion::Fragments => "Fragments",
                Portion::Other => "Other pairs",
            };
            Some(context! { dataset => name, basis => "", svg => Value::from_safe_string(svg) })
        })
        .collect()
}

fn bars(overview: &Overview<'_>) -> Vec<Value> {
    figures(overview, |column| ap_figure(overview, column, Target::Page))
}

fn accuracies(overview: &Overview<'_>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .filter_map(|(column, dataset)| {
            let svg = accuracy_figure(overview, column, Target::Page)?;
            let (svg, basis) = (
                Value::from_safe_string(svg),
                accuracy_basis(overview, column),
            );
            Some(context! { dataset => *dataset, basis, svg })
        })
        .collect()
}

/// One figure for each dataset that has one.
fn figures(overview: &Overview<'_>, draw: impl Fn(usize) -> Option<String>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .filter_map(|(column, dataset)| {
            let svg = Value::from_safe_string(draw(column)?);
            Some(context! { dataset => *dataset, basis => overview.basis(column), svg })
        })
        .collect()
}

/// The figures of accuracy against time, and what is to be said of the times.
fn scatters(content: &Content, overview: &Overview<'_>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .filter_map(|(column, dataset)| {
            let svg = time_figure(content, overview, column, Target::Page)?;
            Some(context! {
                dataset => *dataset,
                basis => overview.basis(column),
                svg => Value::from_safe_string(svg),
                about_times => about_times(content, overview, column),
            })
        })
        .collect()
}

/// Matchers by estimators: the mean over all datasets, then each. Poses and homographies apart.
fn estimators(summaries: &[Summary], overview: &Overview<'_>) -> Vec<Value> {
    let models = [Model::Pose, Model::Homography];
    let figure = |name: &str, basis: String, dataset, model| {
        let svg = estimator_figure(summaries, dataset, model, Target::Page)?;
        Some(context! { dataset => name, basis, svg => Value::from_safe_string(svg) })
    };
    let means = models.into_iter().filter_map(|model| {
        let of_model = summaries.iter().filter(|s| s.model == model);
        let datasets: BTreeSet<&str> = of_model.map(|s| &*s.dataset).collect();
        let name = match model {
            _ if datasets.len() < 2 => return None,
            _ if datasets.len() == overview.datasets.len() => "Mean over all datasets",
            Model::Pose => "Mean over all datasets with poses",
            Model::Homography => "Mean over all datasets with homographies",
        };
        let basis = match model {
            Model::Pose => String::new(),
            Model::Homography => "AUC at 3 px".to_owned(),
        };
        figure(name, basis, None, model)
    });
    let each = (overview.datasets.iter().enumerate())
        .flat_map(|(column, dataset)| models.map(|model| (column, *dataset, model)))
        .filter_map(|(column, dataset, model)| {
            let basis = overview.basis_of(column, model);
            figure(dataset, basis, Some(dataset), model)
        });
    means.chain(each).collect()
}

/// Names of a row, and its numbers as text.
fn row(summary: &Summary, cells: Vec<String>) -> Value {
    context! {
        dataset => &summary.dataset,
        matcher => &summary.matcher,
        estimator => &summary.estimator,
        cells,
    }
}

/// Heads of the table of all scores: each score, followed by its interval.
fn score_heads(shown: &[&ScoreKind]) -> Vec<&'static str> {
    let heads = |kind: &&ScoreKind| {
        if kind.has_interval() {
            vec![kind.heading, "95 % interval"]
        } else {
            vec![kind.heading]
        }
    };
    shown.iter().flat_map(heads).collect()
}

fn scores(s: &Summary, shown: &[&ScoreKind]) -> Value {
    let cells = |kind: &&ScoreKind| {
        let score = s.scores.get(kind.id);
        let number = |value: Option<f64>| numbers::score(kind.notation, value);
        let mut cells = vec![number(score.value)];
        if kind.has_interval() {
            cells.push(interval(&score, number));
        }
        cells
    };
    row(s, shown.iter().flat_map(cells).collect())
}

#[cfg(test)]
mod tests;
