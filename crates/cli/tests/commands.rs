//! What every command promises on the command line: output, messages, exit codes.

mod common;
mod planes;

use std::fmt::Write;
use std::fs;
use std::process::Output;

use common::{dataset, matchbench};
use planes::homographies;

fn run(arguments: &[&str]) -> Output {
    matchbench()
        .args(arguments)
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn help_succeeds_and_bad_usage_is_bad_input() {
    assert_eq!(run(&["--help"]).status.code(), Some(0));
    for arguments in [&["bogus"][..], &["run"], &["run", "--no-such-option"], &[]] {
        assert_eq!(run(arguments).status.code(), Some(1), "{arguments:?}");
    }
}

#[test]
fn help_of_every_command_fits_into_a_hundred_columns() {
    let all = text(&run(&["--help"]).stdout);
    let (_, commands) = all.split_once("Commands:\n").expect("they are listed");
    let (commands, _) = commands.split_once("\n\n").expect("options follow");
    let names = (commands.lines()).filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    let names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    assert!(names.len() > 20, "{names:?}");
    for name in names {
        let help = text(&run(&[name, "--help"]).stdout);
        let long = help.lines().find(|line| line.chars().count() > 100);
        assert_eq!(long, None, "{name}");
    }
}

#[test]
fn list_names_every_parameter() {
    let out = text(&run(&["list"]).stdout);
    for expected in [
        "sift",
        "extractor.contrast_threshold = 0.04",
        "extractor.max_size ",
        "extractor.size ",
        "selection = \"ratio\"  (ratio, mutual, smnn, fginn)",
        "budget = \"authors\"  (authors, small)",
        "sampler = \"prosac\"  (uniform, prosac, spread)",
        "ransac-e",
        "strecha",
    ] {
        assert!(out.contains(expected), "{expected} is not in\n{out}");
    }
}

#[test]
fn shells_complete_every_command_and_the_manual_names_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("man1");
    assert!(
        run(&["man", "--out", &out.to_string_lossy()])
            .status
            .success()
    );
    let manual = text(&run(&["man"]).stdout);
    for command in ["demo", "import", "validate", "run", "completions", "man"] {
        for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
            let script = text(&run(&["completions", shell]).stdout);
            assert!(script.contains(command), "{shell}: {command}");
        }
        assert!(
            manual.contains(&format!("matchbench\\-{command}(1)")),
            "{command}\n{manual}"
        );
        let page = fs::read_to_string(out.join(format!("matchbench-{command}.1")));
        assert!(page.is_ok_and(|page| page.starts_with(".ie")), "{command}");
    }
    assert_eq!(run(&["completions", "tcsh"]).status.code(), Some(1));
}

#[test]
fn names_that_do_not_exist_are_answered_with_those_that_do() {
    for (arguments, expected) in [
        (
            ["run", "x", "--matchers", "sfit", "--out", "y"],
            "did you mean `sift`",
        ),
        (
            ["run", "/no/such/folder", "--matchers", "sift", "--out", "y"],
            "/no/such/folder",
        ),
        (
            ["import", "nuscenes", "x", "y", "--pairs", "all"],
            "strecha",
        ),
        (["import", "tum", ".", "y", "--pairs", "some"], "fragments:"),
    ] {
        let output = run(&arguments);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn a_parameter_is_set_by_name_and_an_unknown_one_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2);
    let go = |setting: &str, run: &str| {
        matchbench()
            .args(["run", "--matchers", "sift", "--set", setting, "--out"])
            .args([&folder.path().join(run), &wall])
            .output()
            .expect("the program starts")
    };
    assert!(go("sift.ratio=0.7", "right").status.success());
    let plan = fs::read_to_string(folder.path().join("right/plan.json")).expect("a plan");
    assert!(plan.contains("\"ratio\": 0.7"), "{plan}");
    for (setting, named) in [
        ("sift.raito=0.7", "raito"),
        ("sift.extractor.sgima=1", "sgima"),
        ("surf.ratio=0.7", "is not part of this run"),
    ] {
        let refused = go(setting, "wrong");
        assert_eq!(refused.status.code(), Some(1));
        assert!(
            text(&refused.stderr).contains(named),
            "{}",
            text(&refused.stderr)
        );
    }
}

/// Three listed pairs, one true pose each: no turn, one step to the right.
///
/// | pair | result | error in degrees |
/// | --- | --- | --- |
/// | 0 1 | 100 matches, direction turned by atan(0.0524) | 3.0 |
/// | 0 2 | 300 matches, direction turned by atan(0.1763) | 10.0 |
/// | 0 3 | no row | failed |
/// | 7 8 | not listed | ignored |
///
/// SP(1..3) = 0 (the first error lies just above 3), SP(4..10) = 1/3, SP(11..15) = 2/3 (the second
/// error lies just above 10), so AUC = (7/3 + 10/3) / 15 = 17/45 = 0.3777...; AP(5) = 100.
#[test]
fn eval_scores_the_authors_layout_as_counted_by_hand() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let truth = folder.path().join("truth/room");
    let results = folder.path().join("results/room");
    fs::create_dir_all(&truth).expect("writable");
    fs::create_dir_all(&results).expect("writable");
    let pose = |t: &str| format!("1 0 0 {t} 0 1 0 0 0 0 1 0");
    fs::write(
        truth.join("pairs.txt"),
        format!("0 1 {0}\r\n0 2   {0} \n0 3 {0}", pose("1")),
    )
    .expect("writable");
    let turned = |x: &str, y: &str| format!("1 0 0 {x} 0 1 0 {y} 0 0 1 0");
    fs::write(
        results.join("sift.txt"),
        format!(
            "0 1 100 {}\n0 2 300 {}\n7 8 50 {}\n",
            turned("0.998629", "0.05234"),
            turned("0.984807", "0.17366"),
            pose("1"),
        ),
    )
    .expect("writable");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let output = run(&[
        "eval",
        &path("results"),
        "--datasets",
        &path("truth"),
        "--format",
        "csv",
    ]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    for warning in [
        "no result with sift for 1 of 3 pairs of room, counted as wrong",
        "ignored: 1 result of sift for pairs that room does not list in this order",
    ] {
        assert!(said.contains(warning), "{said}");
    }
    let csv = text(&output.stdout);
    let mut lines = csv.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let row: Vec<&str> = lines.next().expect("a row").split(',').collect();
    assert_eq!(lines.next(), None);
    let value = |name: &str| {
        row[header
            .iter()
            .position(|column| *column == name)
            .expect(name)]
    };
    let number = |name: &str| value(name).parse::<f64>().expect(name);
    assert_eq!((value("dataset"), value("matcher")), ("room", "sift"));
    assert_eq!(
        (value("pairs"), value("failed"), value("ignored")),
        ("3", "1", "1")
    );
    for (name, expected) in [
        ("sp3", 0.0),
        ("sp4", 1.0 / 3.0),
        ("sp10", 1.0 / 3.0),
        ("sp11", 2.0 / 3.0),
    ] {
        assert!((number(name) - expected).abs() < 1e-12, "{name}");
    }
    assert!((number("auc") - 17.0 / 45.0).abs() < 1e-12);
    assert_eq!(number("ap5"), 100.0);
}

#[test]
fn eval_of_the_published_shape_needs_no_datasets() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let sequence = folder.path().join("results/06-office-wide");
    fs::create_dir_all(&sequence).expect("writable");
    // All pairs of 12 images, as published; right where the images are near.
    let (mut truth, mut rows) = (String::new(), String::new());
    for (a, b) in (0..12).flat_map(|a| (a + 1..12).map(move |b| (a, b))) {
        writeln!(truth, "{a} {b} 1 0 0 1 0 1 0 0 0 0 1 0").expect("a string takes all");
        let found = u32::from(b - a <= 9);
        writeln!(rows, "{a} {b} {} 1 0 0 {found} 0 1 0 0 0 0 1 0", 50 * found)
            .expect("a string takes all");
    }
    fs::write(sequence.join("groundtruth.txt"), truth).expect("writable");
    fs::write(sequence.join("sift.txt"), rows).expect("writable");
    let auc = |more: &[&str]| {
        let results = path("results");
        let output = run(&[&["eval", &results, "--format", "csv"], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let row = text(&output.stdout)
            .lines()
            .nth(1)
            .expect("one row")
            .to_owned();
        let fields: Vec<&str> = row.split(',').collect();
        (
            fields[3].to_owned(),
            fields[5].parse::<f64>().expect("an AUC"),
        )
    };
    assert_eq!(auc(&[]), ("66".into(), 63.0 / 66.0));
    assert_eq!(auc(&["--pairs", "window:9"]), ("63".into(), 1.0));
    assert_eq!(auc(&["--preset", "paper"]), ("63".into(), 1.0));
    let strided = ["eval", &path("results"), "--pairs", "window:9,stride:15"];
    assert!(text(&run(&strided).stderr).contains("after the stride"));
}

#[test]
fn eval_of_published_errors_ends_with_their_mean() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let method = folder.path().join("root_sift");
    fs::create_dir(&method).expect("writable");
    let head = "identifiers covisible0 covisible1 R_errs t_errs t_errs2";
    fs::write(method.join("KIT.txt"), format!("{head}\na#1#2 1 1 0 0 0\n")).expect("writable");
    fs::write(
        method.join("ICL.txt"),
        format!("{head}\na#1#2 1 1 90 9 9\n"),
    )
    .expect("writable");
    let errors = method.display().to_string();
    let output = run(&["eval", "--errors", &errors, "--format", "csv"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let csv = text(&output.stdout);
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let at = rows[0]
        .iter()
        .position(|head| *head == "exact_auc_5")
        .expect("a column");
    let scores: Vec<_> = rows[1..].iter().map(|row| (row[0], row[at])).collect();
    assert_eq!(scores, [("ICL", "0.0"), ("KIT", "1.0"), ("mean", "0.5")]);
    assert_eq!(run(&["eval"]).status.code(), Some(1));
}

#[test]
fn a_run_exports_to_what_eval_reads_with_the_same_scores() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let path = |name: &str| folder.path().join(name).display().to_string();
    let done = matchbench()
        .args(["run", "--matchers", "sift", "--report", "--out"])
        .args([&path("run"), &wall.display().to_string()])
        .output()
        .expect("the program starts");
    assert!(done.status.success(), "{}", text(&done.stderr));
    assert!(folder.path().join("run/report/index.html").is_file());
    assert!(
        run(&["export", &path("run"), &path("authors")])
            .status
            .success()
    );
    let score = |arguments: &[&str]| {
        let output = run(&[arguments, &["--format", "json"]].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let text = json.to_string();
        let auc = text.split("\"auc\":").nth(1).expect("an AUC").to_owned();
        auc.split(',').next().expect("a number").to_owned()
    };
    let from_run = score(&["eval", &path("run")]);
    let from_authors = score(&[
        "eval",
        &path("authors"),
        "--datasets",
        &folder.path().display().to_string(),
    ]);
    assert_eq!(from_run, from_authors);
}

#[test]
fn validate_names_file_and_line_and_remedy() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let path = wall.display().to_string();
    assert_eq!(run(&["validate", &path]).status.code(), Some(0));
    let pairs = fs::read_to_string(wall.join("pairs.txt")).expect("written just now");
    let broken = pairs.replace("0 2  1 0 0", "0 9  1 NaN 0");
    fs::write(wall.join("pairs.txt"), broken + &pairs).expect("writable");
    fs::write(wall.join("Images/0001.pgm"), "P5 160 120 255\n").expect("writable");
    let output = run(&["validate", &path]);
    let out = text(&output.stdout);
    assert_eq!(output.status.code(), Some(2), "{out}");
    for expected in ["pairs.txt:2:", "pairs.txt:4:", "0001.pgm"] {
        assert!(out.contains(expected), "{expected} is not in\n{out}");
    }
}

#[test]
fn validate_counts_what_it_says_of_many_files_unless_all_are_asked_for() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 13);
    let path = wall.display().to_string();
    for index in 1..13 {
        let file = wall.join(format!("Images/{index:04}.pgm"));
        fs::write(file, index.to_string()).expect("writable");
    }
    let errors = |arguments: &[&str]| {
        let out = text(&run(arguments).stdout);
        let named = (out.lines().filter(|line| line.contains(".pgm: "))).count();
        assert!(out.contains("12 errors, "), "{out}");
        (named, out.contains("and 2 more errors of the kind: "))
    };
    assert_eq!(errors(&["validate", &path]), (10, true));
    assert_eq!(errors(&["validate", &path, "--all"]), (12, false));
}

#[test]
fn show_draws_a_pair_that_the_dataset_lists() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3).display().to_string();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let show = |pair: [&str; 2], out: &str| {
        let [a, b] = pair;
        run(&[
            "show",
            &wall,
            a,
            b,
            "--matcher",
            "sift",
            "--keypoints",
            "--out",
            &path(out),
        ])
    };
    let shown = show(["0", "2"], "pair.svg");
    let said = text(&shown.stdout);
    assert!(shown.status.success(), "{}", text(&shown.stderr));
    assert!(
        said.contains("wall 0 – 2, sift + ransac-e: pose off by"),
        "{said}"
    );
    assert!(said.contains("selected matches"), "{said}");
    let svg = fs::read_to_string(path("pair.svg")).expect("it was written");
    assert!(svg.matches("<image").count() == 2 && svg.contains("class=\"keypoints\""));
    assert!(svg.contains("magenta: keypoints"));
    let plain = path("plain.svg");
    let shown = run(&[
        "show",
        &wall,
        "0",
        "2",
        "--matcher",
        "sift",
        "--out",
        &plain,
    ]);
    assert!(shown.status.success(), "{}", text(&shown.stderr));
    let svg = fs::read_to_string(plain).expect("it was written");
    assert!(svg.contains("estimated yellow") && !svg.contains("keypoints"));
    assert!(show(["0000.pgm", "1"], "pair.png").status.success());
    let png = fs::read(path("pair.png")).expect("it was written");
    assert!(png.starts_with(b"\x89PNG"));
    for (pair, out, expected) in [
        (
            ["2", "0"],
            "no.png",
            "no pair 2 0; it has the two in the other order",
        ),
        (["0", "7"], "no.png", "there is no image `7`"),
        (["0", "7.pgm"], "no.png", "there is no image `7.pgm`"),
        (["0", "1"], "no.jpg", ".png or .svg"),
    ] {
        let refused = show(pair, out);
        assert_eq!(refused.status.code(), Some(1));
        assert!(
            text(&refused.stderr).contains(expected),
            "{}",
            text(&refused.stderr)
        );
        assert!(!folder.path().join(out).exists());
    }
}

#[test]
fn time_has_a_line_for_every_matcher() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3).display().to_string();
    let tables = ["times.csv", "times.tex"].map(|name| folder.path().join(name));
    let [csv, latex] = tables.each_ref().map(|path| path.display().to_string());
    let arguments = ["time", &wall, "--matchers", "sift,orb", "--pairs", "2"];
    let output = run(&[&arguments[..], &["--csv", &csv, "--latex", &latex]].concat());
    let out = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(
        out.contains("1 thread, no cache; first 2 pairs of wall"),
        "{out}"
    );
    let read = |path: &std::path::PathBuf| fs::read_to_string(path).expect("it was asked for");
    assert!(read(&tables[0]).contains("\norb,") && read(&tables[1]).contains("\nORB & "));
    for matcher in ["sift", "orb"] {
        let line = out
            .lines()
            .find(|line| line.starts_with(matcher))
            .expect(matcher);
        // Name and features, four stages of `median (lower–upper)`, memory and its unit.
        let words: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(
            words.len(),
            if cfg!(target_os = "linux") { 12 } else { 11 },
            "{line}"
        );
        assert!(words[1].parse::<u32>().expect("a count") > 0, "{line}");
        assert!(
            words[2].parse::<f64>().expect("milliseconds") > 0.0,
            "{line}"
        );
    }
    // Before anything is measured.
    let refused = run(&[&arguments[..], &["--csv", &format!("{wall}/dataset.toml")]].concat());
    assert_eq!(refused.status.code(), Some(1));
    assert!(refused.stdout.is_empty(), "{}", text(&refused.stdout));
    let said = text(&refused.stderr);
    assert!(said.contains("which it would damage"), "{said}");
}

#[test]
fn a_plane_without_poses_is_timed_and_shown() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    fs::remove_file(wall.join("pairs.txt")).expect("it was there");
    homographies(&wall, &[(0, 1), (0, 2)]);
    // The report of a run on it has this command.
    let wall = wall.display().to_string();
    let timed = run(&["time", &wall, "--matchers", "orb", "--pairs", "2"]);
    assert!(timed.status.success(), "{}", text(&timed.stderr));
    assert!(text(&timed.stdout).contains("\norb "), "{timed:?}");
    let out = folder.path().join("pair.svg").display().to_string();
    let refused = run(&["show", &wall, "1", "2", "--matcher", "orb", "--out", &out]);
    let said = "has no pair 1 2; its homographies.txt lists those that it has";
    assert!(text(&refused.stderr).contains(said), "{refused:?}");
}

#[test]
fn compare_says_what_changed_in_numbers_and_in_words() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 14).display().to_string();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let go = |name: &str, setting: &str| {
        let arguments = ["--matchers", "sift", "--set", setting, "--out", &path(name)];
        let done = run(&[&["run", &wall][..], &arguments].concat());
        assert!(done.status.success(), "{}", text(&done.stderr));
    };
    go("good", "sift.ratio=0.8");
    // There are no features, so no poses.
    go("bad", "sift.extractor.contrast_threshold=0.9");
    let compare = |before: &str, after: &str| {
        let output = run(&["compare", &path(before), &path(after)]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let out = compare("bad", "good");
    let sentence = format!(
        "{} beats {} on wall with sift + ransac-e by ",
        path("good"),
        path("bad")
    );
    assert!(out.contains(&sentence) && out.contains("better"), "{out}");
    // The report decides it together with all others.
    assert!(out.contains("], for this comparison alone\n"), "{out}");
    assert!(compare("good", "bad").contains(&sentence));
    assert!(compare("good", "good").contains("score the same on wall"));
}

#[test]
fn eval_says_who_is_best_and_how_certainly() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 8).display().to_string();
    let out = folder.path().join("run").display().to_string();
    let done = run(&["run", &wall, "--matchers", "sift,orb", "--out", &out]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    let told = text(&run(&["eval", &out]).stdout);
    let sentences: Vec<&str> = told
        .lines()
        .filter(|line| line.starts_with("wall: "))
        .collect();
    let [sentence] = sentences[..] else {
        panic!("one sentence for the dataset:\n{told}");
    };
    assert!(
        sentence.contains("sift + ransac-e") && sentence.contains("orb + ransac-e"),
        "{told}"
    );
    let few = dataset(folder.path(), "few", 5).display().to_string();
    let of_few = folder.path().join("of-few").display().to_string();
    let done = run(&["run", &few, "--matchers", "sift,orb", "--out", &of_few]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    let told_of_few = text(&run(&["eval", &of_few]).stdout);
    assert!(
        told_of_few.contains(
            "nothing is certain below 6 independent units (images that are in several pairs, and pairs that share no \
             image); there are 5"
        ),
        "{told_of_few}"
    );
    let eval = |format: &str| run(&["eval", &out, "--format", format, "--intervals"]);
    let table = text(&eval("latex").stdout);
    assert!(table.contains("SIFT}") && table.contains(" [0."), "{table}");
    let refused = text(&eval("csv").stderr);
    assert!(
        refused.contains("csv and json have intervals without it"),
        "{refused}"
    );
    let protocol = ["eval", &out, "--protocol", "matchbench,roma", "--intervals"];
    let table = text(&run(&protocol).stdout);
    assert!(
        table.contains(" [0.") && table.contains("95 % interval"),
        "{table}"
    );
    let refused = text(&run(&[&protocol[..], &["--format", "json"]].concat()).stderr);
    assert!(refused.contains("csv and json have"), "{refused}");
    let last = told.lines().last().expect("what to do next");
    assert_eq!(last, format!("Next: matchbench report {out}"));
    let report = run(&["report", &out, "--threads", "1"]);
    assert!(report.status.success(), "{}", text(&report.stderr));
    let page = folder.path().join("run/report/index.html");
    let page = fs::read_to_string(page).expect("it was written");
    let words = page
        .split_once("Each comparison in words")
        .expect("a list")
        .1;
    let first = words.split_once("<li>").expect("an item").1;
    assert!(
        first.starts_with("sift") || first.starts_with("orb"),
        "{}",
        &first[..200]
    );
}

#[test]
fn threads_are_bounded() {
    for number in ["0", "5000", "many"] {
        let refused = run(&["eval", "nowhere", "--threads", number]);
        let message = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(1), "{message}");
        assert!(message.contains("from 1 to 1024"), "{message}");
    }
}
