//! Matched points of two views, one array per coordinate.

use std::borrow::Cow;

use nalgebra::Point2;

use super::Covariances;

/// Matched points: point `i` of `a` and point `i` of `b` are assumed to show the same scene point. They are at depth 1
/// (see [`Camera::normalize`](super::Camera::normalize)) wherever poses and essential matrices are concerned, and in
/// pixels ([`MatchedPoints::in_pixels`](super::MatchedPoints::in_pixels)) or at depth 1 for homographies and fundamental
/// matrices, whose unit is that of the points. Each coordinate has its own array, so that kernels can read several
/// matches at once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointPairs {
    /// x in view `a`.
    pub a_x: Vec<f64>,
    /// y in view `a`.
    pub a_y: Vec<f64>,
    /// x in view `b`.
    pub b_x: Vec<f64>,
    /// y in view `b`.
    pub b_y: Vec<f64>,
    /// The covariances of image noise at the points; `None` if the noise is the same everywhere.
    pub covariances: Option<Covariances>,
}

impl PointPairs {
    /// Number of matches.
    pub fn len(&self) -> usize {
        self.a_x.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.a_x.is_empty()
    }

    /// Match number `index`: its point in `a` and its point in `b`.
    ///
    /// # Panics
    /// If there is no such match.
    pub fn get(&self, index: usize) -> (Point2<f64>, Point2<f64>) {
        (
            Point2::new(self.a_x[index], self.a_y[index]),
            Point2::new(self.b_x[index], self.b_y[index]),
        )
    }

    /// The matches, each as its point in `a` and its point in `b`.
    pub fn iter(&self) -> impl Iterator<Item = (Point2<f64>, Point2<f64>)> + '_ {
        (0..self.len()).map(|index| self.get(index))
    }

    /// The matches as if the noise were the same everywhere.
    pub(crate) fn without_covariances(&self) -> Cow<'_, Self> {
        match self.covariances {
            None => Cow::Borrowed(self),
            Some(_) => Cow::Owned(Self {
                a_x: self.a_x.clone(),
                a_y: self.a_y.clone(),
                b_x: self.b_x.clone(),
                b_y: self.b_y.clone(),
                covariances: None,
            }),
        }
    }

    /// The matches with these numbers, in the order of the numbers, with their covariances.
    ///
    /// # Panics
    /// If there is no such match.
    #[must_use]
    pub fn chosen(&self, indices: &[u32]) -> Self {
        let chosen = |values: &[f64]| indices.iter().map(|&i| values[i as usize]).collect();
        Self {
            a_x: chosen(&self.a_x),
            a_y: chosen(&self.a_y),
            b_x: chosen(&self.b_x),
            b_y: chosen(&self.b_y),
            covariances: self.covariances.as_ref().map(|covariances| Covariances {
                a: covariances.a.each_ref().map(|entry| chosen(entry)),
                b: covariances.b.each_ref().map(|entry| chosen(entry)),
            }),
        }
    }
}

impl FromIterator<(Point2<f64>, Point2<f64>)> for PointPairs {
    fn from_iter<I: IntoIterator<Item = (Point2<f64>, Point2<f64>)>>(pairs: I) -> Self {
        let mut all = Self::default();
        for (a, b) in pairs {
            all.a_x.push(a.x);
            all.a_y.push(a.y);
            all.b_x.push(b.x);
            all.b_y.push(b.y);
        }
        all
    }
}
