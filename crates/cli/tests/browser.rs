//! The report in a real browser: it loads from disk, curves switch, the table sorts, a pair opens.
//!
//! Needs Chromium or Chrome, whose program `MATCHBENCH_BROWSER` names.

mod common;
mod planes;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::{dataset, matchbench};
use planes::homographies;

/// The name of the dataset: markup that would run if the page took it for that, and its folder.
const NAME: &str = "<script>hacked=1<img src=x onerror=hacked=1>";
const FOLDER: &str = "-script-hacked-1-img-src-x-onerror-hacked-1-";

/// Clicks through the page and leaves what it found in an attribute.
const PROBE: &str = r##"
<script>
window.addEventListener("load", () => {
  const log = [];
  const check = (what, ok) => log.push(`${ok ? "ok" : "FAILED"}: ${what}`);
  const off = () => document.querySelectorAll(".series.off").length;
  const curve = document.querySelector(".legend button");
  curve.click();
  check("a curve is switched off", off() > 0);
  curve.click();
  check("and on again", off() === 0);
  curve.dispatchEvent(new PointerEvent("pointerenter"));
  check("the others are dimmed", document.querySelectorAll(".dim .series.lit").length > 0);
  curve.dispatchEvent(new PointerEvent("pointerleave"));
  document.querySelector(".presets [data-only=none]").click();
  check("none is left", document.querySelector(".chart.sp .series:not(.off)") === null);
  document.querySelector(".presets [data-only=all]").click();
  check("all are back", off() === 0);
  const aucs = () => [...document.querySelectorAll(".panel.pose .overview tbody tr")].map((row) => Number([...row.cells[1].childNodes].findLast((part) => part.nodeType === Node.TEXT_NODE).textContent));
  const byAuc = document.querySelectorAll(".panel.pose .overview thead button")[1];
  byAuc.click();
  check("the best comes first", aucs().length === 2 && aucs()[0] >= aucs()[1]);
  byAuc.click();
  check("and last", aucs()[0] <= aucs()[1]);
  // As of matchers from outside, what they are stands behind their names.
  const methods = [...document.querySelectorAll(".panel.pose .overview tbody th")];
  for (const method of methods) method.insertAdjacentHTML("beforeend", `<small>${method.textContent === "orb" ? "z" : "a"}</small>`);
  document.querySelector(".panel.pose .overview thead button").click();
  check("names are sorted", document.querySelector(".panel.pose .overview tbody th").textContent === "orbz");
  const heads = [...document.querySelectorAll("#pair-table thead button")];
  check("an upper bound is called so", heads.some((head) => head.textContent === "Overlap \u2264"));
  const column = heads.findIndex((head) => head.textContent === "Baseline");
  heads[column].click();
  document.querySelectorAll("#pair-table thead button")[column].click();
  const rows = [...document.querySelectorAll("#pair-table tbody tr")];
  const values = rows.map((row) => Number(row.cells[column].textContent));
  check("the table is sorted", values[0] > values.at(-1) && values.every((x, i) => !i || values[i - 1] >= x));
  document.getElementById("pair-pictures").click();
  document.querySelector("#pair-table tbody button").click();
  const view = document.getElementById("pair-view");
  check("a pair opens", !view.hidden && view.querySelectorAll("img").length === 2);
  check("its matches are drawn", view.querySelector("svg path") !== null);
  const shown = () => getComputedStyle(view.querySelector("path.keypoints")).display !== "none";
  const keypoints = [...view.querySelectorAll("label")].find((label) => label.textContent === "keypoints");
  check("keypoints wait", !shown());
  keypoints.click();
  check("and come on demand", shown());
  const beside = document.querySelector("#pair-table tbody a");
  check("it has a page beside", /^pairs\/[^/]+\/\d+-\d+\.html$/.test(beside.getAttribute("href")));
  check("it has an address", /^#pair=.+\/\d+-\d+-0\/sift\/ransac-e$/.test(location.hash));
  const button = (text) => [...view.querySelectorAll("button")].find((button) => button.textContent === text);
  button("orb").click();
  const isOrb = () => !view.hidden && /, orb$/.test(view.querySelector("h3").textContent);
  check("another matcher on it", isOrb());
  const address = location.hash;
  button("Close").click();
  check("it closes", view.hidden && location.hash === "#pairs");
  check("no name from the data has run", window.hacked === undefined);
  window.addEventListener("hashchange", () => setTimeout(() => {
    check("an address opens its pair", isOrb());
    document.body.dataset.probe = `${log.join("; ")}; done`;
  }));
  location.hash = address;
});
</script>
"##;

/// Opens a pair of homographies, and leaves one estimator alone.
const PLANES: &str = r##"
<script>
window.addEventListener("load", () => {
  const shown = () => document.querySelectorAll("#mma .series:not(.off)").length;
  const all = shown();
  document.querySelector(".presets [data-estimator='ransac-h']").click();
  const kept = shown();
  document.querySelector("#pair-table tbody button").click();
  const view = document.getElementById("pair-view");
  const said = view.hidden ? "no pair" : view.querySelector("p").textContent;
  const errors = [...view.querySelectorAll(".rivals tbody tr")].map((row) => row.cells[3].textContent);
  document.body.dataset.probe = `${said} ${errors.every((text) => / px$/.test(text))} ${all} ${kept}`;
});
</script>
"##;

/// A page on a telephone: nothing but tables and charts in their boxes may be wider than it, no name is cut off, and the text
/// of charts, 11 units high, can be read.
const NARROW: &str = r#"
<iframe id="page" width="390" height="800" style="border: 0" src="PAGE"></iframe>
<script>
window.addEventListener("load", () => {
  const page = document.getElementById("page").contentDocument.documentElement;
  const cut = [...page.querySelectorAll("th.name")].filter((name) => name.scrollWidth > name.clientWidth);
  const squeezed = [...page.querySelectorAll("th.name:first-child")].filter((name) => name.clientWidth > 0 && name.clientWidth < 60);
  const height = (chart) => (11 * chart.getBoundingClientRect().width) / chart.viewBox.baseVal.width;
  const heights = [...page.querySelectorAll("svg.chart")].map(height).filter((height) => height > 0);
  const tiny = heights.filter((height) => height < 8);
  const width = page.scrollWidth;
  document.body.dataset.probe = width > 390 ? `${width} pixels wide` : cut.length ? `${cut[0].textContent} is cut off` : squeezed.length ? `${squeezed[0].textContent} is squeezed` : tiny.length ? `text of ${tiny} pixels` : "fits";
});
</script>
"#;

/// A page on a desk: the tables of the figures need no scrolling, and no text of a figure is cut off.
const WIDE: &str = r#"
<iframe id="page" width="1280" height="800" style="border: 0" src="PAGE"></iframe>
<script>
window.addEventListener("load", () => {
  const page = document.getElementById("page").contentDocument;
  const tables = [...page.querySelectorAll("figure .scroll")];
  const cut = tables.filter((table) => table.scrollWidth > table.clientWidth);
  const isOutside = (text) => {
    const [inner, outer] = [text, text.closest("svg")].map((element) => element.getBoundingClientRect());
    return inner.left < outer.left - 0.5 || inner.right > outer.right + 0.5;
  };
  const texts = [...page.querySelectorAll("svg.chart text")].filter(isOutside).map((text) => text.textContent);
  const fits = tables.length > 0 && cut.length === 0 && texts.length === 0;
  document.body.dataset.probe = fits ? "fits" : `${cut.length} of ${tables.length} tables, and ${texts}`;
});
</script>
"#;

/// The page of a comparison on a desk: the pictures of a pair begin at one height, also where words above one of them need
/// more lines.
const BESIDE: &str = r#"
<iframe id="page" width="1280" height="800" style="border: 0" src="PAGE"></iframe>
<script>
window.addEventListener("load", () => {
  const page = document.getElementById("page").contentDocument;
  const pairs = [...page.querySelectorAll(".beside")].map((pair) => [...pair.querySelectorAll(".picture")]);
  pairs[0][0].previousElementSibling.append(" and more words".repeat(20));
  const isLevel = (pictures) => new Set(pictures.map((picture) => picture.getBoundingClientRect().top)).size === 1;
  document.body.dataset.probe = pairs.every(isLevel) ? "level" : "not level";
});
</script>
"#;

/// The page of a run of SIFT and ORB, with a script at its end.
fn probed(data: &Path, run: &Path, options: &[&str], script: &str) -> PathBuf {
    let status = (matchbench().arg("run").arg(data))
        .args(["--matchers", "sift,orb", "--report"])
        .args(options)
        .arg("--out")
        .arg(run)
        .status()
        .expect("the program starts");
    assert!(status.success());
    let page = fs::read_to_string(run.join("report/index.html")).expect("it was written");
    let probe = run.with_file_name("probe.html");
    fs::write(&probe, page + script).expect("writable");
    probe
}

#[test]
#[ignore = "needs MATCHBENCH_BROWSER, the program of Chromium or Chrome"]
fn page_works_in_a_browser() {
    let browser = std::env::var("MATCHBENCH_BROWSER").expect("MATCHBENCH_BROWSER names a program");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let data = dataset(folder.path(), NAME, 4);
    let run = folder.path().join("run");
    let probe = probed(&data, &run, &[], PROBE);
    let (dom, log) = look(&browser, folder.path(), &probe);
    let found = found_in(&dom);
    assert!(
        found.ends_with("done") && !found.contains("FAILED"),
        "{found}\n{log}"
    );
    assert!(!log.contains("CONSOLE"), "{log}");
    for words in [
        &["leaderboard", ".", "--out", "site"][..],
        &[
            "compare",
            "run",
            "--matchers",
            "sift,orb",
            "--out",
            "differ",
        ],
    ] {
        let done = (matchbench().args(words).current_dir(folder.path())).status();
        assert!(done.expect("the program starts").success(), "{words:?}");
    }
    let wide = folder.path().join("wide.html");
    fs::write(&wide, WIDE.replace("PAGE", "run/report/index.html")).expect("writable");
    let (dom, log) = look(&browser, folder.path(), &wide);
    assert_eq!(found_in(&dom), "fits", "{log}");
    let beside = folder.path().join("beside.html");
    fs::write(&beside, BESIDE.replace("PAGE", "differ/index.html")).expect("writable");
    let (dom, log) = look(&browser, folder.path(), &beside);
    assert_eq!(found_in(&dom), "level", "{log}");
    for page in [
        "run/report/index.html",
        "site/index.html",
        "differ/index.html",
    ] {
        let narrow = folder.path().join("narrow.html");
        fs::write(&narrow, NARROW.replace("PAGE", page)).expect("writable");
        let (dom, log) = look(&browser, folder.path(), &narrow);
        assert_eq!(found_in(&dom), "fits", "{page}: {log}");
        let (dom, log) = look(&browser, folder.path(), &folder.path().join(page));
        assert!(
            !log.contains("CONSOLE") && !dom.contains("<img src=\"x\""),
            "{page}: {log}"
        );
    }
    let pages = run.join("report/pairs").join(FOLDER);
    let beside = fs::read_to_string(pages.join("0-1.html")).expect("all are few");
    assert!(beside.contains("images/0.jpg") && pages.join("images/0.jpg").is_file());
    assert!(beside.contains("&lt;img") && !beside.contains("<img src=x"));
}

#[test]
#[ignore = "needs MATCHBENCH_BROWSER, the program of Chromium or Chrome"]
fn a_pair_of_homographies_opens_in_a_browser() {
    let browser = std::env::var("MATCHBENCH_BROWSER").expect("MATCHBENCH_BROWSER names a program");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    homographies(&wall, &[(0, 1), (0, 2), (1, 2)]);
    let run = folder.path().join("run");
    let probe = probed(&wall, &run, &["--estimator", "best-h,ransac-h"], PLANES);
    let (dom, log) = look(&browser, folder.path(), &probe);
    let found = found_in(&dom);
    assert!(
        found.starts_with("Corners off by ") && found.ends_with(" true 2 2"),
        "{found}\n{log}"
    );
    assert!(!log.contains("CONSOLE"), "{log}");
}

/// Opens a page and gives what has become of it, and what the browser had to say.
fn look(browser: &str, folder: &Path, page: &Path) -> (String, String) {
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--virtual-time-budget=5000",
        ])
        .args([
            "--allow-file-access-from-files",
            "--enable-logging=stderr",
            "--dump-dom",
        ])
        .arg(format!(
            "--user-data-dir={}",
            folder.join("profile").display()
        ))
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("the browser starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

/// What the script of a page found.
fn found_in(dom: &str) -> &str {
    (dom.split("data-probe=\"").nth(1))
        .and_then(|rest| rest.split('"').next())
        .unwrap_or("the script did not come to its end")
}
