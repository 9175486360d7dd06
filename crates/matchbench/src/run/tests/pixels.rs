//! Matchers that look at the pixels of both images of a pair.

use super::*;

/// Images decoded by [`counting`].
static DECODED: AtomicUsize = AtomicUsize::new(0);

fn counting(file: &[u8]) -> Result<GrayImage, String> {
    DECODED.fetch_add(1, Ordering::Relaxed);
    decode(file)
}

#[test]
fn matchers_that_use_pixels_are_given_them_and_images_are_decoded_once() {
    let toy = Toy {
        uses_pixels: true,
        ..Toy::default()
    };
    let bench = Bench::new(vec![toy.contender("pixels", &["first"])]);
    assert_eq!(
        bench.run("run").unwrap().failed,
        0,
        "the toy asserts that it has them"
    );
    // The same with and without the features of the run before, whose pixels are decoded for the pairs alone.
    for name in ["new", "from the cache"] {
        let (folder, before) = (bench.path(name), DECODED.load(Ordering::Relaxed));
        let run = Run {
            decode: counting,
            cache: FeatureCache::new(bench.path("cache")),
            ..Run::new(&bench.datasets, &bench.contenders, &folder)
        };
        run.execute(&Silent, &Cancel::default()).unwrap();
        assert_eq!(DECODED.load(Ordering::Relaxed) - before, 12 + 5, "{name}");
        assert_eq!(bench.records(name), bench.records("run"));
    }
}
