//! What a manifest may say, and what it means.

use proptest::prelude::*;
use serde_json::json;

use super::*;

const LEAST: &str = "name = 'x'\ncommand = ['serve']\n";

fn parse(text: &str) -> Result<Manifest, ManifestError> {
    let built_in = BuiltIn {
        matchers: vec!["sift"],
        estimators: vec!["best"],
    };
    Manifest::parse(Path::new("/m/x.toml"), text, &built_in)
}

#[test]
fn what_is_left_out_has_its_default() {
    let manifest = parse(LEAST).unwrap();
    assert_eq!(manifest.kind, Kind::Matches);
    assert_eq!(manifest.workers, 1);
    let seconds = [manifest.timeout, manifest.start_timeout].map(|wait| wait.as_secs());
    assert_eq!(seconds, [60, 300]);
    assert_eq!(manifest.folder(), Path::new("/m"));
    assert_eq!(manifest.effective(), json!({}));
}

#[test]
fn what_cannot_be_is_named_with_its_line() {
    for (text, line, named) in [
        ("name = 'x'\ncommand = ['a']\ncolour = 3\n", 3, "colour"),
        (
            "name = 'x'\ncommand = ['a']\ntimeuot_s = 3\n",
            3,
            "did you mean `timeout_s`?",
        ),
        ("name = 'X y'\ncommand = ['a']\n", 1, "X y"),
        ("name = 'all'\ncommand = ['a']\n", 1, "all"),
        ("\nname = 'sift'\ncommand = ['a']\n", 2, "sift"),
        ("name = 'best'\ncommand = ['a']\n", 1, "best"),
        ("name = 'x'\ncommand = []\n", 2, "command"),
        ("name = 'x'\ncommand = ['']\n", 2, "command"),
        ("name = 'x'\ncommand = 'a'\n", 2, "not a list"),
        ("name = 'x'\ncommand = ['a', 3]\n", 2, "not a list"),
        (
            "name = 'x'\ncommand = ['a']\ntimeout_s = 0\n",
            3,
            "timeout_s",
        ),
        ("name = 'x'\ncommand = ['a']\ntimeout_s = nan\n", 3, "NaN"),
        (
            "name = 'x'\ncommand = ['a']\nstart_timeout_s = 1e9\n",
            3,
            "1000000000",
        ),
        ("name = 'x'\ncommand = ['a']\nworkers = 0\n", 3, "workers"),
        (
            "name = 'x'\ncommand = ['a']\nestimator = 'bset'\n",
            3,
            "unknown estimator `bset` (did you mean `best`?)",
        ),
        ("name = 'x'\ncommand = ['a']\nkind = 'poses'\n", 3, "poses"),
        (
            "name = 'x'\ncommand = ['a']\n[matching]\nratio = 0.8\n",
            3,
            "matching",
        ),
        (
            "name = 'x'\ncommand = ['a']\nkind = 'features'\n[matching]\nratio = 1.5\n",
            4,
            "1.5",
        ),
    ] {
        let error = parse(text).expect_err(text);
        assert_eq!(error.line, Some(line), "{text}: {error}");
        assert!(error.to_string().contains(named), "{text}: {error}");
    }
}

#[test]
fn a_program_is_known_by_its_name_wherever_it_is_installed() {
    for (command, started) in [
        (
            "['python3', 'x.py', '/w/1.pth']",
            ["python3", "x.py", "/w/1.pth"],
        ),
        (
            if cfg!(windows) {
                "['C:/bin/python3', 'x.py', '-q']"
            } else {
                "['/usr/bin/python3', 'x.py', '-q']"
            },
            ["python3", "x.py", "-q"],
        ),
        ("['./bin/python3', '', '']", ["./bin/python3", "", ""]),
    ] {
        let manifest = parse(&format!("name = 'x'\ncommand = {command}\n")).unwrap();
        assert_eq!(manifest.started(), started);
    }
}

#[test]
fn settings_change_parameters_at_every_depth() {
    let text = format!("{LEAST}[params]\nmodel = 'n16'\nsize = {{ w = 640, h = 480 }}\n");
    let changes = json!({"model": "n32", "size": {"w": 1024}, "new": 1});
    let manifest = parse(&text).unwrap().with(&changes).unwrap();
    assert_eq!(
        manifest.effective(),
        json!({"model": "n32", "size": {"w": 1024, "h": 480}, "new": 1})
    );
    assert!(parse(&text).unwrap().with(&json!(3)).is_err());
}

#[test]
fn the_matching_of_features_is_set_apart_from_parameters() {
    let text = format!("{LEAST}kind = 'features'\n");
    let manifest = parse(&text).unwrap();
    assert_eq!(manifest.kind, Kind::Features(Matching::default()));
    assert!(Matching::default().is_mutual());
    let changed = manifest.clone().with(&json!({"matching": {"ratio": 0.8}}));
    let Kind::Features(matching) = changed.unwrap().kind else {
        panic!("still features")
    };
    assert!(matching.ratio == Some(0.8) && !matching.is_mutual());
    for wrong in [json!({"ratoi": 0.8}), json!({"ratio": 2}), json!(3)] {
        let error = manifest.clone().with(&json!({"matching": wrong}));
        assert!(error.is_err(), "{wrong}");
    }
    let misspelt = manifest.clone().with(&json!({"matching": {"ratoi": 0.8}}));
    let said = misspelt.unwrap_err().to_string();
    assert!(
        said.ends_with(
            "unknown field `ratoi` (did you mean `ratio`?), expected one of `ratio`, `mutual`, `hamming`; correct this \
             setting"
        ),
        "{said}"
    );
    for (params, named) in [
        ("matching = 3", "cannot be called `matching`"),
        ("at = 2020-01-01", "`params.at` is the date 2020-01-01"),
        ("ratio = nan", "`params.ratio` is nan"),
        ("all = [inf]", "`params.all[0]` is inf"),
    ] {
        let text = format!("{text}[params]\n{params}\n");
        let said = parse(&text).unwrap_err().to_string();
        assert!(said.contains(named), "{said}");
    }
}

#[test]
fn paths_are_told_from_ids() {
    for (name, path) in [
        ("sift", false),
        ("x.toml", true),
        ("./x", true),
        ("a/b", true),
    ] {
        assert_eq!(Manifest::is_path(name), path, "{name}");
    }
}

proptest! {
    #[test]
    fn no_text_panics(text in "(name = 'x'\ncommand = \\['a'\\]\n)?.{0,60}") {
        let _ = parse(&text);
    }
}
