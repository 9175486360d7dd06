//! HDF5 files as they are written, cut and changed ones, and hostile ones made by hand.

use super::*;

#[test]
fn nested_arrays_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.h5");
    let mut out = Hdf5Out::default();
    out.floats("a/x.png/keypoints".into(), &[2, 2], &[1.5, 2.0, -0.25, 3e7]);
    out.integers("a/x.png/n".into(), &[3], &[1, -1, 70_000]);
    out.doubles("empty".into(), &[0], &[]);
    out.write(&path).unwrap();
    let file = Hdf5::open(&path).unwrap();
    let mut paths = file.arrays().unwrap();
    paths.sort();
    assert_eq!(paths, ["a/x.png/keypoints", "a/x.png/n", "empty"]);
    let keypoints = file.array("a/x.png/keypoints").unwrap();
    assert_eq!(keypoints.rows(2), Ok(2));
    assert_eq!(keypoints.to_vec(), [1.5, 2.0, -0.25, 3e7]);
    assert_eq!(
        file.array("a/x.png/n").unwrap().to_vec(),
        [1.0, -1.0, 70_000.0]
    );
    assert_eq!(file.array("empty").unwrap().length(), Ok(0));
    let limited = Hdf5::with_arrays_of(&path, 12).unwrap();
    assert!(limited.array("a/x.png/n").is_ok());
    let error = limited.array("a/x.png/keypoints").unwrap_err();
    assert!(
        (error.what()).ends_with("(16 bytes) exceeds the 12 byte read limit"),
        "{error:?}"
    );
    let error = file.array("a/y").err().unwrap();
    assert!(
        error.file == path && error.what().starts_with("array `a/y`: "),
        "{error:?}"
    );
}

/// Where the first object of a file of the first format begins.
const HEAD: u64 = 96;

/// A message of an object.
fn message(kind: u16, data: &[u8]) -> Vec<u8> {
    let length = data.len().next_multiple_of(8);
    let mut bytes = [kind.to_le_bytes(), (length as u16).to_le_bytes()].concat();
    bytes.extend([0; 4]);
    bytes.extend(data);
    bytes.resize(8 + length, 0);
    bytes
}

/// An object of these messages.
fn object(messages: &[Vec<u8>]) -> Vec<u8> {
    let count = messages.len() as u16;
    let messages = messages.concat();
    let mut bytes = vec![1, 0];
    bytes.extend(count.to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend((messages.len() as u32).to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(messages);
    bytes
}

/// A group with links of one letter, `a` and so on, to objects at these places.
fn group(links: &[u64]) -> Vec<u8> {
    // Links are in the group itself: no heap, no tree.
    let mut messages = vec![
        message(2, &[[0; 2].as_slice(), &[0xff; 16], &[0; 6]].concat()),
        message(10, &[0; 8]),
    ];
    messages.extend((b'a'..).zip(links).map(|(letter, to)| {
        let link = [&[1, 0, 1, letter][..], &to.to_le_bytes()].concat();
        message(6, &link)
    }));
    object(&messages)
}

/// A file of the first format with these objects one after the other; the first is the root.
fn file_of(objects: &[Vec<u8>]) -> Vec<u8> {
    let objects = objects.concat();
    let mut file = b"\x89HDF\r\n\x1a\n\0\0\0\0\0\x08\x08\0\x04\0\x10\0\0\0\0\0".to_vec();
    let end = HEAD + objects.len() as u64;
    for address in [0, u64::MAX, end, u64::MAX, 0, HEAD, 0] {
        file.extend(address.to_le_bytes());
    }
    file.resize(HEAD as usize, 0);
    file.extend(objects);
    file
}

/// `groups` groups in a chain, each with `links` links to the next.
fn chain(groups: u64, links: usize) -> Vec<u8> {
    let size = group(&vec![0; links]).len() as u64;
    let of = |number: u64| {
        let next = if number < groups { links } else { 0 };
        group(&vec![HEAD + number * size; next])
    };
    file_of(&(1..=groups).map(of).collect::<Vec<_>>())
}

/// One array `a` of bytes in this shape, of which none was written.
fn promise(shape: &[u64]) -> Vec<u8> {
    let to = HEAD + group(&[0]).len() as u64;
    let sides = shape.iter().flat_map(|side| side.to_le_bytes());
    let space = [1, shape.len() as u8, 0, 0, 0, 0, 0, 0].into_iter();
    let array = object(&[
        message(1, &space.chain(sides).collect::<Vec<u8>>()),
        message(3, &[0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0]),
        message(8, &[&[3, 1][..], &[0xff; 8], &[0; 8]].concat()),
    ]);
    file_of(&[group(&[to]), array])
}

#[test]
fn an_array_that_claims_more_than_its_file_can_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.h5");
    let read = |shape: &[u64]| {
        std::fs::write(&path, promise(shape)).unwrap();
        let file = Hdf5::open(&path)?;
        assert_eq!(file.arrays()?, ["a"]);
        file.array("a").map(|array| array.len())
    };
    assert_eq!(read(&[5, 2]).unwrap(), 10);
    for shape in [&[1 << 29, 2][..], &[1 << 20]] {
        let error = read(shape).unwrap_err().what();
        assert!(error.contains("more than a file of"), "{error}");
    }
    assert!(read(&[1 << 40, 1 << 40]).is_err());
}

/// One array of bytes in this shape and chunks of that one, of which none was written, under so many names.
fn chunked(shape: [u64; 2], chunk: [u32; 2], names: usize) -> Vec<u8> {
    let to = HEAD + group(&vec![0; names]).len() as u64;
    let sides = shape.iter().flat_map(|side| side.to_le_bytes());
    let of_chunk = chunk.iter().chain(&[1]).flat_map(|side| side.to_le_bytes());
    let space = [1, 2, 0, 0, 0, 0, 0, 0].into_iter();
    let layout = [3, 2, 3].into_iter().chain([0xff; 8]).chain(of_chunk);
    let array = object(&[
        message(1, &space.chain(sides).collect::<Vec<u8>>()),
        message(3, &[0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0]),
        message(8, &layout.collect::<Vec<u8>>()),
    ]);
    file_of(&[group(&vec![to; names]), array])
}

#[test]
fn chunks_that_are_more_than_a_file_can_hold_are_refused() {
    let open = |shape, chunk, names| {
        let file = Hdf5::of_bytes(Path::new("m.h5"), chunked(shape, chunk, names)).unwrap();
        assert_eq!(file.arrays().unwrap().len(), names);
        file
    };
    let read = |shape, chunk| (open(shape, chunk, 1).array("a")).map(|array| array.len());
    // As programs make them of few values where there may be more one day.
    for chunk in [[1024, 2], [1 << 20, 4], [1, 2]] {
        assert_eq!(read([20, 2], chunk).unwrap(), 40);
    }
    assert_eq!(read([0, 2], [1 << 31, 2]).unwrap(), 0);
    for (shape, chunk) in [
        ([20, 2], [1, 1 << 26]),
        ([1, 2], [1, 1 << 26]),
        ([20, 2], [u32::MAX, u32::MAX]),
    ] {
        let error = read(shape, chunk).unwrap_err().what();
        assert!(error.contains("more than a file of"), "{error}");
    }
    // Each could be there, but not all; one may be read again.
    let file = open([1, 2], [1, 4 << 20], 20);
    for _ in 0..20 {
        assert_eq!(file.array("a").unwrap().len(), 2);
    }
    let read = ('a'..='t').filter(|name| file.array(&name.to_string()).is_ok());
    assert_eq!(read.collect::<String>(), "abcd");
}

#[test]
fn an_array_that_is_smaller_than_its_chunk_is_read() {
    let points = [1.5_f32, 2.0, -0.25, 3e7];
    let mut out = Hdf5Out::default();
    for name in ["x/keypoints", "y/keypoints"] {
        let array = DatasetBuilder::typed_data(name, vec![2, 2], &points).unwrap();
        out.add(array.chunked([1024, 2]).max_shape([u64::MAX, 2]));
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.h5");
    out.write(&path).unwrap();
    let file = Hdf5::open(&path).unwrap();
    for name in file.arrays().unwrap() {
        assert_eq!(file.array(&name).unwrap().to_vec(), points.map(f64::from));
    }
}

#[test]
fn a_filter_that_is_not_known_is_told_with_what_to_write_instead() {
    // The number that h5py has registered for its LZF.
    let lzf = [&[2, 1][..], &32_000_u16.to_le_bytes(), &[0; 6]].concat();
    let space = [1, 1, 0, 0, 0, 0, 0, 0]
        .into_iter()
        .chain(4_u64.to_le_bytes());
    let array = |tree: u64| {
        let sides = [4_u32, 1].into_iter().flat_map(u32::to_le_bytes);
        let layout = [3, 2, 2].into_iter().chain(tree.to_le_bytes()).chain(sides);
        object(&[
            message(1, &space.clone().collect::<Vec<u8>>()),
            message(3, &[0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0]),
            message(11, &lzf),
            message(8, &layout.collect::<Vec<u8>>()),
        ])
    };
    let to = HEAD + group(&[0]).len() as u64;
    let tree = to + array(0).len() as u64;
    // One chunk of four bytes, behind the tree that leads to it.
    let key = |at: u64| {
        [
            &4_u32.to_le_bytes()[..],
            &[0; 4],
            &at.to_le_bytes(),
            &[0; 8],
        ]
        .concat()
    };
    let leaf = [&b"TREE\x01\0\x01\0"[..], &[0xff; 16], &key(0)].concat();
    let chunk = tree + (leaf.len() + 8 + key(4).len()) as u64;
    let leaf = [leaf, chunk.to_le_bytes().to_vec(), key(4), vec![7; 4]].concat();
    let bytes = file_of(&[group(&[to]), array(tree), leaf]);
    let file = Hdf5::of_bytes(Path::new("m.h5"), bytes).unwrap();
    let error = file.array("a").unwrap_err();
    assert!(error.what().contains("unsupported filter"), "{error:?}");
    assert!(error.remedy.contains("gzip"), "{error:?}");
}

#[test]
fn groups_that_links_multiply_are_refused_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.h5");
    let arrays = |groups, links| {
        std::fs::write(&path, chain(groups, links)).unwrap();
        Hdf5::open(&path)?.arrays()
    };
    assert_eq!(arrays(8, 3).unwrap(), [""; 0]);
    let error = arrays(30, 1).unwrap_err();
    assert!(error.what().contains("deeper than"), "{error:?}");
    // 20 groups have 10^19 paths.
    let wide = chain(20, 10);
    std::fs::write(&path, wide).unwrap();
    let file = Hdf5::open(&path).unwrap();
    for (limits, what) in [
        ((10_000, usize::MAX), "too many groups and arrays"),
        ((usize::MAX, 100_000), "too long"),
    ] {
        let error = file
            .arrays_within(limits.0, limits.1, u64::MAX)
            .unwrap_err();
        assert!(error.what().contains(what), "{error:?}");
    }
}

#[test]
fn links_to_nothing_are_not_resolved_on_every_path() {
    // Each group of a chain has two links to the next, and three that resolve to nothing.
    let nothing = |name: u8| message(6, &[1, 8, 1, 1, name, 2, 0, b'/', b'x']);
    let links = |next: u64| {
        let to = |name: u8| message(6, &[&[1, 0, 1, name][..], &next.to_le_bytes()].concat());
        object(&[
            to(b'a'),
            to(b'b'),
            nothing(b'c'),
            nothing(b'd'),
            nothing(b'e'),
        ])
    };
    let size = links(0).len() as u64;
    let mut groups: Vec<_> = (1..=8).map(|number| links(HEAD + number * size)).collect();
    groups.push(group(&[]));
    let file = Hdf5::of_bytes(Path::new("m.h5"), file_of(&groups)).unwrap();
    let mut found = Found {
        arrays: Vec::new(),
        members: 510,
        bytes: usize::MAX,
        listings: HashMap::new(),
    };
    let root = file.file.root_group().unwrap();
    file.collect(&root, "", 0, &mut found).unwrap();
    assert_eq!(found.members, 0, "2 + 4 + ... + 256 groups");
    assert_eq!(found.listings.len(), 9);
    let kept = found.listings.values().filter(|kept| kept.is_some());
    assert_eq!(kept.count(), 8, "all but the root");
    let inner = root.groups().unwrap().remove(0);
    let lists = [0; 2].map(|_| file.listing(&inner, &mut found).unwrap());
    assert!(Rc::ptr_eq(&lists[0], &lists[1]));
}

#[test]
fn groups_that_share_their_parts_are_read_in_time() {
    const GROUPS: u64 = 30;
    // What all groups share is padding here; links would take more memory than the file by far.
    let padding = message(0, &[0; 6000]);
    let length = padding.len() as u64;
    let first = HEAD + group(&[0; GROUPS as usize]).len() as u64;
    let shared = message(16, &[first.to_le_bytes(), length.to_le_bytes()].concat());
    let mut inner = object(&[shared]);
    // The messages of both parts.
    inner[2] = 2;
    let places = (0..GROUPS).map(|number| first + length + number * inner.len() as u64);
    let mut objects = vec![group(&places.collect::<Vec<_>>()), padding];
    objects.extend(vec![inner; GROUPS as usize]);
    let file = Hdf5::of_bytes(Path::new("m.h5"), file_of(&objects)).unwrap();
    assert_eq!(file.arrays().unwrap(), [""; 0]);
    let file = Hdf5::of_bytes(Path::new("m.h5"), file_of(&objects)).unwrap();
    let error = file
        .arrays_within(MAX_MEMBERS, MAX_NAME_BYTES, GROUPS * length)
        .unwrap_err();
    assert!(
        error.what().contains("more parts than it has bytes for"),
        "{error:?}"
    );
    assert_eq!(error.file, Path::new("m.h5"));
}

#[test]
fn a_group_that_seems_cut_may_be_a_large_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.h5");
    let whole = chain(3, 2);
    std::fs::write(&path, &whole[..whole.len() - 8]).unwrap();
    let error = Hdf5::open(&path).unwrap().arrays().unwrap_err();
    assert!(error.what().contains("unexpected end of data"), "{error:?}");
    assert!(error.remedy.contains("libver=\"earliest\""), "{error:?}");
}

#[test]
fn a_file_that_is_cut_or_changed_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.h5");
    let mut out = Hdf5Out::default();
    out.floats("a/keypoints".into(), &[2, 2], &[1.5, 2.0, -0.25, 3e7]);
    out.integers("a/b/matches0".into(), &[2], &[1, -1]);
    out.write(&path).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let read_all = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let file = Hdf5::open(&path)?;
        for array in file.arrays()? {
            file.array(&array)?;
        }
        Ok::<_, ArrayError>(())
    };
    assert!(read_all(&whole).is_ok());
    for length in (0..whole.len()).step_by(3) {
        assert!(read_all(&whole[..length]).is_err(), "cut to {length}");
    }
    for place in 0..whole.len() {
        let mut changed = whole.clone();
        changed[place] ^= (place as u8) | 1;
        // The file is refused or read; a changed number inside an array cannot be detected.
        let _ = read_all(&changed);
    }
}
