//! The parameters that every matcher has: the size of the images in which features are found, and whether matches are
//! moved to better places.

use matchbench_vision::image::Size;
use matchbench_vision::matching::{ImageSize, Refined, Resized};
use serde_json::{Value, json};

use super::{BuiltMatcher, MatcherEntry};
use crate::config::{self, ConfigError};

/// The matcher of an `entry` with the given parameters: the entry's own, see [`MatcherEntry::build`], and those
/// that all matchers have:
///
/// - With `extractor.max_size`, features are found in images reduced to at most so many pixels in width and height.
///   With `extractor.size`, such as `"640x480"`, they are found in images of that size (see [`Resized`]). Without either,
///   the images keep their size.
/// - With `refine`, matches are moved to where the pixels about their points agree best (see [`Refined`]), in the images
///   as they are.
///
/// # Errors
/// If a parameter is unknown, would do nothing, or is of another type or out of range.
pub fn build(
    entry: &dyn MatcherEntry,
    params: Option<&Value>,
) -> Result<BuiltMatcher, ConfigError> {
    let (refine, own) = take_refine(params);
    let mut built = build_resized(entry, own)?;
    match refine {
        None | Some(Value::Bool(false) | Value::Null) => {}
        Some(Value::Bool(true)) => {
            built.matcher = Box::new(Refined::new(built.matcher));
            built.params[REFINE] = Value::Bool(true);
        }
        Some(other) => {
            let reason = format!("{REFINE} is {other}, but must be true or false");
            return Err(ConfigError::new(entry.id(), reason));
        }
    }
    Ok(built)
}

/// The matcher whose features are found in images of the given size.
fn build_resized(
    entry: &dyn MatcherEntry,
    params: Option<Value>,
) -> Result<BuiltMatcher, ConfigError> {
    let (sizes, own) = take_sizes(params);
    let mut built = entry
        .build(own.as_ref())
        .map_err(|error| unknown(entry, own.as_ref()).unwrap_or(error))?;
    let refused = |reason: String| ConfigError::new(entry.id(), reason);
    let (name, given) = match &sizes[..] {
        [] => return Ok(built),
        [one] => one,
        _ => {
            let both = "`max_size` and `size` say two things of the same images; leave one out";
            return Err(refused(both.into()));
        }
    };
    let size = image_size(name, given).map_err(refused)?;
    let resized = Resized::new(built.matcher, size).map_err(|error| refused(error.to_string()))?;
    built.matcher = Box::new(resized);
    built.params["extractor"][*name] = given.clone();
    for extraction in [Some(&mut built.extraction), built.detection.as_mut()]
        .into_iter()
        .flatten()
    {
        let own = extraction.params.take();
        extraction.params = json!({*name: given, "of": own});
        if let ImageSize::Exactly(_) = size {
            extraction.revision += EXACT_SIZE_REVISION;
        }
    }
    Ok(built)
}

/// Added to the revision of an extractor for images of an exact size. It is increased when features in such images
/// are changed in another way than before.
const EXACT_SIZE_REVISION: u32 = 1;

/// Name of the parameter that says whether matches are moved to better places.
pub const REFINE: &str = "refine";

/// Names of the parameters that set the size of the images.
pub const SIZES: [&str; 2] = ["max_size", "size"];

/// The error for the first unknown parameter, of the entry or of its extractor. The error of the entry alone would not
/// list those that all matchers have.
fn unknown(entry: &dyn MatcherEntry, own: Option<&Value>) -> Option<ConfigError> {
    const EXTRACTOR: &str = "extractor";
    let (own, mut defaults) = (own?, entry.defaults());
    let of_extractor = defaults[EXTRACTOR].take();
    let first = |what, given: &Value, known: &Value, of_all: &[&'static str]| {
        let known = known.as_object().into_iter().flatten();
        let known = known.map(|(name, _)| &**name);
        let known: Vec<&str> = known.chain(of_all.iter().copied()).collect();
        let look_up = |wanted: &String| config::find(what, &known, |n| n, wanted).err();
        given.as_object()?.keys().find_map(look_up)
    };
    let of_part = || {
        let given = own.get(EXTRACTOR)?;
        first("`extractor` parameter", given, &of_extractor, &SIZES)
    };
    // `extractor` is there now, whether it was or not.
    let unknown = first("parameter", own, &defaults, &[REFINE]).or_else(of_part)?;
    let parts = (of_extractor.as_object().into_iter().flatten()).map(|(name, _)| &**name);
    let unknown = unknown.of_part(EXTRACTOR, parts.chain(SIZES));
    Some(ConfigError::new(entry.id(), unknown))
}

/// The value of a parameter of [`SIZES`].
fn image_size(name: &str, given: &Value) -> Result<ImageSize, String> {
    if name == "max_size" {
        let most = given.as_u64().and_then(|most| usize::try_from(most).ok());
        let most = most.ok_or_else(|| format!("max_size is {given}; give pixels"))?;
        return Ok(ImageSize::AtMost(most));
    }
    let sides = given.as_str().and_then(|text| text.split_once('x'));
    sides
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)))
        .map(|(width, height)| ImageSize::Exactly(Size::new(width, height)))
        .ok_or_else(|| format!("size is {given}; give width and height, for example 640x480"))
}

/// The given value of [`REFINE`], and the other parameters.
fn take_refine(params: Option<&Value>) -> (Option<Value>, Option<Value>) {
    let mut own = params.cloned();
    let object = own.as_mut().and_then(Value::as_object_mut);
    (object.and_then(|own| own.remove(REFINE)), own)
}

/// The given parameters of [`SIZES`], and the other parameters.
fn take_sizes(mut own: Option<Value>) -> (Vec<(&'static str, Value)>, Option<Value>) {
    let extractor = own.as_mut().and_then(|own| own.get_mut("extractor"));
    let Some(extractor) = extractor.and_then(Value::as_object_mut) else {
        return (Vec::new(), own);
    };
    let given = SIZES.map(|name| Some((name, extractor.remove(name)?)));
    let sizes = given
        .into_iter()
        .flatten()
        .filter(|(_, size)| !size.is_null());
    let sizes: Vec<_> = sizes.collect();
    // A matcher without this group of parameters would refuse it.
    let is_empty = extractor.is_empty();
    if let Some(own) = own.as_mut().and_then(Value::as_object_mut)
        && is_empty
    {
        own.remove("extractor");
    }
    (sizes, own)
}
