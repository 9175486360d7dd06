//! What is merged of shards where something failed.

use super::*;

#[test]
fn a_source_that_failed_and_then_found_nothing_is_merged() {
    // What it finds of this pair, and of some others, fails, since their depth cannot be read.
    let pair = [0, 1];
    let mut bench = Bench::new(Vec::new());
    for frame in &mut bench.datasets[0].sequence.frames[..2] {
        frame.depth = Some(DepthFile {
            path: "nowhere.png".into(),
            unit: DepthUnit::MILLIMETRES,
        });
    }
    bench.contenders = vec![Flaky::on(&[pair], &[]).contender()];
    let plan = bench.plan("plan", 2, KeepMatches::All);
    bench.shards(&plan, "plan", [1, 2]);
    bench.contenders = vec![Flaky::on(&[], &[pair]).contender()];
    // Its matches, none, come behind those of the other pairs.
    bench.shards(&plan, "plan", [1, 2]);
    let merged = merge(&plan, &bench.path("plan"), &[], &bench.path("merged")).unwrap();
    let single = bench.work(KeepMatches::All, "single", None, &Stop::never());
    assert!(single.failed > 0 && merged.failed == single.failed as u64);
    let but_for_devices = |name| {
        let (mut records, others) = bench.results(name);
        // What was tried again with matches that were stored has none.
        for record in &mut records {
            record.device = None;
        }
        (records, others)
    };
    assert!(but_for_devices("merged") == but_for_devices("single"));
}

#[test]
fn a_shard_is_merged_where_what_broke_later_has_few_matches() {
    let toy = Toy {
        threshold: 200,
        ..Toy::default()
    };
    let bench = Bench::new(vec![toy.contender("toy", &["first"])]);
    let plan = bench.plan("plan", 1, KeepMatches::All);
    // The pairs of an image that came late have their matches at the end of the file.
    let image = bench.path("street/0000.raw");
    fs::rename(&image, bench.path("away")).unwrap();
    bench.shards(&plan, "plan", [1]);
    fs::rename(bench.path("away"), &image).unwrap();
    bench.shards(&plan, "plan", [1]);
    let file = store::path(&bench.path("plan/shards/1"), "street", "toy", "first");
    let mut records = store::read(&file).unwrap();
    for record in records.iter_mut().filter(|record| record.task.a == 0) {
        let selected = record.counts.selected as usize;
        assert!(selected > 0 && selected < MIN_MATCHES, "{selected}");
        record.outcome = Outcome::Failed {
            reason: "its depth cannot be read".into(),
            may_pass: true,
        };
    }
    store::rewrite(&file, &records).unwrap();
    merge(&plan, &bench.path("plan"), &[], &bench.path("merged")).unwrap();
    bench.run("single").unwrap();
    let matches = |run: &str| fs::read(bench.path(run).join("matches/street/toy.bin")).unwrap();
    assert_eq!(matches("merged"), matches("single"));
}

/// Retried matches are appended at once, their records later.
#[test]
fn a_shard_that_was_killed_while_it_tried_again_is_merged() {
    let flaky = || Flaky::default().with(&["first"]);
    let toy = || Toy::default().contender("toy", &["first"]);
    for keep in [KeepMatches::All, KeepMatches::Inliers] {
        let mut bench = Bench::new(vec![toy(), flaky()]);
        bench.datasets.truncate(1);
        let name = format!("{keep:?}");
        let plan = bench.plan(&name, 1, keep);
        let image = bench.path("street/0006.raw");
        fs::rename(&image, bench.path("away")).unwrap();
        let fails = [[4, 6], [5, 6], [6, 7], [6, 8]];
        bench.contenders[1] = Flaky::on(&fails, &[]).with(&["first"]);
        bench.shards(&plan, &name, [1]);
        let records = bench.path(&name).join("shards/1/records");
        let before: Vec<_> = (files(&records).into_iter())
            .map(|file| (fs::read(&file).unwrap(), file))
            .collect();
        fs::rename(bench.path("away"), &image).unwrap();
        bench.contenders[1] = flaky();
        bench.shards(&plan, &name, [1]);
        for (bytes, file) in before {
            assert_ne!(fs::read(&file).unwrap(), bytes);
            fs::write(file, bytes).unwrap();
        }
        let out = format!("merged {name}");
        let merged = merge(&plan, &bench.path(&name), &[], &bench.path(&out)).unwrap();
        assert_eq!(merged.failed, 2 * fails.len() as u64);
        // The run goes on with that.
        let again = bench.work(keep, &out, None, &Stop::never());
        assert_eq!((again.now, again.failed), (2 * fails.len(), 0));
        bench.work(keep, &format!("single {name}"), None, &Stop::never());
        let single = bench.records(&format!("single {name}"));
        let but_for_devices = |mut records: Vec<RunRecord>| {
            for record in &mut records {
                record.device = None;
            }
            records
        };
        assert_eq!(
            but_for_devices(bench.records(&out)),
            but_for_devices(single)
        );
    }
}

#[test]
fn a_shard_that_has_lost_matches_is_run_again() {
    let bench = bench();
    let plan = bench.plan("plan", 2, KeepMatches::All);
    bench.shards(&plan, "plan", [1, 2]);
    let merged = || merge(&plan, &bench.path("plan"), &[], &bench.path("merged"));
    let file = bench.path("plan/shards/1/matches/street/dark.bin");
    let sound = fs::read(&file).unwrap();
    fs::write(&file, &sound[..sound.len() / 2]).unwrap();
    let error = merged().unwrap_err().to_string();
    assert!(
        error.contains("run shard 1 again, which makes them again") && !error.contains("delete"),
        "{error}"
    );
    bench.shards(&plan, "plan", [1]);
    merged().unwrap();
    bench.run("single").unwrap();
    assert!(bench.results("merged") == bench.results("single"));
}

#[test]
fn what_a_run_has_repaired_since_it_was_merged_stays() {
    let bench = bench();
    let plan = bench.plan("plan", 2, KeepMatches::All);
    bench.shards(&plan, "plan", [1, 2]);
    let merged = || merge(&plan, &bench.path("plan"), &[], &bench.path("merged"));
    merged().unwrap();
    let before = bench.results("merged");
    // Again, it does no harm.
    merged().unwrap();
    assert!(bench.results("merged") == before);
    let file = store::path(&bench.path("plan/shards/1"), "street", "bright", "first");
    let mut records = store::read(&file).unwrap();
    records[0].outcome = Outcome::Failed {
        reason: "for a while".into(),
        may_pass: true,
    };
    store::rewrite(&file, &records).unwrap();
    let error = merged().unwrap_err().to_string();
    assert!(error.contains("1 record failed in the shards"), "{error}");
    assert!(bench.results("merged") == before);
}
