//! The doors of a cache of features, which may be another person's. Whoever writes such a file can give it the right
//! checksum, so bytes are offered with theirs.

use std::fs;
use std::path::{Path, PathBuf};

use matchbench::cache::{FeatureCache, Key};
use matchbench::matchers::Extraction;
use matchbench_vision::features::Keypoint;

/// Bytes of a checksum, at the end of a file.
const CHECKSUM: usize = 32;

/// The key that everything is kept under here.
pub(crate) fn key() -> Key {
    let extraction = Extraction {
        extractor: "any".into(),
        params: serde_json::Value::Null,
        revision: 1,
    };
    Key::new(b"an image", 0, &extraction)
}

/// The file of features, or of keypoints, in a cache.
pub(crate) fn file(cache: &Path, ending: &str) -> PathBuf {
    let name = key().to_string();
    cache.join(&name[..2]).join(format!("{name}.{ending}"))
}

/// What stands before the checksum of a file.
pub(crate) fn content(file: &Path) -> Vec<u8> {
    let mut bytes = fs::read(file).expect("it was written");
    bytes.truncate(bytes.len() - CHECKSUM);
    bytes
}

pub(super) fn features(folder: &Path, bytes: &[u8]) -> bool {
    let cache = offered(folder, "features", bytes);
    let Some(features) = cache.load(key()) else {
        return false;
    };
    assert_eq!(features.descriptors.len(), features.len());
    check(&features.keypoints);
    if let Some(frames) = &features.frames {
        assert_eq!(frames.len(), features.len());
        assert!(frames.as_flattened().iter().all(|x| x.is_finite()));
    }
    cache.save(key(), &features).expect("writable");
    assert_eq!(cache.load(key()), Some(features));
    true
}

pub(super) fn keypoints(folder: &Path, bytes: &[u8]) -> bool {
    let cache = offered(folder, "keypoints", bytes);
    let Some((keypoints, seconds)) = cache.load_keypoints(key()) else {
        return false;
    };
    assert!(seconds >= 0.0 && seconds.is_finite());
    check(&keypoints);
    (cache.save_keypoints(key(), &keypoints, seconds)).expect("writable");
    assert_eq!(cache.load_keypoints(key()), Some((keypoints, seconds)));
    true
}

/// A cache with a file of these bytes and their checksum.
fn offered(folder: &Path, ending: &str, bytes: &[u8]) -> FeatureCache {
    let path = file(folder, ending);
    fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
    let checksum = blake3::hash(bytes);
    fs::write(path, [bytes, checksum.as_bytes()].concat()).expect("writable");
    FeatureCache::new(folder)
}

fn check(keypoints: &[Keypoint]) {
    for keypoint in keypoints {
        let angle = keypoint.angle.unwrap_or(0.0);
        let numbers = [
            keypoint.at.x,
            keypoint.at.y,
            keypoint.size,
            keypoint.response,
            angle,
        ];
        assert!(numbers.iter().all(|x| x.is_finite()), "{keypoint:?}");
    }
}
