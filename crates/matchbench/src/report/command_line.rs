//! Commands as they are typed: the arguments that ask again for what the plan of a run describes.
//!
//! Seeds belong to tasks. So one matcher with one estimator on one dataset, if it is run alone, gets the same
//! records as in a run with others. A parameter of the plan that is not the default of this version is given by
//! `--set`, everything else by the option that it came from. So plans of earlier versions must be modernized first
//! ([`Plan::modernized`]). Words with special characters are quoted for the
//! shell, since names come from plans and datasets of anybody.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde_json::Value;

use super::names::defaults;
use crate::config::{parse_value, together};
use crate::matchers::MATCHERS;
use crate::protocols::{self, EstimatorRule, MATCHBENCH, Protocol, without_protocol};
use crate::records::{DatasetPlan, EstimatorPlan, IN_PYTHON, MatcherPlan, Plan};

/// A command: its words, the program's first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct CommandLine(Vec<String>);

impl CommandLine {
    /// `matchbench` with these words.
    pub(super) fn new<W: Into<String>>(words: impl IntoIterator<Item = W>) -> Self {
        let words = words.into_iter().map(Into::into);
        Self(
            [String::from("matchbench")]
                .into_iter()
                .chain(words)
                .collect(),
        )
    }

    fn push(&mut self, option: &str, value: impl Into<String>) {
        self.0.extend([option.to_owned(), value.into()]);
    }
}

impl fmt::Display for CommandLine {
    /// As it is typed in a shell.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<String> = self.0.iter().map(|word| shell_word(word)).collect();
        f.write_str(&words.join(" "))
    }
}

/// A word of a command line as a shell takes it, in quotes where it needs them.
pub fn shell_word(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-+@%=:,./".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// A folder of this name, as no program takes it for an option.
pub(super) fn folder(name: &str) -> String {
    if name.starts_with('-') {
        format!("./{name}")
    } else {
        name.to_owned()
    }
}

/// The source of the matches, as far as a plan can tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// A matcher of this program.
    Native,
    /// Files of another tool.
    Files,
    /// A program with a manifest.
    Outside,
    /// Code in Python, in the process of the run.
    Python,
}

impl Origin {
    /// Where the matches of a planned matcher come from.
    pub(super) fn of(matcher: &MatcherPlan) -> Self {
        match (&matcher.extraction, &matcher.version) {
            (Some(_), _) => Self::Native,
            (None, None) => Self::Files,
            _ if matcher.notes.iter().any(|note| note == IN_PYTHON) => Self::Python,
            (None, Some(_)) => Self::Outside,
        }
    }
}

/// The command that runs a planned matcher with one of its estimators on one dataset, into the folder `out`.
/// `None` if no command can do that: the plan is that of a shard, or an estimator is not part of this program.
pub(super) fn cell(
    plan: &Plan,
    dataset: &DatasetPlan,
    (matcher, estimator): (&MatcherPlan, &EstimatorPlan),
    out: &str,
) -> Option<CommandLine> {
    let variant = Variant::of(matcher, estimator)?;
    let protocols = variant.protocols();
    let estimators = [variant.id.to_owned()];
    run(
        plan,
        &[dataset],
        &[matcher],
        (&estimators, &protocols),
        variant.settings(),
        out,
    )
}

/// The command that runs everything that is planned on these datasets. `None` if no single command can do that.
pub(super) fn whole(plan: &Plan, datasets: &[&DatasetPlan], out: &str) -> Option<CommandLine> {
    let matchers: Vec<&MatcherPlan> = plan.matchers_on(datasets.first()?).collect();
    if !(datasets.iter()).all(|dataset| plan.matchers_on(dataset).eq(matchers.iter().copied())) {
        return None;
    }
    let variants = (matchers.iter())
        .flat_map(|matcher| (matcher.estimators.iter()).map(move |e| Variant::of(matcher, e)))
        .collect::<Option<Vec<_>>>()?;
    let mut protocols: Vec<&'static Protocol> = Vec::new();
    for variant in &variants {
        if !(protocols.iter()).any(|known| known.id == variant.protocol.id) {
            protocols.push(variant.protocol);
        }
    }
    let mut first: Vec<String> = Vec::new();
    for variant in &variants {
        if variant.matcher.id == matchers.first()?.id && !first.iter().any(|id| id == variant.id) {
            first.push(variant.id.to_owned());
        }
    }
    let estimators = [Vec::new(), first]
        .into_iter()
        .find(|names| (matchers.iter()).all(|matcher| runs_with(matcher, names, &protocols)))?;
    if protocols.len() == 1 && variants.iter().any(|variant| variant.protocols().len() > 1) {
        protocols.insert(0, &MATCHBENCH);
    }
    // One estimator has one set of parameters in a command.
    let mut settings = Given::new();
    for variant in &variants {
        for (name, value) in variant.settings() {
            if settings.get(&name).is_some_and(|known| *known != value) {
                return None;
            }
            settings.insert(name, value);
        }
    }
    let agrees = |variant: &Variant<'_>| {
        let its = format!("{}.", variant.id);
        (settings
            .iter()
            .filter_map(|(name, value)| Some((name.strip_prefix(&its)?, value))))
        .all(|(path, value)| at(&variant.estimator.params, path) == Some(value))
    };
    if !variants.iter().all(agrees) {
        return None;
    }
    run(
        plan,
        datasets,
        &matchers,
        (&estimators, &protocols),
        settings,
        out,
    )
}

/// The command that measures how long the native matchers of a plan take.
pub(super) fn time(plan: &Plan, dataset: &DatasetPlan) -> Option<CommandLine> {
    let native = |matcher: &&MatcherPlan| Origin::of(matcher) == Origin::Native;
    let matchers: Vec<_> = plan.matchers_on(dataset).filter(native).collect();
    let ids: Vec<&str> = matchers.iter().map(|matcher| &*matcher.id).collect();
    if ids.is_empty() {
        return None;
    }
    let mut line = CommandLine::new(["time".to_owned(), folder(&dataset.name)]);
    line.push("--matchers", ids.join(","));
    for (name, value) in matchers.iter().flat_map(|matcher| of_matcher(matcher)) {
        line.push("--set", setting(&name, &value));
    }
    Some(line)
}

/// The command that draws a pair with the matches of a planned matcher and the result of one of its estimators,
/// in the first repetition. The two parts are the text before the numbers of the two frames and the text after
/// them. `None` if no command can do that.
pub(super) fn show(
    plan: &Plan,
    dataset: &DatasetPlan,
    (matcher, estimator): (&MatcherPlan, &EstimatorPlan),
) -> Option<[String; 2]> {
    let variant = Variant::of(matcher, estimator)?;
    let mut chosen = CommandLine(Vec::new());
    match Origin::of(matcher) {
        _ if !variant.protocol.is_ours() => return None,
        Origin::Native => chosen.push("--matcher", matcher.id.clone()),
        Origin::Outside => chosen.push("--matcher", format!("{}.toml", matcher.id)),
        Origin::Files => from_files(&[matcher], &[dataset], &mut chosen)?,
        Origin::Python => return None,
    }
    chosen.push("--estimator", variant.id);
    for (name, value) in variant.settings().into_iter().chain(of_matcher(matcher)) {
        chosen.push("--set", setting(&name, &value));
    }
    if plan.settings.seed != 0 {
        chosen.push("--seed", plan.settings.seed.to_string());
    }
    chosen.push("--out", "pair.png");
    let pair = CommandLine::new(["show".to_owned(), folder(&dataset.name)]);
    Some([pair.to_string(), chosen.to_string()])
}

/// `ID.NAME` of parameters, and their values.
type Given = BTreeMap<String, Value>;

/// An estimator as a matcher is planned with it.
struct Variant<'a> {
    matcher: &'a MatcherPlan,
    estimator: &'a EstimatorPlan,
    id: &'a str,
    protocol: &'static Protocol,
}

impl<'a> Variant<'a> {
    fn of(matcher: &'a MatcherPlan, estimator: &'a EstimatorPlan) -> Option<Self> {
        let id =
            (estimator.variant_of.as_deref()).unwrap_or_else(|| without_protocol(&estimator.id));
        defaults(id)?;
        Some(Self {
            matcher,
            estimator,
            id,
            protocol: protocols::of_estimator(&estimator.id),
        })
    }

    /// The protocols to ask for: its own, and also that of the paper if its own alone would resize images that
    /// the run took unchanged.
    fn protocols(&self) -> Vec<&'static Protocol> {
        let size = self.protocol.size.params();
        let resized = size.is_none_or(|size| {
            let (name, size) = (size["extractor"].as_object())
                .and_then(|sizes| sizes.iter().next())
                .expect("a size has a name");
            let params = &self.matcher.params["extractor"];
            Origin::of(self.matcher) != Origin::Native || params.get(name) == Some(size)
        });
        if resized {
            vec![self.protocol]
        } else {
            vec![&MATCHBENCH, self.protocol]
        }
    }

    /// Its parameters that differ from those that its protocol sets.
    fn settings(&self) -> Given {
        let of_protocol = match self.protocol.estimator {
            EstimatorRule::Of { id, params } if id == self.id => Some(params()),
            _ => None,
        };
        let usual = together(defaults(self.id), of_protocol).unwrap_or_default();
        let mut settings = Given::new();
        differences(self.id, &self.estimator.params, &usual, &mut settings);
        settings
    }
}

/// Whether a command that names these estimators and protocols gives a matcher exactly those that it is planned
/// with.
fn runs_with(matcher: &MatcherPlan, names: &[String], protocols: &[&'static Protocol]) -> bool {
    let own = match Origin::of(matcher) {
        Origin::Native => (MATCHERS.iter())
            .find(|entry| entry.id() == matcher.id)
            .map(|entry| entry.estimator()),
        Origin::Files => Some("best"),
        // Its manifest says so. Python has no command.
        Origin::Outside | Origin::Python => None,
    };
    let planned: BTreeSet<&str> = (matcher.estimators.iter()).map(|e| &*e.id).collect();
    let mut given = BTreeSet::new();
    for protocol in protocols {
        let asked = match protocol.estimator {
            EstimatorRule::Of { id, .. } => Some(id),
            EstimatorRule::Own => own,
        };
        match (names, asked) {
            ([], None) => return planned.len() == protocols.len(),
            ([], Some(id)) => drop(given.insert(protocol.name_of(id))),
            (names, _) => given.extend(names.iter().map(|id| protocol.name_of(id))),
        }
    }
    given.iter().map(String::as_str).eq(planned)
}

/// `matchbench run` on these datasets.
fn run(
    plan: &Plan,
    datasets: &[&DatasetPlan],
    matchers: &[&MatcherPlan],
    (estimators, protocols): (&[String], &[&'static Protocol]),
    of_estimators: Given,
    out: &str,
) -> Option<CommandLine> {
    if plan.shard.is_some() {
        return None;
    }
    let folders = datasets.iter().map(|dataset| folder(&dataset.name));
    let mut line = CommandLine::new(["run".to_owned()].into_iter().chain(folders));
    let mut ids: Vec<String> = Vec::new();
    let mut settings = of_estimators;
    let mut files: Vec<&MatcherPlan> = Vec::new();
    for &matcher in matchers {
        match Origin::of(matcher) {
            Origin::Native => ids.push(matcher.id.clone()),
            Origin::Outside => ids.push(format!("{}.toml", matcher.id)),
            Origin::Files => files.push(matcher),
            Origin::Python => return None,
        }
        settings.extend(of_matcher(matcher));
    }
    from_files(&files, datasets, &mut line)?;
    if !ids.is_empty() {
        line.push("--matchers", ids.join(","));
    }
    if !estimators.is_empty() {
        line.push("--estimator", estimators.join(","));
    }
    let ours = protocols.iter().all(|protocol| protocol.is_ours());
    if !ours {
        let ids: Vec<&str> = protocols.iter().map(|protocol| protocol.id).collect();
        line.push("--protocol", ids.join(","));
    }
    for (name, value) in &settings {
        line.push("--set", setting(name, value));
    }
    let chosen = plan.settings;
    for (option, number) in [
        ("--limit", chosen.limit),
        ("--sample", chosen.sample),
        (
            "--time-budget",
            chosen.time_budget_ms.map(|ms| ms.get() as usize),
        ),
    ] {
        if let Some(number) = number {
            line.push(option, number.to_string());
        }
    }
    let repetitions = chosen.repetitions.get();
    if repetitions > 1 || !ours {
        line.push("--repeat", repetitions.to_string());
    }
    line.push("--seed", chosen.seed.to_string());
    line.push("--out", out);
    Some(line)
}

/// Parameters of a matcher that are not its defaults. Of a matcher from outside, whose defaults are not known
/// here, all parameters.
fn of_matcher(matcher: &MatcherPlan) -> Given {
    let mut settings = Given::new();
    match Origin::of(matcher) {
        Origin::Native => {
            if let Some(entry) = MATCHERS.iter().find(|entry| entry.id() == matcher.id) {
                differences(
                    &matcher.id,
                    &matcher.params,
                    &entry.defaults(),
                    &mut settings,
                );
            }
        }
        Origin::Outside => {
            differences(&matcher.id, &matcher.params, &Value::Null, &mut settings);
        }
        Origin::Files | Origin::Python => {}
    }
    settings
}

/// The folder where commands expect the matches of a planned matcher that come from files; it has a folder for each
/// dataset. Plans have no folders of the machine that they were made on.
fn place(matcher: &MatcherPlan) -> String {
    format!("MATCHES/{}", matcher.id)
}

/// The same for one dataset.
pub(super) fn place_of(matcher: &MatcherPlan, dataset: &DatasetPlan) -> String {
    format!("{}/{}", place(matcher), dataset.name)
}

/// Matches from files. For one dataset they are named as the plan has them, each or by their folder; for several, by
/// the folder of all. The options of files are those of all of them: `None` if they are read in different ways.
fn from_files(
    matchers: &[&MatcherPlan],
    of: &[&DatasetPlan],
    line: &mut CommandLine,
) -> Option<()> {
    let mut ways: Vec<(&str, CommandLine)> = Vec::new();
    for matcher in matchers {
        let datasets = matcher.params.get("datasets")?.as_array()?;
        let mut files = Vec::new();
        for dataset in of {
            let its = datasets.iter().find(|its| its["name"] == dataset.name)?;
            ways.push((its["format"].as_str()?, way_of_reading(its)?));
            let folder = place_of(matcher, dataset);
            for file in its["files"].as_array()? {
                files.push(match file["count"].as_u64()? {
                    1 => format!("{folder}/{}", file["name"].as_str()?),
                    _ => folder.clone(),
                });
            }
        }
        let named = match of {
            [_] => files.join(","),
            _ => place(matcher),
        };
        line.push("--matches", format!("{}={named}", matcher.id));
    }
    let Some((format, way)) = ways.first() else {
        return Some(());
    };
    if ways.iter().any(|(_, other)| other != way) {
        return None;
    }
    // Formats are recognised where none is named.
    if ways.iter().all(|(other, _)| other == format) {
        line.push("--matches-format", *format);
    }
    line.0.extend(way.0.iter().cloned());
    Some(())
}

/// The options, but for the format, by which files are read as they were understood.
fn way_of_reading(files: &Value) -> Option<CommandLine> {
    let mut line = CommandLine(Vec::new());
    let center = files["pixel_center"].as_f64()?;
    line.push("--pixel-center", center.to_string());
    if let Some([width, height]) = files["resized"].as_array().map(Vec::as_slice) {
        line.push("--resized", format!("{width}x{height}"));
    }
    if files["verified"] == true {
        line.0.push("--verified".to_owned());
    }
    for (key, value) in files["notes"].as_object().into_iter().flatten() {
        line.push("--note", format!("{key}={}", value.as_str()?));
    }
    Some(line)
}

/// The parameters in `params` that differ from `usual`, as `ID.NAME`. A list is one value.
fn differences(name: &str, params: &Value, usual: &Value, found: &mut Given) {
    match params {
        Value::Object(fields) => {
            for (field, value) in fields {
                let usual = usual.get(field).unwrap_or(&Value::Null);
                differences(&format!("{name}.{field}"), value, usual, found);
            }
        }
        value if value != usual => {
            found.insert(name.to_owned(), value.clone());
        }
        _ => {}
    }
}

/// `ID.NAME=VALUE`, in the form that `--set` reads as this value.
fn setting(name: &str, value: &Value) -> String {
    let plain = value
        .as_str()
        .filter(|text| !text.is_empty() && parse_value(text) == Value::String((*text).to_owned()));
    plain.map_or_else(
        || format!("{name}={value}"),
        |text| format!("{name}={text}"),
    )
}

fn at<'a>(params: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('.')
        .try_fold(params, |value, name| value.get(name))
}

#[cfg(test)]
mod tests;
