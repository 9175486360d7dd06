//! Plans of earlier versions, converted to what this version would write for the same run.
//!
//! Earlier plans list parameters that had no effect (the threshold of a score without one, the samples'
//! grid beside uniform samples). These parameters do not exist any more. Without them the plans equal those
//! of today, and their runs can go on.

use serde_json::Value;

use crate::{estimators, matchers};

/// The plan without parameters that did nothing.
pub(super) fn modernized(mut plan: Value) -> Value {
    for matcher in list(&mut plan, "matchers") {
        modernize_matcher(matcher);
        for estimator in list(matcher, "estimators") {
            modernize_estimator(estimator);
        }
    }
    plan
}

fn modernize_matcher(plan: &mut Value) {
    let Some(Ok(entry)) = id(plan).map(matchers::find) else {
        return;
    };
    let Some(written) = plan.get("params") else {
        return;
    };
    let params = entry.modernized(written);
    if params == *written {
        return;
    }
    // The extraction repeats the parameters of the extractor. Another revision is another extraction.
    if let Ok(built) = entry.build(Some(&params)) {
        let extraction = crate::config::to_json(&built.extraction);
        if let Some(before) = plan.get_mut("extraction")
            && before.get("revision") == extraction.get("revision")
        {
            *before = extraction;
        }
    }
    plan["params"] = params;
}

fn modernize_estimator(plan: &mut Value) {
    // Variants that differ in a parameter are called `ID@VALUE`.
    let id = id(plan).and_then(|id| id.split('@').next());
    let Some(Ok(entry)) = id.map(estimators::find) else {
        return;
    };
    if let Some(params) = plan.get_mut("params") {
        *params = entry.modernized(params);
    }
}

fn id(plan: &Value) -> Option<&str> {
    plan.get("id")?.as_str()
}

fn list<'a>(plan: &'a mut Value, name: &str) -> &'a mut [Value] {
    (plan.get_mut(name).and_then(Value::as_array_mut)).map_or(&mut [], Vec::as_mut_slice)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::estimators::ESTIMATORS;
    use crate::matchers::MATCHERS;

    /// What every estimator but `ransac-e` listed.
    fn every_parameter() -> Value {
        json!({
            "geometry": "essential", "score": "msac", "sampler": "uniform", "confidence": 0.999,
            "threshold_px": 1.0, "cheirality": true, "degensac": true, "sprt": true, "min_iterations": 50,
            "max_iterations": 1000, "local_steps": 10, "final_loss": "truncated", "final_steps": 25,
            "prosac_horizon": 200_000, "cells": 20, "score_cells": 10, "max_depth": 50.0
        })
    }

    fn over(all: &Value, changes: Value) -> Value {
        let mut all = all.clone();
        let changes = changes.as_object().expect("an object").clone();
        all.as_object_mut().expect("an object").extend(changes);
        all
    }

    /// As version 0.1.0 wrote them at first.
    fn lmeds(threshold_px: f64) -> Value {
        over(
            &every_parameter(),
            json!({
                "score": "median", "threshold_px": threshold_px, "min_iterations": 218, "max_iterations": 218,
                "local_steps": 0, "final_steps": 0, "cheirality": false, "sprt": false
            }),
        )
    }

    #[test]
    fn estimators_of_earlier_plans_are_those_of_today() {
        let mut plan = json!({"matchers": [{"id": "no-such-matcher", "params": {}, "estimators": [
            {"id": "lmeds-e", "params": lmeds(1.0)},
            {"id": "lmeds-e@0.5", "params": lmeds(0.5)},
        ]}]});
        for entry in ESTIMATORS
            .iter()
            .filter(|entry| entry.id() != "lmeds-e" && entry.id() != "lmeds-f")
        {
            let params = match entry.id() {
                // Of homographies there were none.
                "ransac-e" | "ransac-h" | "best-h" => entry.defaults(),
                _ => over(&every_parameter(), entry.defaults()),
            };
            let list = plan["matchers"][0]["estimators"].as_array_mut().unwrap();
            list.push(json!({"id": entry.id(), "params": params}));
        }
        let plan = modernized(plan);
        for estimator in plan["matchers"][0]["estimators"].as_array().unwrap() {
            let id = id(estimator).unwrap().split('@').next().unwrap();
            let entry = estimators::find(id).unwrap();
            assert_eq!(estimator["params"], entry.defaults(), "{id}");
        }
    }

    #[test]
    fn what_an_earlier_version_could_not_do_is_off() {
        let entry = estimators::find("adaptive").unwrap();
        for (later, off) in [
            ("turns", json!(false)),
            ("plane_poses", json!(false)),
            ("hypotheses", json!(1)),
            ("hopeless", json!(0.0)),
        ] {
            let mut written = entry.defaults();
            let value = written.as_object_mut().unwrap().remove(later);
            assert!(value.is_some_and(|value| value != off), "{later}");
            let plan = json!({"matchers": [{"id": "sift", "estimators": [
                {"id": "adaptive", "params": written}
            ]}]});
            let mut today = over(&entry.defaults(), json!({later: off}));
            if later == "turns" {
                // Without turns there is nothing by which several would be compared.
                let compared = today.as_object_mut().unwrap().remove("hypotheses");
                assert!(compared.is_some());
            }
            let found = modernized(plan);
            assert_eq!(found["matchers"][0]["estimators"][0]["params"], today);
        }
    }

    #[test]
    fn matchers_of_earlier_plans_are_those_of_today() {
        for entry in MATCHERS {
            let built = entry.build(None).unwrap();
            let today = json!({"matchers": [{
                "id": entry.id(), "params": built.params, "extraction": built.extraction, "estimators": []
            }]});
            let mut earlier = today.clone();
            let matcher = &mut earlier["matchers"][0];
            match entry.id() {
                "freak" => {
                    for name in ["extended", "upright"] {
                        matcher["params"]["extractor"]["surf"][name] = json!(false);
                        matcher["extraction"]["params"]["surf"][name] = json!(false);
                    }
                }
                "repmatch" => {
                    let pose = &mut matcher["params"]["selection"]["pose"];
                    *pose = over(&every_parameter(), pose.clone());
                    // Later than that.
                    let pose = pose.as_object_mut().unwrap();
                    pose.retain(|name, _| name != "plane_poses" && name != "hopeless");
                }
                _ => {}
            }
            assert_eq!(modernized(earlier), today, "{}", entry.id());
        }
    }

    #[test]
    fn what_is_no_plan_is_left_as_it_is() {
        for odd in [
            json!(null),
            json!([1]),
            json!({"matchers": 1}),
            json!({"matchers": [1, {"id": 2}]}),
        ] {
            assert_eq!(modernized(odd.clone()), odd);
        }
    }
}
