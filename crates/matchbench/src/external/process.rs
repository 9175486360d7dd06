//! A child process: it is started in a process group of its own, read by threads, and ended in any case.
//!
//! Three threads serve a child: one writes to its standard input, so that a child that does not read
//! cannot hold the host up; one sorts its standard output into protocol and log; one copies its
//! standard error. The queues between are short, so a child that floods waits for the host.
//!
//! A child ends in one of these ways, and is reaped in all of them:
//!
//! | | |
//! | --- | --- |
//! | the matcher is done | `bye`, standard input closed, [`GRACE`] to go, then killed |
//! | it misbehaves, or the host panics | killed |
//! | whoever starts it is stopped before it is ready | killed |
//! | Ctrl-C once | as done, after the pairs in flight: its group is not the terminal's |
//! | Ctrl-C twice | the command line calls [`end_all`] before it exits; no other is started in its place |
//! | the host is killed | its standard input closes, upon which it has to go |
//!
//! The whole group is killed, so that programs started by the child end too, unless they left it. It is
//! killed before the child is reaped, while its number cannot yet belong to another process.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::io::{BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender, SyncSender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::lines::{self, read_line};
use super::log::{Log, told};
use crate::matchers::Cancel;

/// Longest line of a child, in bytes.
pub(super) const LONGEST_LINE: usize = 1 << 20;
/// Longest line of a log; longer ones are broken.
const LONGEST_LOGGED: usize = 1 << 16;
/// Lines of the protocol that wait to be read.
const WAITING: usize = 16;
/// How long a child may take to go once it is asked to.
const GRACE: Duration = Duration::from_secs(3);
/// U+FEFF in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
/// How often a child that is waited for is looked at.
const LOOK: Duration = Duration::from_millis(200);
/// A look that took so much longer than it was to take: meanwhile this process was stopped.
const PAUSE: Duration = Duration::from_secs(2);
/// How long the last words of a child that has ended are waited for.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// The groups of all children.
static GROUPS: Mutex<Groups> = Mutex::new(Groups {
    alive: BTreeSet::new(),
    ended: 0,
});

struct Groups {
    /// Leaders of those that are alive.
    alive: BTreeSet<u32>,
    /// How many [`Ended`] there are.
    ended: usize,
}

/// The children of a matcher that have ended and are still heard: what they started left their group and holds their
/// output open, which costs threads and descriptors.
#[derive(Clone, Default)]
pub(super) struct Outlived(Arc<Mutex<Vec<Weak<()>>>>);

impl Outlived {
    /// How many they are now.
    pub(super) fn count(&self) -> usize {
        let mut ended = lock(&self.0);
        ended.retain(|threads| threads.strong_count() > 0);
        ended.len()
    }
}

/// A child that is heard line by line; dropping it ends it.
pub(super) struct Process {
    child: Child,
    /// `None` once standard input is to be closed.
    requests: Option<Sender<Vec<u8>>>,
    lines: Receiver<Heard>,
    /// Disconnected when standard error has ended.
    errors: Receiver<()>,
    /// The last line of standard error that was not blank, or an answer that is no JSON, fit to be shown: it may say why
    /// the child ended, or why nothing was heard.
    complaint: Arc<Mutex<String>>,
    /// Until when it may go, once it was asked to.
    grace: Option<Instant>,
    reaped: bool,
    /// Held by the threads that hear it.
    threads: Weak<()>,
    outlived: Outlived,
}

/// What was heard of a child.
#[derive(Debug)]
pub(super) enum Heard {
    /// A JSON object with a `type`.
    Message(Value),
    /// A line above [`LONGEST_LINE`].
    Flood,
}

/// Why nothing was heard.
#[derive(Debug)]
pub(super) enum Silence {
    /// The time was over.
    Timeout,
    /// It closed its standard output, which is what ending looks like, or has ended.
    Closed,
    /// Whoever waits was stopped.
    Stopped,
}

impl Process {
    /// Starts `command` in `folder`.
    ///
    /// # Errors
    /// If the system cannot, in words.
    pub(super) fn start(
        command: &[String],
        folder: &Path,
        log: &Log,
        outlived: &Outlived,
    ) -> Result<Self, String> {
        let [program, arguments @ ..] = command else {
            return Err("the command is empty".into());
        };
        let mut command = Command::new(program_in(folder, program));
        command
            .args(arguments)
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        group::lead(&mut command);
        let mut child = {
            // Held over the start: `end_all` sees this child, or it is not started.
            let mut groups = groups();
            if groups.ended > 0 {
                return Err("all matchers from outside were ended".into());
            }
            let child = (command.spawn())
                .map_err(|error| format!("`{program}` cannot be started: {error}"))?;
            groups.alive.insert(child.id());
            child
        };
        let stdin = child.stdin.take().expect("piped");
        let stdout = child.stdout.take().expect("piped");
        let stderr = child.stderr.take().expect("piped");
        let (requests, to_write) = mpsc::channel();
        let (heard, lines) = mpsc::sync_channel(WAITING);
        let (ended, errors) = mpsc::sync_channel(0);
        let complaint = Arc::default();
        let threads = Arc::new(());
        // From here on the child ends if something fails.
        let process = Self {
            child,
            requests: Some(requests),
            lines,
            errors,
            complaint: Arc::clone(&complaint),
            grace: None,
            reaped: false,
            threads: Arc::downgrade(&threads),
            outlived: outlived.clone(),
        };
        let (out_log, error_log) = (log.clone(), log.clone());
        let unheard = Arc::clone(&complaint);
        serve(move || write_all(stdin, &to_write))?;
        let held = Arc::clone(&threads);
        serve(move || {
            sort(stdout, &heard, &out_log, &unheard);
            drop(held);
        })?;
        serve(move || {
            copy(stderr, &error_log, &complaint, ended);
            drop(threads);
        })?;
        Ok(process)
    }

    /// Sends a line. Whether it arrives shows in the answer.
    pub(super) fn send(&self, mut line: Vec<u8>) {
        line.push(b'\n');
        if let Some(requests) = &self.requests {
            // The other end is gone when the child is: then nothing will be heard either.
            let _ = requests.send(line);
        }
    }

    /// Whether it has said something that nobody has heard yet. One thing of it is lost now, so it is to be ended.
    pub(super) fn has_spoken(&self) -> bool {
        self.lines.try_recv().is_ok()
    }

    /// Waits until `deadline` for the next message, or until `cancel` is set. Time in which this process is stopped does not
    /// count.
    pub(super) fn hear(
        &mut self,
        mut deadline: Instant,
        cancel: &Cancel,
    ) -> Result<Heard, Silence> {
        loop {
            if cancel.is_set() {
                return Err(Silence::Stopped);
            }
            let start = Instant::now();
            let left = deadline.saturating_duration_since(start);
            let heard = self.lines.recv_timeout(left.min(LOOK));
            // A job that is suspended and goes on later is no fault of the child.
            let paused = start.elapsed().saturating_sub(LOOK);
            let paused = Some(paused).filter(|paused| *paused >= PAUSE);
            deadline += paused.unwrap_or_default();
            match heard {
                Ok(heard) => return Ok(heard),
                Err(RecvTimeoutError::Disconnected) => return Err(Silence::Closed),
                Err(RecvTimeoutError::Timeout) if paused.is_some() => {}
                Err(RecvTimeoutError::Timeout) if left <= LOOK => return Err(Silence::Timeout),
                Err(RecvTimeoutError::Timeout) if group::has_ended(&mut self.child) => {
                    // What it started holds its output open: but for what it said last, nothing will come.
                    let last = self.lines.recv_timeout(LAST_WORDS);
                    return last.map_err(|_| Silence::Closed);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Kills it, and says how it ended and what it printed last: `exit status: 1; it printed: ...`.
    pub(super) fn kill(mut self) -> String {
        // One that closed its output is about to end by itself, and its own status says more.
        let by_itself = self.wait_to_end(LAST_WORDS);
        let status = self.end(Duration::ZERO);
        // A program that outlives its group may hold standard error open: not for long.
        let _ = self.errors.recv_timeout(LAST_WORDS);
        let how = match status {
            Some(status) if by_itself => status.to_string(),
            _ => "it was killed".into(),
        };
        match &**lock(&self.complaint) {
            "" => how,
            last => format!("{how}; it last printed: {last}"),
        }
    }

    /// Asks it to go and closes its standard input; when it is dropped, it has what is left of [`GRACE`].
    pub(super) fn say_goodbye(&mut self, bye: Vec<u8>) {
        self.send(bye);
        self.requests = None;
        self.grace = Some(Instant::now() + GRACE);
    }

    /// Waits `grace` for its end, kills what is left of its group, and reaps it.
    fn end(&mut self, grace: Duration) -> Option<ExitStatus> {
        if self.reaped {
            return None;
        }
        self.requests = None;
        self.wait_to_end(grace);
        group::kill(self.child.id());
        // Before it is reaped: afterwards the system may give its process id to another.
        groups().alive.remove(&self.child.id());
        self.reaped = true;
        lock(&self.outlived.0).push(self.threads.clone());
        let _ = self.child.kill();
        self.child.wait().ok()
    }

    /// Whether it has ended within `time`; it is not reaped.
    fn wait_to_end(&mut self, time: Duration) -> bool {
        let deadline = Instant::now() + time;
        loop {
            if group::has_ended(&mut self.child) {
                return true;
            }
            if Instant::now() >= deadline {
                return false;
            }
            thread::sleep(Duration::from_millis(2));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let grace = self.grace.map_or(Duration::ZERO, |until| {
            until.saturating_duration_since(Instant::now())
        });
        if self.end(grace).is_some() {
            // What it said last is to be in the log before the host goes on, and perhaps ends.
            let _ = self.errors.recv_timeout(LAST_WORDS);
        }
    }
}

/// Kills all children of this process and what they started, for a host that is about to exit. None is started,
/// neither in their place nor for another matcher, as long as the returned value lives.
pub fn end_all() -> Ended {
    let mut groups = groups();
    groups.ended += 1;
    for &leader in &groups.alive {
        group::kill(leader);
    }
    Ended(())
}

/// As long as it lives, no child is started, see [`end_all`].
#[derive(Debug)]
#[must_use]
pub struct Ended(());

impl Drop for Ended {
    fn drop(&mut self) {
        groups().ended -= 1;
    }
}

fn groups() -> MutexGuard<'static, Groups> {
    lock(&GROUPS)
}

/// What is in it, also where another thread panicked while it held it.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts a thread that serves a child.
fn serve(work: impl FnOnce() + Send + 'static) -> Result<(), String> {
    let started = thread::Builder::new().spawn(work);
    started
        .map(drop)
        .map_err(|error| format!("no thread can be started for it: {error}"))
}

/// A program that is a path counts from the folder of the manifest; another is looked up as usual.
fn program_in(folder: &Path, program: &str) -> OsString {
    if program.contains(std::path::is_separator) {
        folder.join(program).into()
    } else {
        program.into()
    }
}

fn write_all(mut stdin: ChildStdin, lines: &Receiver<Vec<u8>>) {
    for line in lines {
        if stdin.write_all(&line).and_then(|()| stdin.flush()).is_err() {
            return;
        }
    }
}

/// Objects with a `type` are messages; all else goes to the log, and is a `complaint` if it was to be a message.
fn sort(stdout: impl Read, heard: &SyncSender<Heard>, log: &Log, complaint: &Mutex<String>) {
    let mut stdout = BufReader::new(stdout);
    let mut line = Vec::new();
    loop {
        match read_line(&mut stdout, LONGEST_LINE, &mut line) {
            Ok(lines::Line::Whole) => {}
            Ok(lines::Line::TooLong) => {
                log.line(format!("(a line too long: {} ...)", told(&line)).as_bytes());
                let _ = heard.send(Heard::Flood);
                return;
            }
            Ok(lines::Line::End) | Err(_) => return,
        }
        // Some languages write it before their first line.
        let text = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&line);
        match serde_json::from_slice::<Value>(text) {
            Ok(message) if message.get("type").is_some_and(Value::is_string) => {
                if heard.send(Heard::Message(message)).is_err() {
                    return;
                }
            }
            _ if line.is_empty() => {}
            read => {
                if let Err(error) = read
                    && is_like_a_message(text)
                {
                    *lock(complaint) = format!("{}, which is no JSON: {error}", told(&line));
                }
                log.line(&line);
            }
        }
    }
}

/// Whether a line was to be a message: an object that says `"type"`, though perhaps with a NaN or half of it.
fn is_like_a_message(line: &[u8]) -> bool {
    line.starts_with(b"{") && line.windows(6).any(|word| word == b"\"type\"")
}

/// All goes to the log; the last line that is not blank is the `complaint`.
fn copy(stderr: impl Read, log: &Log, complaint: &Mutex<String>, _ended: SyncSender<()>) {
    let mut stderr = BufReader::new(stderr);
    let mut line = Vec::new();
    loop {
        match read_line(&mut stderr, LONGEST_LOGGED, &mut line) {
            Ok(lines::Line::Whole) if line.is_empty() => {}
            Ok(lines::Line::Whole | lines::Line::TooLong) => {
                if !line.trim_ascii().is_empty() {
                    *lock(complaint) = told(&line);
                }
                log.line(&line);
            }
            Ok(lines::Line::End) | Err(_) => return,
        }
    }
}

/// Process groups, by system calls that need no unsafe code here.
#[cfg(unix)]
mod group {
    use std::os::unix::process::CommandExt;
    use std::process::{Child, Command};

    use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

    /// The child will lead a group of its own.
    pub(super) fn lead(command: &mut Command) {
        command.process_group(0);
    }

    /// Kills the group of a `leader` that has not been reaped.
    pub(super) fn kill(leader: u32) {
        if let Some(leader) = pid(leader) {
            // It fails where all members have ended, which is what is wanted.
            let _ = kill_process_group(leader, Signal::KILL);
        }
    }

    /// Whether the child has ended; it is left to be reaped.
    pub(super) fn has_ended(child: &mut Child) -> bool {
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        let ended = pid(child.id()).map(|pid| waitid(WaitId::Pid(pid), options));
        // An error says that there is nothing to wait for.
        !matches!(ended, Some(Ok(None)))
    }

    fn pid(number: u32) -> Option<Pid> {
        Pid::from_raw(i32::try_from(number).ok()?)
    }
}

/// Elsewhere the child itself is ended; what it started is left to the system.
#[cfg(not(unix))]
mod group {
    use std::process::{Child, Command};

    pub(super) fn lead(_: &mut Command) {}

    pub(super) fn kill(_: u32) {}

    pub(super) fn has_ended(child: &mut Child) -> bool {
        !matches!(child.try_wait(), Ok(None))
    }
}
