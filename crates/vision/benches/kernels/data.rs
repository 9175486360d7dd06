//! What the benchmarks work on, all drawn from seeds, and the answers by definition.

use matchbench_vision::features::{BinaryRows, Descriptors, FloatRows};
use matchbench_vision::geometry::{Camera, MatchedPoints};
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::matching::Correspondence;
use matchbench_vision::nalgebra::{Point2, Point3, Rotation3, Vector2, Vector3};
use matchbench_vision::seed::Seed;

/// Boxes and blobs of all sizes over each other, and noise.
pub(crate) fn texture(size: Size) -> GrayImage {
    let mut rng = Seed(23).rng();
    let mut image = GrayImage::filled(size, 128);
    for _ in 0..1500 {
        let side = (3.0 / (0.02 + rng.uniform())) as usize;
        let (x, y) = (rng.below(size.width as u32), rng.below(size.height as u32));
        let (grey, round) = (rng.below(256) as u8, rng.below(2) == 0);
        for dy in 0..side.min(size.height - y as usize) {
            for dx in 0..side.min(size.width - x as usize) {
                let from_middle = [dx, dy].map(|v| 2.0 * v as f64 / side as f64 - 1.0);
                if !round || from_middle[0].hypot(from_middle[1]) <= 1.0 {
                    image.set(x as usize + dx, y as usize + dy, grey);
                }
            }
        }
    }
    image.map(|&grey| grey.saturating_add(rng.below(9) as u8))
}

/// Two sets of random bits, of which each row of the first is near to one of the second.
pub(crate) fn bits(length: usize, rows: usize) -> [Descriptors; 2] {
    let mut rng = Seed(24).rng();
    let mut word = || u64::from(rng.next_u32()) << 32 | u64::from(rng.next_u32());
    let b: Vec<u64> = (0..rows * length / 64).map(|_| word()).collect();
    let a = b.iter().map(|b| b ^ (word() & word() & word())).collect();
    [a, b].map(|data| Descriptors::Binary(BinaryRows::from_vec(length, data)))
}

/// Two sets of rows of bytes, of which each row of the first is near to one of the second.
pub(crate) fn values(dim: usize, rows: usize) -> [Descriptors; 2] {
    let mut rng = Seed(25).rng();
    let mut draw = |width: f64| (width * rng.uniform()).floor() as f32;
    let b: Vec<f32> = (0..rows * dim).map(|_| draw(150.0)).collect();
    let a = b.iter().map(|b| b + draw(40.0)).collect();
    [a, b].map(|data| Descriptors::Float(FloatRows::from_vec(dim, data)))
}

/// The definition of a search, for one row of `a`.
pub(crate) fn defined(a: &Descriptors, b: &Descriptors, row: u32) -> Correspondence {
    let distances: Vec<f32> = match (a, b) {
        (Descriptors::Binary(a), Descriptors::Binary(b)) => (0..b.len())
            .map(|i| {
                let words = a.row(row as usize).iter().zip(b.row(i));
                words.map(|(a, b)| (a ^ b).count_ones()).sum::<u32>() as f32
            })
            .collect(),
        (Descriptors::Float(a), Descriptors::Float(b)) => (0..b.len())
            .map(|i| {
                let values = a.row(row as usize).iter().zip(b.row(i));
                values
                    .fold(0.0_f32, |sum, (a, b)| (a - b).mul_add(a - b, sum))
                    .sqrt()
            })
            .collect(),
        _ => unreachable!("both are of one kind"),
    };
    let mut order: Vec<usize> = (0..distances.len()).collect();
    order.sort_by(|&i, &j| distances[i].total_cmp(&distances[j]));
    Correspondence {
        a: row,
        b: order[0] as u32,
        distance: distances[order[0]],
        second: distances[order[1]],
    }
}

/// Matches of a scene that is seen from two places by one camera: three quarters right to a pixel, the
/// others wrong.
pub(crate) fn two_views(matches: usize) -> (MatchedPoints, Camera) {
    let camera = Camera::pinhole(600.0, 600.0, 319.5, 239.5);
    let mut rng = Seed(26).rng();
    let turn = Rotation3::from_euler_angles(0.05, -0.2, 0.03);
    let step = Vector3::new(1.0, 0.1, 0.2);
    let mut points = MatchedPoints::new(Vec::new(), Vec::new(), Vec::new());
    let pixel = |p: Point3<f64>, noise: [f64; 2]| {
        camera.project(Point2::new(p.x / p.z, p.y / p.z)) + Vector2::from(noise)
    };
    for number in 0..matches {
        let mut wide = |width: f64| width * (rng.uniform() - 0.5);
        let depth = 8.0 + wide(8.0);
        let place = Point3::new(wide(depth), wide(0.8 * depth), depth);
        let noise = [wide(1.0), wide(1.0)];
        let a = pixel(place, noise);
        let b = if number % 4 == 3 {
            Point2::new(320.0 + wide(640.0), 240.0 + wide(480.0))
        } else {
            pixel(turn * place + step, [wide(1.0), wide(1.0)])
        };
        points.push(a, b, (number % 4 + 1) as f32 / 5.0);
    }
    (points, camera)
}
