//! Steps 1 and 2 of BRISK: the layers of the scale space, their FAST scores, and the maxima among them.
//!
//! [`ScaleLayers::corners`] finds the pixels that are maxima in their own layer. [`ScaleLayers::refine`]
//! compares one with the square around the same place in the layers above and below, and fits quadratics to
//! find its place and scale.

use super::refine::{FIRST, INTRA_OCTAVE, OCTAVE, quadratic_maximum};
use crate::image::{GrayImage, Size, shrink_u8};
use crate::simd::{segment_scores, weak_maxima};

/// Octaves (even) and intra-octaves (odd), from fine to coarse.
pub(super) struct ScaleLayers {
    layers: Vec<Layer>,
}

struct Layer {
    image: GrayImage,
    /// FAST scores of all pixels, 0 where there is none.
    scores: GrayImage,
    /// Pixel `x` of this layer is taken for `scale * x + offset` of the image.
    scale: f32,
    offset: f32,
}

/// A maximum of the score over place and scale, in pixels of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Maximum {
    pub x: f32,
    pub y: f32,
    pub scale: f32,
    pub score: f32,
}

/// A maximum in a neighbouring layer, relative to the pixel it was sought from.
#[derive(Clone, Copy)]
struct Neighbour {
    score: f32,
    dx: f32,
    dy: f32,
}

/// From a pixel `x` of one layer to the square around the same place in a neighbouring layer,
/// `(times x + plus -+ half) / over`, and back, `(back[0] u + back[1]) / back[2]`.
struct Step {
    times: i32,
    plus: i32,
    half: i32,
    over: f32,
    back: [f64; 3],
}

const OCTAVE_UP: Step = Step {
    times: 4,
    plus: -1,
    half: 2,
    over: 6.0,
    back: [6.0, 1.0, 4.0],
};
const INTRA_UP: Step = Step {
    times: 6,
    plus: -1,
    half: 3,
    over: 8.0,
    back: [8.0, 1.0, 6.0],
};
// The way back that would undo the way there has -1; OpenCV has +1, a quarter of a pixel further.
const OCTAVE_DOWN: Step = Step {
    times: 8,
    plus: 1,
    half: 4,
    over: 6.0,
    back: [6.0, 1.0, 8.0],
};
const INTRA_DOWN: Step = Step {
    times: 6,
    plus: 1,
    half: 3,
    over: 4.0,
    back: [4.0, -1.0, 6.0],
};

/// Row by row, so that the first four come before the pixel itself.
const NEIGHBOURS: [[i32; 2]; 8] = [
    [-1, -1],
    [0, -1],
    [1, -1],
    [-1, 0],
    [1, 0],
    [-1, 1],
    [0, 1],
    [1, 1],
];

impl ScaleLayers {
    pub(super) fn new(image: &GrayImage, octaves: usize) -> Self {
        let mut layers = vec![Layer::new(image.clone(), 1.0)];
        let two_thirds = Size::new(2 * (image.width() / 3), 2 * (image.height() / 3));
        layers.push(Layer::new(shrink_u8(image, two_thirds), 1.5));
        for i in 2..2 * octaves {
            let larger = &layers[i - 2];
            let half = Size::new(larger.image.width() / 2, larger.image.height() / 2);
            layers.push(Layer::new(
                shrink_u8(&larger.image, half),
                2.0 * larger.scale,
            ));
        }
        Self { layers }
    }

    pub(super) fn len(&self) -> usize {
        self.layers.len()
    }

    /// Pixels of a layer that score at least `threshold` and not less than their neighbours.
    pub(super) fn corners(&self, index: usize, threshold: u8) -> Vec<[i32; 2]> {
        let scores = &self.layers[index].scores;
        let mut corners = Vec::new();
        let mut columns = Vec::new();
        for y in 3..scores.height().max(6) - 3 {
            let rows = [scores.row(y - 1), scores.row(y), scores.row(y + 1)];
            columns.clear();
            weak_maxima(rows, threshold, &mut columns);
            let places = columns.iter().map(|&x| [x as i32, y as i32]);
            corners.extend(places.filter(|&[x, y]| self.layers[index].wins_ties(x, y, threshold)));
        }
        corners
    }

    /// The maximum over place and scale near pixel (x, y) of a layer; `None` if a neighbouring
    /// layer scores higher there.
    pub(super) fn refine(&self, index: usize, x: i32, y: i32) -> Option<Maximum> {
        let layer = &self.layers[index];
        let is_octave = index.is_multiple_of(2);
        let centre = layer.score(x, y);
        let above = match self.layers.get(index + 1) {
            Some(above) => {
                let step = if is_octave { OCTAVE_UP } else { INTRA_UP };
                Some(above.maximum_near([x, y], &step, centre, false)?)
            }
            None => None,
        };
        let below = match index.checked_sub(1) {
            Some(below) => {
                let step = if is_octave { OCTAVE_DOWN } else { INTRA_DOWN };
                self.layers[below].maximum_near([x, y], &step, centre, true)?
            }
            None => layer.guess_below(x, y),
        };
        let [score, dx, dy] = quadratic_maximum(layer.scores_around(x, y));
        let Some(above) = above else {
            return Some(layer.in_image(x, y, [dx, dy], 1.0, score));
        };
        let fit = match index {
            0 => FIRST,
            _ if is_octave => OCTAVE,
            _ => INTRA_OCTAVE,
        };
        let here = score.max(centre as f32);
        let [scale, score] = fit.maximum(below.score, here, above.score);
        // The place is interpolated between this layer and the one that the scale leans to.
        let (towards, here) = match (scale > 1.0, index) {
            (true, _) if is_octave => (above, (1.5 - scale) / 0.5),
            (true, _) => (above, 4.0 - scale * 3.0),
            (false, 0) => (below, (scale - 0.5) / 0.5),
            (false, _) if is_octave => (below, (scale - 0.75) / 0.25),
            (false, _) => (below, scale * 3.0 - 2.0),
        };
        let there = 1.0 - here;
        let offset = [
            here * dx + there * towards.dx,
            here * dy + there * towards.dy,
        ];
        Some(layer.in_image(x, y, offset, scale, score))
    }
}

/// Along one axis the two ends of a square in another layer and the whole pixels between them.
struct Samples {
    start: f32,
    end: f32,
    count: i32,
}

impl Samples {
    /// Those of the square around the place of pixel `v`.
    fn of(v: i32, step: &Step) -> Self {
        let at = |half: i32| (step.times * v + step.plus + half) as f32 / step.over;
        let (start, end) = (at(-step.half), at(step.half));
        Self {
            start,
            end,
            count: 2 + end as i32 - start as i32,
        }
    }

    /// A place, and the pixel that stands for it.
    fn at(&self, i: i32) -> (f32, i32) {
        let pixel = self.start as i32 + i.max(1);
        match i {
            0 => (self.start, pixel),
            _ if self.is_inner(i) => (pixel as f32, pixel),
            _ => (self.end, self.end as i32),
        }
    }

    fn is_inner(&self, i: i32) -> bool {
        0 < i && i + 1 < self.count
    }
}

impl Layer {
    fn new(image: GrayImage, scale: f32) -> Self {
        let mut scores = GrayImage::filled(image.size(), 0);
        for y in 3..image.height().max(6) - 3 {
            let around = std::array::from_fn(|i| image.row(y + i - 3));
            segment_scores(around, 1, scores.row_mut(y));
        }
        Self {
            image,
            scores,
            scale,
            offset: 0.5 * scale - 0.5,
        }
    }

    /// The score of a pixel; 0 outside.
    fn score(&self, x: i32, y: i32) -> i32 {
        let inside = |v: i32, length: usize| v >= 0 && (v as usize) < length;
        if inside(x, self.scores.width()) && inside(y, self.scores.height()) {
            i32::from(self.scores.at(x as usize, y as usize))
        } else {
            0
        }
    }

    /// The score between pixels, bilinear and cut off to a whole number.
    fn score_between(&self, x: f32, y: f32) -> i32 {
        let (left, top) = (x as i32, y as i32);
        let (right_share, lower_share) = (x - left as f32, y - top as f32);
        let (left_share, upper_share) = (1.0 - right_share, 1.0 - lower_share);
        let score = |dx, dy| self.score(left + dx, top + dy) as f32;
        let upper =
            left_share * upper_share * score(0, 0) + right_share * upper_share * score(1, 0);
        let lower = left_share * lower_share * score(0, 1);
        (upper + lower + right_share * lower_share * score(1, 1)) as u8 as i32
    }

    fn scores_around(&self, x: i32, y: i32) -> [[i32; 3]; 3] {
        let row = |y| [self.score(x - 1, y), self.score(x, y), self.score(x + 1, y)];
        [row(y - 1), row(y), row(y + 1)]
    }

    /// Whether of the neighbours with the same score none scores higher after smoothing, and no
    /// earlier one as high.
    fn wins_ties(&self, x: i32, y: i32, threshold: u8) -> bool {
        let centre = self.score(x, y);
        let smooth = |x: i32, y: i32| -> i32 {
            let mut sum = 0;
            for (dy, weight_y) in [(-1, 1), (0, 2), (1, 1)] {
                for (dx, weight_x) in [(-1, 1), (0, 2), (1, 1)] {
                    let score = self.score(x + dx, y + dy);
                    if score >= i32::from(threshold) {
                        sum += weight_x * weight_y * score;
                    }
                }
            }
            sum
        };
        let around = self.scores_around(x, y);
        if around
            .as_flattened()
            .iter()
            .filter(|&&score| score == centre)
            .count()
            == 1
        {
            return true;
        }
        let here = smooth(x, y);
        NEIGHBOURS.iter().enumerate().all(|(i, [dx, dy])| {
            let (x, y) = (x + dx, y + dy);
            let is_earlier = i < 4;
            self.score(x, y) != centre || smooth(x, y) < here + i32::from(!is_earlier)
        })
    }

    /// The maximum of this layer in the square around the place of a pixel of a neighbouring
    /// layer; `None` if it is higher than `centre`, the score of that pixel. `ties` says whether
    /// equal scores are told apart by those around them.
    fn maximum_near(
        &self,
        pixel: [i32; 2],
        step: &Step,
        centre: i32,
        ties: bool,
    ) -> Option<Neighbour> {
        let columns = Samples::of(pixel[0], step);
        let rows = Samples::of(pixel[1], step);
        let mut most = -1;
        let mut best = [0, 0];
        for row in 0..rows.count {
            let (y, pixel_y) = rows.at(row);
            for column in 0..columns.count {
                let (x, pixel_x) = columns.at(column);
                let score = self.score_between(x, y);
                // The last row cannot exclude the pixel.
                if score > centre && row + 1 < rows.count {
                    return None;
                }
                let is_pixel = rows.is_inner(row) && columns.is_inner(column);
                let wins_tie = || self.ring(pixel_x, pixel_y) > self.ring(best[0], best[1]);
                if score > most || (ties && is_pixel && score == most && wins_tie()) {
                    // The first row stands for the second.
                    best = [pixel_x, pixel_y];
                    most = score;
                }
            }
        }
        let [refined, dx, dy] = quadratic_maximum(self.scores_around(best[0], best[1]));
        let back = |whole: i32, part: f32, from: i32| {
            let at = f64::from(whole as f32 + part);
            ((at * step.back[0] + step.back[1]) / step.back[2]) as f32 - from as f32
        };
        let dx = back(best[0], dx, pixel[0]);
        let dy = back(best[1], dy, pixel[1]);
        let is_near = dx.abs() <= 1.0 && dy.abs() <= 1.0;
        let most = most as f32;
        Some(Neighbour {
            score: if is_near { refined.max(most) } else { most },
            dx: dx.clamp(-1.0, 1.0),
            dy: dy.clamp(-1.0, 1.0),
        })
    }

    /// Weighted sum of the scores around a pixel.
    fn ring(&self, x: i32, y: i32) -> i32 {
        let s = self.scores_around(x, y);
        2 * (s[0][1] + s[1][0] + s[1][2] + s[2][1]) + s[0][0] + s[0][2] + s[2][0] + s[2][2]
    }

    /// Stands for the layer below the first: scores of the segment test on the eight neighbours
    /// of a pixel, five in a row.
    fn guess_below(&self, x: i32, y: i32) -> Neighbour {
        let scores = [y - 1, y, y + 1].map(|y| [x - 1, x, x + 1].map(|x| self.small_score(x, y)));
        let [_, dx, dy] = quadratic_maximum(scores);
        let most = scores.as_flattened().iter().max().copied().unwrap_or(0);
        Neighbour {
            score: most as f32,
            dx,
            dy,
        }
    }

    /// The FAST score on the circle of radius 1; 0 nearer than two pixels to the border.
    fn small_score(&self, x: i32, y: i32) -> i32 {
        const CIRCLE: [[i32; 2]; 8] = [
            [-1, 0],
            [-1, -1],
            [0, -1],
            [1, -1],
            [1, 0],
            [1, 1],
            [0, 1],
            [-1, 1],
        ];
        let inside = |v: i32, length: usize| v >= 2 && v < length as i32 - 2;
        if !inside(x, self.image.width()) || !inside(y, self.image.height()) {
            return 0;
        }
        let pixel = |x: i32, y: i32| i32::from(self.image.at(x as usize, y as usize));
        let centre = pixel(x, y);
        let differences = CIRCLE.map(|[dx, dy]| pixel(x + dx, y + dy) - centre);
        let mut most = 1;
        for start in 0..8 {
            let arc: [i32; 5] = std::array::from_fn(|k| differences[(start + k) % 8]);
            let [mut low, mut high] = [arc[0], arc[0]];
            for difference in arc {
                low = low.min(difference);
                high = high.max(difference);
            }
            most = most.max(low).max(-high);
        }
        most - 1
    }

    /// A place and scale relative to a pixel of this layer, in those of the image.
    fn in_image(&self, x: i32, y: i32, offset: [f32; 2], scale: f32, score: f32) -> Maximum {
        let to_image = |whole: i32, part: f32| (part + whole as f32) * self.scale + self.offset;
        Maximum {
            x: to_image(x, offset[0]),
            y: to_image(y, offset[1]),
            scale: scale * self.scale,
            score,
        }
    }
}
