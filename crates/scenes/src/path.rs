//! How the camera moves: smoothly through stations, with the shaking of a hand.

use matchbench_vision::seed::Seed;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Where the camera is, what it looks at and how it is turned around that direction.
#[derive(Clone, Copy)]
pub(super) struct Station {
    eye: [f64; 3],
    target: [f64; 3],
    roll: f64,
}

impl Station {
    /// A camera at `eye`, in metres, with `target` in the middle of the image.
    pub(super) const fn new(eye: [f64; 3], target: [f64; 3]) -> Self {
        Self {
            eye,
            target,
            roll: 0.0,
        }
    }

    /// The same with the camera turned clockwise by `roll` radians, as its holder sees it.
    pub(super) const fn rolled(self, roll: f64) -> Self {
        Self { roll, ..self }
    }
}

/// A path through stations at one station per second, before shaking is added.
pub(super) struct Path {
    pub stations: &'static [Station],
    /// Amplitude of the shaking: metres, and radians.
    pub shake: [f64; 2],
    pub seed: u64,
}

impl Path {
    /// Pose of the camera (x right, y down, z forward) at `time` seconds.
    pub(super) fn world_from_camera(&self, time: f64) -> Isometry3<f64> {
        let eye = Point3::from(self.along(time, |station| station.eye));
        let target = Point3::from(self.along(time, |station| station.target));
        let forward = (target - eye).normalize();
        let right = forward.cross(&Vector3::z()).normalize();
        let down = forward.cross(&right);
        let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
        let steady = Isometry3::from_parts(
            Translation3::from(eye),
            UnitQuaternion::from_rotation_matrix(&axes),
        );
        let roll = self.along(time, |station| [station.roll, 0.0, 0.0]).x;
        // To turn by zero could change the sign of a zero.
        let steady = if roll == 0.0 {
            steady
        } else {
            steady * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll)
        };
        let seed = Seed(self.seed);
        steady
            * Isometry3::new(
                tremble(time, seed.child("position")) * self.shake[0],
                tremble(time, seed.child("rotation")) * self.shake[1],
            )
    }

    /// Catmull-Rom spline through one property of the stations.
    fn along(&self, time: f64, part: impl Fn(&Station) -> [f64; 3]) -> Vector3<f64> {
        let last = self.stations.len() as i64 - 1;
        let leg = time.floor().clamp(0.0, (last - 1) as f64);
        let t = time - leg;
        let at = |k: i64| {
            let index = (leg as i64 + k).clamp(0, last);
            Vector3::from(part(&self.stations[index as usize]))
        };
        let (p0, p1, p2, p3) = (at(-1), at(0), at(1), at(2));
        let cubic = (p1 - p2) * 3.0 + p3 - p0;
        let square = p0 * 2.0 - p1 * 5.0 + p2 * 4.0 - p3;
        p1 + ((p2 - p0) + (square + cubic * t) * t) * (0.5 * t)
    }
}

/// The tremor of a hand: slow swaying and a little fast trembling, about in [-1, 1] per axis.
fn tremble(time: f64, seed: Seed) -> Vector3<f64> {
    let mut rng = seed.rng();
    Vector3::from_fn(|_, _| {
        [(0.9, 0.6), (2.3, 0.3), (5.7, 0.12), (11.0, 0.04)]
            .iter()
            .map(|(hertz, amplitude)| {
                let hertz = hertz * (0.8 + 0.4 * rng.uniform());
                let turns = hertz * time + rng.uniform();
                amplitude * libm::sin(std::f64::consts::TAU * turns)
            })
            .sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_its_stations_and_looks_at_their_targets() {
        const PATH: Path = Path {
            stations: &[
                Station::new([0.0, 0.0, 1.0], [5.0, 1.0, 0.5]),
                Station::new([1.0, 0.5, 1.2], [5.0, 0.0, 0.5]),
                Station::new([2.0, 0.0, 1.0], [5.0, 1.0, 0.5]),
            ],
            shake: [0.0, 0.0],
            seed: 0,
        };
        for (second, station) in PATH.stations.iter().enumerate() {
            let pose = PATH.world_from_camera(second as f64);
            assert!((pose.translation.vector - Vector3::from(station.eye)).norm() < 1e-12);
            let seen = pose.inverse() * Point3::from(station.target);
            assert!(seen.x.abs() < 1e-12 && seen.y.abs() < 1e-12 && seen.z > 0.0);
            let up = pose.inverse() * Vector3::z();
            assert!(up.y < 0.0, "up in the world is up in the image");
        }
    }

    #[test]
    fn a_camera_that_is_turned_clockwise_sees_up_on_its_left() {
        const PATH: Path = Path {
            stations: &[
                Station::new([0.0, 0.0, 1.0], [5.0, 0.0, 1.0]),
                Station::new([0.0, 0.0, 1.0], [5.0, 0.0, 1.0]).rolled(0.5),
            ],
            shake: [0.0, 0.0],
            seed: 0,
        };
        let up = PATH.world_from_camera(1.0).inverse() * Vector3::z();
        let expected = Vector3::new(-libm::sin(0.5), -libm::cos(0.5), 0.0);
        assert!((up - expected).norm() < 1e-12, "{up}");
    }
}
