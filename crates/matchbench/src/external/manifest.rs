//! `name.toml`: how a matcher from outside is started and what it is called.
//!
//! ```toml
//! name = "aliked-lightglue"                      # its id in tables
//! summary = "ALIKED-n16 and LightGlue"
//! reference = "..."                              # the paper
//! command = ["python3", "aliked_lightglue.py"]   # started in the folder of the manifest
//! kind = "matches"                               # or "features"; default "matches"
//! estimator = "best"                             # default: ransac-e
//! timeout_s = 60                                 # a pair or an image; default 60
//! start_timeout_s = 300                          # until it is ready; default 300
//! workers = 1                                    # processes at once; default 1
//!
//! [matching]                                     # kind = "features" alone
//! ratio = 0.8                                    # ratio test; default: none
//! mutual = true                                  # mutual check; default: true unless `ratio` is given
//! hamming = false                                # descriptors are bits in bytes; default: real values
//!
//! [params]                                       # handed to the child, which refuses unknown ones
//! max_keypoints = 2048
//! ```
//!
//! An unknown key is an error, except in `params`, which belong to the child.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::config::{find, from_toml, readable};
use crate::front_door::SETTINGS;

/// The only key of a setting that is not a parameter of the child.
const MATCHING: &str = "matching";
/// Longest file that is read as a manifest, in bytes.
const LONGEST: u64 = 1 << 20;
/// Longest time that can be waited for, in seconds: a day.
const LONGEST_WAIT: f64 = 86_400.0;
/// Most processes of one matcher.
const MAX_WORKERS: usize = 64;

/// How a matcher from outside is started and what it is called.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifest {
    /// The file, absolute.
    pub path: PathBuf,
    /// Id in tables, records and on the command line.
    pub name: String,
    /// What it is, in a few words.
    pub summary: String,
    /// The paper.
    pub reference: String,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// What it answers.
    pub kind: Kind,
    /// Id of the estimator that it is run with unless another is asked for.
    pub estimator: Option<String>,
    /// How long an answer may take.
    pub timeout: Duration,
    /// How long it may take to get ready.
    pub start_timeout: Duration,
    /// Most processes at once.
    pub workers: usize,
    /// Parameters of the child.
    pub params: Map<String, Value>,
}

/// What a matcher from outside answers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Matches of a pair of images.
    Matches,
    /// Keypoints and descriptors of an image; the search is native.
    Features(Matching),
}

/// How described features are matched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Matching {
    /// Largest ratio of nearest to second nearest distance; `None` for no such test.
    #[serde(default)]
    pub ratio: Option<f32>,
    /// Whether each feature must be the other's nearest. Default: if there is no `ratio`.
    #[serde(default)]
    pub mutual: Option<bool>,
    /// Whether descriptors are bits packed into bytes, compared by Hamming distance.
    #[serde(default)]
    pub hamming: bool,
}

impl Matching {
    /// Whether the mutual check is made.
    pub fn is_mutual(&self) -> bool {
        self.mutual.unwrap_or(self.ratio.is_none())
    }
}

/// What is built in, which a manifest may name or must not be called.
#[derive(Clone, Debug, Default)]
pub struct BuiltIn {
    /// Ids of matchers.
    pub matchers: Vec<&'static str>,
    /// Ids of estimators.
    pub estimators: Vec<&'static str>,
}

impl BuiltIn {
    /// Whether nothing from outside may have this name.
    pub fn takes(&self, name: &str) -> bool {
        let mut ids = self.matchers.iter().chain(&self.estimators);
        name == "all" || ids.any(|id| *id == name)
    }
}

/// A manifest that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{}: {what}; {remedy}", .file.display(), .line.map(|n| format!(":{n}")).unwrap_or_default())]
pub struct ManifestError {
    /// The manifest.
    pub file: PathBuf,
    /// The line in it, counted from 1, where there is one.
    pub line: Option<usize>,
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub remedy: String,
}

/// The file as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    name: toml::Spanned<String>,
    #[serde(default)]
    summary: String,
    #[serde(default)]
    reference: String,
    command: toml::Spanned<toml::Value>,
    #[serde(default)]
    kind: KindName,
    estimator: Option<toml::Spanned<String>>,
    #[serde(default = "one_minute")]
    timeout_s: toml::Spanned<f64>,
    #[serde(default = "five_minutes")]
    start_timeout_s: toml::Spanned<f64>,
    #[serde(default = "one")]
    workers: toml::Spanned<usize>,
    matching: Option<toml::Spanned<Matching>>,
    #[serde(default)]
    params: toml::Table,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum KindName {
    #[default]
    Matches,
    Features,
}

impl Manifest {
    /// Whether `name`, given where the id of a matcher can stand, is the path of a manifest.
    pub fn is_path(name: &str) -> bool {
        Path::new(name)
            .extension()
            .is_some_and(|extension| extension == "toml")
            || name.contains(['/', '\\'])
    }

    /// Reads the manifest at `path`. Its own name cannot be one that is `built_in`: `--set` and records could
    /// not tell them apart.
    ///
    /// # Errors
    /// If the file cannot be read or says something that cannot be.
    pub fn read(path: &Path, built_in: &BuiltIn) -> Result<Self, ManifestError> {
        let path = std::path::absolute(path).map_err(|error| io_error(path, &error.to_string()))?;
        let about = fs::metadata(&path).map_err(|error| io_error(&path, &error.to_string()))?;
        if !about.is_file() || about.len() > LONGEST {
            return Err(io_error(
                &path,
                "this is no manifest but another kind of file",
            ));
        }
        let text =
            fs::read_to_string(&path).map_err(|error| io_error(&path, &error.to_string()))?;
        Self::parse(&path, &text, built_in)
    }

    /// The manifest with this `text`, as if it stood at the absolute `path`.
    ///
    /// # Errors
    /// If it says something that cannot be.
    pub fn parse(path: &Path, text: &str, built_in: &BuiltIn) -> Result<Self, ManifestError> {
        let source = Source { path, text };
        let file: Text = toml::from_str(text).map_err(|error| {
            let remedy = "correct this line; docs/matchers.md shows all keys";
            let what = readable(&error.message().replace('\n', ", "));
            source.error(error.span().map(|span| span.start), what, remedy)
        })?;
        source.check_name(&file.name, built_in)?;
        let command = source.command(&file.command)?;
        if let Some(estimator) = &file.estimator {
            let known = find(
                "estimator",
                &built_in.estimators,
                |id| id,
                estimator.get_ref(),
            );
            let at = Some(estimator.span().start);
            known.map_err(|what| source.error(at, what.to_string(), "correct this line"))?;
        }
        let timeout = source.seconds("timeout_s", &file.timeout_s)?;
        let start_timeout = source.seconds("start_timeout_s", &file.start_timeout_s)?;
        let workers = *file.workers.get_ref();
        if !(1..=MAX_WORKERS).contains(&workers) {
            let what = format!("`workers` is {workers}");
            let remedy = format!("give a number from 1 to {MAX_WORKERS}");
            return Err(source.error(Some(file.workers.span().start), what, remedy));
        }
        let kind = match (file.kind, file.matching) {
            (KindName::Matches, None) => Kind::Matches,
            (KindName::Matches, Some(matching)) => {
                let what = "`matching` is given, but the child answers matches";
                let remedy = "write kind = \"features\", or leave the table out";
                return Err(source.error(Some(matching.span().start), what, remedy));
            }
            (KindName::Features, matching) => {
                let at = matching.as_ref().map(|matching| matching.span().start);
                let matching = matching.map(toml::Spanned::into_inner).unwrap_or_default();
                (matching.check()).map_err(|(what, remedy)| source.error(at, what, remedy))?;
                Kind::Features(matching)
            }
        };
        let params = from_toml("params", toml::Value::Table(file.params)).map_err(|what| {
            let remedy = "write numbers that are finite, strings, booleans, lists and tables";
            source.error(None, what, remedy)
        })?;
        let Value::Object(params) = params else {
            unreachable!("a table becomes an object")
        };
        if params.contains_key(MATCHING) {
            let remedy = "give it another name";
            let what = "a parameter cannot be called `matching`: that is the table beside it";
            return Err(source.error(None, what, remedy));
        }
        Ok(Self {
            path: path.into(),
            name: file.name.into_inner(),
            summary: file.summary,
            reference: file.reference,
            command,
            kind,
            estimator: file.estimator.map(toml::Spanned::into_inner),
            timeout,
            start_timeout,
            workers,
            params,
        })
    }

    /// The same matcher with some parameters changed: `changes` is an object like `params`, merged
    /// into it at every depth; for features its key `matching` changes that table.
    ///
    /// # Errors
    /// If `changes` is no object, or names something of `matching` that is not there or out of range.
    pub fn with(mut self, changes: &Value) -> Result<Self, ManifestError> {
        let path = self.path.clone();
        let refused = |what: String, remedy: &str| ManifestError {
            file: path.clone(),
            line: None,
            what,
            remedy: remedy.into(),
        };
        let Value::Object(changes) = changes else {
            let what = format!("expected parameters like {{\"name\": value}}, found {changes}");
            return Err(refused(
                what,
                &format!("give {}", SETTINGS.with("NAME.KEY=VALUE")),
            ));
        };
        let mut changes = changes.clone();
        if let Kind::Features(matching) = &mut self.kind
            && let Some(change) = changes.remove(MATCHING)
        {
            let mut table = serde_json::to_value(*matching).expect("plain numbers");
            merge(&mut table, change);
            *matching = serde_json::from_value(table).map_err(|error| {
                refused(
                    format!(
                        "{SETTINGS} {}.matching: {}",
                        self.name,
                        readable(&error.to_string())
                    ),
                    "correct this setting",
                )
            })?;
            matching
                .check()
                .map_err(|(what, remedy)| refused(what, remedy))?;
        }
        let mut params = Value::Object(self.params);
        merge(&mut params, Value::Object(changes));
        let Value::Object(params) = params else {
            unreachable!("an object merged into an object")
        };
        Ok(Self { params, ..self })
    }

    /// The folder that the child is started in.
    pub(super) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new("/"))
    }

    /// The command, as far as the results depend on it. A program with an absolute path is known by its name alone,
    /// since on another machine it may be installed elsewhere; all else is as it is written.
    pub fn started(&self) -> Vec<String> {
        let mut command = self.command.clone();
        if let [program, ..] = &mut command[..]
            && let path = Path::new(&*program)
            && path.is_absolute()
            && let Some(name) = path.file_name().and_then(OsStr::to_str)
        {
            *program = name.to_owned();
        }
        command
    }

    /// Everything that the results depend on, besides the command and what the child says of itself.
    pub fn effective(&self) -> Value {
        let mut all = self.params.clone();
        if let Kind::Features(matching) = &self.kind {
            let matching = crate::config::to_json(matching);
            all.insert(MATCHING.into(), matching);
        }
        Value::Object(all)
    }
}

impl Matching {
    fn check(&self) -> Result<(), (String, &'static str)> {
        match self.ratio {
            Some(ratio) if !(ratio > 0.0 && ratio <= 1.0) => Err((
                format!("`ratio` is {ratio}"),
                "give a number above 0 and at most 1",
            )),
            _ => Ok(()),
        }
    }
}

/// A manifest's text, to say where something is wrong in it.
struct Source<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Source<'_> {
    fn error(
        &self,
        byte: Option<usize>,
        what: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ManifestError {
        let line = |byte: usize| {
            let before = self.text.bytes().take(byte);
            before.filter(|&byte| byte == b'\n').count() + 1
        };
        ManifestError {
            file: self.path.into(),
            line: byte.map(line),
            what: what.into(),
            remedy: remedy.into(),
        }
    }

    fn check_name(
        &self,
        name: &toml::Spanned<String>,
        built_in: &BuiltIn,
    ) -> Result<(), ManifestError> {
        let (at, name) = (Some(name.span().start), name.get_ref());
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if name.is_empty() || name.len() > 64 || !name.chars().all(plain) || name.starts_with('-') {
            let what = format!("`{name}` cannot be the name of a matcher");
            let remedy = "use up to 64 lower-case letters, digits and dashes, as in `aliked-n16`";
            return Err(self.error(at, what, remedy));
        }
        if built_in.takes(name) {
            let what = format!("`{name}` is taken by what is built in");
            return Err(self.error(at, what, "choose another name"));
        }
        Ok(())
    }

    /// The program and its arguments.
    fn command(&self, given: &toml::Spanned<toml::Value>) -> Result<Vec<String>, ManifestError> {
        let texts = |list: &Vec<toml::Value>| -> Option<Vec<String>> {
            let texts = list.iter().map(|text| text.as_str().map(str::to_owned));
            texts.collect()
        };
        let what = match given.get_ref().as_array().and_then(texts) {
            Some(command) if command.iter().any(|part| part.contains('\0')) => {
                "`command` has a NUL, which no argument can have"
            }
            Some(command) if command.first().is_some_and(|program| !program.is_empty()) => {
                return Ok(command);
            }
            Some(_) => "`command` names no program",
            None => "`command` is not a list of texts, the program and its arguments",
        };
        let remedy = "write it as in command = [\"python3\", \"matcher.py\"]";
        Err(self.error(Some(given.span().start), what, remedy))
    }

    fn seconds(&self, key: &str, value: &toml::Spanned<f64>) -> Result<Duration, ManifestError> {
        let seconds = *value.get_ref();
        if seconds > 0.0 && seconds <= LONGEST_WAIT {
            return Ok(Duration::from_secs_f64(seconds));
        }
        let what = format!("`{key}` is {seconds}");
        let remedy = format!("give seconds, above 0 and at most {LONGEST_WAIT}");
        Err(self.error(Some(value.span().start), what, remedy))
    }
}

fn io_error(path: &Path, what: &str) -> ManifestError {
    ManifestError {
        file: path.into(),
        line: None,
        what: what.into(),
        remedy: "give the path of a manifest like `adapters/opencv/sift.toml`".into(),
    }
}

/// Objects are merged key by key; everything else is replaced.
fn merge(value: &mut Value, change: Value) {
    match (value, change) {
        (Value::Object(value), Value::Object(change)) => {
            for (key, change) in change {
                merge(value.entry(key).or_insert(Value::Null), change);
            }
        }
        (value, change) => *value = change,
    }
}

fn one_minute() -> toml::Spanned<f64> {
    toml::Spanned::new(0..0, 60.0)
}

fn five_minutes() -> toml::Spanned<f64> {
    toml::Spanned::new(0..0, 300.0)
}

fn one() -> toml::Spanned<usize> {
    toml::Spanned::new(0..0, 1)
}

#[cfg(test)]
mod tests;
