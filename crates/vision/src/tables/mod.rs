//! Constants that belong to an algorithm's definition but were learned, not derived.
//!
//! `SOURCES.toml` says of each file what it holds, which paper it belongs to and how to make it
//! again; a test recomputes the hashes.

/// FREAK's tests: the two receptive fields that are compared, for each of 512 bits.
pub(crate) const FREAK_PAIRS: &[u8; 2 * 512] = include_bytes!("freak_pairs.bin");

/// LATCH's triplets: x and y of the anchor, of the first and of the second companion, as signed
/// bytes, for each of 256 bits.
pub(crate) const LATCH_TRIPLETS: &[u8; 6 * 256] = include_bytes!("latch_triplets.bin");

/// ORB's tests: x and y of the first place, x and y of the second, as signed bytes, for each of
/// 256 bits.
pub(crate) const ORB_PAIRS: &[u8; 4 * 256] = include_bytes!("orb_pairs.bin");

/// The learned BinBoost, as `BinBoostTable` writes it.
pub(crate) const BINBOOST: &[u8] = include_bytes!("binboost.bin");

/// The learned DLCO, as `DlcoTable` writes it.
pub(crate) const DLCO: &[u8] = include_bytes!("dlco.bin");

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use sha2::{Digest, Sha256};

    #[test]
    fn every_table_is_the_one_that_its_source_describes() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/tables");
        let text = fs::read_to_string(folder.join("SOURCES.toml")).expect("the list exists");
        let sources: toml::Table = text.parse().expect("the list is TOML");
        for (name, source) in &sources {
            let bytes = fs::read(folder.join(name)).expect("a listed table exists");
            let hash = format!("{:x}", Sha256::digest(&bytes));
            for key in ["holds", "paper", "made", "command"] {
                assert!(
                    source.get(key).is_some_and(toml::Value::is_str),
                    "{name}: no {key}"
                );
            }
            assert_eq!(source["sha256"].as_str(), Some(&hash[..]), "{name}");
            assert_eq!(
                source["bytes"].as_integer(),
                Some(bytes.len() as i64),
                "{name}"
            );
        }
        for file in fs::read_dir(&folder).expect("the folder can be listed") {
            let path = file.expect("the folder can be listed").path();
            let name = path.file_name().and_then(|name| name.to_str());
            let is_table = path.extension().is_some_and(|extension| extension == "bin");
            assert!(
                !is_table || name.is_some_and(|name| sources.contains_key(name)),
                "{} is not listed",
                path.display()
            );
        }
    }
}
