//! A database that COLMAP's mapper can start from: cameras as the dataset has them, matches, and the
//! two-view geometries of the estimated poses.
//!
//! The schema is the one that COLMAP had before rigs and frames; newer versions of COLMAP add what is
//! missing when they open it.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::{Camera, Lens, RelativePose, essential_from_pose};
use matchbench_vision::image::Size;
use nalgebra::{Matrix3, UnitVector3, Vector2};
use rusqlite::{Connection, MAIN_DB, params};

use super::super::export::{Model, TwoView, numbered};
use super::super::{ExchangeError, Export, PairExport};
use super::{CENTER, MAX_IMAGES};
use crate::files::write_new;

const SCHEMA: &str = "
CREATE TABLE cameras (
    camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
    model INTEGER NOT NULL,
    width INTEGER NOT NULL,
    height INTEGER NOT NULL,
    params BLOB,
    prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (
    image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL,
    name TEXT NOT NULL UNIQUE,
    camera_id INTEGER NOT NULL,
    CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
    FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints (
    image_id INTEGER PRIMARY KEY NOT NULL,
    rows INTEGER NOT NULL,
    cols INTEGER NOT NULL,
    data BLOB,
    FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (
    image_id INTEGER PRIMARY KEY NOT NULL,
    rows INTEGER NOT NULL,
    cols INTEGER NOT NULL,
    data BLOB,
    FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (
    pair_id INTEGER PRIMARY KEY NOT NULL,
    rows INTEGER NOT NULL,
    cols INTEGER NOT NULL,
    data BLOB);
CREATE TABLE two_view_geometries (
    pair_id INTEGER PRIMARY KEY NOT NULL,
    rows INTEGER NOT NULL,
    cols INTEGER NOT NULL,
    data BLOB,
    config INTEGER NOT NULL,
    F BLOB,
    E BLOB,
    H BLOB,
    qvec BLOB,
    tvec BLOB);
";

/// COLMAP's number for a pair of calibrated cameras whose essential matrix is known.
const CALIBRATED: i64 = 2;
/// COLMAP's number for a pair whose homography is known: of a plane, or of cameras in one place.
const PLANAR_OR_PANORAMIC: i64 = 6;

/// Writes `database.db`. Coordinates are float32 with 0.5 added, which rounds them by up to half a
/// unit in the last place: all that COLMAP can hold.
pub(super) fn write(folder: &Path, export: &Export<'_>) -> Result<Vec<PathBuf>, ExchangeError> {
    let path = folder.join("database.db");
    let unwritable = |error: &dyn std::fmt::Display| ExchangeError::unwritable(&path, error);
    let names = export.distinct_names(str::to_owned)?;
    check_distinct(&path, export)?;
    let bytes = database(export, &names).map_err(|error| unwritable(&error))?;
    write_new(&path, &bytes).map_err(|error| unwritable(&error))?;
    Ok(vec![path])
}

/// COLMAP has one place for the matches of two images, in whichever order they are a pair.
fn check_distinct(path: &Path, export: &Export<'_>) -> Result<(), ExchangeError> {
    let mut seen = HashSet::new();
    for (a, b) in export.pairs.iter().map(|pair| pair.frames) {
        if !seen.insert((a.min(b), a.max(b))) {
            let what = format!("the pairs {b} {a} and {a} {b} are one pair of a COLMAP database");
            let remedy = "leave one of the two out of the dataset, or export in another format";
            return Err(ExchangeError::new(path, what, remedy));
        }
    }
    Ok(())
}

fn database(export: &Export<'_>, names: &[String]) -> rusqlite::Result<Vec<u8>> {
    let mut connection = Connection::open_in_memory()?;
    connection.execute_batch(SCHEMA)?;
    let transaction = connection.transaction()?;
    let numbered = numbered(export);
    let camera_ids = insert_cameras(&transaction, export)?;
    let images = numbered.keypoints.iter().zip(names).zip(&camera_ids);
    for (((keypoints, name), camera_id), frame) in images.zip(0..) {
        transaction.execute(
            "INSERT INTO images VALUES (?1, ?2, ?3)",
            params![image_id(frame), name, camera_id],
        )?;
        let coordinates: Vec<u8> = (keypoints.iter().flat_map(|p| [p.x, p.y]))
            .flat_map(|x| ((f64::from(x) + CENTER) as f32).to_le_bytes())
            .collect();
        transaction.execute(
            "INSERT INTO keypoints VALUES (?1, ?2, 2, ?3)",
            params![image_id(frame), keypoints.len() as i64, coordinates],
        )?;
    }
    for (pair, indices) in export.pairs.iter().zip(&numbered.matches) {
        insert_pair(&transaction, export, pair, indices)?;
    }
    transaction.commit()?;
    Ok(connection.serialize(MAIN_DB)?.to_vec())
}

/// The id of each frame's camera. Images that share a camera name it once; it must be there before them.
fn insert_cameras(connection: &Connection, export: &Export<'_>) -> rusqlite::Result<Vec<i64>> {
    let mut cameras: Vec<(Camera, Size)> = Vec::new();
    let mut camera_ids = Vec::new();
    for (frame, &size) in export.sequence.frames.iter().zip(&export.sizes) {
        let camera = (frame.camera, size);
        let known = cameras.iter().position(|known| *known == camera);
        let id = known.unwrap_or(cameras.len()) as i64 + 1;
        camera_ids.push(id);
        if known.is_none() {
            let (model, numbers) = model(&camera.0);
            let (width, height) = (size.width as i64, size.height as i64);
            cameras.push(camera);
            connection.execute(
                "INSERT INTO cameras VALUES (?1, ?2, ?3, ?4, ?5, 1)",
                params![id, model, width, height, doubles(&numbers)],
            )?;
        }
    }
    Ok(camera_ids)
}

/// The matches of a pair as indices of keypoints and, if its estimate found a model, its two-view geometry.
fn insert_pair(
    connection: &Connection,
    export: &Export<'_>,
    pair: &PairExport,
    indices: &[[u32; 2]],
) -> rusqlite::Result<()> {
    let (a, b) = pair.frames;
    // The smaller id comes first.
    let swapped = a > b;
    let (first, second) = if swapped { (b, a) } else { (a, b) };
    let pair_id = MAX_IMAGES * image_id(first) + image_id(second);
    let rows = |kept: &dyn Fn(usize) -> bool| {
        let kept = indices.iter().enumerate().filter(|(row, _)| kept(*row));
        let pairs = kept.map(|(_, &[i, j])| if swapped { [j, i] } else { [i, j] });
        pairs
            .flatten()
            .flat_map(u32::to_le_bytes)
            .collect::<Vec<u8>>()
    };
    let all = rows(&|_| true);
    connection.execute(
        "INSERT INTO matches VALUES (?1, ?2, 2, ?3)",
        params![pair_id, indices.len() as i64, all],
    )?;
    let Some(TwoView { b_from_a, inliers }) = &pair.two_view else {
        return Ok(());
    };
    let camera = |frame: u32| &export.sequence.frames[frame as usize].camera;
    let geometry = match b_from_a {
        Model::Pose(pose) => {
            let pose = if swapped { inverse(pose) } else { *pose };
            Geometry::of_pose(&pose, camera(first), camera(second))
        }
        Model::Homography(h) => {
            let Some(h) = (if swapped { h.try_inverse() } else { Some(*h) }) else {
                return Ok(());
            };
            Geometry::of_homography(&h)
        }
    };
    let inlying = rows(&|row| inliers[row]);
    connection.execute(
        "INSERT INTO two_view_geometries VALUES (?1, ?2, 2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
        params![
            pair_id,
            (inlying.len() / 8) as i64,
            inlying,
            geometry.config,
            matrix(&geometry.f),
            matrix(&geometry.e),
            matrix(&geometry.h),
            doubles(&geometry.rotation),
            doubles(&geometry.translation),
        ],
    )?;
    Ok(())
}

/// What COLMAP keeps of the geometry of two images; matrices that it does not have are zero.
struct Geometry {
    /// COLMAP's number of its kind.
    config: i64,
    f: Matrix3<f64>,
    e: Matrix3<f64>,
    h: Matrix3<f64>,
    /// A quaternion, w first.
    rotation: [f64; 4],
    translation: [f64; 3],
}

impl Geometry {
    fn of_pose(pose: &RelativePose, first: &Camera, second: &Camera) -> Self {
        let e = essential_from_pose(pose);
        let q = pose.rotation.quaternion();
        Self {
            config: CALIBRATED,
            f: fundamental(&e, first, second),
            e,
            h: Matrix3::zeros(),
            rotation: [q.w, q.i, q.j, q.k],
            translation: pose.direction.into_inner().into(),
        }
    }

    /// Of a homography of pixels whose first one's centre is at (0, 0).
    fn of_homography(h: &Matrix3<f64>) -> Self {
        let shift = |by| Matrix3::new_translation(&Vector2::new(by, by));
        Self {
            config: PLANAR_OR_PANORAMIC,
            f: Matrix3::zeros(),
            e: Matrix3::zeros(),
            h: shift(CENTER) * h * shift(-CENTER),
            rotation: [1.0, 0.0, 0.0, 0.0],
            translation: [0.0; 3],
        }
    }
}

/// COLMAP counts images from 1.
fn image_id(frame: u32) -> i64 {
    i64::from(frame) + 1
}

/// COLMAP's number of the camera's model and its parameters: PINHOLE (1), OPENCV (4), of a fisheye OPENCV_FISHEYE (5)
/// or, with a third radial coefficient, FULL_OPENCV (6).
fn model(camera: &Camera) -> (i64, Vec<f64>) {
    let mut numbers = vec![camera.fx, camera.fy, camera.cx + CENTER, camera.cy + CENTER];
    let lens = match camera.distortion {
        None => return (1, numbers),
        Some(Lens::Fisheye(lens)) => {
            numbers.extend([lens.k1, lens.k2, lens.k3, lens.k4]);
            return (5, numbers);
        }
        Some(Lens::Brown(lens)) => lens,
    };
    numbers.extend([lens.k1, lens.k2, lens.p1, lens.p2]);
    if lens.k3 == 0.0 {
        return (4, numbers);
    }
    numbers.extend([lens.k3, 0.0, 0.0, 0.0]);
    (6, numbers)
}

fn inverse(b_from_a: &RelativePose) -> RelativePose {
    let rotation = b_from_a.rotation.inverse();
    RelativePose {
        rotation,
        direction: UnitVector3::new_normalize(-(rotation * b_from_a.direction.into_inner())),
    }
}

/// F of pixels in COLMAP's convention, `K_b^-T E K_a^-1`.
fn fundamental(e: &Matrix3<f64>, a: &Camera, b: &Camera) -> Matrix3<f64> {
    let inverse = |camera: &Camera| {
        let (x, y) = (camera.cx + CENTER, camera.cy + CENTER);
        let (fx, fy) = (camera.fx, camera.fy);
        Matrix3::new(
            1.0 / fx,
            0.0,
            -x / fx,
            0.0,
            1.0 / fy,
            -y / fy,
            0.0,
            0.0,
            1.0,
        )
    };
    inverse(b).transpose() * e * inverse(a)
}

/// Row after row.
fn matrix(m: &Matrix3<f64>) -> Vec<u8> {
    doubles(m.transpose().as_slice())
}

fn doubles(numbers: &[f64]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}
