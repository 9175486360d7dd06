//! Shards, merged, are the run of one machine.

use super::outside::Flaky;
use super::*;
use crate::datasets::{DatasetError, DepthFile, DepthUnit};
use crate::records::shards::{Asked, Merged, Part, merge};
use crate::records::{KeepMatches, ShardError, ShardPlan};

mod merged;

impl Bench {
    /// What a run of this bench is, all of it or one part.
    fn work(
        &self,
        keep: KeepMatches,
        name: &str,
        shard: Option<Shard<'_>>,
        cancel: &Stop,
    ) -> RunSummary {
        let folder = self.path(name);
        let run = Run {
            settings: self.settings,
            decode,
            feature_memory: 20_000,
            keep_matches: keep,
            shard,
            ..Run::new(&self.datasets, &self.contenders, &folder)
        };
        let pool = ThreadPoolBuilder::new().num_threads(self.threads).build();
        pool.unwrap()
            .install(|| run.execute(cancel, &cancel.0))
            .unwrap()
    }

    fn plan(&self, name: &str, shards: u32, keep: KeepMatches) -> ShardPlan {
        let asked = Asked::default();
        let plan = plan_shards(
            &self.datasets,
            &self.contenders,
            self.settings,
            shards,
            asked,
            keep,
            &[],
        );
        let plan = plan.unwrap();
        plan.write(&self.path(name)).unwrap();
        assert_eq!(ShardPlan::open(&self.path(name)).unwrap(), plan);
        plan
    }

    /// Does the shards of a plan in the folder `name`.
    fn shards(&self, plan: &ShardPlan, name: &str, numbers: impl IntoIterator<Item = u32>) {
        for number in numbers {
            let shard = Some(Shard { plan, number });
            let folder = format!("{name}/shards/{number}");
            self.work(plan.keep_matches(), &folder, shard, &Stop::never());
        }
    }

    /// What two runs have in common but for the times: the records apart, the bytes of all else.
    fn results(&self, name: &str) -> (Vec<RunRecord>, Vec<(PathBuf, Vec<u8>)>) {
        let folder = self.path(name);
        let of_run = |path: &PathBuf| {
            let first = path
                .components()
                .next()
                .map(|part| part.as_os_str().to_owned());
            let first = first.unwrap_or_default();
            !["cache", "records", ".lock"]
                .iter()
                .any(|other| first == *other)
        };
        let mut others: Vec<(PathBuf, Vec<u8>)> = Vec::new();
        for file in files(&folder) {
            let inside = file.strip_prefix(&folder).unwrap().to_path_buf();
            if of_run(&inside) {
                others.push((inside, fs::read(file).unwrap()));
            }
        }
        (self.records(name), others)
    }
}

/// Stops after so many records.
struct Stop(Cancel, AtomicUsize);

impl Stop {
    fn after(records: usize) -> Self {
        Self(Cancel::default(), AtomicUsize::new(records))
    }

    fn never() -> Self {
        Self::after(usize::MAX)
    }
}

impl Observer for Stop {
    fn on_record(&self, _: &RunRecord) {
        if self.1.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.0.set();
        }
    }
}

fn bench() -> Bench {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(3);
    bench
}

#[test]
fn any_number_of_shards_comes_to_the_run_of_one_machine() {
    let bench = bench();
    // One image cannot be read, and one file is not there.
    fs::write(bench.path("street/0003.raw"), [0; 7]).unwrap();
    fs::remove_file(bench.path("office/0004.raw")).unwrap();
    for keep in [KeepMatches::All, KeepMatches::Inliers, KeepMatches::None] {
        let single = format!("single {keep:?}");
        let summary = bench.work(keep, &single, None, &Stop::never());
        let single = bench.results(&single);
        assert!(summary.failed > 0 && single.1.len() >= 3, "{:?}", single.1);
        let kept = |folder: &str| single.1.iter().any(|(file, _)| file.starts_with(folder));
        assert_eq!(kept("matches"), keep == KeepMatches::All);
        assert_eq!(kept("inliers"), keep == KeepMatches::Inliers);
        for shards in [1, 3, 11, 28] {
            let name = format!("plan of {shards} {keep:?}");
            let plan = bench.plan(&name, shards, keep);
            // In no order.
            bench.shards(&plan, &name, (1..=shards).rev());
            let merged = format!("merged of {shards} {keep:?}");
            let done = merge(&plan, &bench.path(&name), &[], &bench.path(&merged)).unwrap();
            let expected = Merged {
                tasks: summary.total as u64,
                failed: summary.failed as u64,
            };
            assert_eq!(done, expected);
            assert!(
                bench.results(&merged) == single,
                "{shards} shards, {keep:?}"
            );
            // The merged folder is a run, with which a run goes on: it tries again what failed.
            let again = bench.work(keep, &merged, None, &Stop::never());
            assert_eq!((again.now, again.failed), (summary.failed, summary.failed));
            merge(&plan, &bench.path(&name), &[], &bench.path(&merged)).unwrap();
            assert!(bench.results(&merged) == single, "merged again");
        }
    }
}

#[test]
fn a_shard_that_was_stopped_torn_and_mended_elsewhere_comes_to_the_same() {
    let mut bench = bench();
    bench.settings.limit = Some(17);
    bench.work(KeepMatches::All, "single", None, &Stop::never());
    let plan = bench.plan("plan", 2, KeepMatches::All);
    let image = bench.path("street/0003.raw");
    let sound = fs::read(&image).unwrap();
    fs::write(&image, [0; 7]).unwrap();
    let shard = Shard {
        plan: &plan,
        number: 2,
    };
    let mut stops = 0;
    for _ in 0..100 {
        let summary = bench.work(KeepMatches::All, "node", Some(shard), &Stop::after(9));
        stops += 1;
        let file = store::path(&bench.path("node"), "street", "bright", "first");
        if let Ok(bytes) = fs::read(&file) {
            fs::write(&file, &bytes[..bytes.len() - 3]).unwrap();
        }
        if summary.is_complete() {
            break;
        }
    }
    assert!((3..100).contains(&stops), "{stops} stops");
    fs::write(&image, &sound).unwrap();
    let summary = bench.work(KeepMatches::All, "node", Some(shard), &Stop::never());
    assert!(summary.is_complete() && summary.now > 0 && summary.failed == 0);
    bench.shards(&plan, "plan", [1]);
    // The folder of one shard was copied to another place, that of the plan as a whole too.
    let copies = [bench.path("node"), bench.path("plan")];
    merge(&plan, &bench.path("plan"), &copies, &bench.path("merged")).unwrap();
    assert!(bench.results("merged") == bench.results("single"));
}

#[test]
fn pairs_of_another_shard_are_refused() {
    let bench = bench();
    let plan = bench.plan("plan", 3, KeepMatches::None);
    let [first, second] = [1, 2].map(|number| Shard {
        plan: &plan,
        number,
    });
    let (run, parts) = first.of(plan.plan().clone(), &bench.datasets).unwrap();
    assert_eq!(run.shard, Some(plan.shard(1).unwrap()));
    let pairs: usize = parts.iter().map(|part| part.sequence.pairs.len()).sum();
    assert_eq!(pairs as u64, plan.cut().parts[0].pairs);
    assert!(first.of(plan.plan().clone(), &parts).is_ok());
    let error = second.of(plan.plan().clone(), &parts).unwrap_err();
    assert!(
        error.to_string().contains("not those of shard 2"),
        "{error}"
    );
}

#[test]
fn what_is_missing_is_named_and_nothing_is_written() {
    let bench = bench();
    let plan = bench.plan("plan", 4, KeepMatches::All);
    bench.shards(&plan, "plan", [1, 3]);
    let shard = Shard {
        plan: &plan,
        number: 2,
    };
    bench.work(
        KeepMatches::All,
        "plan/shards/2",
        Some(shard),
        &Stop::after(9),
    );
    let merged = || merge(&plan, &bench.path("plan"), &[], &bench.path("merged"));
    let Err(ShardError::Gaps { shards }) = merged() else {
        panic!("two are missing")
    };
    assert_eq!(
        shards.iter().map(|(number, _)| *number).collect::<Vec<_>>(),
        [2, 4]
    );
    assert!(
        shards[0].1.contains(" of ") && shards[1].1 == "not begun",
        "{shards:?}"
    );
    assert!(!bench.path("merged").exists());
    let error = merged().unwrap_err().to_string();
    assert!(error.contains("--shard"), "{error}");
    bench.shards(&plan, "plan", [2, 4]);
    merged().unwrap();
}

#[test]
fn a_folder_of_another_plan_is_refused() {
    let mut bench = bench();
    let plan = bench.plan("plan", 3, KeepMatches::All);
    bench.shards(&plan, "plan", [1, 2, 3]);
    bench.settings.seed = 1;
    let other = plan_shards(
        &bench.datasets,
        &bench.contenders,
        bench.settings,
        3,
        Asked::default(),
        KeepMatches::All,
        &[],
    );
    let other = other.unwrap();
    assert!(matches!(
        other.write(&bench.path("plan")),
        Err(ShardError::Taken { .. })
    ));
    let refused = |name: &str, plan: &ShardPlan, number: u32, named: &str| {
        let folder = bench.path(name);
        let run = Run {
            settings: bench.settings,
            decode,
            shard: Some(Shard { plan, number }),
            ..Run::new(&bench.datasets, &bench.contenders, &folder)
        };
        let error = run
            .execute(&Silent, &Cancel::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains(named), "{error}");
    };
    refused("plan/shards/1", &other, 1, "seed");
    refused("new", &plan, 1, "not what was planned");
    refused("new", &other, 4, "1 to 3");
    refused("new", &other, 0, "1 to 3");
    let error = merge(&other, &bench.path("plan"), &[], &bench.path("merged"));
    assert!(matches!(error, Err(ShardError::Foreign { .. })));
    // One shard in the place of another, and a run that is no shard.
    fs::rename(bench.path("plan/shards/1"), bench.path("away")).unwrap();
    fs::rename(bench.path("plan/shards/2"), bench.path("plan/shards/1")).unwrap();
    let error = merge(&plan, &bench.path("plan"), &[], &bench.path("merged"));
    assert!(matches!(error, Err(ShardError::Foreign { .. })));
    bench.run("run").unwrap();
    let error = merge(
        &plan,
        &bench.path("plan"),
        &[bench.path("run")],
        &bench.path("merged"),
    );
    assert!(error.unwrap_err().to_string().contains("shard 2"));
}

#[test]
fn a_changed_plan_is_refused() {
    let bench = bench();
    bench.plan("plan", 3, KeepMatches::All);
    let file = bench.path("plan/plan.json");
    let text = fs::read_to_string(&file).unwrap();
    for (from, to) in [
        ("\"seed\": 0", "\"seed\": 1"),
        ("\"keep_matches\": \"all\"", "\"keep_matches\": \"none\""),
        ("\"format\": 1", "\"format\": 9"),
        ("\"asked\"", "\"unknown\": 1, \"asked\""),
        ("1*", "2*"),
    ] {
        assert!(text.contains(from), "{from}");
        fs::write(&file, text.replacen(from, to, 1)).unwrap();
        let error = ShardPlan::open(&bench.path("plan")).unwrap_err();
        assert!(matches!(error, ShardError::Damaged { .. }), "{error}");
    }
    fs::write(&file, text).unwrap();
    let error = RunFolder::open(&bench.path("plan"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("merge"), "{error}");
}

#[test]
fn two_folders_of_one_shard_must_agree() {
    let bench = bench();
    let plan = bench.plan("plan", 2, KeepMatches::All);
    bench.shards(&plan, "plan", [1, 2]);
    bench.shards(&plan, "copy", [2]);
    let copies = [bench.path("copy")];
    let merged = || merge(&plan, &bench.path("plan"), &copies, &bench.path("merged"));
    merged().unwrap();
    let file = store::path(&bench.path("copy/shards/2"), "street", "dark", "first");
    let mut records = store::read(&file).unwrap();
    records[4].counts.putative += 1;
    store::rewrite(&file, &records).unwrap();
    let Err(ShardError::Differs {
        number: 2, line: 5, ..
    }) = merged()
    else {
        panic!("one record differs")
    };
    // Also where one of them is not done.
    store::rewrite(&file, &records[..5]).unwrap();
    assert!(matches!(merged(), Err(ShardError::Differs { .. })));
    store::rewrite(&file, &records[..4]).unwrap();
    merged().unwrap();
}

#[test]
fn shards_of_different_images_and_damaged_shards_are_refused() {
    let bench = bench();
    let plan = bench.plan("plan", 2, KeepMatches::All);
    bench.shards(&plan, "plan", [1, 2]);
    let merged = || merge(&plan, &bench.path("plan"), &[], &bench.path("merged"));
    let spoil = |file: &str, spoiled: &dyn Fn(Vec<u8>) -> Vec<u8>, named: &str| {
        let file = bench.path("plan/shards").join(file);
        let sound = fs::read(&file).unwrap();
        fs::write(&file, spoiled(sound.clone())).unwrap();
        let error = merged().unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
        let unfinished = format!("{} is unfinished", bench.path("merged").display());
        assert!(error.contains(&unfinished), "{error}");
        fs::write(&file, sound).unwrap();
    };
    let flipped = |at: usize| {
        move |mut bytes: Vec<u8>| {
            bytes[at] ^= 1;
            bytes
        }
    };
    spoil(
        "2/records/street/dark+first.jsonl",
        &flipped(40),
        "checksum",
    );
    spoil("2/matches/street/dark.bin", &flipped(90), "checksum");
    spoil(
        "1/matches/street/dark.bin",
        &|bytes| bytes[..60].to_vec(),
        "has lost the matches",
    );
    let doubled = |bytes: Vec<u8>| [&bytes[..], &bytes[8..]].concat();
    spoil("1/matches/street/dark.bin", &doubled, "without a record");
    let swapped = |bytes: Vec<u8>| {
        let text = String::from_utf8(bytes).unwrap();
        let mut lines: Vec<&str> = text.lines().collect();
        lines.swap(0, 3);
        lines
            .join("\n")
            .into_bytes()
            .into_iter()
            .chain([b'\n'])
            .collect()
    };
    spoil(
        "2/records/street/dark+first.jsonl",
        &swapped,
        "another task",
    );
    let notes = bench.path("plan/shards/2/images/street.txt");
    let sound = fs::read(&notes).unwrap();
    fs::remove_file(&notes).unwrap();
    let error = merged().unwrap_err().to_string().replace('\\', "/");
    assert!(
        error.contains("shards/2: it has lost the notes of the images of street"),
        "{error}"
    );
    fs::write(&notes, sound).unwrap();
    // The first image that both shards know.
    let notes = |number: u32| {
        let file = bench.path(&format!("plan/shards/{number}/images/street.txt"));
        fs::read_to_string(file).unwrap()
    };
    let (first, second) = (notes(1), notes(2));
    let shared = first
        .lines()
        .find(|line| second.lines().any(|other| other == *line));
    let shared = shared.expect("the cut goes through some image");
    let digit = if shared.ends_with('0') { "1" } else { "0" };
    let changed = format!("{}{digit}", &shared[..shared.len() - 1]);
    let other = |bytes: Vec<u8>| {
        let text = String::from_utf8(bytes).unwrap();
        text.replacen(shared, &changed, 1).into_bytes()
    };
    spoil("2/images/street.txt", &other, "the same image of frame");
    merged().unwrap();
}

/// A dataset of so many frames and these pairs; nobody looks at its images.
fn table(name: &str, frames: u32, pairs: impl Iterator<Item = (u32, u32)>) -> Dataset {
    let folder = tempfile::tempdir().unwrap();
    let mut dataset = dataset(folder.path(), name, 2);
    let frame = dataset.sequence.frames[0].clone();
    let pair = dataset.sequence.pairs[0];
    dataset.sequence.frames = vec![frame; frames as usize];
    dataset.sequence.pairs = pairs.map(|(a, b)| Pair { a, b, ..pair }).collect();
    dataset
}

fn parts(datasets: &[Dataset], shards: u32) -> Vec<Part> {
    let plan = plan_shards(
        datasets,
        &two_by_two(),
        RunSettings::default(),
        shards,
        Asked::default(),
        KeepMatches::All,
        &[],
    );
    plan.unwrap().cut().parts.clone()
}

#[test]
fn few_images_are_extracted_twice() {
    let all = || (0..120).flat_map(|a| (a + 1..120).map(move |b| (a, b)));
    let exhaustive = [table("all", 120, all())];
    for shards in [2, 4, 16, 60] {
        let parts = parts(&exhaustive, shards);
        let pairs = || parts.iter().map(|part| part.pairs);
        assert!(pairs().max().unwrap() - pairs().min().unwrap() <= u64::from(shards.ilog2()));
        // Squares have two images for each of their sides.
        let side = (7140.0 / f64::from(shards)).sqrt();
        let squares = 2.0 * side * f64::from(shards);
        let images: u64 = parts.iter().map(|part| part.images).sum();
        assert!(
            (images as f64) < 1.1 * squares,
            "{shards} shards: {images}, {squares}"
        );
    }
    let neighbours = (0..300).flat_map(|a| (a + 1..(a + 4).min(300)).map(move |b| (a, b)));
    let street = [table("street", 300, neighbours), table("all", 120, all())];
    assert_eq!(images_of_one(&street, RunSettings::default()), 420);
    let parts = parts(&street[..1], 10);
    let images: u64 = parts.iter().map(|part| part.images).sum();
    assert!(images <= 300 + 9 * 4, "{images}");
}

#[test]
fn what_cannot_be_cut_is_refused() {
    let cut = |pairs: &[(u32, u32)], shards| {
        let datasets = [table("street", 5, pairs.iter().copied())];
        let asked = Asked::default();
        let (contenders, settings) = (two_by_two(), RunSettings::default());
        let keep = KeepMatches::All;
        plan_shards(&datasets, &contenders, settings, shards, asked, keep, &[])
    };
    for (pairs, shards, named) in [
        (&[(0, 1), (1, 2)][..], 3, "2 pairs cannot be cut into"),
        (&[(0, 1), (1, 2)], 0, "2 pairs cannot be cut into"),
        (&[(0, 1), (1, 2), (0, 1)], 2, "0 1 twice"),
    ] {
        let error = cut(pairs, shards).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
    assert!(cut(&[(0, 1), (1, 2)], 2).is_ok());
    let settings = RunSettings {
        sample: Some(1),
        ..RunSettings::default()
    };
    let mut datasets = [table("street", 5, [(0, 1), (1, 2)].into_iter())];
    let planned = |datasets: &[Dataset], settings| {
        let (contenders, asked) = (two_by_two(), Asked::default());
        let shards = plan_shards(
            datasets,
            &contenders,
            settings,
            1,
            asked,
            KeepMatches::All,
            &[],
        );
        shards.unwrap_err().to_string()
    };
    assert!(planned(&datasets, settings).contains("sample"));
    datasets[0].matchers = Some(["bright".to_owned()].into());
    assert!(planned(&datasets, RunSettings::default()).contains("not all matchers"));
}

#[test]
fn what_is_surveyed_is_planned_as_what_is_opened() {
    let (_folder, dir) = crate::datasets::testing::dataset();
    let planned = |dataset: Result<Dataset, DatasetError>, limit| {
        let settings = RunSettings {
            limit,
            ..RunSettings::default()
        };
        let (datasets, contenders) = ([dataset.unwrap()], two_by_two());
        let (asked, keep) = (Asked::default(), KeepMatches::All);
        let plan = plan_shards(&datasets, &contenders, settings, 2, asked, keep, &[]);
        plan.map_err(|error| error.to_string())
    };
    for limit in [None, Some(2)] {
        let plan = planned(Dataset::open(&dir), limit);
        assert_eq!(planned(Dataset::survey(&dir), limit), plan);
        assert!(plan.is_ok());
    }
    assert_eq!(Dataset::survey(&dir).unwrap().sequence.pairs.len(), 1);
    // The last pair has a homography alone, which no pose is judged by.
    let homographies = "0 1 1 0 5 0 1 -3 0 0 1\n3 0 2 0 0 0 2 0 0 0 2\n";
    fs::write(dir.join("homographies.txt"), homographies).unwrap();
    let refused = planned(Dataset::open(&dir), None).unwrap_err();
    assert!(refused.contains("no pose of the pair 3 0"), "{refused}");
    assert_eq!(planned(Dataset::survey(&dir), None), Err(refused));
}
