//! Makes a set of patches from scenes.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use indicatif::ProgressBar;
use matchbench::datasets::Sequence;
use matchbench::datasets::rendered::{self, Place, Scene, World};
use matchbench_vision::features::{
    Descriptors, Extractor, Features, PatchSource, Sift, SiftParams, binboost, dlco,
};
use matchbench_vision::geometry::RelativePose;
use matchbench_vision::image::{FloatImage, GrayImage};
use matchbench_vision::seed::Seed;
use nalgebra::{Point2, Point3};
use serde::{Deserialize, Serialize};

use super::warp::Warp;
use super::{LENGTHS, Manifest, PARTS, PatchSet, Triplet, epipolar, exact};

/// Side of a patch, in sizes of the keypoint, as descriptors on SIFT's keypoints use it.
const SCALE_FACTOR: f32 = 6.75;
/// A point counts as hidden in `b` if the depth there differs from its own by more than this share.
const DEPTH_TOLERANCE: f64 = 0.01;

/// What a set is made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Recipe {
    /// Scenes of each part: folders of datasets, or `rendered:<name>`.
    pub(crate) scenes: [Vec<String>; 3],
    /// Most triplets of one pair of images.
    pub(crate) per_pair: usize,
    /// Warped views of each photograph.
    pub(crate) warps: usize,
    /// Whether warped views are blurred, and rendered images warped as well.
    #[serde(default)]
    pub(crate) blurred: bool,
    pub(crate) seed: u64,
}

/// Makes the set of `recipe` in `folder`, which must not contain a set yet. Scenes that were finished before a
/// stop are not made again.
pub(crate) fn make(recipe: &Recipe, folder: &Path, bar: &ProgressBar) -> Result<Manifest> {
    let path = folder.join("manifest.json");
    ensure!(
        !path.exists(),
        "{}: exists; name another folder",
        path.display()
    );
    refuse_shared(&recipe.scenes)?;
    let unfinished = folder.join("unfinished");
    let mut parts = Vec::new();
    for (name, scenes) in PARTS.iter().zip(&recipe.scenes) {
        let mut whole = PatchSet::default();
        for (number, scene) in scenes.iter().enumerate() {
            bar.set_message(scene.clone());
            let folder = unfinished.join(format!("{name}-{number}"));
            whole.append(make_scene(scene, recipe, &folder, bar)?);
        }
        parts.push(whole.write(folder, name)?);
    }
    let manifest = Manifest {
        version: 1,
        recipe: recipe.clone(),
        parts,
    };
    manifest.write(folder)?;
    fs::remove_dir_all(&unfinished).with_context(|| format!("{}", unfinished.display()))?;
    Ok(manifest)
}

/// Refuses a scene that is named twice, and one that shows a place of another part: a place may be rendered several times,
/// with other frames.
fn refuse_shared(parts: &[Vec<String>; 3]) -> Result<()> {
    let mut seen: Vec<(PathBuf, Option<Place>, usize, &str)> = Vec::new();
    for (part, scenes) in parts.iter().enumerate() {
        for scene in scenes {
            let (path, shown) = (place(scene)?, rendered_place(scene)?);
            for (its_path, its_shown, its_part, first) in &seen {
                if *its_path == path {
                    bail!("{scene}: is named twice (as {first}); parts must not share scenes");
                }
                if *its_part != part && shown.is_some() && *its_shown == shown {
                    bail!("{scene}: shows the place of {first}; parts must not share scenes");
                }
            }
            seen.push((path, shown, part, scene));
        }
    }
    Ok(())
}

/// The place that a scene shows, if it is rendered.
fn rendered_place(scene: &str) -> Result<Option<Place>> {
    let name = scene.strip_prefix("rendered:");
    name.map(|name| Ok(rendered_scene(name)?.place)).transpose()
}

/// What a scene is, however it is written: its folder without links, or its name if it is rendered. It must
/// exist, before minutes are spent on others.
fn place(scene: &str) -> Result<PathBuf> {
    if let Some(name) = scene.strip_prefix("rendered:") {
        return rendered_scene(name).map(|_| PathBuf::from(scene));
    }
    Sequence::open(Path::new(scene))?;
    fs::canonicalize(scene).with_context(|| scene.to_owned())
}

fn rendered_scene(name: &str) -> Result<&'static Scene> {
    let scenes = rendered::scenes();
    let found = scenes.iter().find(|scene| scene.name == name);
    found.with_context(|| {
        let names: Vec<_> = scenes.iter().map(|scene| scene.name).collect();
        format!(
            "rendered:{name}: no such scene; use one of {}",
            names.join(", ")
        )
    })
}

/// The patches of one scene. They are read from `folder` if they were finished there; otherwise they are made
/// and written there.
fn make_scene(scene: &str, recipe: &Recipe, folder: &Path, bar: &ProgressBar) -> Result<PatchSet> {
    let alone = Recipe {
        scenes: [vec![scene.to_owned()], Vec::new(), Vec::new()],
        ..recipe.clone()
    };
    if folder.join("manifest.json").exists() {
        ensure!(
            Manifest::read(folder)?.recipe == alone,
            "{}: was made by another command; delete it to begin anew",
            folder.display()
        );
        return PatchSet::read(folder, PARTS[0]);
    }
    let mut maker = Maker {
        recipe,
        set: PatchSet::default(),
        sift: Sift::new(SiftParams::default()).context("the default parameters of SIFT")?,
        bar,
    };
    match scene.strip_prefix("rendered:") {
        Some(name) => maker.add_rendered(name)?,
        None => maker.add_sequence(Path::new(scene))?,
    }
    let part = maker.set.write(folder, PARTS[0])?;
    let manifest = Manifest {
        version: 1,
        recipe: alone,
        parts: vec![part],
    };
    manifest.write(folder)?;
    Ok(maker.set)
}

struct Maker<'a> {
    recipe: &'a Recipe,
    set: PatchSet,
    sift: Sift,
    bar: &'a ProgressBar,
}

/// An image and the data needed for it. A patch that is stored already is not stored again.
struct View {
    features: Features,
    source: PatchSource,
    stored: BTreeMap<usize, u32>,
}

impl Maker<'_> {
    fn view(&self, image: &GrayImage) -> View {
        View {
            features: self.sift.extract(image),
            source: PatchSource::new(image),
            stored: BTreeMap::new(),
        }
    }

    fn source(&mut self, name: String) -> u32 {
        self.set.sources.push(name);
        self.set.sources.len() as u32 - 1
    }

    /// Adds pairs of photographs by their poses, and pairs of each photograph with warped views of itself.
    fn add_sequence(&mut self, folder: &Path) -> Result<()> {
        let sequence = Sequence::open(folder)?;
        let name = sequence.name.clone();
        let seed = Seed(self.recipe.seed).child(&name);
        let images = (sequence.frames.iter())
            .map(|frame| Ok(frame.pixels()?))
            .collect::<Result<Vec<_>>>()?;
        self.bar
            .inc_length((sequence.pairs.len() + images.len() * self.recipe.warps) as u64);
        let mut views: Vec<View> = images.iter().map(|image| self.view(image)).collect();

        let source = self.source(format!("{name}/poses"));
        for (number, pair) in sequence.pairs.iter().enumerate() {
            self.bar.inc(1);
            let Some(pose) = pair.pose().and_then(RelativePose::from_isometry) else {
                continue;
            };
            let (a, b) = (pair.a as usize, pair.b as usize);
            let [a_view, b_view] = views
                .get_disjoint_mut([a, b])
                .context("a pair of one image")?;
            let cameras = [&sequence.frames[a].camera, &sequence.frames[b].camera];
            let pairs = epipolar::agreeing([&a_view.features, &b_view.features], cameras, &pose);
            self.add([a_view, b_view], pairs, source, seed.number(number as u64));
        }

        self.add_warps(&images, &mut views, &name, seed);
        Ok(())
    }

    /// Adds pairs of each image with warped views of it.
    fn add_warps(&mut self, images: &[GrayImage], views: &mut [View], name: &str, seed: Seed) {
        let source = self.source(format!("{name}/warps"));
        for (frame, (image, view)) in images.iter().zip(views).enumerate() {
            for n in 0..self.recipe.warps {
                self.bar.inc(1);
                let seed = seed.child("warp").number(frame as u64).number(n as u64);
                let warp = Warp::new(image, self.recipe.blurred, seed);
                let mut warped = self.view(&warp.image);
                let transfer = |p: Point2<f64>| warp.transfer(p);
                let pairs = exact::agreeing(&view.features, &warped.features, &transfer);
                self.add([view, &mut warped], pairs, source, seed);
            }
        }
    }

    /// Adds pairs of images of a rendered scene, by its depth, and pairs with warped views of its images.
    fn add_rendered(&mut self, name: &str) -> Result<()> {
        let scene = rendered_scene(name)?;
        let source = self.source(format!("rendered-{name}/depth"));
        let seed = Seed(self.recipe.seed).child(name);
        let world = World::build(scene.place);
        let pairs = rendered::sequence(scene).pairs;
        let images: Vec<GrayImage> = (0..scene.frames)
            .map(|frame| world.render(scene, frame))
            .collect();
        let warps = if self.recipe.blurred {
            images.len() * self.recipe.warps
        } else {
            0
        };
        self.bar.inc_length((pairs.len() + warps) as u64);
        let depths: Vec<FloatImage> = (0..scene.frames)
            .map(|frame| world.depth(scene, frame))
            .collect();
        let mut views: Vec<View> = images.iter().map(|image| self.view(image)).collect();
        for (number, pair) in pairs.iter().enumerate() {
            self.bar.inc(1);
            let (a, b) = (pair.a as usize, pair.b as usize);
            let transfer = |p| transfer(scene, [&depths[a], &depths[b]], pair, p);
            let [a_view, b_view] = views
                .get_disjoint_mut([a, b])
                .context("a pair of one image")?;
            let found = exact::agreeing(&a_view.features, &b_view.features, &transfer);
            self.add([a_view, b_view], found, source, seed.number(number as u64));
        }
        if self.recipe.blurred {
            self.add_warps(&images, &mut views, &format!("rendered-{name}"), seed);
        }
        Ok(())
    }

    /// Adds some of the pairs of keypoints. Each becomes a triplet with the keypoint of `b` that looks most
    /// similar to that of `a` but is elsewhere.
    fn add(
        &mut self,
        [a, b]: [&mut View; 2],
        mut pairs: Vec<(usize, usize)>,
        source: u32,
        seed: Seed,
    ) {
        let mut rng = seed.child("choice").rng();
        let wanted = self.recipe.per_pair.min(pairs.len());
        for i in 0..wanted {
            let other = i + rng.below((pairs.len() - i) as u32) as usize;
            pairs.swap(i, other);
        }
        for &(i, j) in &pairs[..wanted] {
            let Some(negative) = most_similar_elsewhere(&a.features, i, &b.features, j) else {
                continue;
            };
            let triplet = Triplet {
                anchor: self.store(a, i),
                positive: self.store(b, j),
                negative: self.store(b, negative),
                source,
            };
            self.set.triplets.push(triplet);
        }
    }

    /// The number of the patch of a keypoint; the patch is stored first if it was not yet.
    fn store(&mut self, view: &mut View, keypoint: usize) -> u32 {
        if let Some(&index) = view.stored.get(&keypoint) {
            return index;
        }
        let index = self.set.len() as u32;
        let at = &view.features.keypoints[keypoint];
        for (data, side) in self.set.data.iter_mut().zip([dlco::SIDE, binboost::SIDE]) {
            let start = data.len();
            data.resize(start + side * side, 0);
            view.source
                .rectify(at, SCALE_FACTOR, side, &mut data[start..]);
        }
        let row = sift_row(&view.features, keypoint);
        self.set.data[2].extend(row.iter().map(|&value| value as u8));
        debug_assert_eq!(self.set.data[2].len(), self.set.len() * LENGTHS[2]);
        view.stored.insert(keypoint, index);
        index
    }
}

fn sift_row(features: &Features, index: usize) -> &[f32] {
    let Descriptors::Float(rows) = &features.descriptors else {
        unreachable!("SIFT's descriptors are real values");
    };
    rows.row(index)
}

fn most_similar_elsewhere(a: &Features, i: usize, b: &Features, truth: usize) -> Option<usize> {
    let (row, truth) = (sift_row(a, i), &b.keypoints[truth]);
    let far = truth.size.max(5.0);
    (b.keypoints.iter().enumerate())
        .filter(|(_, other)| (other.at - truth.at).norm() > far)
        .map(|(j, _)| {
            let squares = row
                .iter()
                .zip(sift_row(b, j))
                .map(|(x, y)| (x - y) * (x - y));
            (squares.sum::<f32>(), j)
        })
        .min_by(|x, y| x.0.total_cmp(&y.0))
        .map(|(_, j)| j)
}

/// The place in the second image of a point of the first; `None` if something hides it there.
fn transfer(
    scene: &Scene,
    [depth_a, depth_b]: [&FloatImage; 2],
    pair: &matchbench::datasets::Pair,
    at: Point2<f64>,
) -> Option<Point2<f64>> {
    let camera = scene.camera();
    let z = f64::from(nearest(depth_a, at)?);
    let ray = camera.normalize(at);
    let point = pair.pose()? * Point3::new(ray.x * z, ray.y * z, z);
    if !point.z.is_finite() || point.z <= 0.0 {
        return None;
    }
    let seen = camera.project(Point2::new(point.x / point.z, point.y / point.z));
    let there = f64::from(nearest(depth_b, seen)?);
    ((there / point.z - 1.0).abs() < DEPTH_TOLERANCE).then_some(seen)
}

fn nearest(depth: &FloatImage, at: Point2<f64>) -> Option<f32> {
    let (x, y) = (at.x.round(), at.y.round());
    let inside = x >= 0.0 && y >= 0.0 && x < depth.width() as f64 && y < depth.height() as f64;
    inside.then(|| depth.at(x as usize, y as usize))
}
