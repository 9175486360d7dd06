//! Tests of images as gray pixels.

use std::fs;

use proptest::prelude::*;

use super::*;

/// Small images made with Pillow and OpenCV. `*.pgm` is what OpenCV 4.14 reads from the file
/// with `IMREAD_GRAYSCALE | IMREAD_IGNORE_ORIENTATION`.
fn fixture(name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/images");
    fs::read(folder.join(name)).expect("fixtures are part of the repository")
}

fn largest_difference_from_opencv(name: &str) -> u8 {
    let stem = name.replace('.', "-");
    let expected = decode_gray(&fixture(&format!("{stem}.pgm"))).unwrap();
    let found = decode_gray(&fixture(name)).unwrap();
    assert_eq!(found.size(), expected.size(), "{name}");
    let difference = found.data().iter().zip(expected.data());
    difference.map(|(p, q)| p.abs_diff(*q)).max().unwrap()
}

#[test]
fn pixels_of_red_green_and_blue_are_as_in_a_png_file() {
    let found = gray_of_rgb(
        Size::new(3, 1),
        &[[255, 0, 0], [0, 255, 0], [0, 0, 255]].concat(),
    );
    // The other rules round, and have 150 for green.
    assert_eq!(found.data(), [76, 149, 29]);
    let rgb = image::load_from_memory(&fixture("color.png"))
        .unwrap()
        .into_rgb8();
    let size = Size::new(rgb.width() as usize, rgb.height() as usize);
    assert_eq!(
        gray_of_rgb(size, &rgb),
        decode_gray(&fixture("color.png")).unwrap()
    );
}

#[test]
fn gray_is_that_of_opencv() {
    for name in [
        "color.png",
        "palette.png",
        "rgba.png",
        "one-bit.png",
        "gray16.png",
        "rgb16.png",
        "color.bmp",
        "color.ppm",
        "color.tif",
        "color.webp",
    ] {
        assert_eq!(largest_difference_from_opencv(name), 0, "{name}");
    }
    for name in [
        "color.jpg",
        "progressive.jpg",
        "gray.jpg",
        "turned.jpg",
        "tall.jpg",
        "tall-progressive.jpg",
        "adobe-rgb.jpg",
    ] {
        assert!(largest_difference_from_opencv(name) <= 1, "{name}");
    }
}

#[test]
fn a_jpeg_of_channels_that_the_decoder_mixes_up_is_refused() {
    for (name, has) in [
        ("narrow.jpg", "fewer samples than another"),
        ("apart.jpg", "in separate scans"),
        ("partly-apart.jpg", "in separate scans"),
    ] {
        let error = decode_gray(&fixture(name)).unwrap_err();
        let DecodeError::Unsupported(what) = &error else {
            panic!("{name}: {error}");
        };
        assert!(what.contains(has), "{name}: {what}");
    }
    // All channels are of one size, or each of them is alone and no more than one block high.
    for name in ["apart-equal.jpg", "apart-wide.jpg"] {
        assert!(largest_difference_from_opencv(name) <= 1, "{name}");
    }
}

#[test]
fn an_image_cut_off_anywhere_is_an_error() {
    for name in [
        "color.jpg",
        "progressive.jpg",
        "color.png",
        "color.tif",
        "color.ppm",
    ] {
        let bytes = fixture(name);
        for length in 0..bytes.len() {
            let cut = decode_gray(&bytes[..length]);
            // A PNG is complete before its 12-byte end marker.
            let complete = name.ends_with("png") && length >= bytes.len() - 12;
            assert!(cut.is_err() || complete, "{name} cut to {length} bytes");
        }
    }
}

#[test]
fn errors_name_the_file_and_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0001.jpg");
    let message = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let error = read_gray(&path).unwrap_err();
        assert_eq!(error.file, path);
        format!("{}; {}", error.what, error.remedy)
    };
    let jpeg = fixture("color.jpg");
    assert_eq!(
        message(&jpeg[..jpeg.len() - 2]),
        "the image is truncated; copy or download the file again"
    );
    assert!(message(b"<html>not found</html>").starts_with("not an image"));
    assert!(message(b"").starts_with("not an image"));
    assert!(message(&fixture("cmyk.jpg")).starts_with("unsupported pixels: CMYK"));
    assert!(read_gray(&folder.path().join("none.png")).is_err());
}

const JPEGS: [&str; 5] = [
    "color.jpg",
    "gray.jpg",
    "progressive.jpg",
    "restarts.jpg",
    "progressive-restarts.jpg",
];

#[test]
fn a_jpeg_with_a_sampling_factor_of_three_is_not_called_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0001.jpg");
    fs::write(&path, fixture("thirds.jpg")).unwrap();
    for error in [read_gray(&path).unwrap_err(), read_size(&path).unwrap_err()] {
        assert_eq!(
            error.what,
            "unsupported pixels: a JPEG with a sampling factor of 3 (4:4:4, 4:2:2, 4:2:0 and 4:1:1 are read)"
        );
        assert_eq!(error.remedy, "convert it to a png of 8-bit gray or colour");
    }
}

#[test]
fn a_jpeg_of_another_kind_is_not_called_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0001.jpg");
    let sound = fixture("gray.jpg");
    let frame = (sound.windows(2)).position(|marker| marker == [0xff, 0xc0]);
    let frame = frame.expect("it is sequential");
    // Marker, length, bits.
    let with = |at: usize, byte: u8| {
        let mut other = sound.clone();
        other[frame + at] = byte;
        other
    };
    let no_frame = "a JPEG without a frame of Huffman codes: it may be lossless, JPEG-LS, or arithmetically coded";
    for (file, what) in [
        (with(4, 12), "a JPEG whose values do not have 8 bits"),
        (with(1, 0xc3), no_frame),
        (with(1, 0xc9), no_frame),
        (with(1, 0xf7), no_frame),
    ] {
        fs::write(&path, file).unwrap();
        for error in [read_gray(&path).unwrap_err(), read_size(&path).unwrap_err()] {
            assert_eq!(error.what, format!("unsupported pixels: {what}"));
            assert_eq!(error.remedy, "convert it to a png of 8-bit gray or colour");
        }
    }
}

#[test]
fn a_jpeg_cut_anywhere_is_refused_also_with_an_end_marker_put_on() {
    for name in JPEGS {
        let whole = fixture(name);
        assert!(decode_gray(&whole).is_ok(), "{name}");
        let end = whole.windows(2).rposition(|m| m == [0xff, 0xd9]);
        let end = end.expect("it is whole");
        for length in 0..end {
            for put_on in [
                &[0xff, 0xd9][..],
                &[0xff, 0xff, 0xff, 0xd9],
                &[0xff, 0xd0, 0xff, 0xd9],
            ] {
                let cut = [&whole[..length], put_on].concat();
                assert!(
                    decode_gray(&cut).is_err(),
                    "{name} cut to {length} of {end}"
                );
            }
        }
    }
}

#[test]
fn a_jpeg_with_more_data_than_pixels_or_a_part_left_out_is_refused() {
    for name in JPEGS {
        let mut lower = fixture(name);
        let at = (lower.windows(2)).position(|m| m[0] == 0xff && (0xc0..=0xc2).contains(&m[1]));
        let at = at.expect("a frame has a header");
        lower[at + 5..at + 7].copy_from_slice(&[0, 8]);
        assert!(decode_gray(&lower).is_err(), "{name}: 8 rows");
    }
    // Between two restarts, from marker to marker: whole intervals that are missing.
    let whole = fixture("restarts.jpg");
    let markers: Vec<usize> = (1..whole.len())
        .filter(|&at| whole[at - 1] == 0xff && (0xd0..0xd8).contains(&whole[at]))
        .collect();
    assert!(markers.len() >= 2);
    for ends in markers.windows(2) {
        let cut = [&whole[..ends[0]], &whole[ends[1]..]].concat();
        assert!(decode_gray(&cut).is_err(), "without {ends:?}");
    }
}

#[test]
fn a_small_file_that_claims_a_large_image_is_refused() {
    for name in JPEGS {
        let mut bytes = fixture(name);
        let at = (bytes.windows(2)).position(|m| m[0] == 0xff && (0xc0..=0xc2).contains(&m[1]));
        let at = at.expect("a frame has a header");
        bytes[at + 5..at + 9].copy_from_slice(&[0x08, 0x00, 0x08, 0x00]);
        assert!(decode_gray(&bytes).is_err(), "{name}");
    }
}

#[test]
fn a_webp_without_its_last_bytes_is_truncated() {
    let whole = fixture("color.webp");
    assert!(decode_gray(&whole).is_ok());
    for missing in 1..whole.len() - 12 {
        let decoded = decode_gray(&whole[..whole.len() - missing]);
        assert!(decoded.is_err(), "without {missing} bytes");
    }
}

#[test]
fn a_bomb_is_not_decoded() {
    let bomb = b"P5 60000 60000 255\n";
    let size = Size::new(60000, 60000);
    assert_eq!(decode_gray(bomb), Err(DecodeError::TooLarge(size)));
}

#[test]
fn an_image_without_pixels_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0000.pgm");
    for header in ["P5 0 5 255\n", "P6 5 0 255\n", "P2 0 0 255\n"] {
        fs::write(&path, header).unwrap();
        for error in [read_gray(&path).unwrap_err(), read_size(&path).unwrap_err()] {
            assert_eq!(error.what, "the image is damaged: it has no pixels");
        }
    }
}

#[test]
fn the_header_alone_tells_the_size() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "color.jpg",
        "progressive.jpg",
        "color.png",
        "color.bmp",
        "color.webp",
    ] {
        let path = folder.path().join(name);
        fs::write(&path, fixture(name)).unwrap();
        assert_eq!(read_size(&path).unwrap(), Size::new(24, 17), "{name}");
    }
    let path = folder.path().join("half.png");
    fs::write(&path, &fixture("color.png")[..100]).unwrap();
    assert_eq!(read_size(&path).unwrap(), Size::new(24, 17));
    fs::write(&path, "").unwrap();
    assert!(read_size(&path).is_err());
}

#[test]
fn what_decoders_know_besides_is_not_read() {
    let gif =
        b"GIF89a\x01\0\x01\0\x80\0\0\0\0\0\xff\xff\xff,\0\0\0\0\x01\0\x01\0\0\x02\x02D\x01\0;";
    assert!(
        image::load_from_memory(gif).is_ok(),
        "it is sound, and could be read"
    );
    assert_eq!(decode_gray(gif), Err(DecodeError::UnknownFormat));
}

proptest! {
    #[test]
    fn damaged_bytes_do_not_panic(
        which in 0..4_usize,
        at in 0..2000_usize,
        byte in any::<u8>(),
    ) {
        let mut bytes = fixture(["turned.jpg", "progressive.jpg", "palette.png", "color.tif"][which]);
        let at = at % bytes.len();
        bytes[at] = byte;
        let _ = decode_gray(&bytes);
    }
}
