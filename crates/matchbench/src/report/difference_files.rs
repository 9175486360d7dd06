//! The comparison of two methods as a folder: `index.html`, `pairs.csv` and the images of the pairs that are
//! shown.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::cache::FeatureCache;
use crate::datasets::{Pair, Sequence};
use crate::metrics::PairGeometry;

use super::PairView;
use super::csv::{self, Cell};
use super::difference::{Duel, Side, Twin, twins, won};
use super::file_names::file_names;
use super::html::{Chapter, Shown, difference_page};
use super::of_run::{ReportError, Reported, sequences};
use super::pages::Pages;
use super::pair_words::outcome;
use super::pictures::{Keypoints, Thumbnails, thumbnails, views_of};

/// Writes the page that compares methods two by two, with at most `most` pairs on which each of the two wins.
/// Pictures are included if the dataset of a run is still in its place and the matches were kept. Files of an
/// earlier comparison are replaced; other files stay.
///
/// # Errors
/// If a run cannot be read, or a file cannot be written.
pub fn write_differences(
    folder: &Path,
    duels: &[Duel<'_>],
    most: usize,
) -> Result<Reported, ReportError> {
    let out = Pages::new(folder)?;
    let mut notes = BTreeSet::new();
    let mut known = BTreeMap::new();
    for side in duels.iter().flat_map(|duel| &duel.sides) {
        let (found, missing) = sequences(side.run.plan());
        notes.extend(missing);
        known.extend(found);
    }
    let names: Vec<String> = (duels.iter())
        .map(|duel| {
            format!(
                "{} {} {}",
                duel.sides[0].results.dataset, duel.sides[0].name, duel.sides[1].name
            )
        })
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut chapters = Vec::new();
    let mut rows = Vec::new();
    for (duel, name) in duels.iter().zip(file_names(&names)) {
        let twins = twins(duel);
        rows.extend(twins.iter().map(|twin| row(duel, twin)));
        let sequence = known.get(&duel.sides[0].results.dataset);
        let won = won(&twins, most);
        let (won, images) = shown(duel, won, sequence)?;
        notes.extend(images.note);
        let folder = format!("images/{name}");
        for (frame, image) in images.small {
            out.write(Path::new(&format!("{folder}/{frame}.jpg")), &image.jpeg)?;
        }
        chapters.push(Chapter {
            duel: *duel,
            images: folder,
            won,
        });
    }
    out.write(Path::new("pairs.csv"), csv::table(rows).as_bytes())?;
    out.write(
        Path::new("index.html"),
        difference_page(&chapters).as_bytes(),
    )?;
    out.remove_earlier()?;
    Ok(Reported {
        page: folder.join("index.html"),
        notes: notes.into_iter().collect(),
    })
}

/// The pairs as they are shown, and their images.
fn shown<'a>(
    duel: &Duel<'a>,
    won: [Vec<Twin<'a>>; 2],
    sequence: Option<&Sequence>,
) -> Result<([Vec<Shown<'a>>; 2], Thumbnails), ReportError> {
    let frames: BTreeSet<(u32, u32)> = won.iter().flatten().map(|twin| twin.frames).collect();
    let pairs: Vec<&Pair> = (sequence.iter())
        .flat_map(|sequence| &sequence.pairs)
        .filter(|pair| frames.contains(&(pair.a, pair.b)))
        .collect();
    let (mut views, mut images) = (BTreeMap::new(), Thumbnails::default());
    let mut geometry = sequence.map(PairGeometry::of_sequence).unwrap_or_default();
    for side in duel.sides {
        PairGeometry::measure(&mut geometry, side.results);
    }
    if let Some(sequence) = sequence {
        let mut runs = duel.sides.map(|side| side.run).to_vec();
        runs.dedup_by_key(|run| run.path());
        images = thumbnails(&runs, sequence, &pairs);
        for (side, method) in duel.sides.iter().enumerate() {
            let cache = FeatureCache::new(method.run.default_cache());
            let mut keypoints = Keypoints::new(method.run.plan(), cache);
            let set = method.results;
            let found = views_of(
                method.run,
                set,
                sequence,
                &pairs,
                &images.small,
                &mut keypoints,
            )?;
            views.extend(
                found
                    .into_iter()
                    .map(|(_, view)| ((view.frames, side), view)),
            );
        }
    }
    let mut of = |twin: Twin<'a>| {
        let mut view = |side: usize| -> Option<PairView> { views.remove(&(twin.frames, side)) };
        Shown {
            views: [view(0), view(1)],
            geometry: geometry.get(&twin.frames).copied(),
            twin,
        }
    };
    Ok((
        won.map(|won| won.into_iter().map(&mut of).collect()),
        images,
    ))
}

/// A repetition of a pair in the table of all.
fn row(duel: &Duel<'_>, twin: &Twin<'_>) -> csv::Row {
    let name = |head: &str, text: &str| (head.to_owned(), Cell::Name(text.to_owned()));
    let count = |head: String, count: u32| (head, Cell::Count(count as usize));
    let mut row = vec![
        name("dataset", &duel.sides[0].results.dataset),
        name("first", duel.sides[0].name),
        name("second", duel.sides[1].name),
        count("a".to_owned(), twin.frames.0),
        count("b".to_owned(), twin.frames.1),
    ];
    for (side, error) in ["first", "second"].iter().zip(twin.errors()) {
        row.push((format!("{side}_error"), Cell::Number(error)));
    }
    for (side, result) in ["first", "second"].iter().zip(twin.results) {
        row.push((
            format!("{side}_outcome"),
            Cell::Name(outcome(result).to_owned()),
        ));
        row.push((
            format!("{side}_correspondences"),
            (result.correspondences)
                .map_or(Cell::Number(None), |number| Cell::Count(number as usize)),
        ));
    }
    row.push(count("repetition".to_owned(), twin.repetition()));
    for (side, Side { results, .. }) in ["first", "second"].iter().zip(&duel.sides) {
        let method = [
            ("matcher", &results.matcher),
            ("estimator", &results.estimator),
        ];
        row.extend(method.map(|(what, id)| name(&format!("{side}_{what}"), id)));
    }
    row
}
