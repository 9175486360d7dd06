//! The page of two methods side by side, on the pairs where they differ most.

use minijinja::{Value, context};

use super::super::PairView;
use super::super::advantage::advantage;
use super::super::difference::{Duel, Twin};
use super::super::numbers::{NONE, p_value};
use super::super::pair_words::{outcome, sentence};
use super::pair_pages::{colours, facts, picture};
use super::{environment, template};
use crate::metrics::{Model, PairGeometry};
use crate::protocols::{Protocol, of_estimator};

/// A pair as the page shows it.
pub(in super::super) struct Shown<'a> {
    pub(in super::super) twin: Twin<'a>,
    /// The matches of both methods, as far as they are available.
    pub(in super::super) views: [Option<PairView>; 2],
    pub(in super::super) geometry: Option<PairGeometry>,
}

/// Two methods, and the pairs on which each wins.
pub(in super::super) struct Chapter<'a> {
    pub(in super::super) duel: Duel<'a>,
    /// The folder of its images.
    pub(in super::super) images: String,
    pub(in super::super) won: [Vec<Shown<'a>>; 2],
}

/// The page as text.
pub(in super::super) fn difference_page(chapters: &[Chapter<'_>]) -> String {
    let environment = environment();
    let shown = chapters.iter().flat_map(|chapter| &chapter.won).flatten();
    let page = template(&environment, "difference.html").render(context! {
        title => "matchbench comparison",
        style => include_str!("style.css"),
        chapters => chapters.iter().map(chapter).collect::<Vec<_>>(),
        has_keypoints => shown.flat_map(|shown| &shown.views).flatten().any(PairView::has_keypoints),
        colours => colours(),
    });
    page.expect("the template only uses what it is given")
}

fn chapter(chapter: &Chapter<'_>) -> Value {
    let Duel {
        sides,
        on,
        comparison,
    } = chapter.duel;
    let names = sides.map(|side| side.name);
    let protocols = sides.map(|side| of_estimator(&side.results.estimator));
    let lists: Vec<Value> = (chapter.won.iter().zip(names))
        .map(|(won, name)| {
            let pairs: Vec<Value> = won
                .iter()
                .map(|shown| pair(shown, names, protocols))
                .collect();
            context! { name, pairs }
        })
        .collect();
    context! {
        on,
        names => names.map(str::to_owned).to_vec(),
        words => advantage(names[1], names[0], on, &comparison.auc),
        pairs => comparison.pairs,
        gained => comparison.gained,
        lost => comparison.lost,
        p_value => comparison.auc.p_value.map(p_value),
        is_repeated => sides.iter().all(|side| side.results.repetitions > 1),
        images => &chapter.images,
        lists,
    }
}

fn pair(shown: &Shown<'_>, names: [&str; 2], protocols: [&Protocol; 2]) -> Value {
    let (a, b) = shown.twin.frames;
    let results = shown.twin.results;
    let unit = match results[0].model {
        Model::Pose => "°",
        Model::Homography => " px",
    };
    let errors = shown.twin.errors();
    let error = |side: usize| match errors[side] {
        Some(error) => format!("{error:.2}{unit}"),
        None if results[side].outcome.is_ok() => NONE.to_owned(),
        None => outcome(results[side]).to_owned(),
    };
    let panels: Vec<Value> = (0..2)
        .map(|side| {
            let result = (results[side], protocols[side]);
            if let Some(view) = &shown.views[side] {
                picture(names[side], Some(result), view)
            } else {
                context! { label => names[side], words => sentence(result.0, result.1) }
            }
        })
        .collect();
    context! {
        a,
        b,
        errors => [error(0), error(1)].to_vec(),
        facts => shown.geometry.as_ref().map(facts),
        panels,
    }
}
