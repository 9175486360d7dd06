//! The fingerprint of a dataset: a hash that identifies its cameras, pairs and truth. Results for one truth
//! must not be taken for results of another.

use matchbench_vision::geometry::{Camera, Lens};

use super::{Frame, Pair, Sequence};

/// The number of pairs of a dataset and its fingerprint, for use if only some of its pairs are in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Whole {
    /// Number of its pairs.
    pub pairs: usize,
    /// Its [`Sequence::fingerprint`].
    pub fingerprint: String,
}

impl Sequence {
    /// The number of pairs and the fingerprint, for use when the dataset itself is not available.
    pub fn whole(&self) -> Whole {
        Whole {
            pairs: self.pairs.len(),
            fingerprint: self.fingerprint(),
        }
    }

    /// Hash of the cameras, the pairs and their truth. Neither images nor depth are part of it, only whether
    /// there is depth. To read all of them would delay every start, and features are looked up by the content
    /// of the images anyway.
    pub fn fingerprint(&self) -> String {
        let mut fingerprint = Fingerprint::of(&self.frames);
        (self.pairs.iter()).for_each(|pair| fingerprint.add(pair));
        fingerprint.text(&self.frames)
    }
}

/// A fingerprint that is being computed, pair by pair.
pub(super) struct Fingerprint {
    hasher: blake3::Hasher,
    has_poses: bool,
}

impl Fingerprint {
    /// Starts the fingerprint of a dataset with these frames; it has no pairs yet.
    pub(super) fn of(frames: &[Frame]) -> Self {
        let mut this = Self {
            hasher: blake3::Hasher::new(),
            has_poses: false,
        };
        for frame in frames {
            let Camera {
                fx,
                fy,
                cx,
                cy,
                distortion,
            } = frame.camera;
            this.numbers(&[fx, fy, cx, cy]);
            match distortion {
                None => this.numbers(&[0.0; 5]),
                Some(Lens::Brown(lens)) => {
                    this.numbers(&[lens.k1, lens.k2, lens.p1, lens.p2, lens.k3]);
                }
                // An infinity, which no dataset contains, so that these are not taken for the others.
                Some(Lens::Fisheye(lens)) => {
                    this.numbers(&[lens.k1, lens.k2, lens.k3, lens.k4, f64::INFINITY]);
                }
            }
        }
        this
    }

    /// Adds the next pair.
    pub(super) fn add(&mut self, pair: &Pair) {
        self.numbers(&[f64::from(pair.a), f64::from(pair.b)]);
        if let Some(b_from_a) = pair.pose() {
            self.numbers(b_from_a.rotation.coords.as_slice());
            self.numbers(b_from_a.translation.vector.as_slice());
            self.has_poses = true;
        }
        if let Some(homography) = pair.homography() {
            // A homography has nine numbers, as a pair with a pose has (two indices, four of the rotation, three of
            // the translation), so one could be taken for the other. An infinity, which no dataset contains,
            // separates them. A dataset of homographies alone needs none, and keeps the fingerprint that it had in
            // earlier versions.
            if self.has_poses {
                self.numbers(&[f64::INFINITY]);
            }
            self.numbers(homography.as_slice());
        }
    }

    /// The fingerprint, after all pairs were added.
    pub(super) fn text(mut self, frames: &[Frame]) -> String {
        // Fields that few datasets have are hashed only if they are there, so that the hashes of all other
        // datasets stay the same.
        for (index, frame) in frames.iter().enumerate() {
            if !frame.turn.is_none() {
                self.numbers(&[index as f64, f64::from(u8::from(frame.turn))]);
            }
            if let Some(depth) = &frame.depth {
                let invalid = depth.unit.invalid.map_or(0.0, f64::from);
                self.numbers(&[index as f64, depth.unit.per_unit, invalid]);
            }
        }
        self.hasher.finalize().to_hex().to_string()
    }

    fn numbers(&mut self, numbers: &[f64]) {
        /// As many numbers as a homography has. One update of the hash costs more than the eight bytes of a
        /// number.
        const AT_ONCE: usize = 9;
        let mut bytes = [[0; 8]; AT_ONCE];
        for some in numbers.chunks(AT_ONCE) {
            for (bytes, number) in bytes.iter_mut().zip(some) {
                *bytes = number.to_le_bytes();
            }
            self.hasher.update(bytes[..some.len()].as_flattened());
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion};

    use super::super::Truth;
    use super::*;

    fn of(pairs: &[Pair]) -> String {
        let sequence = Sequence {
            name: "room".into(),
            frames: Vec::new(),
            pairs: pairs.to_vec(),
        };
        sequence.fingerprint()
    }

    fn posed(a: u32, b: u32, x: f64) -> Pair {
        let turn = UnitQuaternion::identity();
        let b_from_a = Isometry3::from_parts(Translation3::new(x, 2.0, 3.0), turn);
        Pair::with_pose(a, b, b_from_a)
    }

    #[test]
    fn a_homography_is_not_taken_for_another_pair_with_a_pose() {
        let first = posed(0, 1, 1.0);
        // The numbers of the second pair: its frames, the rotation 0 0 0 1, the translation.
        let numbers = [2.0, 3.0, 0.0, 0.0, 0.0, 1.0, 4.0, 2.0, 3.0];
        let both = Pair {
            truth: Truth::Both {
                b_from_a: *first.pose().expect("it has one"),
                homography: Matrix3::from_column_slice(&numbers),
            },
            ..first
        };
        assert_ne!(of(&[both]), of(&[first, posed(2, 3, 4.0)]));
    }

    #[test]
    fn fingerprints_of_one_kind_of_truth_stay() {
        let plane = Pair::with_homography(0, 1, Matrix3::identity());
        let known = [posed(0, 1, 1.0), plane].map(|pair| of(&[pair])[..16].to_owned());
        assert_eq!(known, ["732a9fa2db6a6d8c", "f9f0d3ccaf78cb09"]);
    }
}
