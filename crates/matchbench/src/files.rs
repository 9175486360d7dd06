//! Files that are written whole or not at all.

use std::fs;
use std::io::{self, Write};
use std::path::Path;

/// Writes `contents` beside `path` and renames it into place, so that whoever reads `path` finds
/// the old file or the new one, never a part. Missing folders are made.
///
/// # Errors
/// What the file system says, with the path named.
pub fn write_whole(path: &Path, contents: &[u8]) -> io::Result<()> {
    let named = |error: io::Error| {
        io::Error::new(
            error.kind(),
            format!("cannot write {}: {error}", path.display()),
        )
    };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder).map_err(named)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".matchbench-");
    // Temporary files are private to their owner; this one becomes an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut beside = builder.tempfile_in(folder).map_err(named)?;
    beside.write_all(contents).map_err(named)?;
    beside.as_file().sync_data().map_err(named)?;
    beside.persist(path).map_err(|error| named(error.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_nothing_is_left_beside() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("new/file.txt");
        write_whole(&path, b"old").expect("writable");
        write_whole(&path, b"new").expect("writable");
        assert_eq!(fs::read(&path).expect("readable"), b"new");
        let beside = fs::read_dir(path.parent().expect("has a folder")).expect("readable");
        assert_eq!(beside.count(), 1);
    }

    #[test]
    fn an_error_names_the_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("file"), b"").expect("writable");
        let path = folder.path().join("file/below");
        let error = write_whole(&path, b"").expect_err("a file is no folder");
        assert!(error.to_string().contains("below"), "{error}");
    }
}
