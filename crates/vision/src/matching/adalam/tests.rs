use nalgebra::{Affine2, Matrix3, Point2};

use super::*;
use crate::features::{DescriptorKind, Descriptors};
use crate::seed::Rng;

const SIZE: Size = Size::new(640, 480);

/// A turn by 20 degrees, a stretch and a shift: about what the keypoints below say.
fn motion() -> Affine2<f64> {
    let matrix = Matrix3::new(0.94, -0.36, 90.0, 0.33, 0.98, -40.0, 0.0, 0.0, 1.0);
    Affine2::from_matrix_unchecked(matrix)
}

fn keypoint(at: Point2<f64>, size: f32, angle: f32) -> Keypoint {
    Keypoint {
        at: at.cast(),
        size,
        angle: Some(angle),
        response: 1.0,
        octave: 0,
    }
}

/// Two images' keypoints and the ambiguity of the match between those of one index.
#[derive(Clone, Default)]
struct Scene {
    a: Vec<Keypoint>,
    b: Vec<Keypoint>,
    ambiguity: Vec<f32>,
}

impl Scene {
    fn push(&mut self, a: Keypoint, b: Keypoint, ambiguity: f32) {
        self.a.push(a);
        self.b.push(b);
        self.ambiguity.push(ambiguity);
    }

    /// First `right` matches that follow the motion to about half a pixel, then `wrong` ones.
    fn of(right: usize, wrong: usize, seed: u64) -> Self {
        let mut rng = Seed(seed).rng();
        let mut scene = Self::default();
        while scene.a.len() < right {
            let a = anywhere(&mut rng);
            let b = motion() * a + nalgebra::Vector2::from_fn(|_, _| 0.5 * rng.normal());
            if b.x >= 0.0 && b.y >= 0.0 && b.x < 640.0 && b.y < 480.0 {
                let angle = 0.35 + 0.1 * rng.normal() as f32;
                let size = 4.0 * (1.0 + 0.1 * rng.normal() as f32);
                let ambiguity = 0.4 + 0.6 * rng.uniform() as f32;
                scene.push(keypoint(a, 4.0, 0.0), keypoint(b, size, angle), ambiguity);
            }
        }
        for _ in 0..wrong {
            let (a, b) = (anywhere(&mut rng), anywhere(&mut rng));
            let angle = std::f32::consts::TAU * rng.uniform() as f32;
            let ambiguity = 0.7 + 0.3 * rng.uniform() as f32;
            scene.push(keypoint(a, 4.0, 0.0), keypoint(b, 4.0, angle), ambiguity);
        }
        scene
    }

    fn features(&self, size_b: Size) -> [Features; 2] {
        let features = |size, keypoints: &[Keypoint]| {
            let mut descriptors = Descriptors::empty(DescriptorKind::Float { dim: 1 });
            if let Descriptors::Float(rows) = &mut descriptors {
                (0..keypoints.len()).for_each(|i| rows.push(&[i as f32]));
            }
            Features::new(size, keypoints.to_vec(), descriptors)
        };
        [features(SIZE, &self.a), features(size_b, &self.b)]
    }

    fn matches(&self) -> Correspondences {
        (0..)
            .zip(&self.ambiguity)
            .map(|(i, &distance)| Correspondence {
                a: i,
                b: i,
                distance,
                second: 1.0,
            })
            .collect()
    }

    fn kept_with(&self, params: AdalamParams, size_b: Size) -> Vec<bool> {
        let [a, b] = self.features(size_b);
        let adalam = Adalam::new(params).unwrap();
        adalam.mask(&a, &b, &self.matches(), None)
    }

    fn kept(&self) -> Vec<bool> {
        self.kept_with(AdalamParams::default(), SIZE)
    }
}

fn anywhere(rng: &mut Rng) -> Point2<f64> {
    Point2::new(639.0 * rng.uniform(), 479.0 * rng.uniform())
}

fn count(kept: &[bool]) -> usize {
    kept.iter().filter(|&&kept| kept).count()
}

#[test]
fn matches_that_move_together_stay_and_others_go() {
    let kept = Scene::of(300, 900, 1).kept();
    let (right, wrong) = (count(&kept[..300]), count(&kept[300..]));
    assert!(right > 280 && wrong < 10, "{right} right, {wrong} wrong");
    assert_eq!(count(&Scene::of(0, 2000, 2).kept()), 0);
}

#[test]
fn without_orientations_and_sizes_places_alone_decide() {
    let mut scene = Scene::of(300, 300, 1);
    for keypoint in scene.a.iter_mut().chain(&mut scene.b) {
        keypoint.angle = None;
        keypoint.size = 0.0;
    }
    let kept = scene.kept();
    let (right, wrong) = (count(&kept[..300]), count(&kept[300..]));
    assert!(right > 280 && wrong < 20, "{right} right, {wrong} wrong");
}

#[test]
fn the_order_of_matches_does_not_matter_and_an_image_may_have_any_size() {
    let scene = Scene::of(120, 300, 3);
    let kept = scene.kept();
    let mut order: Vec<usize> = (0..kept.len()).collect();
    Seed(4).rng().shuffle(&mut order);
    let mut shuffled = Scene::default();
    for &i in &order {
        shuffled.push(scene.a[i], scene.b[i], scene.ambiguity[i]);
    }
    let expected: Vec<bool> = order.iter().map(|&i| kept[i]).collect();
    assert!(shuffled.kept() == expected && count(&kept) > 100);
    // Twice as large, which is exact.
    let mut enlarged = scene;
    for b in &mut enlarged.b {
        b.at *= 2.0;
        b.size *= 2.0;
    }
    let size = Size::new(2 * SIZE.width, 2 * SIZE.height);
    assert_eq!(enlarged.kept_with(AdalamParams::default(), size), kept);
}

/// Steps 3 and 4 as the text says them: residuals sorted, each place looked at.
#[test]
fn inliers_are_those_of_the_definition() {
    let params = AdalamParams {
        refit: false,
        ..AdalamParams::default()
    };
    let reach = [100.0, 80.0];
    for seed in 0..20 {
        // Crowded around a seed, of which the first matches are those of the motion.
        let mut rng = Seed(seed).rng();
        let centre = Point2::new(320.0, 240.0);
        let candidates: Vec<Candidate> = (0..60)
            .map(|i| {
                let mut offset = || nalgebra::Vector2::from_fn(|_, _| 60.0 * (rng.uniform() - 0.5));
                let (at, elsewhere) = (offset(), offset());
                let map = motion().matrix().fixed_view::<2, 2>(0, 0).into_owned();
                let moves = if i % 3 == 1 {
                    elsewhere
                } else {
                    map * at + 0.02 * elsewhere
                };
                let [at, moves] = if i == 0 { [at * 0.0; 2] } else { [at, moves] };
                Candidate {
                    a: centre + at,
                    b: centre + moves,
                    ambiguity: 0.5,
                    turn: None,
                    growth: None,
                }
            })
            .collect();
        let members: Vec<usize> = (0..candidates.len()).collect();
        let around = Neighbourhood::new(&candidates, 0, &members, reach).unwrap();
        let relative = |i: usize| {
            let (a, b) = (candidates[i].a - centre, candidates[i].b - centre);
            (a / reach[0], b / reach[1])
        };
        let mut best = (0, Vec::new());
        let mut drawn = 0;
        'samples: for later in 1..members.len() {
            for earlier in 0..later {
                if drawn == params.samples {
                    break 'samples;
                }
                drawn += 1;
                let [(a, b), (c, d)] = [earlier, later].map(relative);
                let from = nalgebra::Matrix2::from_columns(&[a, c]);
                let Some(inverse) = from.try_inverse().filter(|_| earlier > 0) else {
                    continue;
                };
                let map = nalgebra::Matrix2::from_columns(&[b, d]) * inverse;
                let singular = map.singular_values();
                if singular.max() > 5.0 || singular.min() < 0.2 {
                    continue;
                }
                let mut residuals: Vec<(f64, usize)> = (members.iter())
                    .filter(|&&i| ![0, earlier, later].contains(&i))
                    .map(|&i| ((map * relative(i).0 - relative(i).1).norm_squared(), i))
                    .collect();
                residuals.sort_by(|one, other| one.0.total_cmp(&other.0));
                let total = residuals.len() as f64;
                let enough =
                    |k: &usize| *k as f64 / (total * residuals[k - 1].0) >= params.confidence;
                let inliers = (1..=residuals.len()).rfind(enough).unwrap_or(0);
                if inliers > best.0 {
                    let mut all = vec![0, earlier, later];
                    all.extend(residuals[..inliers].iter().map(|&(_, i)| i));
                    all.sort_unstable();
                    best = (inliers, all);
                }
            }
        }
        assert!(best.0 > 10, "{}", best.0);
        assert_eq!(around.inliers(&params), best.1, "{seed}");
    }
}

#[test]
fn seeds_are_the_clearest_around_and_of_equals_the_first() {
    let at = |(x, ambiguity): (f64, f32)| Candidate {
        a: Point2::new(x, 0.0),
        b: Point2::origin(),
        ambiguity,
        turn: None,
        growth: None,
    };
    // In the order of their clarity; 8 loses to 5, which loses to 0 and is no seed itself.
    let candidates = [
        (0.0, 0.1),
        (5.0, 0.2),
        (8.0, 0.3),
        (20.0, 0.4),
        (30.0, 0.4),
        (20.0, 0.4),
    ]
    .map(at);
    assert_eq!(clearest(&[0, 1, 2, 3, 4, 5], &candidates, 10.0), [0, 3, 4]);
    assert_eq!(clearest(&[1, 2, 4], &candidates, 10.0), [1, 4]);
    assert_eq!(clearest(&[], &candidates, 10.0), [0; 0]);
    // Of equally clear ones, those that were not taken rule nothing out, but clearer ones do.
    let candidates = [
        (0.0, 0.0),
        (6.0, 0.0),
        (12.0, 0.0),
        (18.0, 0.0),
        (24.0, 0.1),
    ]
    .map(at);
    assert_eq!(clearest(&[0, 1, 2, 3, 4], &candidates, 10.0), [0, 2]);
}

#[test]
fn equally_clear_matches_are_kept_all_over_the_image() {
    let mut scene = Scene::default();
    for place in 0..1200 {
        let (column, row) = (f64::from(place / 30), f64::from(place % 30));
        let at = Point2::new(16.0 * column, 16.0 * row);
        scene.push(keypoint(at, 4.0, 0.0), keypoint(at, 4.0, 0.0), 0.0);
    }
    assert!(scene.kept().iter().all(|&kept| kept));
}

#[test]
fn turns_and_growths_agree_around_the_circle() {
    let with = |turn: f64, growth: f64| Candidate {
        a: Point2::origin(),
        b: Point2::origin(),
        ambiguity: 0.5,
        turn: Some(turn.to_radians()),
        growth: Some(growth),
    };
    let agree = |one: f64, other: f64| {
        let most = 30_f64.to_radians();
        with(one, 1.0).turns_as(&with(other, 1.0), most)
    };
    assert!(agree(350.0, 10.0) && agree(-350.0, 15.0) && agree(20.0, -5.0));
    assert!(!agree(350.0, 25.0) && !agree(-180.0, 0.0));
    let grows = |one: f64, other: f64| with(0.0, one).grows_as(&with(0.0, other), 1.5);
    assert!(grows(1.4, 1.0) && grows(1.0, 1.4) && !grows(1.0, 1.6) && !grows(1.6, 1.0));
}

#[test]
fn seeds_are_each_others_nearest_unless_that_is_not_asked() {
    let mut scene = Scene::of(100, 0, 5);
    scene.ambiguity.fill(0.5);
    let [a, mut b] = scene.features(SIZE);
    let select = |b: &Features, mutual_seeds| {
        let params = AdalamParams {
            mutual_seeds,
            ..AdalamParams::default()
        };
        let [a, b] = [&a, b].map(|features| View {
            features,
            image: None,
            camera: None,
        });
        let mut matches = scene.matches();
        let adalam = Adalam::new(params).unwrap();
        adalam.select(a, b, &mut matches, Seed(0));
        matches.len()
    };
    assert!(select(&b, true) > 80);
    // Now all of b are nearest to the first of a.
    if let Descriptors::Float(rows) = &mut b.descriptors {
        *rows = crate::features::FloatRows::from_vec(1, vec![0.0; 100]);
    }
    assert!(select(&b, true) < 60 && select(&b, false) > 80);
}

#[test]
fn clear_matches_are_kept_without_neighbours_where_that_is_asked() {
    let scene = Scene::of(300, 900, 1);
    let params = AdalamParams {
        keep_clear: true,
        ..AdalamParams::default()
    };
    let (of_maps, kept) = (scene.kept(), scene.kept_with(params, SIZE));
    let is_clear = |i: usize| scene.ambiguity[i] < params.seed_ratio;
    let expected: Vec<bool> = (0..1200).map(|i| of_maps[i] || is_clear(i)).collect();
    assert_eq!(kept, expected);
    assert!((300..1200).any(|i| kept[i]) && (0..300).any(|i| kept[i] && !is_clear(i)));
    // What may not be a seed is not clear.
    let [a, b] = scene.features(SIZE);
    let adalam = Adalam::new(params).unwrap();
    let none = vec![false; 1200];
    assert_eq!(
        count(&adalam.mask(&a, &b, &scene.matches(), Some(&none))),
        0
    );
}

#[test]
fn nothing_makes_it_fail() {
    assert_eq!(Scene::default().kept(), [false; 0]);
    let scene = Scene::of(60, 60, 6);
    assert_eq!(
        count(&scene.kept_with(AdalamParams::default(), Size::new(0, 0))),
        0
    );
    // All at one place, equally clear.
    let mut equal = scene.clone();
    equal.a = vec![scene.a[0]; 120];
    equal.b = vec![scene.b[0]; 120];
    equal.ambiguity = vec![0.0; 120];
    assert_eq!(count(&equal.kept()), 0);
    let mut strange = scene;
    for (i, at) in [f32::INFINITY, f32::MAX, -1e9, 0.0].into_iter().enumerate() {
        strange.a[i].at.x = at;
        strange.b[i].size = [f32::INFINITY, -1.0, f32::MIN_POSITIVE, 0.0][i];
        strange.ambiguity[i] = [0.0, f32::NAN, 1e-9, -1.0][i];
    }
    let kept = strange.kept();
    assert!(!kept[0] && !kept[1] && count(&kept) > 30);
}

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    type Change = fn(&mut AdalamParams);
    let cases: [(&str, Change); 12] = [
        ("area_ratio", |p| p.area_ratio = 0.0),
        ("expansion", |p| p.expansion = f64::INFINITY),
        ("max_turn_deg", |p| p.max_turn_deg = -30.0),
        ("max_growth", |p| p.max_growth = 1.0),
        ("confidence", |p| p.confidence = f64::NAN),
        ("max_stretch", |p| p.max_stretch = 0.2),
        ("seed_ratio", |p| p.seed_ratio = 1.1),
        ("seed_ratio", |p| p.seed_ratio = 0.0),
        ("samples", |p| p.samples = 0),
        ("min_inliers", |p| p.min_inliers = 0),
        ("area_ratio", |p| p.area_ratio = f64::NAN),
        ("expansion", |p| p.expansion = -4.0),
    ];
    for (name, change) in cases {
        let mut params = AdalamParams::default();
        change(&mut params);
        let message = Adalam::new(params).unwrap_err().to_string();
        assert!(message.contains(name), "{message}");
    }
}

/// Keypoints turned from 0.5 to 0.75 and grown from 4 to 8 agree with what turned and grew as much, wherever it began.
#[test]
fn a_match_turns_and_grows_from_a_to_b() {
    let at = |size: f32, angle: f32| keypoint(Point2::new(1.0, 2.0), size, angle);
    let (a, b) = ([at(4.0, 0.5), at(0.0, 0.5)], [at(8.0, 0.75), at(3.0, 0.25)]);
    let between = |i: u32, j: u32| {
        let (distance, second) = (1.0, 2.0);
        let found = Correspondence {
            a: i,
            b: j,
            distance,
            second,
        };
        Candidate::new(&a, &b, &found)
    };
    let found = between(0, 0);
    assert_eq!((found.turn, found.growth), (Some(0.25), Some(2.0)));
    assert_eq!(found.ambiguity, 0.5);
    // Without a size nothing is known of the growth, but of the turn.
    let found = between(1, 1);
    assert_eq!((found.turn, found.growth), (Some(-0.25), None));
}

/// Step 2, with R = 30 in a and 50 in b, and lambda = 2.
#[test]
fn members_are_near_in_both_images_and_change_as_the_seed_does() {
    let adalam = Adalam::new(AdalamParams::default()).unwrap();
    let candidate = |a: f64, b: f64, turn_deg: f64, growth: f64| Candidate {
        a: Point2::new(200.0 + a, 100.0),
        b: Point2::new(300.0, 200.0 - b),
        ambiguity: 0.5,
        turn: Some(turn_deg.to_radians()),
        growth: Some(growth),
    };
    let candidates = [
        candidate(0.0, 0.0, 10.0, 1.2),
        candidate(59.0, 99.0, 10.0, 1.2),
        candidate(61.0, 0.0, 10.0, 1.2),
        candidate(0.0, 101.0, 10.0, 1.2),
        candidate(0.0, 0.0, 39.0, 1.2),
        candidate(0.0, 0.0, 41.0, 1.2),
        candidate(0.0, 0.0, -19.0, 1.79),
        candidate(0.0, 0.0, 10.0, 1.81),
        candidate(0.0, 0.0, 10.0, 0.79),
    ];
    assert_eq!(adalam.members(&candidates, 0, [60.0, 100.0]), [0, 1, 4, 6]);
}

/// A circle of this radius covers a hundredth of the image: pi r^2 = 100 * 314 / 100.
#[test]
fn the_radius_is_that_of_a_share_of_the_area() {
    let found = radius(Size::new(100, 314), 100.0);
    assert!((found - 10.0).abs() < 0.01, "{found}");
}

/// Of each match only its feature of a counts as nearest to its feature of b, not the other way round.
#[test]
fn a_match_whose_feature_of_b_has_a_nearer_one_in_a_is_no_seed() {
    let features = |values: &[f32]| {
        Features::of_descriptors(Descriptors::Float(crate::features::FloatRows::from_vec(
            1,
            values.to_vec(),
        )))
    };
    // Both of a are nearest to the first of b, which is nearest to the second of a.
    let (a, b) = (features(&[1.0, 2.0]), features(&[2.25, 9.0]));
    let [a, b] = [&a, &b].map(|features| View {
        features,
        image: None,
        camera: None,
    });
    let found = |a, distance| Correspondence {
        a,
        b: 0,
        distance,
        second: 7.0,
    };
    let adalam = Adalam::new(AdalamParams::default()).unwrap();
    let matches = [found(0, 1.25), found(1, 0.25)];
    assert_eq!(adalam.mutual(a, b, &matches), [false, true]);
    // What fails the ratio test is none either.
    let unclear = [found(0, 1.25), found(1, 6.0)];
    assert_eq!(adalam.mutual(a, b, &unclear), [false, false]);
}

/// Ten matches about a seed. The first two determine the identity. Of N = 8 others each comes within r of it, so
/// 8 r^2 are expected by chance, and 8 - 8 r^2 must be at least 6: r^2 at most 1/4.
#[test]
fn inliers_must_exceed_what_chance_brings() {
    let kept = |squared: f64, samples: u32| {
        let mut ends = vec![(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0)];
        ends.extend((1..9).map(|i| (0.1 * f64::from(i), 0.3, squared.sqrt())));
        let candidates: Vec<Candidate> = (ends.into_iter())
            .map(|(x, y, off)| Candidate {
                a: Point2::new(x, y),
                b: Point2::new(x, y - off),
                ambiguity: 0.5,
                turn: None,
                growth: None,
            })
            .collect();
        let members: Vec<usize> = (0..candidates.len()).collect();
        let around = Neighbourhood::new(&candidates, 0, &members, [1.0; 2]).unwrap();
        let params = AdalamParams {
            confidence: 1.5,
            samples,
            refit: false,
            ..AdalamParams::default()
        };
        around.inliers(&params).len()
    };
    // Pairs are drawn as (0, 1), (0, 2), (1, 2), of which those with the seed determine nothing.
    assert_eq!((kept(0.24, 3), kept(0.26, 3)), (11, 0));
    assert_eq!(kept(0.24, 2), 0);
}

#[test]
fn a_moderate_map_changes_no_length_by_more_than_the_factor() {
    let turned = |angle: f64, x: f64, y: f64| {
        let (sin, cos) = libm::sincos(angle);
        let turn = nalgebra::Matrix2::new(cos, -sin, sin, cos);
        turn * nalgebra::Matrix2::new(x, 0.0, 0.0, y) * turn
    };
    for (x, y, expected) in [
        (1.0, 1.0, true),
        (3.9, 0.26, true),
        (4.1, 1.0, false),
        (1.0, 4.1, false),
        (1.0, 0.24, false),
        (0.24, 1.0, false),
        (4.1, 0.24, false),
        (3.9, 3.9, true),
        (4.1, 4.1, false),
        (0.26, 0.26, true),
        (0.24, 0.24, false),
        (-3.9, 0.26, true),
        (0.0, 0.0, false),
    ] {
        for angle in [0.0, 0.4, 2.0] {
            let map = turned(angle, x, y);
            assert_eq!(neighbourhood::is_moderate(&map, 4.0), expected, "{x} {y}");
        }
    }
}
