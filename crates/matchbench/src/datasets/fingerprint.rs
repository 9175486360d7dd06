//! By what a dataset is known again: results of one truth are no results of another.

use matchbench_vision::geometry::Camera;

use super::Sequence;

impl Sequence {
    /// Hash of what a dataset asks and of its truth. The images are not in it: reading them all would
    /// delay every start, and their features are found by their content.
    pub fn fingerprint(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        let mut numbers = |numbers: &[f64]| {
            for number in numbers {
                hasher.update(&number.to_le_bytes());
            }
        };
        for frame in &self.frames {
            let Camera {
                fx,
                fy,
                cx,
                cy,
                distortion,
            } = frame.camera;
            numbers(&[fx, fy, cx, cy]);
            match distortion {
                None => numbers(&[0.0; 5]),
                Some(lens) => numbers(&[lens.k1, lens.k2, lens.p1, lens.p2, lens.k3]),
            }
        }
        for pair in &self.pairs {
            numbers(&[f64::from(pair.a), f64::from(pair.b)]);
            if let Some(b_from_a) = pair.pose() {
                numbers(b_from_a.rotation.coords.as_slice());
                numbers(b_from_a.translation.vector.as_slice());
            }
            if let Some(homography) = pair.homography() {
                numbers(homography.as_slice());
            }
        }
        // What few datasets have is hashed only where it is, so that the hashes of others stay.
        for (index, frame) in self.frames.iter().enumerate() {
            if !frame.turn.is_none() {
                numbers(&[index as f64, f64::from(u8::from(frame.turn))]);
            }
        }
        hasher.finalize().to_hex().to_string()
    }
}
