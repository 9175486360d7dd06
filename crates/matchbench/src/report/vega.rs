//! Every figure as a Vega-Lite specification that contains its data, for readers who want to change it
//! (<https://vega.github.io/vega-lite/>, version 5).
//!
//! The numbers are those of the drawings. The file names are the same, with the ending `.vl.json`.

use serde_json::{Value, json};

use crate::metrics::{
    Angle, Model, Portion, Reliability, ReliabilityRange, Score, Summary, THRESHOLDS,
};

use super::by_estimator;
use super::content::Content;
use super::figures::{Difficulty, accuracies, difficulty_lines, leads_on, success_curve};
use super::latex::sequence_numbers;
use super::overview::Overview;
use super::pair_time::seconds_for_a_pair;
use crate::metrics::method;

const SCHEMA: &str = "https://vega.github.io/schema/vega-lite/v5.json";

/// SP curves, one row for each matcher and threshold.
pub(super) fn sp(overview: &Overview<'_>, column: usize, angle: Angle) -> Value {
    let model = overview.model(column);
    let unit = match model {
        Model::Pose => "degrees",
        Model::Homography => "pixels",
    };
    let rows = overview
        .ranked(column)
        .into_iter()
        .filter(|(_, summary)| summary.model == model)
        .flat_map(|(row, summary)| {
            let point = |(k, sp): (usize, f64)| json!({"matcher": row.label, unit: k, "sp": sp});
            (success_curve(summary, angle).into_iter())
                .flat_map(|curve| THRESHOLDS.zip(curve.values()).map(point))
                .collect::<Vec<_>>()
        });
    let encoding = json!({
        "x": {"field": unit, "type": "quantitative", "title": format!("error below ({unit})")},
        "y": {"field": "sp", "type": "quantitative", "title": "share of pairs"},
        "color": {"field": "matcher", "type": "nominal", "sort": null},
        "shape": {"field": "matcher", "type": "nominal", "sort": null},
    });
    figure(
        format!("SP curves: {}", overview.datasets[column]),
        rows.collect(),
        json!({"mark": {"type": "line", "point": true}, "encoding": encoding}),
    )
}

/// Mean matching accuracy of one dataset, one row for each matcher and threshold.
pub(super) fn accuracy(overview: &Overview<'_>, column: usize) -> Value {
    let rows = accuracies(overview, column)
        .into_iter()
        .flat_map(|(_, matcher, values)| {
            let point = |(k, mma)| json!({"matcher": matcher, "pixels": k, "mma": mma});
            (1..=10).zip(values).map(point).collect::<Vec<Value>>()
        });
    let encoding = json!({
        "x": {"field": "pixels", "type": "quantitative", "title": "distance below (pixels)"},
        "y": {"field": "mma", "type": "quantitative", "title": "share of the matches"},
        "color": {"field": "matcher", "type": "nominal", "sort": null},
        "shape": {"field": "matcher", "type": "nominal", "sort": null},
    });
    figure(
        format!("Mean matching accuracy: {}", overview.datasets[column]),
        rows.collect(),
        json!({"mark": {"type": "line", "point": true}, "encoding": encoding}),
    )
}

/// AP bars of one dataset, with their intervals.
pub(super) fn ap(overview: &Overview<'_>, column: usize) -> Value {
    let rows = overview.rows.iter().filter_map(|row| {
        let summary = row.cells[column].as_ref()?.summary;
        Some(scored(&row.label, "ap5", summary.scores.get("ap5")))
    });
    let x = json!({"field": "ap5", "type": "quantitative", "title": "correspondences"});
    figure(
        format!("AP bars at 5 degrees: {}", overview.datasets[column]),
        rows.collect(),
        bars_with_intervals(&x),
    )
}

/// The panel of AP bars of a portion, on a logarithmic axis.
pub(super) fn ap_panel(overview: &Overview<'_>, portion: Portion) -> Value {
    let numbers = sequence_numbers(&overview.datasets);
    let mut rows = Vec::new();
    for row in &overview.rows {
        for (column, cell) in row.cells.iter().enumerate() {
            let value = cell
                .as_ref()
                .and_then(|cell| cell.summary.scores.get("ap5").value);
            if let Some(value) = value.filter(|_| overview.portions[column] == portion) {
                rows.push(json!({"matcher": row.label, "sequence": numbers[column], "ap5": value}));
            }
        }
    }
    let encoding = json!({
        "x": {"field": "sequence", "type": "nominal", "sort": null},
        "xOffset": {"field": "matcher", "type": "nominal", "sort": null},
        "y": {"field": "ap5", "type": "quantitative", "scale": {"type": "log"}, "title": "correspondences"},
        "color": {"field": "matcher", "type": "nominal", "sort": null},
    });
    figure(
        format!("AP bars at 5 degrees: {}", portion.name()),
        rows,
        json!({"mark": "bar", "encoding": encoding}),
    )
}

/// By how much the best leads over each of the others.
pub(super) fn lead(content: &Content, overview: &Overview<'_>, column: usize) -> Value {
    let dataset = overview.datasets[column];
    let rows = leads_on(content, overview, column).map(|lead| {
        scored(
            &method(&lead.other.0, &lead.other.1),
            "behind",
            Score {
                value: lead.difference.value,
                interval: lead.difference.interval,
            },
        )
    });
    let x = json!({"field": "behind", "type": "quantitative", "title": "AUC behind the best"});
    let mut spec = bars_with_intervals(&x);
    spec["layer"][0]["mark"] = json!("point");
    figure(format!("Lead of the best: {dataset}"), rows.collect(), spec)
}

/// AUC over the difficulty of the pairs; `None` if that is not known.
pub(super) fn difficulty(
    content: &Content,
    overview: &Overview<'_>,
    column: usize,
    difficulty: Difficulty,
) -> Option<Value> {
    let (ranges, lines) = difficulty_lines(content, overview, column, difficulty)?;
    let rows = lines.iter().flat_map(|(_, label, values)| {
        let point = |(range, auc): (&String, &Option<f64>)| json!({"matcher": label, "range": range, "auc": auc});
        ranges.iter().zip(values).map(point).collect::<Vec<_>>()
    });
    let encoding = json!({
        "x": {"field": "range", "type": "ordinal", "sort": null, "title": difficulty.name()},
        "y": {"field": "auc", "type": "quantitative", "title": "AUC"},
        "color": {"field": "matcher", "type": "nominal", "sort": null},
    });
    Some(figure(
        format!(
            "AUC over {}: {}",
            difficulty.name(),
            overview.datasets[column]
        ),
        rows.collect(),
        json!({"mark": {"type": "line", "point": true}, "encoding": encoding}),
    ))
}

/// Share of right poses over their stated probability.
pub(super) fn reliability(
    lines: &[(usize, &str, Reliability)],
    overview: &Overview<'_>,
    column: usize,
) -> Value {
    let curves = lines
        .iter()
        .filter(|(_, _, reliability)| reliability.has_curve());
    let rows = curves.flat_map(|(_, label, reliability)| {
        let point = |range: &ReliabilityRange| {
            json!({"matcher": label, "stated": range.stated, "right": range.right, "poses": range.poses})
        };
        reliability.ranges.iter().map(point).collect::<Vec<_>>()
    });
    let share = |field: &str, title: &str| json!({"field": field, "type": "quantitative", "scale": {"domain": [0, 1]}, "title": title});
    let encoding = json!({
        "x": share("stated", "stated probability"),
        "y": share("right", "share of right poses"),
        "color": {"field": "matcher", "type": "nominal", "sort": null},
    });
    let mut sized = encoding.clone();
    sized["size"] = json!({"field": "poses", "type": "quantitative"});
    figure(
        format!("Reliability: {}", overview.datasets[column]),
        rows.collect(),
        json!({"layer": [
            {"mark": "line", "encoding": encoding},
            {"mark": {"type": "point", "filled": true, "opacity": 1}, "encoding": sized},
        ]}),
    )
}

/// Accuracy against time, for methods whose time is known.
pub(super) fn time(content: &Content, overview: &Overview<'_>, column: usize) -> Value {
    let rows = overview.rows.iter().filter_map(|row| {
        let summary = row.cells[column].as_ref()?.summary;
        let mut point = scored(&row.label, "auc", summary.auc());
        point["seconds"] = json!(seconds_for_a_pair(content, summary)?);
        Some(point)
    });
    let x = json!({"field": "seconds", "type": "quantitative", "scale": {"type": "log"}, "title": "seconds for a pair"});
    let color = json!({"field": "matcher", "type": "nominal", "sort": null});
    let y = json!({"field": "auc", "type": "quantitative", "title": "AUC"});
    let ends = json!({"x": x, "y": {"field": "low", "type": "quantitative", "title": "AUC"}, "y2": {"field": "high"}, "color": color});
    let layers = json!([
        {"mark": {"type": "point", "filled": true}, "encoding": {"x": x, "y": y, "color": color}},
        {"mark": "rule", "encoding": ends},
        {"mark": {"type": "text", "align": "left", "dx": 6}, "encoding": {"x": x, "y": y, "text": {"field": "matcher"}}},
    ]);
    figure(
        format!("AUC over time: {}", overview.datasets[column]),
        rows.collect(),
        json!({"layer": layers}),
    )
}

/// AUC of matchers by the estimators of one model on one dataset.
pub(super) fn estimators(summaries: &[Summary], dataset: &str, model: Model) -> Value {
    let rows = summaries
        .iter()
        .filter(|s| s.dataset == dataset && s.model == model)
        .map(|s| json!({"matcher": s.matcher, "estimator": s.estimator, "auc": s.auc().value}));
    let encoding = json!({
        "x": {"field": "estimator", "type": "nominal", "sort": null},
        "y": {"field": "matcher", "type": "nominal", "sort": null},
        "color": {"field": "auc", "type": "quantitative", "title": "AUC"},
    });
    figure(
        format!("{}: {dataset}", by_estimator::title(model)),
        rows.collect(),
        json!({"mark": "rect", "encoding": encoding}),
    )
}

/// A score with its interval as a row of data.
fn scored(matcher: &str, name: &str, score: Score) -> Value {
    json!({
        "matcher": matcher,
        name: score.value,
        "low": score.interval.map(|interval| interval.low),
        "high": score.interval.map(|interval| interval.high),
    })
}

/// A mark for each matcher, and a line from `low` to `high`.
fn bars_with_intervals(x: &Value) -> Value {
    let y = json!({"field": "matcher", "type": "nominal", "sort": null});
    let title = &x["title"];
    json!({"layer": [
        {"mark": "bar", "encoding": {"x": x, "y": y}},
        {"mark": "rule", "encoding": {
            "x": {"field": "low", "type": "quantitative", "title": title}, "x2": {"field": "high"}, "y": y,
        }},
    ]})
}

fn figure(title: String, rows: Vec<Value>, drawing: Value) -> Value {
    let mut spec = json!({"$schema": SCHEMA, "title": title, "data": {"values": rows}});
    if let (Some(spec), Value::Object(drawing)) = (spec.as_object_mut(), drawing) {
        spec.extend(drawing);
    }
    spec
}

#[cfg(test)]
mod tests {
    use super::super::tests::content;
    use super::*;

    /// Every field that is drawn must be in the data.
    fn check(spec: &Value) {
        fn fields(value: &Value, found: &mut Vec<String>) {
            match value {
                Value::Object(map) => {
                    found.extend(map.get("field").and_then(Value::as_str).map(str::to_owned));
                    map.values().for_each(|value| fields(value, found));
                }
                Value::Array(list) => list.iter().for_each(|value| fields(value, found)),
                _ => {}
            }
        }
        assert_eq!(spec["$schema"], SCHEMA);
        let rows = spec["data"]["values"].as_array().expect("data inside");
        let mut found = Vec::new();
        fields(&json!([spec["encoding"], spec["layer"]]), &mut found);
        assert!(!rows.is_empty() && !found.is_empty(), "{spec}");
        for field in found {
            assert!(rows[0].get(&field).is_some(), "{field}: {spec}");
        }
    }

    #[test]
    fn every_figure_draws_what_is_in_its_data() {
        let mut content = content(&[("01-room", "sift", 6), ("01-room", "orb", 2)]);
        let known = crate::metrics::PairGeometry {
            baseline: Some(0.5),
            view_angle: Some(10.0),
            overlap: 0.8,
            is_measured: false,
        };
        let pairs = (0..10).map(|a| ((a, a + 1), known));
        content.geometry.insert("01-room".into(), pairs.collect());
        let spread = crate::metrics::Quartiles::of([0.1]);
        for summary in &mut content.summaries {
            summary.stages.extract = spread;
            summary.stages.search = spread;
        }
        let overview = Overview::new(&content.summaries);
        check(&sp(&overview, 0, Angle::Rotation));
        check(&ap(&overview, 0));
        check(&ap_panel(&overview, Portion::Other));
        check(&lead(&content, &overview, 0));
        check(&difficulty(&content, &overview, 0, Difficulty::Overlap).expect("it is known"));
        check(&time(&content, &overview, 0));
        check(&estimators(&content.summaries, "01-room", Model::Pose));
        let panel = ap_panel(&overview, Portion::Other);
        assert_eq!(
            panel["data"]["values"][0],
            json!({"matcher": "sift", "sequence": "01", "ap5": 102.5})
        );
    }
}
