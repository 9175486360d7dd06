//! Matches as a child process writes them: five `f32` each. Nothing of it is believed; everything is
//! checked.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;

use matchbench_vision::features::Features;
use matchbench_vision::image::Size;

use crate::counted::counted;
use crate::files::open_file;
use crate::matchers::{MAX_MATCHES, check_seconds};

/// Bytes of a match.
const ROW: usize = 5 * size_of::<f32>();
/// How far outside an image a point may lie, for the rounding of points of resized images.
const ROUNDING: f32 = 0.01;
/// Stages that a child may name, and letters of a name.
const STAGES: (usize, usize) = (16, 64);
/// Letters of the name of a device.
const DEVICE: usize = 100;

/// The matches of a pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Matched {
    /// x_a, y_a, x_b, y_b in pixels of the original images, pixel centres at integers, and the
    /// ambiguity from 0 (certain) to 1.
    pub rows: Vec<[f32; 5]>,
    /// Features of both images, where the child says so.
    pub features: Option<[u32; 2]>,
    /// How long it took.
    pub times: Times,
}

/// The features of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// Keypoints in pixels of the original image, pixel centres at integers, and descriptors.
    pub features: Features,
    /// How long it took.
    pub times: Times,
}

/// How long an answer took, by two clocks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Times {
    /// From the request to the answer as the host saw it, in seconds; the reading of files is not
    /// in it.
    pub wall: f64,
    /// The child's own word: seconds by name of the stage (`extract`, `match`).
    pub own: BTreeMap<String, f64>,
    /// What it computed on, by its own word.
    pub device: Option<String>,
    /// How many images `extract` is for, if the child says it.
    pub extracted: Option<u32>,
}

impl Times {
    /// Those of two answers together; where they were computed is the first one's word.
    pub(super) fn and(mut self, other: Self) -> Self {
        self.wall += other.wall;
        for (stage, seconds) in other.own {
            *self.own.entry(stage).or_default() += seconds;
        }
        self.extracted = self
            .extracted
            .zip(other.extracted)
            .map(|(one, other)| one.saturating_add(other));
        self
    }

    /// Times as a child tells them.
    ///
    /// # Errors
    /// If they are none, in words.
    pub(super) fn new(
        wall: f64,
        own: BTreeMap<String, f64>,
        device: Option<String>,
    ) -> Result<Self, String> {
        if own.len() > STAGES.0 || own.keys().any(|stage| stage.len() > STAGES.1) {
            return Err("its `seconds` are no times of stages".into());
        }
        for (stage, &seconds) in &own {
            check_seconds(seconds)
                .map_err(|wrong| format!("its `seconds` of {stage:?}: {wrong}"))?;
        }
        // A record has their sum, which must be valid too.
        check_seconds(own.values().sum())
            .map_err(|wrong| format!("its `seconds` together: {wrong}"))?;
        let printable = |device: &String| {
            device.chars().count() <= DEVICE && !device.chars().any(char::is_control)
        };
        if !device.iter().all(printable) {
            return Err("its `device` is no name".into());
        }
        Ok(Self {
            wall,
            own,
            device,
            extracted: None,
        })
    }

    /// The same times, whose `extract` is for so many images of a pair, if the child says it.
    ///
    /// # Errors
    /// If it cannot be, in words.
    pub(super) fn of_images(self, extracted: Option<u32>) -> Result<Self, String> {
        match (extracted, self.extract()) {
            (Some(images @ 3..), _) => Err(format!(
                "its `extracted` is {images}; a pair has two images"
            )),
            (Some(0), Some(seconds)) if seconds > 0.0 => Err(format!(
                "its `extracted` is 0, but its `seconds` of \"extract\" are {seconds}"
            )),
            (Some(images @ 1..), None) => Err(format!(
                "its `extracted` is {images}, but its `seconds` have no \"extract\""
            )),
            _ => Ok(Self { extracted, ..self }),
        }
    }

    fn extract(&self) -> Option<f64> {
        self.own.get("extract").copied()
    }

    /// The time of each image that was extracted. Of one that is not told apart, it stands for image a; without a number
    /// of images, it counts as that of one, and 0 as that of none.
    pub(super) fn of_each_image(&self) -> [Option<f64>; 2] {
        let extract = self.extract();
        match self.extracted {
            None => [extract.filter(|&seconds| seconds > 0.0), None],
            Some(0) => [None; 2],
            Some(1) => [extract, None],
            Some(_) => [extract.map(|seconds| seconds / 2.0); 2],
        }
    }
}

/// Whether images that have so many features, if it is said, can have `count` matches: a feature may have many, but
/// two features have one.
///
/// # Errors
/// If not, in words.
pub(super) fn check_features(count: usize, features: Option<[u32; 2]>) -> Result<(), String> {
    match features {
        Some([a, b]) if count as u64 > u64::from(a) * u64::from(b) => Err(format!(
            "it says {} of {a} and {b} features; leave `features` out where matches \
             are not of features",
            counted(count, "match")
        )),
        _ => Ok(()),
    }
}

/// Reads the `count` matches of two images of these sizes; `pixel_center` is where the child puts
/// the centre of the first pixel.
///
/// # Errors
/// If they are not what was promised, in words.
pub(super) fn read_rows(
    path: &Path,
    count: usize,
    [a, b]: [Size; 2],
    pixel_center: f32,
) -> Result<Vec<[f32; 5]>, String> {
    if count > MAX_MATCHES {
        return Err(format!(
            "it promises {count} matches; {MAX_MATCHES} are the most"
        ));
    }
    let file = match open_file(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound && count == 0 => {
            return Ok(Vec::new());
        }
        file => file.map_err(|error| format!("it wrote no matches: {error}"))?,
    };
    let unreadable = |error: io::Error| format!("its matches cannot be read: {error}");
    let expected = (count * ROW) as u64;
    let found = file.metadata().map_err(unreadable)?.len();
    if found != expected {
        return Err(format!(
            "it promises {} of {ROW} bytes, but wrote {}",
            counted(count, "match"),
            counted(found, "byte")
        ));
    }
    let bytes = read_exactly(file, expected).map_err(unreadable)?;
    let bytes = bytes.ok_or("its matches change while they are read")?;
    let (rows, _) = bytes.as_chunks::<ROW>();
    (rows.iter().enumerate())
        .map(|(index, row)| {
            let (values, _) = row.as_chunks::<4>();
            let mut row: [f32; 5] = std::array::from_fn(|i| f32::from_le_bytes(values[i]));
            row[..4].iter_mut().for_each(|value| *value -= pixel_center);
            check_row(row, a, b).map_err(|wrong| format!("match {index} {wrong}"))?;
            Ok(row)
        })
        .collect()
}

/// All bytes of a file that has so many; `None` if it has more or fewer. The child may still be writing:
/// reading stops one byte after the expected length, which is enough to know that there is more.
fn read_exactly(file: impl Read, expected: u64) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    file.take(expected + 1).read_to_end(&mut bytes)?;
    Ok((bytes.len() as u64 == expected).then_some(bytes))
}

fn check_row(row: [f32; 5], a: Size, b: Size) -> Result<(), String> {
    let [x_a, y_a, x_b, y_b, ambiguity] = row;
    if !row.iter().all(|value| value.is_finite()) {
        return Err(format!("has a number that is not finite: {row:?}"));
    }
    for (name, x, y, size) in [("a", x_a, y_a, a), ("b", x_b, y_b, b)] {
        if !is_inside(x, y, size) {
            let exchanged = if is_inside(y, x, size) {
                " (inside it if x and y were exchanged)"
            } else {
                ""
            };
            return Err(format!(
                "lies outside image {name}: ({x}, {y}) of {size} pixels{exchanged}; points are pixels of the \
                 original image, x before y"
            ));
        }
    }
    if !(0.0..=1.0).contains(&ambiguity) {
        return Err(format!(
            "has ambiguity {ambiguity}, which goes from 0 (certain) to 1"
        ));
    }
    Ok(())
}

/// Whether a point, pixel centres at integers, lies in an image of `size`.
pub fn is_inside(x: f32, y: f32, size: Size) -> bool {
    let within = |value: f32, length: usize| {
        value >= -0.5 - ROUNDING && value <= length as f32 - 0.5 + ROUNDING
    };
    within(x, size.width) && within(y, size.height)
}

#[cfg(test)]
mod tests {
    use std::fs::{self, OpenOptions};
    use std::io::Write;
    use std::thread;

    use super::*;
    use crate::matchers::LONGEST_STAGE;

    const SIZES: [Size; 2] = [Size::new(640, 480), Size::new(100, 200)];

    /// Reads `rows` as a file that is said to have `count` matches.
    fn read(rows: &[[f32; 5]], count: usize, pixel_center: f32) -> Result<Vec<[f32; 5]>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("0_1.f32");
        let bytes: Vec<u8> = (rows.iter().flatten())
            .flat_map(|value| value.to_le_bytes())
            .collect();
        std::fs::write(&path, bytes).unwrap();
        read_rows(&path, count, SIZES, pixel_center)
    }

    #[test]
    fn times_of_two_answers_are_of_both() {
        let times = |wall, extract, extracted| Times {
            wall,
            own: BTreeMap::from([("extract".to_owned(), extract)]),
            device: Some("gpu".to_owned()),
            extracted: Some(extracted),
        };
        let both = times(1.5, 1.0, 1).and(times(0.5, 0.25, 1));
        assert_eq!(both, times(2.0, 1.25, 2));
    }

    #[test]
    fn points_are_moved_to_pixel_centres_at_integers() {
        let row = [0.0, 480.0, 100.0, 7.25, 1.0];
        let moved = [-0.5, 479.5, 99.5, 6.75, 1.0];
        assert_eq!(read(&[row], 1, 0.5), Ok(vec![moved]));
        let inside = [639.5, -0.5, 99.5, 199.5, 0.0];
        assert_eq!(read(&[inside], 1, 0.0), Ok(vec![inside]));
    }

    #[test]
    fn lies_are_named() {
        let good = [1.0, 2.0, 3.0, 4.0, 0.5];
        for (rows, count, named) in [
            (
                vec![good],
                2,
                "promises 2 matches of 20 bytes, but wrote 20",
            ),
            (vec![good], 0, "promises 0"),
            (vec![good], usize::MAX, "the most"),
            (
                vec![good, [f32::NAN, 2.0, 3.0, 4.0, 0.5]],
                2,
                "match 1 has a number",
            ),
            (vec![[f32::INFINITY, 2.0, 3.0, 4.0, 0.5]], 1, "not finite"),
            (
                vec![[640.0, 2.0, 3.0, 4.0, 0.5]],
                1,
                "outside image a: (640, 2)",
            ),
            (vec![[1.0, 2.0, 3.0, -0.6, 0.5]], 1, "outside image b"),
            (vec![[1.0, 2.0, 3.0, 4.0, 1.5]], 1, "ambiguity 1.5"),
            (vec![[1.0, 2.0, 3.0, 4.0, -0.1]], 1, "ambiguity -0.1"),
        ] {
            let wrong = read(&rows, count, 0.0).unwrap_err();
            assert!(wrong.contains(named), "{wrong}");
        }
        let nowhere = Path::new("/nowhere/0_1.f32");
        assert_eq!(read_rows(nowhere, 0, SIZES, 0.0), Ok(Vec::new()));
        let wrong = read_rows(nowhere, 1, SIZES, 0.0).unwrap_err();
        assert!(wrong.contains("wrote no matches"), "{wrong}");
        let folder = tempfile::tempdir().unwrap();
        let wrong = read_rows(folder.path(), 1, SIZES, 0.0).unwrap_err();
        assert!(wrong.contains("a folder where a file is needed"), "{wrong}");
    }

    /// A file that grows as fast as it is read, and how many bytes were read.
    struct Endless(u64);

    impl Read for Endless {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            to.fill(1);
            self.0 += to.len() as u64;
            Ok(to.len())
        }
    }

    #[test]
    fn of_a_file_that_grows_while_it_is_read_no_more_is_read_than_tells_so() {
        let mut endless = Endless(0);
        assert_eq!(read_exactly(&mut endless, 40).unwrap(), None);
        assert_eq!(endless.0, 41);
        assert_eq!(read_exactly(&[1; 39][..], 40).unwrap(), None);
        assert_eq!(read_exactly(&[1; 40][..], 40).unwrap(), Some(vec![1; 40]));
    }

    #[test]
    fn a_file_that_is_being_written_is_refused_or_gives_what_was_promised() {
        const COUNT: usize = 2000;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("0_1.f32");
        let row = [1.0, 2.0, 3.0, 4.0, 0.5_f32];
        let bytes: Vec<u8> = row.iter().flat_map(|value| value.to_le_bytes()).collect();
        let part = bytes.repeat(COUNT / 4);
        thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for _ in 0..200 {
                    // Empty again, then up to twice what was promised.
                    fs::write(&path, b"").unwrap();
                    let mut file = OpenOptions::new().append(true).open(&path).unwrap();
                    (0..8).for_each(|_| file.write_all(&part).unwrap());
                }
            });
            while !writer.is_finished() {
                match read_rows(&path, COUNT, SIZES, 0.0) {
                    Ok(rows) => assert_eq!(rows, vec![row; COUNT]),
                    Err(wrong) => {
                        let named = [
                            "but wrote",
                            "change while they are read",
                            "wrote no matches",
                        ];
                        assert!(named.iter().any(|named| wrong.contains(named)), "{wrong}");
                    }
                }
            }
        });
    }

    #[test]
    fn matches_are_at_most_as_many_as_two_features_can_be_chosen() {
        for (count, features) in [
            (0, [0, 0]),
            (0, [0, 9]),
            (12, [3, 4]),
            (usize::MAX, [u32::MAX; 2]),
        ] {
            let checked = check_features(count.min(MAX_MATCHES), Some(features));
            assert_eq!(checked, Ok(()), "{count} {features:?}");
        }
        assert_eq!(check_features(5, None), Ok(()));
        for (count, features, named) in [
            (1, [0, 9], "1 match of 0 and 9 features"),
            (13, [3, 4], "13 matches of 3 and 4 features"),
        ] {
            let wrong = check_features(count, Some(features)).unwrap_err();
            assert!(wrong.contains(named), "{wrong}");
        }
    }

    #[test]
    fn the_time_of_an_image_is_that_of_the_images_that_were_extracted() {
        let times = |extract: Option<f64>, extracted| {
            let own = extract.map(|seconds| ("extract".to_owned(), seconds));
            let times = Times::new(1.0, own.into_iter().collect(), None);
            times.and_then(|times| times.of_images(extracted))
        };
        for (extract, extracted, each) in [
            (Some(0.5), None, [Some(0.5), None]),
            (Some(0.0), None, [None; 2]),
            (None, None, [None; 2]),
            (Some(0.5), Some(1), [Some(0.5), None]),
            (Some(0.5), Some(2), [Some(0.25); 2]),
            (Some(0.0), Some(0), [None; 2]),
            (None, Some(0), [None; 2]),
        ] {
            let times = times(extract, extracted).expect("it can be");
            assert_eq!(times.of_each_image(), each, "{extract:?} {extracted:?}");
        }
        for (extract, extracted, named) in [
            (Some(0.5), 3, "`extracted` is 3; a pair has two images"),
            (Some(0.5), 0, "`extracted` is 0, but"),
            (None, 2, "`seconds` have no \"extract\""),
        ] {
            let wrong = times(extract, Some(extracted)).expect_err("it cannot be");
            assert!(wrong.contains(named), "{wrong}");
        }
    }

    #[test]
    fn times_are_times() {
        let own = |seconds| BTreeMap::from([("match".to_owned(), seconds)]);
        assert!(Times::new(1.0, own(0.5), Some("cpu".into())).is_ok());
        assert!(Times::new(1.0, own(LONGEST_STAGE), None).is_ok());
        for (seconds, named) in [
            (-1.0, "-1.0 seconds"),
            (f64::NAN, "NaN seconds"),
            (f64::INFINITY, "inf seconds"),
            (
                1e308,
                "1e308 seconds are no time of a stage; 0 to 10000000 are",
            ),
        ] {
            let wrong = Times::new(1.0, own(seconds), None).unwrap_err();
            assert!(
                wrong.contains("\"match\"") && wrong.contains(named),
                "{wrong}"
            );
        }
        let two = ["search", "match"].map(|stage| (stage.to_owned(), 0.6 * LONGEST_STAGE));
        let wrong = Times::new(1.0, two.into(), None).unwrap_err();
        assert!(wrong.contains("together"), "{wrong}");
        assert!(Times::new(1.0, own(0.5), Some("\x1b[2J".into())).is_err());
    }
}
