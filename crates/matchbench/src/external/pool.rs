//! A matcher from outside: its child processes, which of them gets which pair, and when the matcher is
//! given up.

use std::fmt;
use std::hash::{BuildHasher as _, RandomState};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use matchbench_vision::image::Size;

use super::answer::{self, Described, Matched, Times};
use super::features::{memory_for, read_features};
use super::log::Log;
use super::manifest::{Kind, Manifest};
use super::message::{Answer, Request};
use super::process::Outlived;
use super::strikes::{STRIKES, Strikes};
use super::worker::{Fault, Identity, Worker};
use crate::files::TemporaryFolder;
use crate::matchers::Cancel;
use crate::memory::Reserved;

/// How many processes may have ended while what they started holds their output open, until the matcher is given up.
const MOST_OUTLIVED: usize = 16;

/// A matcher from outside, ready to be asked from any number of threads; at most
/// [`Manifest::workers`] are answered at once, the others wait. Dropping it ends its processes.
pub struct External {
    manifest: Manifest,
    identity: Identity,
    log: Log,
    outlived: Outlived,
    /// Where children write their answers.
    scratch: TemporaryFolder,
    questions: AtomicU64,
    /// Makes names that a child cannot know before it is asked; no result depends on them.
    unknown: RandomState,
    pool: Mutex<Pool>,
    /// Told when a place becomes free.
    freed: Condvar,
}

struct Pool {
    idle: Vec<Worker>,
    /// Places of workers that are taken by those who ask.
    taken: usize,
    /// Questions that failed.
    strikes: Strikes,
    /// Whether the last of these took all the time that it had.
    has_hung: bool,
    /// Why the matcher was given up.
    ended: Option<String>,
    /// Stops whoever asks.
    cancel: Cancel,
}

/// An image that a child is asked about.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    /// Its file, absolute.
    pub path: &'a Path,
    /// Its size in pixels.
    pub size: Size,
}

/// A matcher that cannot be started.
#[derive(Debug, thiserror::Error)]
#[error("{}; what it printed is in {}", self.without_log(), log.display())]
pub struct StartError {
    /// Its name.
    pub name: String,
    /// Why, in words.
    pub reason: String,
    /// Its log.
    pub log: PathBuf,
}

impl StartError {
    /// The error without the place of the log, for those who name that themselves.
    pub fn without_log(&self) -> String {
        format!("`{}` cannot be started: {}", self.name, self.reason)
    }
}

/// Why a question has no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Breakdown {
    /// The child says that it cannot do this one, or there is no memory for its answer. Asked again, it would be so again.
    Said(String),
    /// The child broke over this one and was ended, or it was not asked, since so many questions about the same image had
    /// broken it. It may go better another time.
    Broke(String),
    /// The matcher was given up after it broke over several images in a row, this one or earlier ones, or did not start;
    /// the reason names the log.
    Ended(String),
    /// It was left, since the [run](External::heed) is stopped.
    Stopped,
}

impl fmt::Display for Breakdown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Said(reason) | Self::Broke(reason) | Self::Ended(reason) => reason,
            Self::Stopped => "it was stopped before",
        })
    }
}

impl fmt::Debug for External {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("External")
            .field("manifest", &self.manifest)
            .field("identity", &self.identity)
            .finish_non_exhaustive()
    }
}

impl External {
    /// Starts the first process and learns what it is. What it prints goes to `log`.
    ///
    /// # Errors
    /// If it does not get ready.
    pub fn start(manifest: Manifest, log: Log) -> Result<Self, StartError> {
        Self::start_unless(manifest, log, &Cancel::default())
    }

    /// The same, until `cancel` is set: a program may load for minutes.
    ///
    /// # Errors
    /// If it does not get ready, or not before.
    pub fn start_unless(manifest: Manifest, log: Log, cancel: &Cancel) -> Result<Self, StartError> {
        let failed = |reason: String| StartError {
            name: manifest.name.clone(),
            reason,
            log: log.path(),
        };
        // Children run elsewhere, so they need its absolute path.
        let scratch = TemporaryFolder::new()
            .map_err(|error| failed(format!("no folder for its answers: {error}")))?;
        let outlived = Outlived::default();
        let worker = Worker::start(&manifest, &log, &outlived, cancel).map_err(failed)?;
        Ok(Self {
            identity: worker.identity().clone(),
            pool: Mutex::new(Pool {
                idle: vec![worker],
                taken: 0,
                strikes: Strikes::default(),
                has_hung: false,
                ended: None,
                cancel: Cancel::default(),
            }),
            manifest,
            log,
            outlived,
            scratch,
            questions: AtomicU64::new(0),
            unknown: RandomState::new(),
            freed: Condvar::new(),
        })
    }

    /// How it was started.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// What it says of itself.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Where what it prints is kept.
    pub fn log(&self) -> PathBuf {
        self.log.path()
    }

    /// Those who ask from now on are stopped by `cancel`. Then no process is started any more: those that are there answer
    /// all who wait, and where none is left, or one hung, whoever waits is told that it was stopped.
    pub fn heed(&self, cancel: &Cancel) {
        self.pool().cancel = cancel.clone();
    }

    /// The matches of the `pair` of frames, whose images are `a` and `b`.
    ///
    /// # Errors
    /// If there are none that can be used.
    pub fn match_pair(
        &self,
        pair: [u32; 2],
        a: Image<'_>,
        b: Image<'_>,
    ) -> Result<Matched, Breakdown> {
        let out = self.out(&format!("{}_{}.f32", pair[0], pair[1]));
        let request = Request::Match {
            pair,
            a: a.path,
            b: b.path,
            size_a: [a.size.width, a.size.height],
            size_b: [b.size.width, b.size.height],
            out: &out,
        };
        self.ask(a.path, request, &out, |answer, wall| match answer {
            Answer::Matched {
                count,
                features,
                extracted,
                seconds,
                device,
                ..
            } => {
                answer::check_features(count, features)?;
                let sizes = [a.size, b.size];
                let rows = answer::read_rows(&out, count, sizes, self.identity.pixel_center)?;
                let times = Times::new(wall, seconds, device)?.of_images(extracted)?;
                Ok(Matched {
                    rows,
                    features,
                    times,
                })
            }
            _ => Err(Fault::unasked()),
        })
    }

    /// The features of an image.
    ///
    /// # Errors
    /// If there are none that can be used, or the matcher answers matches.
    pub fn describe(&self, image: Image<'_>) -> Result<Described, Breakdown> {
        Ok(self.describe_to_save(image)?.0)
    }

    /// The same, with the memory that is reserved for the features until they are saved.
    pub(super) fn describe_to_save(
        &self,
        image: Image<'_>,
    ) -> Result<(Described, Option<Reserved<'static>>), Breakdown> {
        let Kind::Features(matching) = self.manifest.kind else {
            return Err(Breakdown::Said("it describes no images".into()));
        };
        let out = self.out("features.npz");
        let request = Request::Describe {
            image: image.path,
            size: [image.size.width, image.size.height],
            out: &out,
        };
        self.ask(image.path, request, &out, |answer, wall| match answer {
            Answer::Described {
                count,
                seconds,
                device,
                ..
            } => {
                let memory = memory_for(&out).map_err(|missing| {
                    Fault::Said(format!(
                        "its features are too many: {missing}; let it find fewer, free memory, or set \
                         MATCHBENCH_MAX_MEMORY"
                    ))
                })?;
                let center = self.identity.pixel_center;
                let described = Described {
                    features: read_features(&out, count, image.size, center, matching.hamming)?,
                    times: Times::new(wall, seconds, device)?,
                };
                Ok((described, memory))
            }
            _ => Err(Fault::unasked()),
        })
    }

    /// Asks a worker about an `image`, of a pair the first, takes its answer apart by `read`, and keeps the worker if all
    /// went well.
    fn ask<T>(
        &self,
        image: &Path,
        request: Request<'_>,
        out: &Path,
        read: impl FnOnce(Answer, f64) -> Result<T, Fault>,
    ) -> Result<T, Breakdown> {
        let (_place, idle) = self.take(image)?;
        let start = Instant::now();
        let mut worker = match idle.map_or_else(|| self.start_another(), Ok) {
            Ok(worker) => worker,
            Err(reason) => {
                let has_hung = start.elapsed() >= self.manifest.start_timeout;
                return Err(self.give_up_on(None, reason, has_hung));
            }
        };
        let start = Instant::now();
        let asked = worker.ask(request);
        let answer = asked.and_then(|(answer, wall)| read(answer, wall));
        // The file may be absent, or another kind of thing; the folder goes with the matcher.
        let _ = std::fs::remove_file(out);
        match answer {
            Ok(answer) => {
                self.give_back(worker, image);
                Ok(answer)
            }
            Err(Fault::Said(reason)) => {
                self.give_back(worker, image);
                Err(Breakdown::Said(reason))
            }
            Err(Fault::Broke(reason)) => {
                let has_hung = start.elapsed() >= self.manifest.timeout;
                let reason = format!("{reason} ({})", worker.kill());
                Err(self.give_up_on(Some(image), reason, has_hung))
            }
        }
    }

    /// A place that nobody else has for a question about an `image`, and its worker, unless one is to be started first.
    fn take(&self, image: &Path) -> Result<(Place<'_>, Option<Worker>), Breakdown> {
        let mut pool = self.pool();
        loop {
            if let Some(reason) = &pool.ended {
                return Err(Breakdown::Ended(reason.clone()));
            }
            if pool.strikes.is_left_out(image) {
                // The place that is free is for another who waits.
                self.freed.notify_one();
                return Err(Breakdown::Broke(format!(
                    "it was not asked any more: {STRIKES} questions about {} had broken it",
                    image.display()
                )));
            }
            if let Some(worker) = pool.idle.pop() {
                pool.taken += 1;
                return Ok((Place(self), Some(worker)));
            }
            if pool.cancel.is_set() {
                // No other is started. One that answers will be free; after one that hung nobody waits for the rest.
                if pool.taken == 0 || pool.has_hung {
                    // The others who wait were not told of this place.
                    self.freed.notify_all();
                    return Err(Breakdown::Stopped);
                }
            } else if pool.taken < self.manifest.workers {
                pool.taken += 1;
                return Ok((Place(self), None));
            }
            pool = (self.freed.wait(pool)).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn start_another(&self) -> Result<Worker, String> {
        // Whoever asks was not stopped, and is to have its answer.
        let never = Cancel::default();
        let worker = Worker::start(&self.manifest, &self.log, &self.outlived, &never)?;
        if *worker.identity() == self.identity {
            return Ok(worker);
        }
        let now = &worker.identity().version;
        Err(format!("it became another program: version {now}"))
    }

    fn give_back(&self, worker: Worker, image: &Path) {
        let mut pool = self.pool();
        pool.strikes.answered(image);
        pool.has_hung = false;
        pool.idle.push(worker);
    }

    /// Notes that a worker was lost for this `reason`, over an `image` or since it did not start, and whether the matcher
    /// is with it.
    fn give_up_on(&self, image: Option<&Path>, reason: String, has_hung: bool) -> Breakdown {
        let mut pool = self.pool();
        pool.has_hung = has_hung;
        let given_up = match image {
            Some(image) => pool.strikes.failed(image),
            None => pool.strikes.did_not_start(),
        };
        let given_up = given_up.or_else(|| {
            (self.outlived.count() >= MOST_OUTLIVED).then(|| {
                format!(
                    "{MOST_OUTLIVED} of its processes have ended, and what they started still holds their output open; \
                     let it end what it starts"
                )
            })
        });
        let Some(why) = given_up else {
            return Breakdown::Broke(reason);
        };
        let reason = format!(
            "{why}, the last: {reason}; what it printed is in {}",
            self.log.path().display()
        );
        let ended = pool.ended.get_or_insert(reason).clone();
        // Whoever waits learns that nobody will come.
        self.freed.notify_all();
        Breakdown::Ended(ended)
    }

    fn pool(&self) -> MutexGuard<'_, Pool> {
        self.pool.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A file whose name ends so and begins as no other, since workers may be asked for one pair at once. Nobody can
    /// tell it before the question, so that matches which are there were written after it.
    fn out(&self, name: &str) -> PathBuf {
        let question = self.questions.fetch_add(1, Ordering::Relaxed);
        let unknown = self.unknown.hash_one(question);
        self.scratch
            .path()
            .join(format!("{question}-{unknown:016x}-{name}"))
    }
}

/// A place of a worker, taken by whoever asks. It is free again when this value is dropped, by a panic too, which loses
/// the worker.
struct Place<'a>(&'a External);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.pool().taken -= 1;
        self.0.freed.notify_one();
    }
}

impl Drop for External {
    fn drop(&mut self) {
        // All are asked to go before any is waited for.
        let mut idle = std::mem::take(&mut self.pool().idle);
        idle.iter_mut().for_each(Worker::say_goodbye);
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::mpsc;
    use std::thread;
    use std::time::Duration;

    use super::super::manifest::BuiltIn;
    use super::*;

    /// A program in the language of the shell that matches nothing.
    const PROGRAM: &str = r#"
while read -r line; do
    case $line in
    *hello*) echo '{"type":"ready","protocol":1,"name":"x","version":"1","pixel_center":0}' ;;
    *) echo '{"type":"matched","pair":[0,1],"count":0}' ;;
    esac
done
"#;

    fn start(folder: &Path, program: &str) -> External {
        start_with(folder, program, 1)
    }

    fn start_with(folder: &Path, program: &str, workers: usize) -> External {
        std::fs::write(folder.join("x.sh"), program).unwrap();
        let text =
            format!("name = 'x'\ncommand = ['sh', 'x.sh']\nworkers = {workers}\ntimeout_s = 2\n");
        let manifest = Manifest::parse(&folder.join("x.toml"), &text, &BuiltIn::default()).unwrap();
        let log = Log::open(&folder.join("x.log")).unwrap();
        External::start(manifest, log).unwrap()
    }

    fn match_one(external: &External) -> Result<Matched, Breakdown> {
        let image = Image {
            path: Path::new("/a"),
            size: Size::new(1, 1),
        };
        external.match_pair([0, 1], image, image)
    }

    #[test]
    fn what_was_answered_before_the_question_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        // It has said all when the file is there.
        let early = PROGRAM.replace(
            "\"pixel_center\":0}'",
            "\"pixel_center\":0}'; echo '{\"type\":\"matched\",\"pair\":[0,1],\"count\":0}'; touch said",
        );
        let external = start(folder.path(), &early);
        while !folder.path().join("said").exists() {
            thread::sleep(Duration::from_millis(1));
        }
        thread::sleep(Duration::from_millis(100));
        let answer = match_one(&external);
        let told = answer.expect_err("nobody had asked").to_string();
        assert!(told.contains("it answered before it was asked"), "{told}");
    }

    #[test]
    fn a_byte_order_mark_before_a_message_is_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let marked = PROGRAM.replace("echo '{", r"printf '\357\273\277'; echo '{");
        assert_ne!(marked, PROGRAM);
        let external = start(folder.path(), &marked);
        assert!(match_one(&external).is_ok());
    }

    #[test]
    fn when_a_run_is_stopped_no_child_is_started_in_the_place_of_another() {
        let matches = "echo '{\"type\":\"matched\",\"pair\":[0,1],\"count\":0}'";
        // It answers, hangs, or ends.
        for (answer, answered, stopped) in [(matches, 4, 0), ("sleep 60", 0, 3), ("exit 3", 0, 3)] {
            let folder = tempfile::tempdir().unwrap();
            let program = PROGRAM.replace(matches, answer);
            let program = format!("echo >> starts\n{program}");
            let external = start(folder.path(), &program);
            let cancel = Cancel::default();
            cancel.set();
            external.heed(&cancel);
            let ask = || match_one(&external);
            let all: Vec<_> = thread::scope(|scope| {
                let asking = [(); 4].map(|()| scope.spawn(ask));
                asking.map(|asking| asking.join().unwrap()).into()
            });
            let count = |is: fn(&Result<Matched, Breakdown>) -> bool| {
                all.iter().filter(|answer| is(answer)).count()
            };
            assert_eq!(count(Result::is_ok), answered, "{all:?}");
            let is_stopped = |answer: &_| matches!(answer, Err(Breakdown::Stopped));
            assert_eq!(count(is_stopped), stopped, "{all:?}");
            let starts = std::fs::read_to_string(folder.path().join("starts")).unwrap();
            assert_eq!(starts, "\n", "{answer}");
        }
    }

    #[test]
    fn when_a_run_is_stopped_the_children_that_are_there_answer_all_who_wait() {
        let folder = tempfile::tempdir().unwrap();
        let program = format!("echo >> starts\n{PROGRAM}").replace(
            "echo '{\"type\":\"matched",
            "sleep 0.1; echo '{\"type\":\"matched",
        );
        let external = start_with(folder.path(), &program, 3);
        let cancel = Cancel::default();
        cancel.set();
        external.heed(&cancel);
        thread::scope(|scope| {
            let asking = [(); 5].map(|()| scope.spawn(|| match_one(&external)));
            for asked in asking {
                assert!(asked.join().unwrap().is_ok(), "one child is there");
            }
        });
        let starts = std::fs::read_to_string(folder.path().join("starts")).unwrap();
        assert_eq!(starts, "\n", "two more could have been started");
    }

    #[test]
    fn nobody_can_tell_where_an_answer_is_to_be() {
        let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let [one, other] = folders.each_ref().map(|folder| {
            let out = start(folder.path(), PROGRAM).out("x");
            out.file_name().unwrap().to_owned()
        });
        assert_ne!(one, other, "the first question of both");
    }

    #[test]
    fn a_panic_frees_the_place_that_it_took() {
        let folder = tempfile::tempdir().unwrap();
        let external = start(folder.path(), PROGRAM);
        let out = external.out("x");
        let request = || Request::Match {
            pair: [0, 1],
            a: Path::new("/a"),
            b: Path::new("/b"),
            size_a: [1, 1],
            size_b: [1, 1],
            out: &out,
        };
        let broken = AssertUnwindSafe(|| {
            external.ask(
                Path::new("/a"),
                request(),
                &out,
                |_, _| -> Result<(), Fault> { panic!("as a bug would") },
            )
        });
        assert!(catch_unwind(broken).is_err());
        let (answered, waiting) = mpsc::channel();
        thread::scope(|scope| {
            scope.spawn(|| {
                let asked = external.ask(Path::new("/a"), request(), &out, |_, _| Ok(()));
                answered.send(asked)
            });
            let answer = waiting.recv_timeout(Duration::from_secs(20));
            // Whoever waits for a place that is not free any more would wait for ever.
            external.pool().ended.get_or_insert_default();
            external.freed.notify_all();
            assert_eq!(answer, Ok(Ok(())));
        });
    }
}
