//! SP curves: success ratio over the largest allowed error; also other shares over whole-number thresholds.

use std::fmt::Write as _;

use super::super::numbers::ratio;
use super::series::{Legend, marker, polyline};
use super::{COLOURS, Target, axis, axis_label, escape, grid, open, text, tick};

/// Size of the plot itself and its place in the figure, in user units.
const PLOT: (f64, f64) = (350.0, 210.0);
const LEFT: f64 = 54.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 40.0;

/// The labels of the axes.
pub(in super::super) struct Axes {
    /// The quantity of the threshold.
    pub(in super::super) x: &'static str,
    /// Its unit, as it is written after a number.
    pub(in super::super) unit: &'static str,
    /// The quantity whose share is shown.
    pub(in super::super) y: &'static str,
    /// The largest share of all figures that stand beside this one, and so have the same axis.
    pub(in super::super) most: f64,
}

/// The curve of a matcher.
pub(in super::super) struct Curve<'a> {
    /// Number of the matcher in the report.
    pub(in super::super) series: usize,
    /// Numbers of other series that this curve also stands for: its matcher with other estimators.
    pub(in super::super) others: Vec<usize>,
    /// Its name.
    pub(in super::super) name: &'a str,
    /// The share at the thresholds 1, 2 ..., equally many in every curve.
    pub(in super::super) values: Vec<f64>,
    /// The number beside its name.
    pub(in super::super) number: f64,
}

/// One figure with these curves, in the order of the legend. Curves without values (no pairs) are left out.
pub(in super::super) fn sp_curves(
    target: Target,
    title: &str,
    axes: &Axes,
    curves: &[Curve<'_>],
) -> String {
    let last = curves.first().map_or(2, |curve| curve.values.len());
    let curves: Vec<_> = (curves.iter())
        .filter(|curve| curve.values.iter().all(|value| value.is_finite()))
        .collect();
    let names = curves.iter().map(|curve| curve.name);
    let legend = Legend::beside(target, LEFT + PLOT.0, names);
    let top = if target == Target::File { 34.0 } else { 8.0 };
    let width = LEFT + PLOT.0 + RIGHT + legend.width;
    // A long legend makes the figure higher.
    let plot = (PLOT.0, PLOT.1.max(legend.height));
    let height = top + plot.1 + BOTTOM;
    let max = (curves.iter()).fold(0.0_f64, |max, curve| max.max(curve.values[last - 1]));
    let (step, end) = axis(max.max(axes.most));
    let x = |k: usize| LEFT + plot.0 * (k - 1) as f64 / (last - 1) as f64;
    let y = |share: f64| top + plot.1 * (1.0 - share / end);

    let mut svg = String::new();
    open(&mut svg, target, "chart sp", (width, height), title);
    let ticks = (end / step).round() as usize;
    for value in (0..=ticks).map(|i| i as f64 * step) {
        grid(&mut svg, (x(1), y(value)), (x(last), y(value)));
        let at = (LEFT - 7.0, y(value) + 3.5);
        text(&mut svg, "muted", at, "end", &tick(value, step));
    }
    for k in (1..=last).step_by(2) {
        let at = (x(k), top + plot.1 + 16.0);
        text(&mut svg, "muted", at, "middle", &k.to_string());
    }
    let at = (LEFT + plot.0 / 2.0, top + plot.1 + 32.0);
    text(&mut svg, "muted", at, "middle", axes.x);
    axis_label(&mut svg, top + plot.1 / 2.0, axes.y);
    if target == Target::Page {
        let _ = writeln!(
            svg,
            r#"<line class="cursor" x1="0" x2="0" y1="{:.1}" y2="{:.1}" data-x1="{:.1}" data-x2="{:.1}" data-count="{last}" data-unit="{}" visibility="hidden"/>"#,
            top,
            top + plot.1,
            x(1),
            x(last),
            axes.unit
        );
    }
    // The first curve is drawn last, above the others.
    for (row, curve) in curves.into_iter().enumerate().rev() {
        let (series, name) = (curve.series, curve.name);
        let points: Vec<(f64, f64)> = (curve.values.iter().enumerate())
            .map(|(i, &value)| (x(i + 1), y(value)))
            .collect();
        open_series(&mut svg, target, curve);
        polyline(&mut svg, series, &points);
        // Every third point has a marker, at different points for neighbouring matchers, so that markers seldom
        // cover each other.
        for &(px, py) in points.iter().skip(series % 3).step_by(3) {
            marker(&mut svg, series, px, py);
        }
        if target == Target::File {
            legend.entry(&mut svg, (row, top), series, (name, &ratio(curve.number)));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Opens the group of a matcher. In the page it holds the values, which the script shows when the pointer is
/// over it; in a file the name is its tooltip.
fn open_series(svg: &mut String, target: Target, curve: &Curve<'_>) {
    let series = curve.series;
    let class = series % COLOURS;
    let name = escape(curve.name);
    match target {
        Target::Page => {
            let values: Vec<String> = (curve.values.iter())
                .map(|value| format!("{value:.3}"))
                .collect();
            let values = values.join(" ");
            let switches = [&[series], &curve.others[..]].concat();
            let switches: Vec<String> = switches.iter().map(usize::to_string).collect();
            let switches = switches.join(" ");
            let _ = writeln!(
                svg,
                r#"<g class="series s{class}" data-series="{switches}" data-name="{name}" data-values="{values}">"#
            );
        }
        Target::File => {
            let _ = writeln!(svg, r#"<g class="series s{class}"><title>{name}</title>"#);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{are_near, numbers, scale};
    use super::*;

    const AXES: Axes = Axes {
        x: "error",
        unit: "°",
        y: "share",
        most: 0.0,
    };

    fn curve(series: usize, name: &str, value: f64) -> Curve<'_> {
        Curve {
            series,
            others: Vec::new(),
            name,
            values: vec![value; 15],
            number: value,
        }
    }

    #[test]
    fn figure_is_the_same_every_time_and_names_are_text() {
        let curves = [curve(0, "sift", 0.5), curve(9, "</g><script>", 0.2)];
        let draw = |target| sp_curves(target, "<room>", &AXES, &curves);
        for target in [Target::File, Target::Page] {
            let svg = draw(target);
            assert_eq!(svg, draw(target));
            assert!(!svg.contains("<script>") && !svg.contains("<room>"));
            assert_eq!(svg.matches("<g ").count(), 2);
            assert_eq!(svg.matches("</g>").count(), 2);
        }
        assert!(draw(Target::Page).contains("stroke-dasharray"));
    }

    #[test]
    fn the_axis_reaches_the_largest_share_of_all_figures() {
        let curves = [curve(0, "sift", 0.19)];
        let (own, all) = (AXES, Axes { most: 0.9, ..AXES });
        let top = |axes| {
            let svg = sp_curves(Target::Page, "room", axes, &curves);
            svg.contains(">1.0</text>")
        };
        assert!(!top(&own) && top(&all));
    }

    #[test]
    fn curves_without_values_are_left_out() {
        let nothing = [curve(0, "sift", f64::NAN)];
        let svg = sp_curves(Target::File, "room", &AXES, &nothing);
        assert!(!svg.contains("NaN") && !svg.contains("<g"));
    }

    #[test]
    fn a_long_legend_makes_the_figure_higher() {
        let many: Vec<_> = (0..30).map(|i| curve(i, "matcher", 0.1)).collect();
        let svg = sp_curves(Target::File, "room", &AXES, &many);
        assert!(svg.contains(r#"height="554""#), "{}", &svg[..120]);
        assert!(
            svg.contains(">0.100</text>"),
            "the AUC stands beside the name"
        );
    }

    #[test]
    fn a_curve_goes_through_its_values() {
        let curves = [Curve {
            values: vec![0.0, 0.1, 0.4],
            ..curve(0, "sift", 0.4)
        }];
        let svg = sp_curves(Target::Page, "room", &AXES, &curves);
        let (x, y) = (
            scale(&svg, "x", "middle", ["1", "3"]),
            scale(&svg, "y", "end", ["0.0", "0.4"]),
        );
        let (_, points) = svg.split_once(" points=\"").expect("a line");
        let points = points.split_once('"').expect("it ends").0;
        let points: Vec<f64> = (points.split([' ', ',']))
            .map(|number| number.parse().expect("a number"))
            .collect();
        let expected = [x(1.0), y(0.0), x(2.0), y(0.1), x(3.0), y(0.4)];
        assert!(are_near(&points, &expected), "{svg}");
        // The third point has the marker of the first series.
        assert!(
            are_near(&numbers(&svg, "<circle", "cx"), &[x(1.0)]),
            "{svg}"
        );
        assert!(
            are_near(&numbers(&svg, "<circle", "cy"), &[y(0.0)]),
            "{svg}"
        );
        assert!(
            are_near(&numbers(&svg, "cursor", "data-x2"), &[x(3.0)]),
            "{svg}"
        );
    }
}
