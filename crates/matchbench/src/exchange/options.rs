//! The options by which users describe files of matches, where the files do not describe themselves.

use std::collections::BTreeMap;
use std::path::Path;

use super::{ExchangeError, Format};
use crate::config::UnknownName;
use crate::front_door::{PIXEL_CENTER, RESIZED, VERIFIED};
use crate::matchers::MatchesFrom;

/// Where the centre of the first pixel may be.
pub(crate) const CENTERS: [f64; 2] = [0.0, 0.5];

/// How files are to be read, where they do not say it themselves.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// The format; recognised by its content if absent.
    pub format: Option<&'static Format>,
    /// Where the centre of the first pixel is, 0 or 0.5; the format's convention if absent.
    pub pixel_center: Option<f64>,
    /// Width and height of the images that the points belong to, if they were resized.
    pub resized: Option<[u32; 2]>,
    /// Read the matches that the tool verified (COLMAP's two-view geometries).
    pub verified: bool,
    /// What is to be remembered with the matches.
    pub notes: BTreeMap<String, String>,
}

impl ReadOptions {
    /// As matches were asked for.
    ///
    /// # Errors
    /// If there is no such format.
    pub fn of(asked: &MatchesFrom) -> Result<Self, UnknownName> {
        Ok(Self {
            format: asked.format.as_deref().map(Format::find).transpose()?,
            pixel_center: asked.pixel_center,
            resized: asked.resized,
            verified: asked.verified,
            notes: asked.notes.clone(),
        })
    }

    /// Where the centre of the first pixel is in `file`, which is of `format`.
    ///
    /// # Errors
    /// If the options do not fit the format, or leave out what it does not say itself.
    pub(super) fn center_in(&self, file: &Path, format: &Format) -> Result<f64, ExchangeError> {
        let error = |what: String, remedy: String| Err(ExchangeError::new(file, what, remedy));
        if self.verified && format.id != "colmap" {
            let what = format!("`{}` has no verified matches", format.id);
            return error(what, format!("leave {VERIFIED} out"));
        }
        if format.resized && self.resized.is_none() {
            let what = format!("points of `{}` are those of resized images", format.id);
            return error(
                what,
                format!(
                    "say {}, the size that they were resized to",
                    RESIZED.with("WxH")
                ),
            );
        }
        if self.resized.is_some_and(|size| size.contains(&0)) {
            let remedy = format!("say {}", RESIZED.with("WxH"));
            return error("a resized image has no pixels".into(), remedy);
        }
        match self.pixel_center.or(format.pixel_center) {
            Some(center) if CENTERS.contains(&center) => Ok(center),
            Some(center) => error(
                format!("the centre of the first pixel cannot be at {center}"),
                format!("say {} or 0.5", PIXEL_CENTER.with("0")),
            ),
            None => error(
                format!(
                    "`{}` has no convention for the centre of the first pixel",
                    format.id
                ),
                format!(
                    "say {} (as OpenCV, numpy indices) or 0.5 (as COLMAP)",
                    PIXEL_CENTER.with("0")
                ),
            ),
        }
    }
}
