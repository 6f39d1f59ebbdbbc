//! What the methods find, as rows of a table of spots.

use helio_spot::{
    Flags, Gray, Plane, RobustOptions, Scratch, SpotError, SpotScratch, SpotStatus,
    StandardOptions, View, find_spot, standard,
};

use super::SeenInFrame;
use crate::spots::SpotRow;

/// Why nothing can be made of corners that were given or found.
pub(super) fn no_target(plane: &Plane, width: usize, height: usize) -> String {
    let whose = if plane.corners().marks.is_some() {
        "found"
    } else {
        "given"
    };
    let picture = format!("the picture has {width} x {height} pixels");
    match about(plane, width, height) {
        None => format!("the corners {whose} lie outside the picture: {picture}"),
        Some([_, _, wide, high]) => format!(
            "too few pixels of the target are seen: {wide} x {high} within the corners {whose}, {picture}"
        ),
    }
}

pub(super) fn words(flags: Flags) -> String {
    flags.words().collect::<Vec<_>>().join(" ")
}

/// The smallest rectangle of whole pixels about a target (left, top, width, height), within a picture.
fn about(plane: &Plane, width: usize, height: usize) -> Option<[usize; 4]> {
    let corners = &plane.corners().at_px;
    let along = |k: usize, size: usize| {
        let all = corners.iter().map(|at| at[k]);
        let low = all.clone().fold(f64::INFINITY, f64::min).floor().max(0.0);
        let high = all.fold(f64::NEG_INFINITY, f64::max).ceil();
        let high = high.min(size as f64 - 1.0);
        (high >= low).then(|| (low as usize, (high - low) as usize + 1))
    };
    let ((left, wide), (top, high)) = (along(0, width)?, along(1, height)?);
    Some([left, top, wide, high])
}

pub(super) fn of_standard<P: Gray>(
    view: View<'_, P>,
    plane: &Plane,
    options: &StandardOptions,
    scratch: &mut Scratch,
    row: SpotRow,
    seen: &mut SeenInFrame,
) -> Result<(SpotRow, Flags), SpotError> {
    let none = |status| SpotRow {
        status: Some(status),
        ..row.clone()
    };
    let rectangle = about(plane, view.width(), view.height());
    let part = rectangle.and_then(|[left, top, wide, high]| {
        let part = view.part(left, top, wide, high)?;
        Some((part, [left as f64, top as f64], [wide as f64, high as f64]))
    });
    let Some((part, [left, top], [wide, high])) = part else {
        return Ok((none(SpotStatus::NoTarget), Flags::none()));
    };
    let spot = standard(part, options, scratch)?;
    seen.threshold = Some((
        f64::from(spot.threshold),
        [left, top, left + wide - 1.0, top + high - 1.0],
    ));
    let mut row = SpotRow {
        threshold: Some(spot.threshold),
        area_px: Some(spot.area_px),
        window_px: Some(spot.window_px),
        ..none(spot.status)
    };
    if !spot.status.has_position() {
        return Ok((row, spot.flags));
    }
    let at_px = [left + spot.x_px, top + spot.y_px];
    let Some(at_m) = plane.to_target(at_px) else {
        row.status = Some(SpotStatus::NoTarget);
        return Ok((row, spot.flags));
    };
    let half = 0.5 * f64::from(spot.window_px);
    seen.window = Some([
        at_px[0] - half,
        at_px[1] - half,
        at_px[0] + half,
        at_px[1] + half,
    ]);
    seen.centre = Some(at_px);
    // The standard knows no noise: what is left is the step of half a pixel of its window, evenly spread, and the way
    // from pixels to metres.
    let covariance_m2 = plane.covariance_m2(at_px);
    let step_m = plane.metres_per_px(at_px).unwrap_or(f64::NAN);
    seen.covariance_m2 = covariance_m2;
    let sigma_m =
        covariance_m2.map(|[[uu, _], [_, vv]]| (0.5 * (uu + vv) + step_m * step_m / 12.0).sqrt());
    row.row_column = Some([top + spot.row, left + spot.column]);
    row.at_px = Some(at_px);
    row.at_m = Some(at_m);
    row.sigma_m = sigma_m.filter(|sigma_m| sigma_m.is_finite());
    Ok((row, spot.flags))
}

pub(super) fn of_robust<P: Gray>(
    view: View<'_, P>,
    plane: &Plane,
    options: &RobustOptions,
    scratch: &mut SpotScratch,
    row: SpotRow,
    seen: &mut SeenInFrame,
) -> Result<(SpotRow, Flags), SpotError> {
    let spot = find_spot(view, plane, options, scratch)?;
    let mut row = SpotRow {
        status: Some(spot.status),
        ..row
    };
    if !spot.status.has_position() {
        return Ok((row, spot.flags));
    }
    let at_px = [spot.x_px, spot.y_px];
    seen.centre = Some(at_px);
    seen.covariance_m2 = Some(spot.covariance_with_plane_m2);
    seen.outline_px.extend(scratch.outline_px());
    row.threshold = Some(spot.threshold.round().max(0.0) as u32);
    row.area_px = Some(spot.area_px.round().max(0.0) as u64);
    row.row_column = Some([spot.y_px, spot.x_px]);
    row.at_px = Some(at_px);
    row.at_m = Some([spot.u_m, spot.v_m]);
    row.sigma_m = Some(spot.sigma_m()).filter(|sigma_m| sigma_m.is_finite());
    Ok((row, spot.flags))
}
