//! The key of cached features: a hash of the bytes of the image file and of everything that the extraction
//! depends on (id, every effective parameter, revision), and of how the image is turned.
//!
//! It holds no name, no time and no path. If a parameter changes, or an image is replaced, the key is another
//! one. Only a change of the code itself must be told, by [`Extraction::revision`].

use std::fmt;

use crate::matchers::Extraction;

/// The key of features: a hash of everything they were made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(pub(crate) [u8; 32]);

impl Key {
    /// The key of the features that `extraction` finds in the image `file` (its bytes), turned by so
    /// many quarters counterclockwise.
    pub fn new(file: &[u8], quarters: u8, extraction: &Extraction) -> Self {
        let extraction = serde_json::to_vec(extraction).expect("an extraction is plain JSON");
        let mut hasher = blake3::Hasher::new();
        // The length of an extraction leaves the upper byte free. After the file the turn could be a byte of it.
        let length = extraction.len() as u64 | u64::from(quarters) << 56;
        hasher.update(&length.to_le_bytes());
        hasher.update(&extraction);
        hasher.update(file);
        Self(*hasher.finalize().as_bytes())
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn extraction() -> Extraction {
        Extraction {
            extractor: "sift".into(),
            params: json!({"octaves": 4, "contrast": 0.04}),
            revision: 1,
        }
    }

    #[test]
    fn everything_that_features_depend_on_is_in_the_key() {
        let key = |extraction: &Extraction| Key::new(b"image", 0, extraction);
        let original = key(&extraction());
        assert_eq!(key(&extraction()), original);
        let changed = |change: fn(&mut Extraction)| {
            let mut extraction = extraction();
            change(&mut extraction);
            key(&extraction)
        };
        assert_ne!(changed(|e| e.extractor = "surf".into()), original);
        assert_ne!(changed(|e| e.params["contrast"] = json!(0.03)), original);
        assert_ne!(changed(|e| e.revision = 2), original);
        assert_ne!(Key::new(b"imagf", 0, &extraction()), original);
        assert_ne!(Key::new(b"image", 2, &extraction()), original);
        let turned = Key::new(b"image", 2, &extraction());
        assert_ne!(Key::new(b"image\x02", 0, &extraction()), turned);
    }
}
