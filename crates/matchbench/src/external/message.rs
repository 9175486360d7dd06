//! The lines of protocol 1, as both sides write them; the header of `external` shows them.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The protocol that is spoken here.
pub(super) const PROTOCOL: u32 = 1;

/// What the host writes.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum Request<'a> {
    /// First of all.
    Hello {
        protocol: u32,
        params: &'a Map<String, Value>,
    },
    /// Match two images.
    Match {
        pair: [u32; 2],
        a: &'a Path,
        b: &'a Path,
        size_a: [usize; 2],
        size_b: [usize; 2],
        out: &'a Path,
    },
    /// Describe an image.
    Describe {
        image: &'a Path,
        size: [usize; 2],
        out: &'a Path,
    },
    /// Last of all.
    Bye,
}

impl Request<'_> {
    /// The request as a line, without its end.
    ///
    /// # Errors
    /// If a path is not UTF-8.
    pub(super) fn to_line(self) -> Result<Vec<u8>, String> {
        serde_json::to_vec(&self).map_err(|error| format!("cannot be asked: {error}"))
    }

    /// Whether a `subject` is that of this request.
    pub(super) fn is_about(self, subject: &Subject) -> bool {
        match (self, subject) {
            (Self::Match { pair, .. }, Subject::Pair(other)) => pair == *other,
            (Self::Describe { image, .. }, Subject::Image(other)) => image == Path::new(other),
            _ => false,
        }
    }
}

/// What the child answers.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum Answer {
    /// To `hello`.
    Ready {
        protocol: u32,
        name: String,
        version: String,
        pixel_center: f32,
    },
    /// To `hello`.
    Refused { reason: String },
    /// To `match`.
    Matched {
        pair: [u32; 2],
        count: usize,
        #[serde(default)]
        features: Option<[u32; 2]>,
        #[serde(default)]
        extracted: Option<u32>,
        #[serde(default)]
        seconds: BTreeMap<String, f64>,
        #[serde(default)]
        device: Option<String>,
    },
    /// To `describe`.
    Described {
        image: String,
        count: usize,
        #[serde(default)]
        seconds: BTreeMap<String, f64>,
        #[serde(default)]
        device: Option<String>,
    },
    /// To `match` and `describe`.
    Failed {
        #[serde(default)]
        pair: Option<[u32; 2]>,
        #[serde(default)]
        image: Option<String>,
        reason: String,
    },
}

/// What a request or an answer is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Subject {
    Pair([u32; 2]),
    Image(String),
}

impl Answer {
    /// What it answers for; `None` if it names neither a pair nor an image, or both.
    pub(super) fn subject(&self) -> Option<Subject> {
        match self {
            Self::Matched { pair, .. }
            | Self::Failed {
                pair: Some(pair),
                image: None,
                ..
            } => Some(Subject::Pair(*pair)),
            Self::Described { image, .. }
            | Self::Failed {
                pair: None,
                image: Some(image),
                ..
            } => Some(Subject::Image(image.clone())),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn requests_are_lines_as_documented() {
        let params = Map::new();
        let hello = Request::Hello {
            protocol: PROTOCOL,
            params: &params,
        };
        let request = Request::Match {
            pair: [0, 1],
            a: Path::new("/abs/a \"quoted\"\n.png"),
            b: Path::new("/abs/b.png"),
            size_a: [640, 480],
            size_b: [640, 480],
            out: Path::new("/abs/0_1.f32"),
        };
        let line = |request: Request<'_>| String::from_utf8(request.to_line().unwrap()).unwrap();
        assert_eq!(line(hello), r#"{"type":"hello","protocol":1,"params":{}}"#);
        assert_eq!(
            line(request),
            r#"{"type":"match","pair":[0,1],"a":"/abs/a \"quoted\"\n.png","b":"/abs/b.png","#
                .to_owned()
                + r#""size_a":[640,480],"size_b":[640,480],"out":"/abs/0_1.f32"}"#
        );
        assert_eq!(line(Request::Bye), r#"{"type":"bye"}"#);
    }

    #[test]
    fn answers_say_what_they_are_about_and_nothing_unknown() {
        let parse = |value: Value| serde_json::from_value::<Answer>(value);
        let about = |value| parse(value).unwrap().subject();
        let pair = Some(Subject::Pair([3, 4]));
        assert_eq!(
            about(json!({"type": "matched", "pair": [3, 4], "count": 0})),
            pair
        );
        assert_eq!(
            about(json!({"type": "failed", "pair": [3, 4], "reason": ""})),
            pair
        );
        assert_eq!(about(json!({"type": "failed", "reason": ""})), None);
        let image = Some(Subject::Image("/a".into()));
        assert_eq!(
            about(json!({"type": "described", "image": "/a", "count": 0})),
            image
        );
        for wrong in [
            json!({"type": "matched", "pair": [3, 4], "count": 0, "feature": [1, 2]}),
            json!({"type": "matched", "pair": [3, 4, 5], "count": 0}),
            json!({"type": "matched", "pair": [3, 4], "count": -1}),
            json!({"type": "matched", "pair": [3, 4], "count": 1, "extracted": -1}),
            json!({"type": "described", "image": "/a", "count": 0, "extracted": 1}),
            json!({"type": "matched", "pair": [3, -4], "count": 1}),
            json!({"type": "info"}),
        ] {
            assert!(parse(wrong.clone()).is_err(), "{wrong}");
        }
    }
}
