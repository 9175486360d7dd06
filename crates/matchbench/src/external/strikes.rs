//! Whose fault failures are: that of a matcher from outside, which is given up, or that of an image, which it is not asked
//! about any more.
//!
//! Pairs come grouped by their first image. So a program that crashes over one image alone fails many times in a row,
//! and the pairs of other images are still worth asking for.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// How many questions about one image fail until the program is not asked about it any more, over how many images in a
/// row it fails until it is given up, and how many of its processes in a row do not start until then.
pub(super) const STRIKES: usize = 3;

/// Questions that failed. The image of a question about a pair is its first.
#[derive(Default)]
pub(super) struct Strikes {
    /// How many there were about each image since one about it was answered.
    of_images: BTreeMap<PathBuf, usize>,
    /// The images over which questions failed since any was answered.
    row: BTreeSet<PathBuf>,
    /// Processes that did not start since any question was answered.
    starts: usize,
}

impl Strikes {
    /// A question about this image was answered.
    pub(super) fn answered(&mut self, image: &Path) {
        self.of_images.remove(image);
        self.row.clear();
        self.starts = 0;
    }

    /// A question about this image cost a process. Returns why the matcher is given up, if it is.
    pub(super) fn failed(&mut self, image: &Path) -> Option<String> {
        *self.of_images.entry(image.into()).or_default() += 1;
        self.row.insert(image.into());
        (self.row.len() >= STRIKES).then(|| format!("failures over {STRIKES} images in a row"))
    }

    /// A process did not start. Returns why the matcher is given up, if it is.
    pub(super) fn did_not_start(&mut self) -> Option<String> {
        self.starts += 1;
        (self.starts >= STRIKES).then(|| format!("{STRIKES} failures in a row to start it"))
    }

    /// Whether nothing is asked about this image any more.
    pub(super) fn is_left_out(&self, image: &Path) -> bool {
        self.of_images
            .get(image)
            .is_some_and(|&failed| failed >= STRIKES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asks about images one after the other, as pairs come, until the matcher is given up: which questions were asked.
    fn asked(images: &str, breaks: impl Fn(char) -> bool) -> (String, bool) {
        let (mut strikes, mut asked) = (Strikes::default(), String::new());
        for image in images.chars() {
            let name = image.to_string();
            if strikes.is_left_out(Path::new(&name)) {
                continue;
            }
            asked.push(image);
            if !breaks(image) {
                strikes.answered(Path::new(&name));
            } else if strikes.failed(Path::new(&name)).is_some() {
                return (asked, true);
            }
        }
        (asked, false)
    }

    #[test]
    fn one_image_costs_three_questions_and_the_matcher_goes_on() {
        assert_eq!(
            asked("aaaaabbc", |image| image == 'a'),
            ("aaabbc".into(), false)
        );
        // Others are answered in between, as by several workers.
        assert_eq!(
            asked("abababaabc", |image| image == 'a'),
            ("abababbc".into(), false)
        );
    }

    #[test]
    fn failures_over_three_images_in_a_row_end_the_matcher() {
        assert_eq!(asked("aaaaabbbbbccc", |_| true), ("aaabbbc".into(), true));
        assert_eq!(asked("abcd", |_| true), ("abc".into(), true));
        assert_eq!(
            asked("abxcdx", |image| image != 'x'),
            ("abxcdx".into(), false)
        );
    }

    #[test]
    fn an_image_that_is_answered_once_is_asked_about_again() {
        let (mut strikes, image) = (Strikes::default(), Path::new("a"));
        for _ in 0..4 {
            assert_eq!((strikes.failed(image), strikes.failed(image)), (None, None));
            assert!(!strikes.is_left_out(image));
            strikes.answered(image);
        }
    }

    #[test]
    fn processes_that_do_not_start_are_the_fault_of_no_image() {
        let mut strikes = Strikes::default();
        assert_eq!(
            [strikes.did_not_start(), strikes.did_not_start()],
            [None, None]
        );
        strikes.answered(Path::new("a"));
        assert_eq!(
            [strikes.did_not_start(), strikes.did_not_start()],
            [None, None]
        );
        assert!(strikes.did_not_start().is_some());
    }
}
