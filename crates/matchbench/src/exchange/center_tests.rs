//! What is said where the centre of the first pixel is given otherwise than a format has it.

use super::tests::{FIXTURES, dataset, options};
use super::*;

#[test]
fn a_centre_of_the_first_pixel_that_a_format_does_not_have_is_warned_about() {
    let (folder, sequence) = dataset();
    for (fixture, id, _, resized) in FIXTURES {
        let own = Format::find(id).unwrap().pixel_center;
        for said in [0.0, 0.5] {
            let path = folder.path().join(fixture);
            let options = options(Some(said), resized);
            let files = MatchFiles::open(&[path], &sequence, &options).unwrap();
            let warned = files.survey().warnings.iter().any(|warning| {
                warning.contains(&format!(
                    "--pixel-center {said} says, and files of {id} have"
                ))
            });
            assert_eq!(
                warned,
                own.is_some_and(|own| own != said),
                "{fixture} {said}"
            );
        }
    }
}
