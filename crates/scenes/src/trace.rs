//! Ray casting: finds the first triangle that a ray meets, with a bounding volume hierarchy that four rays
//! traverse together.
//!
//! - Tree: binned surface area heuristic (Wald, "On fast Construction of SAH-based Bounding Volume
//!   Hierarchies", IEEE Symposium on Interactive Ray Tracing 2007).
//! - Triangle test: Moller and Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection",
//!   Journal of Graphics Tools 1997.
//!
//! The four samples of a pixel take nearly the same way through the tree. Plain loops over four lanes become
//! vector instructions on every machine, and give the same bits on all.

use nalgebra::Vector3;

/// Number of rays in a bundle.
pub(super) const LANES: usize = 4;
/// One number per ray.
pub(super) type Lanes = [f32; LANES];
/// [`Hits::triangle`] of a ray that meets nothing.
pub(super) const NOTHING: u32 = u32::MAX;

const BINS: usize = 12;
const LEAF: usize = 4;

/// A bundle of rays, with one array per coordinate. Directions have length 1.
pub(super) struct Rays {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
}

/// Where each ray of a bundle meets its nearest triangle.
pub(super) struct Hits {
    /// Distance along the ray.
    pub distance: Lanes,
    /// Weight of the triangle's second corner.
    pub u: Lanes,
    /// Weight of the triangle's third corner.
    pub v: Lanes,
    /// Index of the triangle, or [`NOTHING`].
    pub triangle: [u32; LANES],
}

impl Rays {
    pub(super) fn new(origin: [Vector3<f32>; LANES], direction: [Vector3<f32>; LANES]) -> Self {
        let lanes = |rows: &[Vector3<f32>; LANES]| [0, 1, 2].map(|k| rows.map(|row| row[k]));
        Self {
            origin: lanes(&origin),
            direction: lanes(&direction),
        }
    }
}

/// The tree over the triangles of one scene.
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// First corner and two edges, in the order of the leaves.
    triangles: Vec<[[f32; 3]; 3]>,
    /// Index in the mesh of each of `triangles`.
    ids: Vec<u32>,
}

struct Node {
    bounds: Bounds,
    /// In a leaf, its first triangle. In an inner node, its second child; the first child is the next node.
    next: u32,
    /// Number of triangles; 0 for an inner node.
    count: u16,
    /// Axis along which the children are separated.
    axis: u16,
}

#[derive(Clone, Copy)]
struct Bounds {
    low: [f32; 3],
    high: [f32; 3],
}

impl Bounds {
    const EMPTY: Self = Self {
        low: [f32::INFINITY; 3],
        high: [f32::NEG_INFINITY; 3],
    };

    fn join(&self, other: &Self) -> Self {
        Self {
            low: std::array::from_fn(|k| self.low[k].min(other.low[k])),
            high: std::array::from_fn(|k| self.high[k].max(other.high[k])),
        }
    }

    fn centre(&self, axis: usize) -> f32 {
        0.5 * (self.low[axis] + self.high[axis])
    }

    /// Half of the surface area; 0 when empty.
    fn area(&self) -> f32 {
        let [x, y, z] = std::array::from_fn(|k| (self.high[k] - self.low[k]).max(0.0));
        x * y + y * z + z * x
    }
}

impl Tree {
    /// The tree over triangles given by their corners.
    pub(super) fn new(corners: &[[Vector3<f32>; 3]]) -> Self {
        let bounds: Vec<Bounds> = corners
            .iter()
            .map(|triangle| {
                triangle.iter().fold(Bounds::EMPTY, |sum, corner| {
                    let point = [corner.x, corner.y, corner.z];
                    sum.join(&Bounds {
                        low: point,
                        high: point,
                    })
                })
            })
            .collect();
        let mut ids: Vec<u32> = (0..corners.len() as u32).collect();
        let mut nodes = Vec::with_capacity(corners.len());
        split(&mut nodes, &bounds, &mut ids, 0);
        let triangles = ids
            .iter()
            .map(|&id| {
                let [a, b, c] = corners[id as usize];
                [a, b - a, c - a].map(Into::into)
            })
            .collect();
        Self {
            nodes,
            triangles,
            ids,
        }
    }

    /// The nearest triangle that each ray meets before `limit`.
    pub(super) fn nearest(&self, rays: &Rays, limit: f32) -> Hits {
        self.walk::<false>(rays, limit)
    }

    /// Whether each ray meets anything at all.
    pub(super) fn blocked(&self, rays: &Rays) -> [bool; LANES] {
        let hits = self.walk::<true>(rays, f32::MAX);
        hits.triangle.map(|id| id != NOTHING)
    }

    /// Traverses the tree. With `ANY`, a ray ends at the first triangle found, which need not be the nearest.
    fn walk<const ANY: bool>(&self, rays: &Rays, limit: f32) -> Hits {
        let mut hits = Hits {
            distance: [limit; LANES],
            u: [0.0; LANES],
            v: [0.0; LANES],
            triangle: [NOTHING; LANES],
        };
        // A direction of exactly 0 would make 0 * infinity in the slab test.
        let inverse = rays
            .direction
            .map(|lane| lane.map(|d| 1.0 / if d.abs() < 1e-12 { 1e-12 } else { d }));
        let mut stack = [0_u32; 64];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let mut index = stack[depth] as usize;
            while enters(&self.nodes[index].bounds, rays, &inverse, &hits.distance) {
                let node = &self.nodes[index];
                if node.count > 0 {
                    let first = node.next as usize;
                    for k in first..first + usize::from(node.count) {
                        meet(&self.triangles[k], self.ids[k], rays, &mut hits);
                    }
                    if ANY {
                        for lane in (0..LANES).filter(|&lane| hits.triangle[lane] != NOTHING) {
                            hits.distance[lane] = -1.0; // enters no more boxes
                        }
                    }
                    break;
                }
                let children = (index + 1, node.next as usize);
                let forward = rays.direction[usize::from(node.axis)][0] >= 0.0;
                let (near, far) = if forward {
                    children
                } else {
                    (children.1, children.0)
                };
                stack[depth] = far as u32;
                depth += 1;
                index = near;
            }
        }
        hits
    }
}

/// Builds the subtree over `ids`, whose first triangle is number `first` in leaf order.
fn split(nodes: &mut Vec<Node>, bounds: &[Bounds], ids: &mut [u32], first: usize) {
    let of = |id: u32| &bounds[id as usize];
    let all = ids.iter().fold(Bounds::EMPTY, |sum, &id| sum.join(of(id)));
    let index = nodes.len();
    nodes.push(Node {
        bounds: all,
        next: first as u32,
        count: ids.len() as u16,
        axis: 0,
    });
    if ids.len() <= LEAF {
        return;
    }
    let (axis, place) = best_plane(bounds, ids);
    ids.sort_by_key(|&id| of(id).centre(axis) >= place);
    let middle = ids.partition_point(|&id| of(id).centre(axis) < place);
    // Triangles in exactly the same place cannot be separated, so they are divided in half.
    let middle = if middle % ids.len() == 0 {
        ids.len() / 2
    } else {
        middle
    };
    let (left, right) = ids.split_at_mut(middle);
    split(nodes, bounds, left, first);
    let second = nodes.len() as u32;
    split(nodes, bounds, right, first + middle);
    let node = &mut nodes[index];
    (node.next, node.count, node.axis) = (second, 0, axis as u16);
}

/// Axis and coordinate of the plane that minimises the expected number of triangle tests.
fn best_plane(bounds: &[Bounds], ids: &[u32]) -> (usize, f32) {
    let mut best = (f32::INFINITY, 0, 0.0);
    for axis in 0..3 {
        let centres = || ids.iter().map(|&id| bounds[id as usize].centre(axis));
        let low = centres().fold(f32::INFINITY, f32::min);
        let high = centres().fold(f32::NEG_INFINITY, f32::max);
        if low == high {
            continue;
        }
        let scale = BINS as f32 / (high - low);
        let mut bins = [(Bounds::EMPTY, 0.0_f32); BINS];
        for &id in ids {
            let triangle = &bounds[id as usize];
            let bin = (((triangle.centre(axis) - low) * scale) as usize).min(BINS - 1);
            bins[bin].0 = bins[bin].0.join(triangle);
            bins[bin].1 += 1.0;
        }
        let cost = |bins: &[(Bounds, f32)]| {
            let (joined, count) = bins.iter().fold((Bounds::EMPTY, 0.0), |(sum, n), bin| {
                (sum.join(&bin.0), n + bin.1)
            });
            joined.area() * count
        };
        for cut in 1..BINS {
            let total = cost(&bins[..cut]) + cost(&bins[cut..]);
            if total < best.0 {
                best = (total, axis, low + cut as f32 / scale);
            }
        }
    }
    (best.1, best.2)
}

/// Whether any ray passes through the box before its `limit`.
#[inline]
fn enters(bounds: &Bounds, rays: &Rays, inverse: &[Lanes; 3], limit: &Lanes) -> bool {
    let mut from = [0.0_f32; LANES];
    let mut to = *limit;
    for (axis, inverse) in inverse.iter().enumerate() {
        for lane in 0..LANES {
            let origin = rays.origin[axis][lane];
            let a = (bounds.low[axis] - origin) * inverse[lane];
            let b = (bounds.high[axis] - origin) * inverse[lane];
            from[lane] = larger(from[lane], smaller(a, b));
            to[lane] = smaller(to[lane], larger(a, b));
        }
    }
    (0..LANES).any(|lane| from[lane] <= to[lane] * (1.0 + 1e-6))
}

/// Shortens the rays that meet the triangle.
#[inline]
fn meet(triangle: &[[f32; 3]; 3], id: u32, rays: &Rays, hits: &mut Hits) {
    /// Closes the cracks between neighbouring triangles that rounding leaves.
    const SLACK: f32 = 1e-5;
    const NEAREST: f32 = 1e-4;
    let [corner, e1, e2] = triangle;
    let mut u = [0.0; LANES];
    let mut v = [0.0; LANES];
    let mut distance = [0.0; LANES];
    let mut margin = [0.0; LANES];
    for lane in 0..LANES {
        let d = [0, 1, 2].map(|k| rays.direction[k][lane]);
        let s = [0, 1, 2].map(|k| rays.origin[k][lane] - corner[k]);
        let p = cross(&d, e2);
        let q = cross(&s, e1);
        let inverse = 1.0 / dot(e1, &p);
        u[lane] = dot(&s, &p) * inverse;
        v[lane] = dot(&d, &q) * inverse;
        distance[lane] = dot(e2, &q) * inverse;
        // Not negative if all conditions below hold, or if one of them involves NaN.
        let inside = smaller(u[lane] + SLACK, v[lane] + SLACK);
        let inside = smaller(inside, 1.0 + SLACK - (u[lane] + v[lane]));
        let between = smaller(
            distance[lane] - NEAREST,
            hits.distance[lane] - distance[lane],
        );
        margin[lane] = smaller(inside, between);
    }
    // Nearly always all four rays miss; this test finds that without a branch per ray.
    if margin.iter().all(|&m| m < 0.0) {
        return;
    }
    for lane in 0..LANES {
        // A triangle seen edge on gives NaN or infinity: then a comparison fails.
        let (u, v, distance) = (u[lane], v[lane], distance[lane]);
        let inside = u >= -SLACK && v >= -SLACK && u + v <= 1.0 + SLACK;
        if inside && distance > NEAREST && distance < hits.distance[lane] {
            hits.distance[lane] = distance;
            hits.u[lane] = u;
            hits.v[lane] = v;
            hits.triangle[lane] = id;
        }
    }
}

// Unlike `f32::min` and `f32::max` these are one instruction: NaN need not be handled.
#[inline]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline]
fn cross(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline]
fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use matchbench_vision::seed::Seed;

    use super::*;

    #[test]
    fn finds_what_testing_every_triangle_finds() {
        let mut rng = Seed(3).rng();
        let mut point =
            |scale: f64| Vector3::from_fn(|_, _| (scale * (rng.uniform() - 0.5)) as f32);
        let corners: Vec<_> = (0..500)
            .map(|_| {
                let at = point(10.0);
                [at + point(1.0), at + point(1.0), at + point(1.0)]
            })
            .collect();
        let tree = Tree::new(&corners);
        let mut met = 0;
        for _ in 0..600 {
            let origin = std::array::from_fn(|_| point(14.0));
            let direction = std::array::from_fn(|_| point(1.0).normalize());
            let rays = Rays::new(origin, direction);
            let hits = tree.nearest(&rays, 100.0);
            let mut slow = Hits {
                distance: [100.0; LANES],
                u: [0.0; LANES],
                v: [0.0; LANES],
                triangle: [NOTHING; LANES],
            };
            for (triangle, &id) in tree.triangles.iter().zip(&tree.ids) {
                meet(triangle, id, &rays, &mut slow);
            }
            assert_eq!(hits.distance, slow.distance);
            met += hits.triangle.iter().filter(|&&id| id != NOTHING).count();
        }
        assert!(met > 100, "only {met} rays met anything");
    }

    #[test]
    fn the_limit_ends_a_ray() {
        let square = [[[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]].map(Vector3::from)];
        let tree = Tree::new(&square);
        let rays = Rays::new([Vector3::new(0.2, 0.2, 0.0); 4], [Vector3::z(); 4]);
        assert_eq!(tree.nearest(&rays, 10.0).distance, [5.0; 4]);
        assert_eq!(tree.nearest(&rays, 4.0).triangle, [NOTHING; 4]);
    }
}
