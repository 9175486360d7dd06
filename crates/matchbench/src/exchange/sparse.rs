//! Keypoints of each image and, for each of the first, which of the second it matches: the form
//! that hloc, glue-factory and SuperGlue share. -1 means none; a score stands beside each keypoint
//! of the first image, matched or not.

use super::{ExchangeError, Rating, RawMatches, bounded};
use crate::arrays::{Array, Hdf5};
use crate::counted::counted;

/// Both images of a pair, of all whose keypoints a `file` has: the names that its own can be split into.
///
/// # Errors
/// If there are none, or several: those of the dataset do not tell which the file means.
pub(super) fn certain<'f>(
    pair: &str,
    mut splits: impl Iterator<Item = [&'f str; 2]>,
    file: &Hdf5,
) -> Result<[&'f str; 2], ExchangeError> {
    let first = splits.next().ok_or_else(|| {
        let what = format!("it lacks the keypoints of an image of `{pair}`");
        ExchangeError::damaged(file.path(), what)
    })?;
    let Some([c, d]) = splits.next() else {
        return Ok(first);
    };
    let [a, b] = first;
    Err(ExchangeError::new(
        file.path(),
        format!(
            "`{pair}` can be the pair `{a}` and `{b}` and the pair `{c}` and `{d}`, and it has keypoints of all"
        ),
        "take those out that are of no pair, or give the images names that can be told apart",
    ))
}

/// The matches of a pair, in the order of the first image's keypoints.
///
/// # Errors
/// If shapes do not fit each other or a match names a keypoint that is not there.
pub(super) fn matched(
    keypoints_a: &Array,
    keypoints_b: &Array,
    b_of_a: &Array,
    scores: Option<&Array>,
) -> Result<RawMatches, String> {
    let columns_a = columns(keypoints_a).map_err(|what| format!("keypoints of a: {what}"))?;
    let columns_b = columns(keypoints_b).map_err(|what| format!("keypoints of b: {what}"))?;
    let counts = [keypoints_a.len() / columns_a, keypoints_b.len() / columns_b];
    let length = flat(b_of_a)?;
    if length != counts[0] {
        return Err(format!(
            "{} for {} of a",
            counted(length, "match"),
            counted(counts[0], "keypoint")
        ));
    }
    if let Some(scores) = scores
        && flat(scores)? != length
    {
        return Err(format!(
            "{} for {} of a",
            counted(scores.len(), "score"),
            counted(length, "keypoint")
        ));
    }
    let (mut a, mut b, mut rating) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..length {
        if let Some(j) = b_of_a
            .index(i, counts[1])
            .map_err(|what| format!("matches: {what}"))?
        {
            bounded(a.len() + 1)?;
            a.push(keypoints_a.point(i, columns_a));
            b.push(keypoints_b.point(j, columns_b));
            rating.extend(scores.map(|scores| scores.get(i)));
        }
    }
    Ok(RawMatches {
        a,
        b,
        turns: None,
        growths: None,
        rating: scores.map_or(Rating::None, |_| Rating::Score(rating)),
        element: keypoints_a.element(),
        keypoints: Some(counts),
    })
}

/// Points that match row by row, perhaps with scores.
///
/// # Errors
/// If their numbers differ.
pub(super) fn row_by_row(
    a: &Array,
    b: &Array,
    scores: Option<&Array>,
) -> Result<RawMatches, String> {
    let (columns_a, columns_b) = (columns(a)?, columns(b)?);
    let (count, count_b) = (a.len() / columns_a, b.len() / columns_b);
    if count != count_b {
        return Err(format!("{} of a, {count_b} of b", counted(count, "point")));
    }
    bounded(count)?;
    let rating = scores.map_or(Ok(Rating::None), |scores| Rating::of_scores(scores, count))?;
    Ok(RawMatches {
        a: (0..count).map(|row| a.point(row, columns_a)).collect(),
        b: (0..count).map(|row| b.point(row, columns_b)).collect(),
        turns: None,
        growths: None,
        rating,
        element: a.element(),
        keypoints: None,
    })
}

/// The keypoints of an image.
///
/// # Errors
/// If they cannot be read or are none; the error names their file.
pub(super) fn keypoints(file: &Hdf5, name: &str) -> Result<Array, ExchangeError> {
    let array = file.array(name)?;
    columns(&array)
        .map_err(|what| ExchangeError::damaged(file.path(), what).at(format!("array `{name}`")))?;
    Ok(array)
}

/// Number of columns of an array of keypoints: x and y, and perhaps more (scale, angle).
pub(super) fn columns(keypoints: &Array) -> Result<usize, String> {
    match *keypoints.shape() {
        [_, columns] if columns >= 2 => Ok(columns),
        _ if keypoints.len() == 0 => Ok(2),
        ref shape => Err(format!("its shape is {shape:?}, not [n, 2]")),
    }
}

/// The length of an array of one dimension; a batch of one is taken for it, since tools forget to
/// remove it.
fn flat(array: &Array) -> Result<usize, String> {
    match array.shape() {
        [1, length] => Ok(*length),
        _ => array.length(),
    }
}
