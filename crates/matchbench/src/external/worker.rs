//! One child process that speaks the protocol. It is asked one thing at a time, and every answer is
//! checked.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::log::{Log, told};
use super::manifest::Manifest;
use super::message::{Answer, PROTOCOL, Request, Subject};
use super::process::{Heard, LONGEST_LINE, Outlived, Process, Silence};
use crate::matchers::Cancel;

/// Letters of a name or version.
const LONGEST_NAME: usize = 200;

/// Why there is no child where whoever starts it was stopped.
const STOPPED: &str = "it was stopped before it was ready";

/// What a child says of itself: part of the plan of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// What it is.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Where it puts the centre of the first pixel: 0 or 0.5.
    pub pixel_center: f32,
}

/// A child that is ready.
pub(super) struct Worker {
    process: Process,
    identity: Identity,
    timeout: Duration,
}

/// Why a question has no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// The child says that it cannot, or cannot be asked or heard; it can go on.
    Said(String),
    /// The child does not keep to the protocol; it has to go.
    Broke(String),
}

impl Fault {
    /// An answer of another kind.
    pub(super) fn unasked() -> Self {
        Self::Broke("it answers something that was not asked for".into())
    }
}

impl From<String> for Fault {
    /// What is wrong with an answer.
    fn from(wrong: String) -> Self {
        Self::Broke(wrong)
    }
}

impl Worker {
    /// Starts a child and waits until it is ready, unless `cancel` is set before.
    ///
    /// # Errors
    /// If it does not get ready, in words.
    pub(super) fn start(
        manifest: &Manifest,
        log: &Log,
        outlived: &Outlived,
        cancel: &Cancel,
    ) -> Result<Self, String> {
        if cancel.is_set() {
            return Err(STOPPED.into());
        }
        let mut process = Process::start(&manifest.command, manifest.folder(), log, outlived)?;
        let hello = Request::Hello {
            protocol: PROTOCOL,
            params: &manifest.params,
        };
        process.send(hello.to_line()?);
        let start = Instant::now();
        let deadline = start + manifest.start_timeout;
        match greeting(&mut process, deadline, manifest, cancel) {
            Ok(identity) => Ok(Self {
                process,
                identity,
                timeout: manifest.timeout,
            }),
            Err(Problem::Refused(reason)) => {
                Err(format!("it refuses its parameters: {}", stated(&reason)))
            }
            Err(Problem::Wrong(wrong)) => Err(format!("{wrong} ({})", process.kill())),
        }
    }

    /// What it says of itself.
    pub(super) fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Asks; returns the answer to this very request, and the seconds until it came.
    pub(super) fn ask(&mut self, request: Request<'_>) -> Result<(Answer, f64), Fault> {
        // A path that cannot be written down is no fault of the child.
        let line = request.to_line().map_err(Fault::Said)?;
        if self.process.has_spoken() {
            return Err(Fault::Broke("it answered before it was asked".into()));
        }
        let start = Instant::now();
        self.process.send(line);
        // A question that was asked is answered, also where the run is stopped.
        let never = Cancel::default();
        let deadline = start + self.timeout;
        let wrong = match hear(&mut self.process, deadline, self.timeout, &never) {
            Err(wrong) => wrong,
            Ok(answer) => match (answer.subject(), answer) {
                (Some(subject), Answer::Failed { reason, .. }) if request.is_about(&subject) => {
                    return Err(Fault::Said(stated(&reason)));
                }
                (Some(subject), answer) if request.is_about(&subject) => {
                    return Ok((answer, start.elapsed().as_secs_f64()));
                }
                (Some(Subject::Pair([a, b])), _) => {
                    format!("it answers for pair {a} {b}, which is not the one that was asked for")
                }
                (Some(Subject::Image(image)), _) => {
                    let image = told(image.as_bytes());
                    format!("it answers for {image}, which is not what was asked for")
                }
                (None, _) => "it answers something that was not asked for".into(),
            },
        };
        Err(Fault::Broke(wrong))
    }

    /// Ends it because it broke; says how it ended.
    pub(super) fn kill(self) -> String {
        self.process.kill()
    }

    /// Asks it to go; it has until it is dropped, and a little longer.
    pub(super) fn say_goodbye(&mut self) {
        let bye = Request::Bye.to_line().expect("it has no path");
        self.process.say_goodbye(bye);
    }
}

enum Problem {
    Refused(String),
    Wrong(String),
}

fn greeting(
    process: &mut Process,
    deadline: Instant,
    manifest: &Manifest,
    cancel: &Cancel,
) -> Result<Identity, Problem> {
    let answer = hear(process, deadline, manifest.start_timeout, cancel).map_err(Problem::Wrong)?;
    let (protocol, name, version, pixel_center) = match answer {
        Answer::Ready {
            protocol,
            name,
            version,
            pixel_center,
        } => (protocol, name, version, pixel_center),
        Answer::Refused { reason } => return Err(Problem::Refused(reason)),
        _ => return Err(Problem::Wrong("it answers before it is ready".into())),
    };
    let wrong = |what: String| Err(Problem::Wrong(what));
    if protocol != PROTOCOL {
        return wrong(format!("it speaks protocol {protocol}, not {PROTOCOL}"));
    }
    if pixel_center != 0.0 && pixel_center != 0.5 {
        return wrong(format!(
            "its `pixel_center` is {pixel_center}, not 0 or 0.5"
        ));
    }
    for (what, text) in [("name", &name), ("version", &version)] {
        let plain = text.len() <= LONGEST_NAME && !text.chars().any(char::is_control);
        if text.is_empty() || !plain {
            return wrong(format!("its `{what}` is empty, too long or not printable"));
        }
    }
    Ok(Identity {
        name,
        version,
        pixel_center,
    })
}

/// The reason that the child gives, fit to be shown.
fn stated(reason: &str) -> String {
    match told(reason.as_bytes()) {
        none if none.is_empty() => "it gives no reason".into(),
        reason => reason,
    }
}

/// The next answer, or why there is none.
fn hear(
    process: &mut Process,
    deadline: Instant,
    timeout: Duration,
    cancel: &Cancel,
) -> Result<Answer, String> {
    match process.hear(deadline, cancel) {
        Ok(Heard::Message(message)) => parse(&message),
        Ok(Heard::Flood) => Err(format!("it wrote a line of more than {LONGEST_LINE} bytes")),
        Err(Silence::Timeout) => Err(format!("no answer within {} s", timeout.as_secs_f64())),
        Err(Silence::Closed) => Err("it ended without an answer".into()),
        Err(Silence::Stopped) => Err(STOPPED.into()),
    }
}

fn parse(message: &Value) -> Result<Answer, String> {
    Answer::deserialize(message).map_err(|error| {
        let what = told(error.to_string().as_bytes());
        format!("its answer is not one of protocol {PROTOCOL}: {what}")
    })
}
