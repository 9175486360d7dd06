//! Places names beside dots so that none covers another: each name takes the nearest free place.

use super::width_of;

/// Left, top, right and bottom.
type Area = [f64; 4];

/// Height of a line of text above and below its baseline.
const ASCENT: f64 = 9.0;
const DESCENT: f64 = 2.0;
/// How far a name may be from its dot. From the third distance on, a line leads to it.
const DISTANCES: [f64; 9] = [7.0, 14.0, 24.0, 36.0, 50.0, 66.0, 84.0, 104.0, 130.0];
/// Directions to try, right and left before up and down.
const WAYS: [(f64, f64); 10] = [
    (1.0, 0.0),
    (-1.0, 0.0),
    (0.8, -0.6),
    (0.8, 0.6),
    (-0.8, -0.6),
    (-0.8, 0.6),
    (0.3, -0.95),
    (0.3, 0.95),
    (-0.3, -0.95),
    (-0.3, 0.95),
];

/// The areas that are occupied.
pub(super) struct Labels {
    within: Area,
    taken: Vec<Area>,
    /// Areas that a name should not cover if there is another place.
    thin: Vec<Area>,
}

/// The place of a name.
pub(super) struct Label {
    /// Left end of its baseline.
    pub(super) at: (f64, f64),
    /// End of the line that leads to it, if it needs one.
    pub(super) leader: Option<(f64, f64)>,
}

impl Labels {
    /// For dots at these places.
    pub(super) fn new(within: Area, dots: impl Iterator<Item = (f64, f64)>) -> Self {
        Self {
            within,
            taken: dots
                .map(|(x, y)| [x - 4.0, y - 4.0, x + 4.0, y + 4.0])
                .collect(),
            thin: Vec::new(),
        }
    }

    /// Adds a line along an axis. Names leave it free if they can.
    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64)) {
        self.thin.push([
            from.0.min(to.0) - 1.0,
            from.1.min(to.1) - 1.0,
            from.0.max(to.0) + 1.0,
            from.1.max(to.1) + 1.0,
        ]);
    }

    /// The nearest free place for the name of a dot; `None` where there is no room.
    pub(super) fn place(&mut self, dot: (f64, f64), name: &str) -> Option<Label> {
        let width = width_of(std::iter::once(name));
        let places = || DISTANCES.iter().flat_map(|&d| WAYS.map(|way| (d, way)));
        let area = |(distance, (dx, dy)): (f64, (f64, f64))| {
            let (x, y) = (dot.0 + distance * dx, dot.1 + distance * dy);
            let left = if dx > 0.0 { x } else { x - width };
            let middle = (ASCENT - DESCENT) / 2.0;
            [
                left,
                y + middle - ASCENT,
                left + width,
                y + middle + DESCENT,
            ]
        };
        let inside = |label: &Area| {
            let [left, top, right, bottom] = self.within;
            label[0] > left && label[1] > top && label[2] < right && label[3] < bottom
        };
        let covers = |label: &Area, areas: &[Area]| areas.iter().any(|a| overlap(*label, *a));
        let crossed = |label: &Area| {
            let end = nearest(*label, dot);
            let mut others = self.taken.iter().filter(|area| !contains(**area, dot));
            others.any(|area| crosses(*area, dot, end))
        };
        let possible = || {
            places().filter(|place| {
                let label = area(*place);
                inside(&label) && !covers(&label, &self.taken)
            })
        };
        // Over a line is better than far away behind others, and that is better than no label.
        let found = possible()
            .find(|place| !covers(&area(*place), &self.thin) && !crossed(&area(*place)))
            .or_else(|| possible().find(|place| !crossed(&area(*place))))
            .or_else(|| possible().next())?;
        let label = area(found);
        self.taken.push(label);
        Some(Label {
            at: (label[0], label[3] - DESCENT),
            leader: (found.0 > DISTANCES[1]).then(|| nearest(label, dot)),
        })
    }
}

fn overlap(one: Area, other: Area) -> bool {
    one[0] < other[2] && other[0] < one[2] && one[1] < other[3] && other[1] < one[3]
}

fn contains(area: Area, (x, y): (f64, f64)) -> bool {
    area[0] <= x && x <= area[2] && area[1] <= y && y <= area[3]
}

/// The point of an area that is nearest to another.
fn nearest(area: Area, (x, y): (f64, f64)) -> (f64, f64) {
    (x.clamp(area[0], area[2]), y.clamp(area[1], area[3]))
}

/// Whether a line goes through an area, tested at a few of its points.
fn crosses(area: Area, from: (f64, f64), to: (f64, f64)) -> bool {
    const POINTS: usize = 24;
    (0..=POINTS).any(|i| {
        let t = i as f64 / POINTS as f64;
        contains(
            area,
            (from.0 + t * (to.0 - from.0), from.1 + t * (to.1 - from.1)),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLOT: Area = [0.0, 0.0, 470.0, 270.0];

    #[test]
    fn names_of_a_crowd_do_not_cover_each_other() {
        // Nineteen matchers within a few pixels of another, as on an easy dataset.
        let dots: Vec<_> = (0..19_u32)
            .map(|i| (220.0 + f64::from(i * 7 % 40), 8.0 + f64::from(i * 5 % 30)))
            .collect();
        let mut labels = Labels::new(PLOT, dots.iter().copied());
        let placed = (dots.iter())
            .filter(|dot| labels.place(**dot, "freak-sift").is_some())
            .count();
        assert_eq!(placed, 19);
        let names = &labels.taken[dots.len()..];
        for (i, one) in names.iter().enumerate() {
            assert!(one[0] >= 0.0 && one[1] >= 0.0 && one[2] <= 470.0 && one[3] <= 270.0);
            assert!(!names[i + 1..].iter().any(|other| overlap(*one, *other)));
        }
    }

    #[test]
    fn a_lonely_name_stands_beside_its_dot() {
        let mut labels = Labels::new(PLOT, [(100.0, 100.0)].into_iter());
        let label = labels.place((100.0, 100.0), "sift").expect("there is room");
        assert_eq!((label.at.0, label.leader), (107.0, None));
    }

    #[test]
    fn lines_are_left_free_where_there_is_another_place() {
        let mut labels = Labels::new(PLOT, [(100.0, 100.0)].into_iter());
        labels.line((110.0, 250.0), (110.0, 50.0));
        let label = labels.place((100.0, 100.0), "sift").expect("there is room");
        assert!(label.at.0 < 100.0, "{:?}", label.at);
        // Nowhere is free of it: over a line is better than nowhere.
        let mut labels = Labels::new(PLOT, [(100.0, 100.0)].into_iter());
        labels.line((0.0, 0.0), (470.0, 270.0));
        assert!(labels.place((100.0, 100.0), "sift").is_some());
    }
}
