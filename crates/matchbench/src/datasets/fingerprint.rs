//! By what a dataset is known again: results of one truth are no results of another.

use matchbench_vision::geometry::Camera;

use super::{Frame, Pair, Sequence};

/// What a dataset asks, where few of its pairs are in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Whole {
    /// Number of its pairs.
    pub pairs: usize,
    /// Its [`Sequence::fingerprint`].
    pub fingerprint: String,
}

impl Sequence {
    /// What is known of it where it is not at hand.
    pub fn whole(&self) -> Whole {
        Whole {
            pairs: self.pairs.len(),
            fingerprint: self.fingerprint(),
        }
    }

    /// Hash of what a dataset asks and of its truth. The images are not in it, nor their depth, but that it is there: reading them all would
    /// delay every start, and their features are found by their content.
    pub fn fingerprint(&self) -> String {
        let mut fingerprint = Fingerprint::of(&self.frames);
        (self.pairs.iter()).for_each(|pair| fingerprint.add(pair));
        fingerprint.text(&self.frames)
    }
}

/// The fingerprint of a dataset whose pairs are gone through.
pub(super) struct Fingerprint(blake3::Hasher);

impl Fingerprint {
    /// That of a dataset with these frames and no pairs yet.
    pub(super) fn of(frames: &[Frame]) -> Self {
        let mut this = Self(blake3::Hasher::new());
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
                Some(lens) => this.numbers(&[lens.k1, lens.k2, lens.p1, lens.p2, lens.k3]),
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
        }
        if let Some(homography) = pair.homography() {
            self.numbers(homography.as_slice());
        }
    }

    /// The fingerprint, once all pairs were added.
    pub(super) fn text(mut self, frames: &[Frame]) -> String {
        // What few datasets have is hashed only where it is, so that the hashes of others stay.
        for (index, frame) in frames.iter().enumerate() {
            if !frame.turn.is_none() {
                self.numbers(&[index as f64, f64::from(u8::from(frame.turn))]);
            }
            if let Some(depth) = &frame.depth {
                let invalid = depth.unit.invalid.map_or(0.0, f64::from);
                self.numbers(&[index as f64, depth.unit.per_unit, invalid]);
            }
        }
        self.0.finalize().to_hex().to_string()
    }

    fn numbers(&mut self, numbers: &[f64]) {
        /// As many as a homography has: an update costs more than the eight bytes of a number.
        const AT_ONCE: usize = 9;
        let mut bytes = [[0; 8]; AT_ONCE];
        for some in numbers.chunks(AT_ONCE) {
            for (bytes, number) in bytes.iter_mut().zip(some) {
                *bytes = number.to_le_bytes();
            }
            self.0.update(bytes[..some.len()].as_flattened());
        }
    }
}
