//! Extracts features from one image several times, and measures the time.
//!
//! ```text
//! extract EXTRACTOR IMAGE REPEATS OUT [KEYPOINTS]
//! ```
//!
//! EXTRACTOR is the id of a matcher, whose features are extracted, or `orb-gms`: the features of `gms` for
//! images of at most 640x480, whatever the size of the image. `ID=PARAMS` changes parameters of the extractor;
//! PARAMS is a JSON object as in `dsp-sift={"affine_shape":true}`. IMAGE is a grey PGM or PNG with 8 bits.
//! KEYPOINTS is a file in the form of `OUT.keypoints.npy`; if it is given, EXTRACTOR describes these keypoints.
//! Each thread works on an image of its own, as in a run; there are `RAYON_NUM_THREADS` of them, or one per
//! core if that is not set. Prints the median time in milliseconds, divided by the number of threads.
//!
//! Writes `OUT.keypoints.npy` with one row `x y size angle_in_degrees response octave` per keypoint (an angle
//! of -1 means none), and `OUT.descriptors.npy` with one row of values (or of bytes, for binary descriptors)
//! each. If ellipses are described, it also writes their frames to `OUT.frames.npy`, row after row.
//! `compare/features.py` reads these files.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use matchbench::datasets::read_gray;
use matchbench::matchers;
use matchbench::memory::{HugePages, keep_freed};
use matchbench_vision::features::{
    BinBoost, BinBoostParams, Daisy, DaisyParams, Describer, Descriptors, DetectThenDescribe,
    Detector, Dlco, DlcoParams, Extractor, Features, Freak, FreakParams, Keypoint, Latch,
    LatchParams,
};
use matchbench_vision::image::GrayImage;
use rayon::prelude::*;
use serde_json::{Value, json};

/// A function that finds the features of an image.
type Extract = Box<dyn Fn(&GrayImage) -> Features + Sync>;

// As in the program.
#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() -> Result<(), Box<dyn Error>> {
    keep_freed(rayon::current_num_threads());
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (arguments, given) = arguments.split_at(arguments.len().min(4));
    let ([id, image, repeats, out], [] | [_]) = (arguments, given) else {
        return Err("usage: extract EXTRACTOR IMAGE REPEATS OUT [KEYPOINTS]".into());
    };
    let given = given.first().map(|path| read_keypoints(Path::new(path)));
    let extract = extract(id, given.transpose()?)?;
    let image = read_gray(Path::new(image))?;
    let mut times = Vec::new();
    let threads = rayon::current_num_threads();
    let round = || -> Vec<Features> {
        let images = (0..threads).into_par_iter();
        images.map(|_| extract(&image)).collect()
    };
    // Not measured: each thread gets the memory of an image, which it keeps for the next.
    let mut all = round();
    for _ in 0..repeats.parse::<usize>()? {
        let start = Instant::now();
        all = round();
        times.push(start.elapsed().as_secs_f64() * 1e3 / threads as f64);
    }
    let features = all.into_iter().next().expect("at least one thread");
    times.sort_by(f64::total_cmp);
    println!(
        "{:.3}",
        times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
    );
    write(&features, out)
}

/// A detector that returns given keypoints.
struct Given(Vec<Keypoint>);

impl Detector for Given {
    fn detect(&self, _: &GrayImage) -> Vec<Keypoint> {
        self.0.clone()
    }
}

/// The features of the matcher `id`; or, if keypoints are given, a function that describes these.
fn extract(id: &str, given: Option<Given>) -> Result<Extract, Box<dyn Error>> {
    if let Some(given) = given {
        return match id {
            "binboost" => Ok(on(given, BinBoost::new(BinBoostParams::default())?)),
            "daisy" => Ok(on(given, Daisy::new(DaisyParams::default())?)),
            "dlco" => Ok(on(given, Dlco::new(DlcoParams::default())?)),
            "freak" | "freak-sift" => Ok(on(given, Freak::new(FreakParams::default())?)),
            "latch" => Ok(on(given, Latch::new(LatchParams::default())?)),
            _ => Err(format!(
                "no describer `{id}`; known: binboost, daisy, dlco, freak, freak-sift, latch"
            )
            .into()),
        };
    }
    let built = match id {
        "orb-gms" => matchers::find("gms")?.build(Some(&json!({"budget": "small"})))?,
        _ => match id.split_once('=') {
            None => matchers::find(id)?.build(None)?,
            Some((id, params)) => {
                let params: Value = serde_json::from_str(params)?;
                matchers::find(id)?.build(Some(&json!({"extractor": params})))?
            }
        },
    };
    Ok(Box::new(move |image| {
        (built.matcher.extract(image)).expect("the matchers of this project cannot fail")
    }))
}

fn on<D: Describer + 'static>(detector: Given, describer: D) -> Extract {
    let extractor = DetectThenDescribe {
        detector,
        describer,
    };
    Box::new(move |image| extractor.extract(image))
}

/// Rows `x y size angle_in_degrees response octave` of single precision, as `write_npy` writes
/// them.
fn read_keypoints(path: &Path) -> Result<Given, Box<dyn Error>> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let length = bytes.get(8..10).ok_or("no header")?;
    let data = &bytes[10 + usize::from(u16::from_le_bytes([length[0], length[1]]))..];
    let values: Vec<f32> = (data.as_chunks().0.iter())
        .map(|&value| f32::from_le_bytes(value))
        .collect();
    let keypoint = |&[x, y, size, angle, response, octave]: &[f32; 6]| Keypoint {
        at: [x, y].into(),
        size,
        angle: (angle >= 0.0).then(|| angle.to_radians()),
        response,
        octave: octave as i16,
    };
    Ok(Given(values.as_chunks().0.iter().map(keypoint).collect()))
}

fn write(features: &Features, out: &str) -> Result<(), Box<dyn Error>> {
    let keypoints: Vec<u8> = features
        .keypoints
        .iter()
        .flat_map(|k| {
            let angle = k.angle.map_or(-1.0, f32::to_degrees);
            [
                k.at.x,
                k.at.y,
                k.size,
                angle,
                k.response,
                f32::from(k.octave),
            ]
        })
        .flat_map(f32::to_le_bytes)
        .collect();
    write_npy(
        &format!("{out}.keypoints.npy"),
        "<f4",
        features.len(),
        6,
        &keypoints,
    )?;
    if let Some(frames) = &features.frames {
        let frames: Vec<u8> = (frames.iter().flatten())
            .flat_map(|v| v.to_le_bytes())
            .collect();
        write_npy(
            &format!("{out}.frames.npy"),
            "<f4",
            features.len(),
            4,
            &frames,
        )?;
    }
    let (kind, columns, data): (_, _, Vec<u8>) = match &features.descriptors {
        Descriptors::Float(rows) => (
            "<f4",
            rows.dim(),
            rows.data().iter().flat_map(|v| v.to_le_bytes()).collect(),
        ),
        Descriptors::Binary(rows) => ("|u1", rows.bytes(), rows.to_bytes()),
    };
    write_npy(
        &format!("{out}.descriptors.npy"),
        kind,
        features.len(),
        columns,
        &data,
    )
}

/// A matrix in numpy's file format, version 1.0.
fn write_npy(
    path: &str,
    kind: &str,
    rows: usize,
    columns: usize,
    data: &[u8],
) -> Result<(), Box<dyn Error>> {
    let header =
        format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}");
    // Magic, version and length take 10 bytes; the data start at a multiple of 64.
    let length = (10 + header.len() + 1).next_multiple_of(64) - 10;
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend_from_slice(&u16::try_from(length)?.to_le_bytes());
    file.extend_from_slice(format!("{header:<width$}\n", width = length - 1).as_bytes());
    file.extend_from_slice(data);
    std::fs::write(path, file).map_err(|error| format!("{path}: {error}").into())
}
