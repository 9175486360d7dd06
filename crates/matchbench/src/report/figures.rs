//! The figures of a report: which curves and bars of which dataset go into which drawing.

use crate::metrics::Angle;

use super::overview::Overview;
use super::svg::{Place, ap_bars, sp_curves};

/// The SP curves of one dataset.
pub(super) fn sp_figure(
    overview: &Overview<'_>,
    column: usize,
    angle: Angle,
    place: Place,
) -> String {
    let curves: Vec<_> = (overview.rows.iter().enumerate())
        .filter_map(|(i, row)| {
            let summary = row.cells[column].as_ref()?.summary;
            let curve = match angle {
                Angle::Pose => &summary.sp,
                Angle::Rotation => &summary.rotation_sp,
                Angle::Translation => &summary.translation_sp,
            };
            Some((i, &*row.label, curve))
        })
        .collect();
    let what = match angle {
        Angle::Pose => "Success ratio",
        Angle::Rotation => "Success ratio, rotation alone",
        Angle::Translation => "Success ratio, translation alone",
    };
    let title = format!("{what}: {}", overview.datasets[column]);
    sp_curves(place, &title, &curves)
}

/// The AP bars of one dataset.
pub(super) fn ap_figure(overview: &Overview<'_>, column: usize, place: Place) -> String {
    let bars: Vec<_> = (overview.rows.iter().enumerate())
        .filter_map(|(i, row)| {
            let summary = row.cells[column].as_ref()?.summary;
            Some((i, &*row.label, summary.ap5))
        })
        .collect();
    let title = format!(
        "Correspondences of right pairs, AP(5): {}",
        overview.datasets[column]
    );
    ap_bars(place, &title, &bars)
}
