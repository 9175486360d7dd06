//! No parameter is accepted and ignored.
//!
//! Each parameter that a matcher or estimator lists is given other values, one parameter at a time, until
//! the result on a small scene is another. A parameter for which no value does that fails, unless what it
//! belongs to is not chosen and the refusal says so. Giving one parameter must also leave all others as they
//! were.

use std::collections::BTreeMap;
use std::f32::consts::TAU;
use std::sync::Mutex;

use matchbench::config::ConfigError;
use matchbench::estimators::{ESTIMATORS, Estimator};
use matchbench::matchers::{BuiltMatcher, Extraction, MATCHERS};
use matchbench_vision::features::Features;
use matchbench_vision::geometry::{Camera, Distortion, Lens, MatchedPoints};
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::matching::{Correspondences, View};
use matchbench_vision::robust::TwoViews;
use matchbench_vision::seed::Seed;
use nalgebra::{Point2, Rotation3, Vector3};
use serde_json::{Value, json};

/// Where a parameter stands in the tree of all: a JSON pointer.
type Pointer = String;

/// Every parameter below `value`; the elements of lists are parameters too.
fn parameters(value: &Value, at: &str, found: &mut Vec<Pointer>) {
    match value {
        Value::Object(parts) => {
            for (name, part) in parts {
                parameters(part, &format!("{at}/{name}"), found);
            }
        }
        Value::Array(parts) => {
            for (index, part) in parts.iter().enumerate() {
                parameters(part, &format!("{at}/{index}"), found);
            }
        }
        _ => found.push(at.to_owned()),
    }
}

/// `{"extractor": {"sigma": 1}}` for `/extractor/sigma`; a list is given whole.
fn given(all: &Value, pointer: &str, value: &Value) -> Value {
    let (parent, name) = pointer
        .rsplit_once('/')
        .expect("a pointer begins with a slash");
    if let Some(Value::Array(list)) = all.pointer(parent) {
        let mut list = list.clone();
        list[name.parse::<usize>().expect("a place in a list")] = value.clone();
        return given(all, parent, &Value::Array(list));
    }
    let inner = json!({ name: value });
    match parent {
        "" => inner,
        parent => given(all, parent, &inner),
    }
}

/// Both, at any depth; they do not contradict each other.
fn together(mut all: Value, more: &Value) -> Value {
    if let (Some(all), Some(more)) = (all.as_object_mut(), more.as_object()) {
        for (name, value) in more {
            let before = all.remove(name).unwrap_or(Value::Null);
            let both = if value.is_object() && before.is_object() {
                together(before, value)
            } else {
                value.clone()
            };
            all.insert(name.clone(), both);
        }
    }
    all
}

/// Values that are worth trying in place of this one.
fn other_values(value: &Value, refused: &dyn Fn(&Value) -> Option<String>) -> Vec<Value> {
    match value {
        Value::Bool(value) => vec![json!(!value)],
        Value::Null => vec![json!(20), json!(2000), json!(0.5)],
        Value::Number(number) if number.is_f64() => {
            let x = number.as_f64().expect("it is one");
            [
                0.5 * x,
                2.0 * x,
                0.1 * x,
                10.0 * x,
                0.9 * x,
                1.1 * x,
                0.01 * x,
                1.0 - 0.5 * (1.0 - x),
                x - 0.5,
                x + 0.5,
            ]
            .map(Value::from)
            .to_vec()
        }
        Value::Number(number) => {
            let x = number.as_u64().expect("counts are not negative");
            [
                x / 2,
                2 * x,
                x / 10,
                x + 1,
                x.saturating_sub(1),
                x + 500,
                x / 100,
                x / 1000,
                1,
                10,
            ]
            .into_iter()
            .filter(|&other| other != x)
            .map(Value::from)
            .collect()
        }
        Value::String(chosen) => {
            // The refusal of a choice that is not there lists those that are.
            let message = refused(&json!("no-such-choice")).expect("there is no such choice");
            let (_, expected) = message
                .split_once("expected")
                .expect("it says what there is");
            let choices: Vec<Value> = expected
                .split('`')
                .skip(1)
                .step_by(2)
                .filter(|&choice| choice != chosen)
                .map(Value::from)
                .collect();
            assert!(!choices.is_empty(), "{message}");
            choices
        }
        _ => unreachable!("parameters are leaves"),
    }
}

/// What the walk needs of a matcher or an estimator.
struct Subject<'a, R> {
    id: &'a str,
    /// Parameters given in every case, so that the scene is small or something happens at all.
    always: Value,
    /// Every parameter as it is built from what is given.
    built: &'a dyn Fn(&Value) -> Result<Value, ConfigError>,
    /// How many cases each stage has.
    cases: [usize; 2],
    /// The result of a case that a parameter acts on: of the extraction, or of what comes after it.
    result: &'a dyn Fn(&Value, Stage, usize) -> R,
}

/// A parameter of the extraction acts on features, another on what is made of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Extraction,
    Rest,
}

impl Stage {
    fn of(pointer: &str) -> Self {
        let is_extraction = pointer.starts_with("/extractor/") || pointer == "/budget";
        if is_extraction {
            Self::Extraction
        } else {
            Self::Rest
        }
    }
}

impl<R: PartialEq> Subject<'_, R> {
    /// The parameters of which no other value changes anything.
    fn dead(&self) -> Vec<String> {
        let all = (self.built)(&self.always).expect("what is always given is allowed");
        let before = [Stage::Extraction, Stage::Rest].map(|stage| {
            let cases = 0..self.cases[stage as usize];
            (cases.map(|case| (self.result)(&self.always, stage, case))).collect::<Vec<R>>()
        });
        let mut pointers = Vec::new();
        parameters(&all, "", &mut pointers);
        // The pose of RepMatch is an estimator, whose parameters are walked as those of `best`; what it finds
        // matters here as far as matches change sides. One of them stands for all.
        pointers.retain(|pointer| {
            !pointer.starts_with("/selection/pose/") || pointer.ends_with("/threshold_px")
        });
        (pointers.into_iter())
            .filter(|pointer| !self.acts(&all, pointer, &before[Stage::of(pointer) as usize]))
            .collect()
    }

    fn acts(&self, all: &Value, pointer: &str, before: &[R]) -> bool {
        let changed = |value: &Value| together(self.always.clone(), &given(all, pointer, value));
        let refusal = |value: &Value| {
            (self.built)(&changed(value))
                .err()
                .map(|error| error.to_string())
        };
        let mut refusals = Vec::new();
        let mut others = other_values(all.pointer(pointer).expect("it is listed"), &refusal);
        others.extend(more_values(self.id, pointer));
        for value in others {
            let params = changed(&value);
            match (self.built)(&params) {
                Err(error) => refusals.push(error.to_string()),
                Ok(built) => {
                    self.others_stay(all, &built, pointer);
                    let stage = Stage::of(pointer);
                    let mut cases = before.iter().enumerate();
                    if cases.any(|(case, before)| (self.result)(&params, stage, case) != *before) {
                        return true;
                    }
                }
            }
        }
        // What belongs to a part that is not chosen is refused whatever its value.
        let names_the_choice =
            |message: &String| message.contains("is set, but") || message.contains("exactly alone");
        let accepted = refusals.is_empty() || !refusals.iter().all(names_the_choice);
        !accepted
    }

    /// A choice may bring parameters and take some away; those that stay keep their values.
    fn others_stay(&self, all: &Value, built: &Value, changed: &str) {
        let mut pointers = Vec::new();
        parameters(all, "", &mut pointers);
        for pointer in pointers.iter().filter(|&pointer| pointer != changed) {
            if let Some(now) = built.pointer(pointer) {
                let before = all.pointer(pointer).expect("it is listed");
                assert_eq!(
                    now, before,
                    "{}: giving {changed} changes {pointer}",
                    self.id
                );
            }
        }
    }
}

/// Values for parameters that the usual ones are too near to, or too far from.
fn more_values(id: &str, pointer: &str) -> Vec<Value> {
    match (id, pointer) {
        (_, "/confidence") => vec![json!(0.999_999), json!(0.01)],
        // Every pose is hopeless.
        (_, "/hopeless") => vec![json!(1.0)],
        // Just above the least number of samples.
        (_, "/max_iterations") => vec![json!(1001), json!(201)],
        // Its default is beyond all scenes.
        ("ransac-e-inliers", "/max_depth") => vec![json!(5.0)],
        (_, "/extractor/views/max_pixels") => vec![json!(5000)],
        (_, "/extractor/views/max_tilt") => vec![json!(1.2)],
        ("gaim", "/selection/collision_px") => vec![json!(50.0)],
        // The maps of the scene are far from these limits.
        ("adalam" | "adalam-asift", "/selection/max_stretch" | "/selection/max_growth") => {
            vec![json!(1.01)]
        }
        (_, pointer) if pointer.ends_with("/max_aspect") => vec![json!(1.01)],
        _ => Vec::new(),
    }
}

const CAMERA: Camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
const WIDE_LENS: Camera = Camera {
    distortion: Some(Lens::Brown(Distortion {
        k1: -0.28,
        k2: 0.07,
        p1: 0.0,
        p2: 0.0,
        k3: 0.0,
    })),
    ..CAMERA
};

/// Matches of scene points at the depth that `depth` gives for a ray and a random number, and wrong ones.
fn matches(
    right: u32,
    wrong: u32,
    seed: u64,
    depth: impl Fn(Point2<f64>, f64) -> f64,
) -> MatchedPoints {
    seen_by(&CAMERA, right, wrong, seed, depth)
}

fn seen_by(
    camera: &Camera,
    right: u32,
    wrong: u32,
    seed: u64,
    depth: impl Fn(Point2<f64>, f64) -> f64,
) -> MatchedPoints {
    let mut rng = Seed(seed).rng();
    let rotation = Rotation3::from_euler_angles(0.02, 0.1, 0.05);
    let mut points = MatchedPoints::default();
    for i in 0..right + wrong {
        // A third of them crowd in a corner.
        let size = if i % 3 == 0 { 0.2 } else { 1.0 };
        let mut anywhere =
            || Point2::new(640.0 * size * rng.uniform(), 480.0 * size * rng.uniform());
        let (a, elsewhere) = (anywhere(), anywhere());
        let ray = camera.normalize(a);
        let scene = rotation * (ray.to_homogeneous() * depth(ray, rng.uniform()));
        let seen = scene + Vector3::new(0.95, 0.1, 0.3);
        let b = camera.project(Point2::new(seen.x / seen.z, seen.y / seen.z));
        let noise = Vector3::from_fn(|_, _| 0.5 * rng.normal()).xy();
        points.push(
            a,
            if i < right { b + noise } else { elsewhere },
            rng.uniform() as f32,
        );
    }
    points
}

/// Matches whose keypoints turned alike, and more of another motion, which did not.
fn turned_alike(mut points: MatchedPoints, others: MatchedPoints) -> MatchedPoints {
    let alike = points.len();
    for (i, (&a, &b)) in others.a.iter().zip(&others.b).enumerate() {
        points.push(a, b, others.ambiguity[i]);
    }
    let mut rng = Seed(9).rng();
    let turns = (0..points.len())
        .map(|i| rng.uniform() as f32 * if i < alike { 0.3 } else { TAU })
        .collect();
    points.with_turns(Some(turns))
}

/// Image b seen in a mirror.
fn mirrored(mut points: MatchedPoints) -> MatchedPoints {
    for b in &mut points.b {
        b.x = 640.0 - b.x;
    }
    points
}

#[test]
fn every_parameter_of_every_estimator_acts() {
    let deep = |_: Point2<f64>, uniform: f64| 3.0 + 6.0 * uniform;
    let wall = |ray: Point2<f64>, uniform: f64| {
        let wall = 8.0 / (1.0 + 0.4 * ray.x);
        if uniform < 0.1 { 0.4 * wall } else { wall }
    };
    // Easy; hopeless for a few hundred samples, and large enough for a test that looks at blocks; a plane with
    // little before it. Most estimators end in the same optimum whatever happened on the way, so some searches
    // are stopped early.
    let whole = usize::MAX;
    let pinhole = [
        (matches(60, 20, 1, deep), 4, whole),
        (matches(60, 90, 5, deep), 6, whole),
        (matches(60, 90, 5, deep), 6, 60),
        (matches(135, 315, 2, deep), 4, whole),
        (matches(135, 315, 2, deep), 7, 100),
        (matches(135, 315, 2, deep), 8, 5),
        (matches(200, 60, 3, wall), 4, whole),
        (matches(200, 60, 3, wall), 5, whole),
        (matches(200, 60, 3, wall), 6, 5),
        (mirrored(matches(200, 60, 3, wall)), 4, whole),
        (matches(135, 315, 4, wall), 4, whole),
        (matches(135, 315, 4, wall), 5, 40),
        (matches(60, 90, 5, wall), 6, 20),
        (matches(40, 60, 6, wall), 7, whole),
        (matches(20, 60, 7, deep), 8, whole),
        (
            turned_alike(matches(60, 0, 5, deep), mirrored(matches(75, 0, 6, deep))),
            6,
            whole,
        ),
        (
            turned_alike(matches(60, 0, 5, wall), mirrored(matches(75, 0, 6, wall))),
            6,
            whole,
        ),
    ];
    let scenes: Vec<_> = (pinhole.into_iter())
        .map(|(points, seed, most)| (points, CAMERA, seed, most))
        .chain([(seen_by(&WIDE_LENS, 60, 20, 8, deep), WIDE_LENS, 4, whole)])
        .collect();
    let mut dead = Vec::new();
    for entry in ESTIMATORS {
        let result = |params: &Value, _: Stage, case: usize| -> String {
            let built = entry.build(Some(params)).expect("it was built before");
            let (points, camera, seed, most) = &scenes[case];
            let views = TwoViews {
                points,
                camera_a: camera,
                camera_b: camera,
            };
            let (seed, stop) = (Seed(*seed), |drawn: usize| drawn >= *most);
            match built.estimator {
                Estimator::Pose(e) => format!("{:?}", e.estimate_until(views, seed, &stop)),
                Estimator::Homography(e) => format!("{:?}", e.estimate_until(points, seed, &stop)),
            }
        };
        let subject = Subject {
            id: entry.id(),
            always: always(entry.id()),
            built: &|params| entry.build(Some(params)).map(|built| built.params),
            cases: [0, scenes.len()],
            result: &result,
        };
        dead.extend(
            subject
                .dead()
                .into_iter()
                .map(|pointer| format!("{}{pointer}", entry.id())),
        );
    }
    assert!(dead.is_empty(), "these parameters do nothing: {dead:#?}");
}

/// A wall that moves by `shift` pixels, before it two boards that move farther, on the right something that
/// has nothing to do with the other image.
fn image(seed: u64, size: Size, shift: usize) -> GrayImage {
    let mut noise = Seed(5).number(seed).rng();
    GrayImage::from_fn(size, |x, y| {
        let (shift, layer) = match y * 4 / size.height {
            1 => (2 * shift, 1),
            2 => (3 * shift / 2, 2),
            _ => (shift, 0),
        };
        let layer = if x > size.width * 4 / 5 {
            10 + seed
        } else {
            layer
        };
        let grey = |cell: [u64; 2], range: u32| {
            let cell = Seed(6).number(layer).number(cell[0]).number(cell[1]);
            cell.rng().below(range)
        };
        let (column, row) = ((x + shift) as u64, y as u64);
        // Detail, and structure that is seen from afar.
        let fine = grey([column / 7, row / 6], 120);
        let coarse = grey([1000 + column / 29, row / 27], 90);
        (20 + fine + coarse + noise.below(6)) as u8
    })
}

/// Features that were extracted before: the same extraction of the same image gives the same.
type Known = Mutex<BTreeMap<(String, usize), Features>>;

fn features(known: &Known, built: &BuiltMatcher, images: &[GrayImage], index: usize) -> Features {
    let Extraction {
        extractor, params, ..
    } = &built.extraction;
    let key = (format!("{extractor} {params}"), index);
    let found = known
        .lock()
        .expect("no other thread panicked")
        .get(&key)
        .cloned();
    found.unwrap_or_else(|| {
        let features = built
            .matcher
            .extract(&images[index])
            .expect("no matcher of ours fails");
        known
            .lock()
            .expect("no other thread panicked")
            .insert(key, features.clone());
        features
    })
}

/// The image turned by 90 degrees.
fn turned(image: &GrayImage) -> GrayImage {
    let size = Size::new(image.height(), image.width());
    GrayImage::from_fn(size, |x, y| image.at(y, image.height() - 1 - x))
}

/// The middle of the image, twice as large.
fn nearer(image: &GrayImage) -> GrayImage {
    let (left, top) = (image.width() / 4, image.height() / 4);
    GrayImage::from_fn(image.size(), |x, y| image.at(left + x / 2, top + y / 2))
}

/// The result of one stage of a matcher.
#[derive(PartialEq)]
enum Matched {
    Extracted(Features),
    /// Putative and selected correspondences of a pair.
    Selected(Correspondences, Correspondences),
}

#[test]
fn every_parameter_of_every_matcher_acts() {
    let size = Size::new(160, 120);
    let (a, b) = (image(0, size, 0), image(1, size, 4));
    // The last is large enough for the larger budget of GMS.
    let large = image(2, Size::new(660, 480), 0);
    let images = [a, turned(&b), nearer(&b), b, large];
    let known = Known::default();
    let mut dead = Vec::new();
    for entry in MATCHERS {
        // Coarse octaves find something in the large image alone.
        let (shown, partners): (&[usize], &[usize]) = match entry.id() {
            "gms" | "gms-s" => (&[0, 4], &[3, 1, 2]),
            "akaze" | "freak" => (&[0, 4], &[3]),
            "gaim" => (&[0], &[3, 2]),
            // Matches that are not mutual, and yet clear, are rare.
            "adalam" | "adalam-asift" => (&[0], &[3, 2, 1]),
            _ => (&[0], &[3]),
        };
        let result = |params: &Value, stage: Stage, case: usize| -> Matched {
            let built = entry.build(Some(params)).expect("it was built before");
            let features_of = |index: usize| features(&known, &built, &images, index);
            let pair = |partner: usize| {
                let (a, b) = (features_of(0), features_of(partner));
                let putative = built
                    .matcher
                    .search(&a, &b)
                    .expect("no matcher of ours fails");
                let view = |features, index: usize| View {
                    features,
                    image: Some(&images[index]),
                    camera: Some(&CAMERA),
                };
                let (view_a, view_b) = (view(&a, 0), view(&b, partner));
                let selected = built
                    .matcher
                    .select(view_a, view_b, putative.clone(), Seed(3));
                Matched::Selected(putative, selected.expect("no matcher of ours fails"))
            };
            match stage {
                Stage::Extraction => Matched::Extracted(features_of(shown[case])),
                Stage::Rest => pair(partners[case]),
            }
        };
        let subject = Subject {
            id: entry.id(),
            always: always(entry.id()),
            built: &|params| entry.build(Some(params)).map(|built| built.params),
            cases: [shown.len(), partners.len()],
            result: &result,
        };
        dead.extend(
            subject
                .dead()
                .into_iter()
                .map(|pointer| format!("{}{pointer}", entry.id())),
        );
    }
    assert!(dead.is_empty(), "these parameters do nothing: {dead:#?}");
}

/// What keeps the scenes of the slow ones small, and lets a rare effect be seen.
fn always(id: &str) -> Value {
    match id {
        "asift" | "code" => {
            json!({"extractor": {"views": {"tilts": 2, "limit": 400, "max_pixels": 19200}}})
        }
        "repmatch" => {
            json!({"extractor": {"views": {"tilts": 4, "limit": 600, "max_pixels": 19200}}})
        }
        "gaim" => json!({
            "extractor": {"views": {"shears": 1, "diagonal_px": 300.0, "limit": 5000}},
            "selection": {"labels": {"nodes": 100, "labels": 10}}
        }),
        "daisy" | "dlco" | "binboost" => json!({"extractor": {"sift": {"limit": 60}}}),
        "adalam-asift" => json!({
            "extractor": {"views": {"tilts": 2, "limit": 400, "max_pixels": 19200}},
            "selection": {"seed_ratio": 1.0, "min_inliers": 3, "keep_clear": false}
        }),
        // With more seeds, some are not mutual.
        "adalam" => json!({"selection": {"seed_ratio": 1.0, "min_inliers": 3}}),
        // Abandoning good models is so rare that only one sample in a thousand more is drawn for it.
        "ransac-f" => json!({"max_iterations": 5000, "confidence": 0.999_999}),
        _ => json!({}),
    }
}
