//! Doors to what a matcher from outside answers: a shell script that says and writes what it is told.

use std::fs;
use std::path::PathBuf;

use matchbench::external::{BuiltIn, External, Image, Log, Manifest, Times};
use matchbench_vision::features::Descriptors;
use matchbench_vision::image::Size;

use super::Doors;
use super::archives::{npy, npz};

/// Says the first line of `said`; if that is as it should be, and so a question comes, copies `written` to where its
/// answer is to be; and says the rest.
const CHILD: &str = r#"head -n 1 said
read -r hello
if head -n 1 said | cmp -s - ready; then
    read -r request
    out=${request##*'"out":"'}
    cp written "${out%%'"'*}"
fi
tail -n +2 said
"#;

/// What a child says before it is asked.
pub(crate) const READY: &str =
    "{\"type\":\"ready\",\"protocol\":1,\"name\":\"x\",\"version\":\"1\",\"pixel_center\":0.5}\n";
/// The answer to a question for matches, of which two are in [`rows`].
pub(crate) const MATCHED: &str = "{\"type\":\"matched\",\"pair\":[0,1],\"count\":2,\"features\":[3,2],\
     \"extracted\":2,\"seconds\":{\"extract\":0.25,\"match\":0.5},\"device\":\"cpu\"}\n";

/// The answer of one that has no matches.
pub(crate) const FAILED: &str = "{\"type\":\"failed\",\"pair\":[0,1],\"reason\":\"no memory\"}\n";

/// Two matches of images of [`SIZE`].
pub(crate) fn rows() -> Vec<u8> {
    let rows: [f32; 10] = [1.0, 2.0, 3.0, 0.5, 0.25, 4.0, 3.0, 0.0, 0.0, 1.0];
    rows.iter().flat_map(|value| value.to_le_bytes()).collect()
}

const SIZE: Size = Size::new(4, 3);
/// Bytes of a match.
const ROW: usize = 20;

impl Doors {
    /// A child that says all this and then ends.
    fn child(&self, kind: &str, said: &[u8], written: &[u8]) -> Option<External> {
        fs::create_dir_all(self.at("child")).expect("writable");
        self.file("child/child.sh", CHILD.as_bytes());
        self.file("child/ready", READY.as_bytes());
        self.file("child/said", said);
        self.file("child/written", written);
        let text = format!("name = \"mine\"\ncommand = [\"sh\", \"child.sh\"]\nkind = {kind:?}\n");
        let path = self.at("child/mine.toml");
        let manifest = Manifest::parse(&path, &text, &BuiltIn::default()).expect("it is sound");
        let log = Log::open(&self.at("child.log")).expect("writable");
        let external = External::start(manifest, log).ok()?;
        let identity = external.identity();
        assert!(identity.pixel_center == 0.0 || identity.pixel_center == 0.5);
        for name in [&identity.name, &identity.version] {
            assert!(!name.is_empty() && !name.chars().any(char::is_control));
        }
        Some(external)
    }

    /// All that a child says about a pair.
    pub(super) fn answers(&self, said: &[u8]) -> bool {
        self.matched(said, &rows())
    }

    /// The matches that a child writes.
    pub(super) fn answered_matches(&self, written: &[u8]) -> bool {
        let count = written.len() / ROW;
        let answer = format!("{{\"type\":\"matched\",\"pair\":[0,1],\"count\":{count}}}\n");
        self.matched(&[READY, &answer].concat().into_bytes(), written)
    }

    fn matched(&self, said: &[u8], written: &[u8]) -> bool {
        let Some(external) = self.child("matches", said, written) else {
            return false;
        };
        let [a, b] = ["0000.pgm", "0001.pgm"].map(|image| self.image(image));
        let [a, b] = [&a, &b].map(|path| Image { path, size: SIZE });
        let Ok(matched) = external.match_pair([0, 1], a, b) else {
            return false;
        };
        for &[x_a, y_a, x_b, y_b, ambiguity] in &matched.rows {
            check_point(x_a, y_a);
            check_point(x_b, y_b);
            assert!((0.0..=1.0).contains(&ambiguity));
        }
        if let Some([a, b]) = matched.features {
            assert!(matched.rows.len() as u64 <= u64::from(a) * u64::from(b));
        }
        check_times(&matched.times);
        true
    }

    /// The keypoints that a child writes for two features.
    pub(super) fn answered_features(&self, keypoints: &[u8]) -> bool {
        let descriptors = npy("|u1", "(2, 3)", &[1, 2, 3, 4, 5, 6]);
        let written = npz(&[("keypoints", keypoints), ("descriptors", &descriptors)]);
        let image = self.image("0000.pgm");
        let answer = format!(
            "{{\"type\":\"described\",\"image\":{:?},\"count\":2}}\n",
            image.display()
        );
        let said = [READY, &answer].concat().into_bytes();
        let Some(external) = self.child("features", &said, &written) else {
            return false;
        };
        let image = Image {
            path: &image,
            size: SIZE,
        };
        let Ok(described) = external.describe(image) else {
            return false;
        };
        let features = described.features;
        for keypoint in &features.keypoints {
            check_point(keypoint.at.x, keypoint.at.y);
            assert!(keypoint.size.is_finite() && keypoint.response.is_finite());
            assert!(keypoint.angle.is_none_or(f32::is_finite));
        }
        if let Descriptors::Float(rows) = &features.descriptors {
            assert!(rows.data().iter().all(|value| value.is_finite()));
        }
        assert_eq!(features.descriptors.len(), features.keypoints.len());
        check_times(&described.times);
        true
    }

    fn image(&self, name: &str) -> PathBuf {
        self.at("truth/sound/Images").join(name)
    }
}

/// Within an image of [`SIZE`], but for a rounding.
fn check_point(x: f32, y: f32) {
    assert!(
        (-0.52..=3.52).contains(&x) && (-0.52..=2.52).contains(&y),
        "({x}, {y})"
    );
}

fn check_times(times: &Times) {
    let total: f64 = times.own.values().sum();
    assert!(times.own.values().all(|&seconds| seconds >= 0.0) && total.is_finite());
    assert!(
        !times
            .device
            .iter()
            .any(|name| name.chars().any(char::is_control))
    );
}
