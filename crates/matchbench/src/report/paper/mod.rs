//! The paper's tables and figures with our numbers, and the published ones beside them.
//!
//! | file | what |
//! | --- | --- |
//! | `index.html` | a page with all of it |
//! | `tables/table{1,2,3}.{tex,csv}` | sequences, AUC, times |
//! | `figures/figure{1,2,3}.{svg,png,pdf}` | the sequences; SP curves and AP bars of the two portions |
//! | `figures/figure{1,2,3}.{png,pdf}.txt` | why this could not be drawn, in its place |
//! | `paper.tex` | a document of these, for LaTeX |
//!
//! The paper has its curves only as drawings, so figures show ours alone.

mod figures;
mod latex;
mod page;
mod published;
mod tables;

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use self::figures::PaperFigure;
use super::csv::field;
use super::pages::{Pages, Undrawn};
use super::{Content, MatcherTimes};
use crate::records::MatcherPlan;

/// The content of Table 3, and how it was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperTimes {
    /// The program and the machine, in words.
    pub machine: String,
    /// The sequence whose pairs were timed.
    pub sequence: String,
    /// How many pairs.
    pub pairs: usize,
    /// [Fingerprint](crate::datasets::Sequence::fingerprint) of the sequence.
    pub fingerprint: String,
    /// What was measured so far.
    pub rows: Vec<MatcherTimes>,
    /// With which parameters; a plan for each of the rows.
    pub plans: Vec<MatcherPlan>,
}

impl PaperTimes {
    /// Whether `other` was measured on the same machine, sequence and pairs.
    pub fn is_like(&self, other: &Self) -> bool {
        let measured = |times: &Self| {
            let Self {
                machine,
                sequence,
                pairs,
                fingerprint,
                ..
            } = times;
            (
                machine.clone(),
                sequence.clone(),
                *pairs,
                fingerprint.clone(),
            )
        };
        measured(self) == measured(other)
    }
}

/// A table that holds our number and the published one in each cell.
struct Sheet {
    /// Name of its files.
    name: &'static str,
    caption: String,
    /// Heads above groups of neighbouring columns, each with its number of columns; they start after the column
    /// of labels.
    groups: Vec<(String, usize)>,
    /// Heads of the columns; the first is that of the labels.
    heads: Vec<String>,
    /// What belongs under the heads, if anything does.
    under: Option<SheetRow>,
    rows: Vec<SheetRow>,
    notes: Vec<String>,
}

struct SheetRow {
    label: String,
    is_baseline: bool,
    cells: Vec<SheetCell>,
}

#[derive(Clone, Debug, Default)]
struct SheetCell {
    /// `None` if there is no result of ours.
    ours: Option<String>,
    /// `None` if the paper has no number.
    published: Option<String>,
    /// 1, 2 or 3 for the best of ours.
    rank: Option<u8>,
    /// Whether ours is above our SIFT.
    is_above: bool,
}

/// Shown if there is no number.
const NOTHING: &str = "/";

/// Colours of the best three, as the paper has them.
const RANKS: [&str; 3] = ["red", "green", "blue"];

/// All files that a paper can have.
const FILES: [&str; 23] = [
    "index.html",
    "paper.tex",
    "tables/table1.tex",
    "tables/table1.csv",
    "tables/table2.tex",
    "tables/table2.csv",
    "tables/table3.tex",
    "tables/table3.csv",
    "figures/figure1.svg",
    "figures/figure1.png",
    "figures/figure1.png.txt",
    "figures/figure1.pdf",
    "figures/figure1.pdf.txt",
    "figures/figure2.svg",
    "figures/figure2.png",
    "figures/figure2.png.txt",
    "figures/figure2.pdf",
    "figures/figure2.pdf.txt",
    "figures/figure3.svg",
    "figures/figure3.png",
    "figures/figure3.png.txt",
    "figures/figure3.pdf",
    "figures/figure3.pdf.txt",
];

/// Refuses a folder in which [`write_paper`] would replace files that are not of an earlier paper.
///
/// # Errors
/// The error names such a file.
pub fn check_paper_folder(folder: &Path) -> io::Result<()> {
    Pages::new(folder)?.refuse_others(&FILES)
}

/// Writes tables, figures, page and document into `folder`, and returns the path of the page, and what is missing and
/// why, in sentences. The page links to the complete report of the run at `report/index.html` in this folder. Files of
/// an earlier paper are replaced.
///
/// # Errors
/// A file that cannot be written, or that is there and not of an earlier paper.
pub fn write_paper(
    folder: &Path,
    content: &Content,
    times: &PaperTimes,
) -> io::Result<(PathBuf, Vec<String>)> {
    write_figures(folder, content, times, &figures::all(content))
}

/// The same with these figures. One that cannot be drawn as PDF is not in the document, which needs that.
fn write_figures(
    folder: &Path,
    content: &Content,
    times: &PaperTimes,
    figures: &[PaperFigure],
) -> io::Result<(PathBuf, Vec<String>)> {
    let out = Pages::new(folder)?;
    out.refuse_others(&FILES)?;
    let write = |name: &str, contents: &[u8]| out.write(Path::new(name), contents);
    let sheets = [
        tables::datasets(content),
        tables::auc(content),
        tables::speed(times),
    ];
    for sheet in &sheets {
        let file = |ending: &str| format!("tables/{}.{ending}", sheet.name);
        write(&file("tex"), latex::table(sheet).as_bytes())?;
        write(&file("csv"), csv(sheet).as_bytes())?;
    }
    let undrawn: Vec<Vec<Undrawn>> = (figures.par_iter())
        .map(|figure| out.write_drawing(figure.name, &figure.svg))
        .collect::<io::Result<_>>()?;
    let has_pdf = |undrawn: &[Undrawn]| undrawn.iter().all(|undrawn| undrawn.ending != "pdf");
    let drawn: Vec<&PaperFigure> = (figures.iter().zip(&undrawn))
        .filter_map(|(figure, undrawn)| has_pdf(undrawn).then_some(figure))
        .collect();
    let lacking = tables::lacking(content);
    write(
        "paper.tex",
        latex::document(lacking.as_deref(), &sheets, &drawn).as_bytes(),
    )?;
    let page = page::render(lacking.as_deref(), &sheets, figures);
    write("index.html", page.as_bytes())?;
    out.remove_earlier()?;
    Ok((
        folder.join("index.html"),
        (undrawn.into_iter().flatten())
            .map(|undrawn| undrawn.note)
            .collect(),
    ))
}

/// One line per cell: row, column, ours, published. A missing number is an empty field.
fn csv(sheet: &Sheet) -> String {
    let mut text = String::from("row,column,ours,published\n");
    for row in sheet.under.iter().chain(&sheet.rows) {
        for (head, cell) in sheet.heads.iter().skip(1).zip(&row.cells) {
            let [ours, published] =
                [&cell.ours, &cell.published].map(|part| value(part.as_deref()));
            let _ = writeln!(
                text,
                "{},{},{ours},{published}",
                field(&row.label),
                field(head)
            );
        }
    }
    text
}

/// A number as it is, and text as a field.
fn value(text: Option<&str>) -> String {
    match text {
        Some(number) if number.parse::<f64>().is_ok() => number.to_owned(),
        text => field(text.unwrap_or_default()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::content;
    use super::*;
    use crate::metrics::{Quartiles, StageQuartiles};

    fn times() -> PaperTimes {
        PaperTimes {
            machine: "a <machine>".into(),
            sequence: "05-castle".into(),
            pairs: 200,
            fingerprint: "1f".into(),
            plans: Vec::new(),
            rows: vec![MatcherTimes {
                matcher: "sift".into(),
                stages: StageQuartiles {
                    features: Quartiles::of([1000.0, 1001.0]),
                    extract: Quartiles::of([0.05, 0.0564]),
                    ..StageQuartiles::default()
                },
            }],
        }
    }

    fn scores() -> Content {
        content(&[
            ("05-castle", "sift", 4),
            ("05-castle", "gms", 6),
            ("05-castle", "orb", 1),
        ])
    }

    #[test]
    fn ours_stands_beside_the_published() {
        let sheet = tables::auc(&scores());
        let text = csv(&sheet);
        for line in [
            "SIFT,\"05\",0.400,0.396",
            "GMS,\"05\",0.600,0.433",
            "SIFT,\"01\",,0.375",
            "RepMatch,\"05\",,0.535",
            "KVLD,\"01\",,",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}: {text}");
        }
        let table = latex::table(&sheet);
        assert!(
            table.contains("\\textbf{\\textcolor{red}{0.600}} \\published{0.433}"),
            "{table}"
        );
        assert!(table.contains("/ \\published{0.535}"), "{table}");
        let speed = csv(&tables::speed(&times()));
        assert!(speed.contains("SIFT,Features,1000.5,1082\n"), "{speed}");
        assert!(speed.contains("CODE,Matching (ms),,(970.1)\n"), "{speed}");
    }

    #[test]
    fn a_quick_look_is_not_taken_for_the_whole_sequences() {
        let mut content = scores();
        let sheet = tables::auc(&content);
        let says = "Incomplete: fewer pairs than published of 05 (10 of 435); nothing of 01, 02, 03, 04, 06, 07, 08.";
        assert!(sheet.notes[0].starts_with(says), "{:?}", sheet.notes);
        assert!(csv(&sheet).contains("\nPairs,\"05\",10,435\n"));
        let text = latex::table(&sheet);
        let under = "Pairs & / \\published{2310} & / \\published{2234}";
        assert!(
            text.contains(under) && text.contains("10 \\published{435}"),
            "{text}"
        );
        assert!(text.find(under) < text.find("\\textbf{SIFT}"), "{text}");
        content.facts.plan = Some(
            r#"{"version": "0.1.0", "settings": {"seed": 7, "repetitions": 1, "limit": null, "sample": 10},
                "datasets": [], "matchers": []}"#
                .into(),
        );
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (page, _) = write_paper(folder.path(), &content, &times()).expect("it is ours");
        let page = std::fs::read_to_string(page).expect("just written");
        assert_eq!(
            page.matches("A quick look: fewer pairs than published of 05 (10 of 435)")
                .count(),
            2
        );
        let document = std::fs::read_to_string(folder.path().join("paper.tex"));
        assert!(document.is_ok_and(|text| text.contains("A quick look: fewer pairs")));
        // All sequences with all their pairs lack nothing.
        for summary in &mut content.summaries {
            summary.pairs = 5000;
        }
        let one = content.summaries[0].clone();
        content.summaries = (["01", "02", "03", "04", "05", "06", "07", "08"].iter())
            .map(|number| crate::metrics::Summary {
                dataset: format!("{number}-x"),
                ..one.clone()
            })
            .collect();
        assert_eq!(tables::lacking(&content), None);
    }

    #[test]
    fn times_read_back_and_know_where_they_were_measured() {
        let times = times();
        let text = serde_json::to_string(&times).expect("plain JSON");
        let back: PaperTimes = serde_json::from_str(&text).expect("written just now");
        assert!(back == times && back.is_like(&times));
        let fewer = PaperTimes {
            pairs: 9,
            ..times.clone()
        };
        let other = PaperTimes {
            fingerprint: "2e".into(),
            ..times.clone()
        };
        assert!(!fewer.is_like(&times) && !other.is_like(&times));
    }

    #[test]
    fn everything_is_written_and_names_are_text() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (page, notes) = write_paper(folder.path(), &scores(), &times()).expect("it is ours");
        assert_eq!(notes, [""; 0]);
        let html = std::fs::read_to_string(page).expect("just written");
        assert!(html.contains("a &lt;machine&gt;") && !html.contains("<machine>"));
        for file in [
            "paper.tex",
            "tables/table1.tex",
            "tables/table3.csv",
            "figures/figure3.png",
        ] {
            assert!(folder.path().join(file).is_file(), "{file}");
        }
        // There are no short baselines here.
        assert!(!folder.path().join("figures/figure2.svg").exists());
        // A sequence of the paper has the portion of the paper, whatever pairs of it were run.
        let short = content(&[("01-office", "sift", 4), ("my-01", "sift", 4)]);
        let names = |content| figures::all(content).into_iter().map(|figure| figure.name);
        assert!(names(&short).eq(["figure2", "figure3"]));
        let nothing = write_paper(folder.path(), &Content::default(), &PaperTimes::default());
        assert!(nothing.is_ok());
    }

    #[test]
    fn a_picture_that_cannot_be_drawn_is_left_out_and_noted() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut figures = figures::all(&content(&[
            ("01-office", "sift", 4),
            ("05-castle", "sift", 4),
        ]));
        figures[0].svg = "no drawing".into();
        let written = write_figures(folder.path(), &scores(), &times(), &figures);
        let (page, notes) = written.expect("all the rest is there");
        assert_eq!(notes.len(), 2, "{notes:?}");
        let at = |name: &str| folder.path().join(name);
        let read = |name: &str| std::fs::read_to_string(at(name));
        for (note, (ending, form)) in notes.iter().zip([("png", "PNG"), ("pdf", "PDF")]) {
            let said = format!("figure2.svg cannot be drawn as {form}");
            assert!(note.starts_with(&said), "{note}");
            let place = format!("figures/figure2.{ending}.txt");
            assert!(read(&place).is_ok_and(|text| text.contains(note)));
            assert!(at(&format!("figures/figure3.{ending}")).is_file());
        }
        assert!(page.is_file());
        let document = read("paper.tex").expect("a document");
        assert!(document.contains("figure3.pdf") && !document.contains("figure2.pdf"));
        assert!(check_paper_folder(folder.path()).is_ok());
    }

    #[test]
    fn only_files_of_an_earlier_paper_are_replaced_and_removed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        let short = content(&[("01-office", "sift", 4)]);
        // Somebody's own paper.
        for name in ["paper.tex", "figures/figure2.png", "index.html"] {
            let file = at(name);
            std::fs::create_dir_all(file.parent().expect("it has one")).expect("writable");
            std::fs::write(&file, "mine").expect("writable");
            for result in [
                check_paper_folder(folder.path()),
                write_paper(folder.path(), &short, &times()).map(drop),
            ] {
                let told = result.expect_err("it is not ours").to_string();
                assert!(told.contains(name), "{told}");
            }
            assert_eq!(std::fs::read_to_string(&file).expect("there"), "mine");
            std::fs::remove_file(&file).expect("it is there");
        }
        write_paper(folder.path(), &short, &times()).expect("nothing is in the way");
        assert!(check_paper_folder(folder.path()).is_ok() && at("figures/figure2.svg").is_file());
        // Every name is known before it is written.
        let listed = std::fs::read_to_string(at(".files")).expect("a list");
        assert!(
            listed.lines().skip(1).all(|name| FILES.contains(&name)),
            "{listed}"
        );
        // Nor is a report a paper, in a folder of an earlier version, which kept no list.
        let report = tempfile::tempdir().expect("a temporary folder");
        let theirs = report.path().join("paper.tex");
        super::super::write_report(report.path(), &short).expect("nothing is in the way");
        std::fs::remove_file(report.path().join(".files")).expect("it is there");
        std::fs::write(&theirs, "mine").expect("writable");
        let told = check_paper_folder(report.path()).expect_err("it is not ours");
        assert!(told.to_string().contains("is not of an earlier"), "{told}");
        // A paper of such a version.
        std::fs::remove_file(at(".files")).expect("it is there");
        std::fs::write(at("notes.txt"), "mine").expect("writable");
        write_paper(folder.path(), &short, &times()).expect("its page is ours");
        write_paper(folder.path(), &scores(), &times()).expect("it is ours");
        assert!(!at("figures/figure2.svg").exists(), "of the paper before");
        assert!(at("figures/figure3.svg").is_file() && at("notes.txt").is_file());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_not_written_through() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let elsewhere = folder.path().join("elsewhere");
        let out = folder.path().join("out");
        std::fs::create_dir_all(&elsewhere).expect("writable");
        write_paper(&out, &scores(), &times()).expect("it is ours");
        std::fs::remove_dir_all(out.join("tables")).expect("it is there");
        std::os::unix::fs::symlink(&elsewhere, out.join("tables")).expect("writable");
        let told = write_paper(&out, &scores(), &times()).expect_err("a link");
        assert!(told.to_string().contains("it is a link"), "{told}");
        assert_eq!(std::fs::read_dir(&elsewhere).expect("there").count(), 0);
    }
}
