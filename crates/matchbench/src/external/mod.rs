//! Matchers as processes: any program, in any language, on any device, beside the native matchers.
//!
//! A manifest ([`Manifest`], `name.toml`) says how the program is started and what it is called in
//! tables. The program lives as long as the run and speaks protocol 1: one JSON object a line, requests
//! on its standard input, answers on its standard output (`>` host, `<` child).
//!
//! ```text
//! > {"type":"hello","protocol":1,"params":{..}}
//! < {"type":"ready","protocol":1,"name":"..","version":"..","pixel_center":0}
//!   or {"type":"refused","reason":".."}                            parameters it does not know
//! > {"type":"match","pair":[0,1],"a":"/abs/a.png","b":"/abs/b.png",
//!    "size_a":[w,h],"size_b":[w,h],"out":"/abs/0_1.f32"}
//! < {"type":"matched","pair":[0,1],"count":498,"features":[2048,2031],
//!    "extracted":2,"seconds":{"extract":0.8,"match":1.9},
//!    "device":"cpu"}                                               the last four may be absent
//! < {"type":"failed","pair":[0,1],"reason":".."}                   nothing can be said of this pair
//! > {"type":"bye"}                                                 and standard input is closed
//! ```
//!
//! `out` holds `count` times five little-endian `f32`: x_a, y_a, x_b, y_b in pixels of the original images,
//! whose first pixel has its centre at `pixel_center` (0 or 0.5), and the ambiguity, from 0 (certain) to 1.
//! `features` are the numbers of features of a and b; `count` is at most their product.
//! `extracted` is how many of the two images `extract` is for (0, 1 or 2). Neither cameras nor
//! poses are sent: the child is not given the truth. It is not kept from looking for it either: it gets the paths of
//! images, and nothing confines it.
//!
//! With `kind = "features"` the child describes images, and search and selection are native:
//!
//! ```text
//! > {"type":"describe","image":"/abs/a.png","size":[w,h],"out":"/abs/0.npz"}
//! < {"type":"described","image":"/abs/a.png","count":2048,"seconds":{"extract":2.3},"device":"cpu"}
//! < {"type":"failed","image":"/abs/a.png","reason":".."}
//! ```
//!
//! Lines that are no JSON object with a `type` go to the log, as does standard error, because libraries
//! print messages while they load.
//!
//! Nothing that a child says is believed. If a child hangs, ends, floods, or answers something else than
//! was asked, the pair that was asked for fails and the child is replaced. After three such failures over one
//! image (of a pair, the first) it is not asked about this image any more. After failures over three images in a row, or if
//! three processes in a row do not start, the matcher ends with an error that names the log ([`Breakdown`]). Children are
//! leaders of process groups that end with them, and all are reaped.
//!
//! `process` starts and ends children, `log` keeps what they print, and `message` and `answer` are the
//! protocol. `worker` is one child that speaks it, `pool` ([`External`]) is several, and `strikes` counts their
//! failures. `features` reads descriptions and `nearest` matches them. `source` is what a run asks, and [`check`] tries a
//! manifest out.

mod answer;
mod check;
mod features;
mod lines;
mod log;
mod manifest;
mod message;
mod nearest;
mod pool;
mod process;
mod source;
mod strikes;
mod worker;

pub use answer::{Described, Matched, Times, is_inside};
pub use check::{Finding, Verdict, check};
pub use features::{wrong_angle, wrong_descriptor, wrong_size};
pub use log::Log;
pub use manifest::{BuiltIn, Kind, Manifest, ManifestError, Matching};
pub use pool::{Breakdown, External, Image, StartError};
pub use process::{Ended, end_all};
pub use worker::Identity;
