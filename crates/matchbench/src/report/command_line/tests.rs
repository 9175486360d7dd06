use serde_json::json;

use super::*;
use crate::config::Changes;
use crate::estimators::ESTIMATORS;
use crate::matchers;

fn plan(text: &Value) -> Plan {
    serde_json::from_value(text.clone()).expect("a plan")
}

/// What `--set` of a command changes.
fn changes(settings: &Given) -> Changes {
    let settings: Vec<String> = (settings.iter())
        .map(|(name, value)| setting(name, value))
        .collect();
    Changes::parse(&settings).expect("they were written for it")
}

/// Every leaf of these parameters with another value.
fn altered(params: &Value, at: &str, found: &mut Vec<(String, Value)>) {
    let other = match params {
        Value::Object(fields) => {
            for (name, value) in fields {
                altered(value, &format!("{at}.{name}"), found);
            }
            return;
        }
        Value::Bool(value) => json!(!value),
        Value::Number(number) if number.is_f64() => match number.as_f64().expect("it is one") {
            0.0 => json!(0.1),
            number => json!(0.9 * number),
        },
        Value::Number(number) => json!(number.as_u64().expect("counts are not negative") + 1),
        Value::Null => json!(20),
        Value::String(_) | Value::Array(_) => return,
    };
    found.push((at.to_owned(), other));
}

#[test]
fn every_parameter_that_is_changed_is_set_to_the_same_again() {
    let mut tried = 0;
    for entry in MATCHERS {
        let mut others = Vec::new();
        altered(&entry.defaults(), entry.id(), &mut others);
        others.push((format!("{}.extractor.size", entry.id()), json!("640x480")));
        for (name, value) in others {
            let given = changes(&Given::from([(name.clone(), value)]));
            let Ok(built) = matchers::build(*entry, given.of(entry.id())) else {
                continue; // it would do nothing, or be out of range
            };
            let planned = MatcherPlan {
                id: entry.id().into(),
                version: None,
                command: None,
                params: built.params.clone(),
                extraction: Some(built.extraction),
                notes: Vec::new(),
                estimators: Vec::new(),
            };
            let settings = of_matcher(&planned);
            let again = changes(&settings);
            let again = matchers::build(*entry, again.of(entry.id())).expect("it was built");
            assert_eq!(again.params, built.params, "{name}");
            // Where turns are used, the number of hypotheses is a parameter too.
            let brought = usize::from(name.rsplit('.').next() == Some("turns"));
            assert_eq!(settings.len(), 1 + brought, "{name}: {settings:?}");
            tried += 1;
        }
    }
    for entry in ESTIMATORS {
        let mut others = Vec::new();
        altered(&entry.defaults(), entry.id(), &mut others);
        for (name, value) in others {
            let given = changes(&Given::from([(name.clone(), value)]));
            let Ok(built) = entry.build(given.of(entry.id())) else {
                continue;
            };
            let mut settings = Given::new();
            differences(entry.id(), &built.params, &entry.defaults(), &mut settings);
            let again = entry.build(changes(&settings).of(entry.id()));
            assert_eq!(again.expect("it was built").params, built.params, "{name}");
            tried += 1;
        }
    }
    assert!(tried > 100, "{tried}");
}

/// Two datasets, and matchers of every origin.
fn every_origin() -> Plan {
    let defaults = |id: &str| defaults(id).expect("it is built in");
    let mut sift = defaults("sift");
    sift["ratio"] = json!(0.7);
    let extraction = json!({"extractor": "x", "params": {}, "revision": 1});
    let own = |id: &str| json!([{"id": id, "params": defaults(id)}]);
    plan(&json!({
        "format": 2, "version": "0.1.0",
        "settings": {"seed": 7, "repetitions": 3, "limit": 50, "sample": 9},
        "datasets": [
            {"name": "room", "path": "/x/room", "frames": 3, "pairs": 3, "fingerprint": "ab"},
            {"name": "it's", "path": "/x/it's", "frames": 3, "pairs": 3, "fingerprint": "cd"},
        ],
        "matchers": [
            {"id": "sift", "params": sift, "extraction": extraction, "estimators": own("ransac-e")},
            {"id": "code", "params": defaults("code"), "extraction": extraction, "estimators": own("rich")},
            {"id": "loma", "params": {"datasets": [{
                "name": "room", "format": "npz", "pixel_center": 0.5, "verified": false,
                "files": [{"name": "a.npz", "count": 1, "blake3": "00"}], "notes": {"device": "cuda"},
            }]}, "estimators": own("best")},
            {"id": "mine", "version": "mine 2", "params": {"size": 1024}, "estimators": own("best")},
        ],
    }))
}

#[test]
fn each_origin_has_its_arguments() {
    let plan = every_origin();
    let line = |matcher: usize| {
        let matcher = &plan.matchers[matcher];
        let line = cell(
            &plan,
            &plan.datasets[0],
            (matcher, &matcher.estimators[0]),
            "out",
        );
        line.expect("a command can").to_string()
    };
    let rest = "--limit 50 --sample 9 --repeat 3 --seed 7 --out out";
    assert_eq!(
        line(0),
        format!(
            "matchbench run room --matchers sift --estimator ransac-e --set sift.ratio=0.7 {rest}"
        )
    );
    assert_eq!(
        line(1),
        format!("matchbench run room --matchers code --estimator rich {rest}")
    );
    assert_eq!(
        line(2),
        format!(
            "matchbench run room --matches loma=MATCHES/loma/room/a.npz --matches-format npz --pixel-center 0.5 \
             --note device=cuda --estimator best {rest}"
        )
    );
    assert_eq!(
        line(3),
        format!(
            "matchbench run room --matchers mine.toml --estimator best --set mine.size=1024 {rest}"
        )
    );
}

#[test]
fn one_command_asks_for_all_where_one_can() {
    let mut plan = every_origin();
    let room = |plan: &Plan| whole(plan, &[&plan.datasets[0]], "out").map(|line| line.to_string());
    let line = room(&plan).expect("each has its own estimator");
    assert!(
        line.contains(
            "room --matches loma=MATCHES/loma/room/a.npz --matches-format npz --pixel-center"
        ) && line.contains("--matchers sift,code,mine.toml"),
        "{line}"
    );
    assert!(!line.contains("--estimator"), "{line}");
    plan.matchers.truncate(2);
    let both: Vec<&DatasetPlan> = plan.datasets.iter().collect();
    let line = whole(&plan, &both, "out")
        .expect("both have the same")
        .to_string();
    assert!(
        line.starts_with(r"matchbench run room 'it'\''s' --matchers sift,code --set"),
        "{line}"
    );
    // Estimators that are not each matcher's own are named, and only where all have them.
    let rich = plan.matchers[1].estimators[0].clone();
    plan.matchers[0].estimators.push(rich);
    assert_eq!(room(&plan), None);
    let first = plan.matchers[0].estimators[0].clone();
    plan.matchers[1].estimators.push(first);
    let line = room(&plan).expect("both have both");
    assert!(line.contains("--estimator ransac-e,rich"), "{line}");
    plan.datasets[1].matchers = Some(vec!["sift".into()]);
    let both: Vec<&DatasetPlan> = plan.datasets.iter().collect();
    assert_eq!(whole(&plan, &both, "out"), None);
    plan.shard = Some(crate::records::ShardOf {
        plan: "x".into(),
        number: 1,
    });
    assert_eq!(room(&plan), None);
}

#[test]
fn several_sources_of_files_are_one_command_where_they_are_read_alike() {
    let mut plan = every_origin();
    let mut other = plan.matchers[2].clone();
    other.id = "roma".into();
    other.params["datasets"][0]["files"][0] = json!({"name": "npz", "count": 9, "blake3": "00"});
    plan.matchers = vec![plan.matchers[2].clone(), other];
    let line = |plan: &Plan| whole(plan, &[&plan.datasets[0]], "out").map(|line| line.to_string());
    let both = "matchbench run room --matches loma=MATCHES/loma/room/a.npz --matches roma=MATCHES/roma/room";
    let read = "--pixel-center 0.5 --note device=cuda --limit 50";
    assert_eq!(
        line(&plan)
            .expect("one command can")
            .split(" --sample")
            .next(),
        Some(&*format!("{both} --matches-format npz {read}"))
    );
    // Each format is known by its content, and all else is one option of all files.
    plan.matchers[1].params["datasets"][0]["format"] = json!("hloc");
    let said = line(&plan).expect("one command can");
    assert!(said.starts_with(&format!("{both} {read}")), "{said}");
    plan.matchers[1].params["datasets"][0]["pixel_center"] = json!(0.0);
    assert_eq!(line(&plan), None);
    plan.matchers[0].params["datasets"][0]["pixel_center"] = json!(0.0);
    let said = line(&plan).expect("one command can");
    assert!(said.contains(" --pixel-center 0 "), "{said}");
    plan.matchers.remove(1);
    let mut more = plan.matchers[0].params["datasets"][0].clone();
    more["name"] = json!("it's");
    let its = plan.matchers[0].params["datasets"].as_array_mut();
    its.expect("it is a list").push(more);
    let datasets: Vec<&DatasetPlan> = plan.datasets.iter().collect();
    let said = whole(&plan, &datasets, "out").map(|line| line.to_string());
    assert!(said.is_some_and(|said| said.contains("--matches loma=MATCHES/loma --matches-format")));
}

#[test]
fn a_protocol_says_its_settings_and_size_only_where_the_run_had_them() {
    let mut plan = every_origin();
    plan.matchers.truncate(1);
    let EstimatorRule::Of { id, params } = protocols::SUPERGLUE.estimator else {
        panic!("it has an estimator of its own");
    };
    plan.matchers[0].estimators = vec![EstimatorPlan {
        id: protocols::SUPERGLUE.name_of(id),
        variant_of: Some(id.into()),
        params: together(defaults(id), Some(params())).expect("both are there"),
        protocol: protocols::SUPERGLUE.rules(),
    }];
    let line = |plan: &Plan| {
        let matcher = &plan.matchers[0];
        let line = cell(
            plan,
            &plan.datasets[0],
            (matcher, &matcher.estimators[0]),
            "out",
        );
        line.expect("a command can").to_string()
    };
    // The images were looked at as they are: with this protocol alone they would not be.
    let as_they_are =
        format!("--estimator {id} --protocol matchbench,superglue --set sift.ratio=0.7");
    assert!(line(&plan).contains(&as_they_are), "{}", line(&plan));
    plan.matchers[0].params["extractor"]["size"] = json!("640x480");
    let resized = "--protocol superglue --set sift.extractor.size=640x480 --set sift.ratio=0.7";
    assert!(line(&plan).contains(resized), "{}", line(&plan));
}

#[test]
fn a_pair_is_drawn_with_the_settings_and_the_seed_of_the_run() {
    let plan = every_origin();
    let shown = |matcher: usize, dataset: usize| {
        let matcher = &plan.matchers[matcher];
        show(
            &plan,
            &plan.datasets[dataset],
            (matcher, &matcher.estimators[0]),
        )
    };
    let rest = "--seed 7 --out pair.png";
    let sift = format!("--matcher sift --estimator ransac-e --set sift.ratio=0.7 {rest}");
    assert_eq!(shown(0, 0), Some(["matchbench show room".into(), sift]));
    let code = format!("--matcher code --estimator rich {rest}");
    assert_eq!(
        shown(1, 1),
        Some([r"matchbench show 'it'\''s'".into(), code])
    );
    let files = "--matches loma=MATCHES/loma/room/a.npz --matches-format npz --pixel-center 0.5 --note device=cuda";
    let files = format!("{files} --estimator best {rest}");
    assert_eq!(shown(2, 0), Some(["matchbench show room".into(), files]));
    let mine = format!("--matcher mine.toml --estimator best --set mine.size=1024 {rest}");
    assert_eq!(shown(3, 0), Some(["matchbench show room".into(), mine]));
}

#[test]
fn a_shell_takes_no_name_for_anything_else() {
    let line = CommandLine::new(["run", "a b", "$(rm x)", "it's", "", "-x"]);
    assert_eq!(
        line.to_string(),
        r"matchbench run 'a b' '$(rm x)' 'it'\''s' '' -x"
    );
    assert_eq!(folder("-x"), "./-x");
}
