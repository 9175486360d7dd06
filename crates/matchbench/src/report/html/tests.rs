//! What stands on the page, and where it stands.

use super::super::tests::{content, homographies, homography_results, results};
use super::super::{DatasetFacts, RunFacts};
use super::*;
use crate::metrics::{Portion, Quartiles, SCORES};

fn page(sets: &[(&str, &str, u32)], title: &str) -> String {
    let mut content = content(sets);
    content.facts = RunFacts {
        title: title.to_owned(),
        facts: vec![("seed".to_owned(), "<7>".to_owned())],
        plan: Some("{\"threads\": 2} </script>".to_owned()),
        results: Vec::new(),
    };
    render(&content)
}

#[test]
fn names_from_data_are_text() {
    let evil = "</script><script>alert(1)</script>";
    let page = page(&[(evil, evil, 4), (evil, "sift", 2)], evil);
    assert!(!page.contains("alert(1)<"), "a name became markup");
    assert_eq!(page.matches("<script").count(), 2);
    assert_eq!(page.matches("</script>").count(), 2);
    // Nor do letters that are written from the right turn what stands beside them.
    assert!(
        page.contains("<figcaption><bdi>"),
        "a name has its own direction"
    );
}

#[test]
fn page_stands_alone() {
    let page = page(&[("room", "sift", 4)], "Report");
    for outside in ["src=", "href=\"http", "@import", "url(", "fetch(", "<link"] {
        assert!(!page.contains(outside), "{outside}");
    }
    // One panel for the pose, one for each angle, one curve in each.
    assert_eq!(page.matches("class=\"series s0\"").count(), 3);
}

#[test]
fn empty_and_single_reports_can_be_written() {
    assert!(page(&[], "Nothing").contains("No results"));
    let one = page(&[("room", "sift", 4)], "One");
    assert!(!one.contains("NaN") && one == page(&[("room", "sift", 4)], "One"));
}

#[test]
fn every_score_has_a_column_and_a_definition() {
    let mut content = content(&[("room", "sift", 4)]);
    content.summaries.push(homographies("boat", "sift"));
    let page = render(&content);
    for kind in SCORES {
        let head = format!("<th scope=\"col\">{}</th>", kind.heading);
        assert!(page.contains(&head), "{}", kind.id);
        let start = kind
            .definition
            .split(['"', '\''])
            .next()
            .unwrap_or_default();
        assert!(page.contains(start), "{}", kind.id);
    }
}

#[test]
fn what_is_compared_is_counted_and_named() {
    let one = content(&[("room", "sift", 4), ("room", "orb", 2)]);
    assert_eq!(compared(&one.summaries), "2 matchers with ransac-e");
    assert!(presets(&Overview::new(&one.summaries)).is_none());
    let sets = [("room", "sift", 4), ("room", "orb", 2), ("room", "sift", 6)];
    let mut both = content(&sets).summaries;
    both[2].estimator = "best".into();
    assert_eq!(compared(&both), "2 matchers with 2 estimators");
    let page = render(&Content {
        summaries: both,
        ..Content::default()
    });
    // Few enough to be told apart: none is hidden at first.
    assert!(page.contains("data-only=\"0\"") && !page.contains("data-opening>"));
}

#[test]
fn many_curves_open_with_the_estimator_of_the_headline_and_all_have_one_order() {
    let matchers = ["sift", "orb", "akaze", "brisk", "kaze"];
    let mut sets = Vec::new();
    for (matcher, row) in matchers.into_iter().zip(0..) {
        // Of the plan: the estimator of the paper is neither first nor best.
        for (estimator, more) in [("usac-e", 1), ("best", 5), ("ransac-e", 3)] {
            let mut set = results("room", matcher, more + row % 2);
            set.estimator = estimator.into();
            sets.push(set);
        }
    }
    let content = Content::new(sets, RunFacts::default());
    let page = render(&content);
    assert!(page.contains("data-estimator=\"best\" data-opening>"));
    let overview = Overview::new(&content.summaries);
    assert_eq!(overview.estimators, ["usac-e", "best", "ransac-e"]);
    let rows: Vec<&str> = overview.rows.iter().map(|row| row.estimator).collect();
    assert_eq!(rows[..4], ["usac-e", "best", "ransac-e", "usac-e"]);
    let buttons = ["usac-e", "best", "ransac-e"].map(|id| page.find(&format!(">with {id}<")));
    assert!(buttons[0].is_some() && buttons.is_sorted(), "{buttons:?}");
}

#[test]
fn figures_side_by_side_have_one_axis() {
    let mut content = content(&[("room", "sift", 9), ("hall", "sift", 1)]);
    let known = crate::metrics::PairGeometry {
        baseline: Some(0.5),
        view_angle: Some(10.0),
        overlap: 0.8,
        is_measured: false,
    };
    for name in ["room", "hall"] {
        let pairs = (0..10).map(|a| ((a, a + 1), known));
        content.geometry.insert(name.into(), pairs.collect());
    }
    let page = render(&content);
    for chart in ["chart sp", "chart strata"] {
        let class = format!("class=\"{chart}\"");
        let figures = page.split(&class).skip(1);
        for figure in figures.filter_map(|rest| rest.split("</svg>").next()) {
            assert!(figure.contains(">1.0</text>"), "{figure}");
        }
        assert!(page.matches(chart).count() >= 2);
    }
}

#[test]
fn matchers_with_the_same_features_share_their_detection() {
    let mut content = content(&[("room", "gms", 4), ("room", "gms-s", 2)]);
    let spread = Quartiles {
        lower: 0.01,
        median: 0.02,
        upper: 0.03,
        mean: 0.02,
    };
    content.summaries[0].stages.extract = Some(spread);
    content.summaries[0].stages.search = Some(spread);
    content.summaries[1].stages.search = Some(spread);
    let untimed = "Without a time, since features came from the cache: gms-s.";
    assert!(render(&content).contains(untimed));
    let outside = [("gms-s".to_owned(), "from files".to_owned())];
    content.outside = outside.into();
    content.summaries[1].stages.features = Quartiles::of([900.0]);
    let untimed = "Without a time, since they come from elsewhere and do not tell that of an image or of a search: gms-s.";
    assert!(render(&content).contains(untimed));
    for matcher in ["gms", "gms-s"] {
        let features = "orb-budget".to_owned();
        content.extractions.insert(matcher.to_owned(), features);
    }
    assert!(!render(&content).contains("Without a time"));
}

#[test]
fn a_matcher_of_one_stage_has_the_time_that_its_pairs_were_waited_for() {
    let mut content = content(&[("room", "loftr", 4), ("hall", "loftr", 4)]);
    let [room, hall] = [0, 1];
    content.summaries[room].stages.outside = Quartiles::of([0.5]);
    content.summaries[room].stages.search = Quartiles::of([0.25]);
    content.summaries[room].stages.estimate = Quartiles::of([0.01]);
    assert!(!render(&content).contains("chart scatter"), "of its own");
    let outside = [("loftr".to_owned(), "from outside".to_owned())];
    content.outside = outside.into();
    let page = render(&content);
    let is_at = |page: &str, time: &str| {
        let mark = page.split("loftr: AUC ").nth(1).expect("a mark");
        mark.split_once(", ")
            .is_some_and(|mark| mark.1.starts_with(time))
    };
    assert!(page.contains("chart scatter") && is_at(&page, "510 ms"));
    let about = "as long as it was waited for: loftr.";
    assert!(page.contains(about) && !page.contains("Without a time"));
    // A function is measured here, as its search.
    content.summaries[room].stages.outside = None;
    assert!(is_at(&render(&content), "260 ms"));
    // Whoever has features may have kept them from before: the search is not all.
    let mut with_features = content.clone();
    with_features.summaries[room].stages.features = Quartiles::of([0.0, 900.0]);
    let mut extracted_there = content.clone();
    extracted_there.summaries[hall].stages.extract = Quartiles::of([0.1]);
    for content in [with_features, extracted_there] {
        assert!(!render(&content).contains("chart scatter"));
    }
    content.summaries[room].stages.features = Quartiles::of([0.0]);
    assert!(is_at(&render(&content), "260 ms"), "no pair has a match");
}

#[test]
fn times_are_shown_where_there_are_any() {
    let mut content = content(&[("room", "sift", 4)]);
    assert!(!render(&content).contains("id=\"times\""));
    let spread = Quartiles {
        lower: 0.01,
        median: 0.0213,
        upper: 0.05,
        mean: 0.03,
    };
    content.summaries[0].stages.search = Some(spread);
    let page = render(&content);
    assert!(page.contains("id=\"times\"") && page.contains("21.3"));
    assert!(page.contains("quartiles: 10.0 to 50.0") && !page.contains("chart scatter"));
    let of_pair = "<em>pair</em> is the time of two images";
    assert!(page.contains(of_pair) && page.contains(">Pair</th>"));
    let mut several = content.clone();
    several.summaries.push(several.summaries[0].clone());
    several.summaries[1].estimator = "best".into();
    let several = render(&several);
    assert!(!several.contains(of_pair) && !several.contains(">Pair</th>"));
    content.summaries[0].stages.extract = Some(spread);
    assert!(render(&content).contains("chart scatter"));
}

#[test]
fn what_only_some_reports_have_is_there_where_they_have_it() {
    let mut content = content(&[("room", "sift", 4), ("room", "sift", 6)]);
    let plain = render(&content);
    assert!(!plain.contains("chart heat") && !plain.contains("chart strata"));
    content.summaries[1].estimator = "lmeds-e".into();
    content.results[1].estimator = "lmeds-e".into();
    let known = crate::metrics::PairGeometry {
        baseline: Some(0.5),
        view_angle: Some(10.0),
        overlap: 0.8,
        is_measured: false,
    };
    let pairs = (0..10).map(|a| ((a, a + 1), known));
    content.geometry.insert("room".into(), pairs.collect());
    let page = render(&content);
    assert!(page.contains("chart heat") && page.contains("chart strata"));
}

#[test]
fn the_best_of_poses_and_of_homographies_are_named_apart() {
    let mut content = content(&[("room", "sift", 4), ("room", "orb", 2)]);
    let lead = "has the highest AUC";
    assert!(render(&content).contains(&format!("<strong>sift</strong> {lead} on <bdi>room<")));
    let sets = [
        homography_results("room", "sift", 3.0),
        homography_results("room", "orb", 1.0),
    ];
    let sets = content.results.iter().cloned().chain(sets).collect();
    content = Content::new(sets, RunFacts::default());
    let page = render(&content);
    for line in [
        format!("<strong>sift + ransac-e</strong> {lead} of poses on <bdi>room<"),
        format!("<strong>orb + best-h</strong> {lead} of homographies on <bdi>room<"),
    ] {
        assert!(page.contains(&line), "{line}");
    }
    // Each model has one estimator: there is nothing to compare in a heat map.
    assert!(!page.contains("chart heat"));
}

#[test]
fn the_headline_says_what_is_shared_and_what_is_certain() {
    let sets = [
        ("room", "sift", 4),
        ("hall", "sift", 4),
        ("wall", "sift", 9),
        ("room", "orb", 4),
        ("hall", "orb", 2),
        ("wall", "orb", 0),
    ];
    let page = page(&sets, "Report");
    let line = "<strong>sift</strong> has the highest AUC on 3 of 3 datasets, shared on 1; its lead over all others is certain on 1.";
    assert!(page.contains(line), "{page}");
    let pair = |other: u32| {
        let sets = [("room", "sift", 9), ("room", "orb", other)];
        render(&content(&sets))
    };
    let on = "the highest AUC on <bdi>room</bdi>";
    for (other, line) in [
        (9, format!("<strong>sift and orb</strong> share {on}.")),
        (
            8,
            format!("<strong>sift</strong> has {on}; its lead over all others is not certain."),
        ),
        (
            0,
            format!("<strong>sift</strong> has {on}; its lead over all others is certain."),
        ),
    ] {
        assert!(pair(other).contains(&line), "{line}");
    }
    // Each is first on one of them.
    let each = render(&content(&[
        ("room", "sift", 9),
        ("hall", "sift", 4),
        ("room", "orb", 2),
        ("hall", "orb", 5),
    ]));
    let line = "</strong> have the highest AUC on 1 of 2 datasets each; their lead over all others is certain on 1 of these 2.";
    assert!(each.contains(line), "{each}");
}

#[test]
fn sift_is_named_where_the_run_has_it() {
    let above = "is above SIFT";
    assert!(page(&[("room", "sift", 4), ("room", "orb", 2)], "").contains(above));
    assert!(!page(&[("room", "surf", 4), ("room", "orb", 2)], "").contains(above));
    assert!(!page(&[("room", "sift", 4)], "").contains(above));
}

#[test]
fn a_property_of_no_dataset_takes_no_room() {
    let mut content = content(&[("room", "sift", 4)]);
    let head = ">Property</th>";
    for property in ["", "little texture"] {
        content.datasets = vec![DatasetFacts {
            name: "room".into(),
            portion: Portion::Fragments,
            frames: 2,
            pairs: 1,
            resolution: None,
            origin: String::new(),
            property: property.into(),
            import: Vec::new(),
            thumbnail: None,
        }];
        let page = render(&content);
        assert_eq!(page.contains(head), !property.is_empty(), "{property}");
        assert!(page.contains(property));
    }
}

/// Heads and cells of each row of each table, top to bottom.
fn tables(page: &str) -> Vec<Vec<usize>> {
    let cells = |row: &str| {
        let row = row.split("</tr>").next().expect("split gives at least one");
        row.matches("<th ").count() + row.matches("<td").count()
    };
    (page.split("<table").skip(1))
        .filter_map(|rest| rest.split("</table>").next())
        .map(|table| table.split("<tr").skip(1).map(cells).collect())
        .collect()
}

#[test]
fn every_row_has_a_cell_under_every_head() {
    let names = ["sift", "orb"].map(|matcher| ["room", "hall"].map(|room| (room, matcher, 4)));
    let mut content = content(names.as_flattened());
    content.summaries[1].estimator = "best".into();
    content.summaries[0].stages.search = Some(Quartiles {
        lower: 0.01,
        median: 0.02,
        upper: 0.03,
        mean: 0.02,
    });
    let mut tables = tables(&render(&content));
    // The script fills the list of pairs.
    tables.retain(|rows| rows.len() > 1);
    assert!(tables.len() >= 6, "{tables:?}");
    for rows in tables {
        assert!(rows.iter().all(|&cells| cells == rows[0]), "{rows:?}");
    }
}

#[test]
fn code_in_messages_is_code() {
    let shown = |message: &str| with_code(message).to_string();
    assert_eq!(
        shown("`a < b` of <i>; see `matchbench run`"),
        "<code>a &lt; b</code> of &lt;i&gt;; see <code>matchbench run</code>"
    );
    assert_eq!(shown("one ` alone"), "one ` alone");
    // Warnings, and what the reasons of failures mean.
    let mut content = content(&[("room", "sift", 4)]);
    content.doubts = vec!["check it (`matchbench validate`)".into()];
    let page = render(&content);
    for code in ["matchbench validate", "max_depth"] {
        assert!(page.contains(&format!("<code>{code}</code>")), "{code}");
    }
}
