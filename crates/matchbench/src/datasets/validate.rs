//! Reports everything that is wrong with a dataset, by file and line, with the way to correct it.
//!
//! Beyond what opening a dataset checks (missing files, columns, numbers, rotations, indices,
//! duplicates), every image is decoded in full, cameras are compared with the images they belong
//! to, and pairs with the poses.

use std::collections::{BTreeSet, HashMap};
use std::fs;
use std::path::Path;

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::cameras::{check_camera, other_size};
use super::decode::decode_gray;
use super::exif::orientation_of;
use super::images::IMAGES;
use super::native::{CAMERA, Contents, HOMOGRAPHIES, PAIRS, POSES};
use super::pair_poses::{contradiction, remedy};
use super::{DatasetError, Problem, manifest};
use crate::files::read_file;

/// All problems of the dataset in the folder `dir`; empty if there are none.
///
/// First come problems of the text files alone, then those of images and cameras, and then contradictions
/// between them. Within a file the order is that of its lines.
pub fn validate(dir: &Path) -> Vec<Problem> {
    let mut problems = Vec::new();
    let contents = Contents::read(dir, &mut problems);
    if contents.images.is_empty() {
        return problems;
    }
    check_name(dir, &contents, &mut problems);
    let sizes = check_images(&contents, &mut problems);
    check_depth(dir, &contents, &sizes, &mut problems);
    check_cameras(dir, &contents, &sizes, &mut problems);
    check_pairs(dir, &contents, &mut problems);
    check_homographies(dir, &contents, &sizes, &mut problems);
    problems
}

fn check_name(dir: &Path, contents: &Contents, problems: &mut Vec<Problem>) {
    let folder = fs::canonicalize(dir).unwrap_or_else(|_| dir.to_owned());
    let folder = folder.file_name().unwrap_or_default().to_string_lossy();
    if contents.name != folder {
        problems.push(Problem::warning(DatasetError::new(
            dir.join(manifest::FILE),
            format!("the name is {}, the folder's is {folder}", contents.name),
            "results are filed under the name; take it out unless that is meant",
        )));
    }
}

/// Decodes every image. Returns its size, turned as its frame says, if that succeeds.
fn check_images(contents: &Contents, problems: &mut Vec<Problem>) -> Vec<Option<Size>> {
    let checked: Vec<_> = contents
        .images
        .par_iter()
        .enumerate()
        .map(|(index, image)| {
            let turn = contents.manifest.turn(index);
            if !image.is_file() {
                return (None, None, None); // reported when the text files were read
            }
            let bytes = match read_file(image) {
                Ok(bytes) => bytes,
                Err(error) => return (None, None, Some(DatasetError::io(image, &error).into())),
            };
            let hash = Some((blake3::hash(&bytes), turn));
            let size = match decode_gray(&bytes) {
                Ok(pixels) => pixels.size(),
                Err(error) => return (None, hash, Some(error.in_file(image).into())),
            };
            let orientation = orientation_of(&bytes);
            let turned = (orientation != 1 && turn.is_none()).then(|| {
                Problem::warning(DatasetError::new(
                    image,
                    format!("EXIF orientation {orientation} is not applied: pixels as stored"),
                    "make sure that camera and pose are those of the stored pixels",
                ))
            });
            (Some(turn.size(size)), hash, turned)
        })
        .collect();
    let mut first = HashMap::new();
    (checked.into_iter().enumerate())
        .map(|(index, (size, hash, problem))| {
            problems.extend(problem);
            let twin = hash.map_or(index, |hash| *first.entry(hash).or_insert(index));
            if twin != index {
                problems.push(Problem::warning(DatasetError::new(
                    &contents.images[index],
                    format!("frame {index} is the same image as frame {twin}"),
                    "take one of them out, or know that the image counts twice",
                )));
            }
            size
        })
        .collect()
}

/// Reads the depth of every frame that has it, in the same way as runs do.
fn check_depth(
    dir: &Path,
    contents: &Contents,
    sizes: &[Option<Size>],
    problems: &mut Vec<Problem>,
) {
    let checked: Vec<Option<Problem>> = (sizes.par_iter().enumerate())
        .map(|(index, size)| {
            let turn = contents.manifest.turn(index);
            let file = contents.manifest.depth(dir, index);
            let file = file.filter(|file| file.path.is_file())?; // else told before
            // The size is that after the turn.
            match file.read(turn.inverse().size((*size)?), turn) {
                Err(error) => Some(error.into()),
                Ok(depth) if depth.coverage() == 0.0 => {
                    let what = "nothing is measured in it";
                    let remedy = "check `per_unit` and `invalid` of depth in dataset.toml";
                    Some(Problem::warning(DatasetError::new(file.path, what, remedy)))
                }
                Ok(_) => None,
            }
        })
        .collect();
    problems.extend(checked.into_iter().flatten());
}

fn check_cameras(
    dir: &Path,
    contents: &Contents,
    sizes: &[Option<Size>],
    problems: &mut Vec<Problem>,
) {
    // A camera is checked once per image size, with the first frame of this size.
    let mut judged: Vec<(Option<Camera>, Size)> = Vec::new();
    for (index, camera) in contents.cameras().into_iter().enumerate() {
        let own = contents
            .manifest
            .frames
            .get(index)
            .is_some_and(|frame| frame.camera.is_some());
        let file = dir.join(if own { manifest::FILE } else { CAMERA });
        let image = &contents.images[index];
        let Some(size) = sizes[index] else { continue };
        if judged.contains(&(camera, size)) {
            continue;
        }
        if !own && let Some((_, other)) = judged.iter().find(|(c, _)| *c == camera) {
            problems.push(other_size(image, size, *other));
        }
        judged.push((camera, size));
        if let Some(camera) = camera {
            check_camera(&camera, size, &file, image, problems);
        }
    }
}

fn check_pairs(dir: &Path, contents: &Contents, problems: &mut Vec<Problem>) {
    let file = dir.join(PAIRS);
    let poses = &contents.poses;
    if poses.is_empty() && !contents.posed.is_empty() {
        problems.push(Problem::warning(DatasetError::new(
            dir.join(IMAGES).join(POSES),
            "there are no poses, so pairs.txt cannot be checked against them",
            "add them if you have them",
        )));
    }
    let listed: BTreeSet<(u32, u32)> = (contents.posed.iter())
        .map(|pair| (pair.a, pair.b))
        .collect();
    for pair in &contents.posed {
        let line = pair.line;
        let mut warn = |what: String, remedy: &str| {
            let error = DatasetError::new(&file, what, remedy);
            problems.push(Problem::warning(error.at(line)));
        };
        if pair.a < pair.b && listed.contains(&(pair.b, pair.a)) {
            warn(
                format!("the pair {0} {1} is listed as {1} {0} too", pair.a, pair.b),
                "take one of them out, or know that it counts twice",
            );
        }
        if pair.truth.translation.vector.norm() == 0.0 {
            warn(
                format!("the pair {} {} has no baseline", pair.a, pair.b),
                "take it out, or know that it counts as wrong in all scores but those of the rotation",
            );
        }
        let pose = |index: u32| poses.get(index as usize).map(|(_, pose)| pose);
        let (Some(a), Some(b)) = (pose(pair.a), pose(pair.b)) else {
            continue;
        };
        if let Some(what) = contradiction((pair.a, pair.b), &pair.truth, [a, b]) {
            problems.push(DatasetError::new(&file, what, remedy(dir)).at(line).into());
        }
    }
}

/// Rows and columns of the grid of pixels at which a homography is tested.
const TRIED: u32 = 16;

fn check_homographies(
    dir: &Path,
    contents: &Contents,
    sizes: &[Option<Size>],
    problems: &mut Vec<Problem>,
) {
    let size = |frame: u32| sizes.get(frame as usize).copied().flatten();
    for pair in &contents.mapped {
        let (Some(a), Some(b)) = (size(pair.a), size(pair.b)) else {
            continue;
        };
        if !meets(&pair.truth, a, b) {
            let what = format!(
                "the homography takes no pixel of frame {} ({a}) into frame {} ({b})",
                pair.a, pair.b
            );
            let error = DatasetError::new(
                dir.join(HOMOGRAPHIES),
                what,
                "it is to take pixels of the first to the second; correct this line or take it out",
            );
            problems.push(error.at(pair.line).into());
        }
    }
}

/// Whether some pixel of a grid on `a` is mapped into `b`.
fn meets(b_from_a: &Matrix3<f64>, a: Size, b: Size) -> bool {
    let last = f64::from(TRIED - 1);
    let place = |step: u32, side: usize| f64::from(step) / last * (side as f64 - 1.0);
    (0..TRIED * TRIED).any(|step| {
        let (x, y) = (place(step % TRIED, a.width), place(step / TRIED, a.height));
        let seen = b_from_a * Vector3::new(x, y, 1.0);
        let (x, y) = (seen.x / seen.z, seen.y / seen.z);
        (-0.5..b.width as f64 - 0.5).contains(&x) && (-0.5..b.height as f64 - 0.5).contains(&y)
    })
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::super::{Severity, testing};
    use super::*;

    /// A sound dataset with `change` applied to the text of one of its files, validated.
    fn spoiled(name: &str, change: impl Fn(&str) -> String) -> Vec<Problem> {
        let (_folder, dir) = testing::dataset();
        let file = dir.join(name);
        fs::write(&file, change(&fs::read_to_string(&file).unwrap())).unwrap();
        validate(&dir)
    }

    /// The only problem, which must be about that file and line and contain those words.
    fn assert_found(problems: &[Problem], file: &str, line: Option<usize>, words: &str) {
        let [problem] = problems else {
            panic!("{problems:#?} is not one problem");
        };
        assert!(problem.error.file.ends_with(file), "{problem}");
        assert_eq!(problem.error.line, line, "{problem}");
        assert!(problem.error.what.contains(words), "{problem}");
        assert!(!problem.error.remedy.is_empty(), "{problem}");
    }

    fn with_line(text: &str, line: usize, new: &str) -> String {
        let mut lines: Vec<_> = text.lines().collect();
        lines[line - 1] = new;
        lines.join("\n")
    }

    #[test]
    fn each_wrong_line_of_the_pairs_is_named() {
        let at_2 = |new: &'static str| spoiled("pairs.txt", move |text| with_line(text, 2, new));
        let eye = "1 0 0 1 0 1 0 0 0 0 1 0";
        let found = at_2("0 7 1 0 0 1 0 1 0 0 0 0 1 0");
        assert_found(&found, "pairs.txt", Some(2), "frame 7 does not exist");
        let found = at_2("0 0 1 0 0 1 0 1 0 0 0 0 1 0");
        assert_found(&found, "pairs.txt", Some(2), "matched with itself");
        let found = at_2("0 2 1 0 0");
        assert_found(&found, "pairs.txt", Some(2), "5 columns");
        let found = at_2("0 2 NaN 0 0 1 0 1 0 0 0 0 1 0");
        assert_found(&found, "pairs.txt", Some(2), "column 3 is NaN");
        let found = at_2("0 2 2 0 0 1 0 1 0 0 0 0 1 0");
        assert_found(&found, "pairs.txt", Some(2), "not a rotation");
        let found = at_2("0 2 1 0 0 1 0 1 0 0 0 0 1 0");
        assert_found(&found, "pairs.txt", Some(2), "differs from pose.txt");
        let found = spoiled("pairs.txt", |text| format!("{text}0 1 {eye}\n"));
        assert_found(&found, "pairs.txt", Some(7), "stands in line 1 already");
        let found = spoiled("pairs.txt", |_| String::new());
        assert_found(&found, "pairs.txt", None, "no pairs");
    }

    #[test]
    fn one_image_as_two_frames_is_warned_of() {
        let (_folder, dir) = testing::dataset();
        let [first, third] = ["0000.png", "0002.png"].map(|name| dir.join("Images").join(name));
        fs::copy(first, third).unwrap();
        let found = validate(&dir);
        assert_found(&found, "Images/0002.png", None, "the same image as frame 0");
        assert_eq!(found[0].severity, Severity::Warning);
    }

    #[test]
    fn a_homography_that_leads_nowhere_is_named() {
        let (_folder, dir) = testing::dataset();
        let rows = "0 1 1 0 5 0 1 -3 0 0 1\n0 2 1 0 999 0 1 0 0 0 1\n";
        fs::write(dir.join("homographies.txt"), rows).unwrap();
        assert_found(
            &validate(&dir),
            HOMOGRAPHIES,
            Some(2),
            "takes no pixel of frame 0",
        );
        fs::remove_file(dir.join("pairs.txt")).unwrap();
        fs::write(dir.join("homographies.txt"), "0 1 1 0 5 0 1 -3 0 0 1\n").unwrap();
        assert_eq!(validate(&dir), []);
    }

    #[test]
    fn the_inverse_pose_is_a_contradiction() {
        let found = spoiled("Images/pose.txt", |text| {
            with_line(text, 2, "1 0 0 50 0 1 0 0 0 0 1 0")
        });
        let lines: Vec<_> = found.iter().map(|p| p.error.line).collect();
        assert_eq!(lines, [Some(1), Some(4), Some(5)], "all pairs with frame 1");
    }

    #[test]
    fn poses_are_checked_line_by_line() {
        let found = spoiled("Images/pose.txt", |text| with_line(text, 4, "1 2 3"));
        assert_eq!(found[0].error.line, Some(4));
        assert!(found[0].error.what.contains("3 columns"));
        let found = spoiled("Images/pose.txt", |text| {
            text.lines().take(3).collect::<Vec<_>>().join("\n")
        });
        assert_found(&found, "pose.txt", None, "3 poses for 4 images");
    }

    #[test]
    fn a_camera_that_cannot_belong_to_the_images_is_noticed() {
        let with = |k: &'static str| spoiled("camera.txt", move |_| k.to_owned());
        let found = with("20 0 100 0 20 8 0 0 1");
        assert_found(&found, "camera.txt", None, "outside the image");
        assert_eq!(found[0].severity, Severity::Error);
        let found = with("20 0 5.75 0 20 4.1 0 0 1");
        assert_found(&found, "camera.txt", None, "far from the centre");
        assert_eq!(found[0].severity, Severity::Warning);
        let found = with("1000 0 12 0 20 8 0 0 1");
        assert_found(&found, "camera.txt", None, "fx 1000");
        // A lens that folds the image.
        let found = spoiled("dataset.toml", |_| {
            "version = 1\ndistortion = { k1 = -3, k2 = 0, p1 = 0, p2 = 0, k3 = 0 }\n".to_owned()
        });
        assert_found(&found, "camera.txt", None, "cannot be undone");
        assert_eq!(found[0].severity, Severity::Error);
        let found = with("20 3 12 0 20 8 0 0 1");
        assert_found(&found, "camera.txt", None, "skew 3");
        let found = with("20 0 12 0 20");
        assert_found(&found, "camera.txt", None, "5 numbers");
    }

    #[test]
    fn cameras_of_the_manifest_are_checked() {
        for (lens, named) in [
            ("{ k1 = nan, k2 = 0, p1 = 0, p2 = 0, k3 = 0 }", "k1 is NaN"),
            (
                "{ k1 = 0, k2 = 0, p1 = 0, p2 = -1e9, k3 = 0 }",
                "p2 is -1000000000",
            ),
        ] {
            let (_folder, dir) = testing::dataset();
            let manifest = format!("version = 1\ndistortion = {lens}\n");
            fs::write(dir.join("dataset.toml"), manifest).unwrap();
            assert_found(&validate(&dir), "dataset.toml", None, named);
            assert!(super::super::Sequence::open(&dir).is_err());
        }
        for (camera, named) in [
            ("{ fx = nan, fy = 20, cx = 12, cy = 8 }", "fx is NaN"),
            ("{ fx = 20, fy = -20, cx = 12, cy = 8 }", "must be positive"),
            ("{ fx = 20, fy = 0, cx = 12, cy = 8 }", "must be positive"),
            ("{ fx = 20, fy = inf, cx = 12, cy = 8 }", "fy is inf"),
        ] {
            let (_folder, dir) = testing::dataset();
            let own = format!("[[frames]]\ncamera = {camera}\n").repeat(3);
            let first = "[[frames]]\ncamera = { fx = 20, fy = 20, cx = 12, cy = 8 }";
            fs::write(
                dir.join("dataset.toml"),
                format!("version = 1\n{first}\n{own}"),
            )
            .unwrap();
            let found = validate(&dir);
            let error = &found.first().expect("a problem").error;
            assert!(error.what.contains(named), "{error}");
            assert!(error.what.starts_with("frame 1: "), "{error}");
            assert!(super::super::Sequence::open(&dir).is_err());
        }
    }

    #[test]
    fn missing_and_damaged_images_are_named() {
        let (_folder, dir) = testing::dataset();
        let image = |index: usize| -> PathBuf { dir.join(format!("Images/{index:04}.png")) };
        let bytes = fs::read(image(1)).unwrap();
        fs::write(image(1), &bytes[..bytes.len() / 2]).unwrap();
        fs::write(image(3), "").unwrap();
        let found = validate(&dir);
        assert_eq!(found.len(), 2, "{found:?}");
        assert_found(&found[..1], "0001.png", None, "truncated");
        assert_found(&found[1..], "0003.png", None, "not an image");
        fs::write(image(1), &bytes).unwrap();
        fs::write(image(3), &bytes).unwrap();
        fs::remove_file(image(2)).unwrap();
        let found = validate(&dir);
        assert!(
            found[0].error.what.contains("0002, is missing"),
            "{found:?}"
        );
        fs::remove_dir_all(dir.join("Images")).unwrap();
        assert_found(&validate(&dir), "Images", None, "");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_image_file_is_named_and_nothing_waits_for_it() {
        let (_folder, dir) = testing::dataset();
        let image = dir.join("Images/0001.png");
        fs::remove_file(&image).unwrap();
        let link = |to: &str| std::os::unix::fs::symlink(to, &image).unwrap();
        link("nowhere.png");
        assert_found(&validate(&dir), "0001.png", None, "the image is missing");
        fs::remove_file(&image).unwrap();
        link("/dev/zero");
        assert_found(&validate(&dir), "0001.png", None, "no regular file");
        fs::remove_file(&image).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&image).status();
        assert!(made.unwrap().success());
        assert_found(&validate(&dir), "0001.png", None, "no regular file");
        assert!(super::super::Sequence::open(&dir).is_err());
        fs::remove_file(&image).unwrap();
        fs::create_dir(&image).unwrap();
        assert_found(&validate(&dir), "0001.png", None, "no regular file");
    }

    #[test]
    fn images_of_another_size_and_turned_ones_are_named() {
        let (_folder, dir) = testing::dataset();
        let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/images");
        fs::remove_file(dir.join("Images/0002.png")).unwrap();
        fs::copy(fixtures.join("turned.jpg"), dir.join("Images/0002.jpg")).unwrap();
        let found = validate(&dir);
        assert_found(&found, "0002.jpg", None, "EXIF orientation 6");
        assert_eq!(found[0].severity, Severity::Warning);
        fs::write(dir.join("Images/0002.jpg"), b"P5 22 17 255\n".repeat(40)).unwrap();
        assert_found(
            &validate(&dir),
            "0002.jpg",
            None,
            "the image is 22x17, others of the same camera are 24x17",
        );
    }

    #[test]
    fn all_problems_are_found_at_once() {
        let (_folder, dir) = testing::dataset();
        fs::write(
            dir.join("dataset.toml"),
            "version = 1\ncolour = 3\nnotes = 7\n",
        )
        .unwrap();
        fs::write(dir.join("camera.txt"), "20 0 100 0 20 8 0 0 1").unwrap();
        fs::write(dir.join("Images/0001.png"), "x").unwrap();
        let pairs = "0 1 nan 0 0 1 0 1 0 0 0 0 1 0\n2 2\n";
        fs::write(dir.join("pairs.txt"), pairs).unwrap();
        let found = validate(&dir);
        let files: Vec<_> = found
            .iter()
            .map(|p| {
                (
                    p.error.file.file_name().unwrap().to_str().unwrap(),
                    p.error.line,
                )
            })
            .collect();
        assert_eq!(
            files,
            [
                ("dataset.toml", Some(2)),
                ("dataset.toml", Some(3)),
                ("pairs.txt", Some(1)),
                ("pairs.txt", Some(2)),
                ("0001.png", None),
                ("camera.txt", None),
            ]
        );
    }

    #[test]
    fn warnings_do_not_stop_a_dataset() {
        let (_folder, dir) = testing::dataset();
        fs::remove_file(dir.join("Images/pose.txt")).unwrap();
        let pairs = ["0 1", "1 0"].map(|pair| format!("{pair} 1 0 0 0 0 1 0 0 0 0 1 0\n"));
        fs::write(dir.join("pairs.txt"), pairs.concat()).unwrap();
        fs::write(dir.join("dataset.toml"), "version = 1\nname = 'else'").unwrap();
        let found = validate(&dir);
        let words = [
            "the name is else",
            "there are no poses",
            "the pair 0 1 is listed as 1 0 too",
            "has no baseline",
            "has no baseline",
        ];
        assert_eq!(found.len(), words.len(), "{found:?}");
        for (problem, words) in found.iter().zip(words) {
            assert_eq!(problem.severity, Severity::Warning);
            assert!(problem.error.what.contains(words), "{problem}");
        }
        assert!(super::super::Sequence::open(&dir).is_ok());
    }
}
