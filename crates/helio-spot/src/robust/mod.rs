//! A spot on real frames: where its light is, or that there is none.
//!
//! The **centre** is the centre of mass of the light that the spot adds to the target: the gray values minus those of
//! the light around, weighted by the area that a pixel covers on the target. It is what the centre of the beam of a
//! heliostat means in calibration, and what a background-removed flux picture has as its centre. It differs from the
//! gray-weighted centroid above a global threshold (whose weights keep the light around and lose the spot's foot) and
//! from the standard's middle of the densest square.
//!
//! The way there:
//! 1. Means of square blocks of pixels, some 256 along the target's longer side (`cells.rs`); what is far darker than
//!    the light around is a mark and left out.
//! 2. The light without the spot (`light.rs`): a quadratic surface through the tiles that are not brighter than it,
//!    with a step along a straight line where a shadow's edge crosses the target.
//! 3. What is brighter forms lumps (`lumps.rs`), told apart where a saddle is deep. A lump is a spot if it stands out
//!    of the roughness around, is neither small nor thin, and does not grow towards the target's edge.
//! 4. Spots are ranked by their light and, where a place is expected, by their distance to it.
//! 5. The centre of the best at full resolution (`centre.rs`), with the uncertainty that noise, the light around,
//!    the shape of the beam and what is not seen of it give.

mod cells;
mod centre;
mod edge;
mod light;
mod lumps;
mod twin;

use crate::error::SpotError;
use crate::image::{Gray, View};
use crate::status::{Flags, SpotStatus};
use crate::target::Plane;
use cells::Cells;
use centre::CentreScratch;
use edge::EdgeScratch;
use light::{Ground, Light, LightScratch};
use lumps::{Lump, Lumps};

/// What the search may be told.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RobustOptions {
    /// Where the spot is expected: right and down of the target's centre, and one standard deviation per
    /// component \[m\]. Ranks the spots of a frame; one alone is taken wherever it is.
    pub expected: Option<(f64, f64, f64)>,
    /// Gray value from which on the camera cannot tell more; white (255, or 65535) unless given. A camera with 12 bits
    /// in the lower bits of 16 has 4095.
    pub white: Option<u32>,
}

/// A lump of light on the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Middle of its light \[m\], right of the target's centre.
    pub u_m: f64,
    /// Middle of its light \[m\], down of the target's centre.
    pub v_m: f64,
    /// Its light: gray value above the light around, summed over the target's area \[gray m²\].
    pub light_m2: f64,
    /// Its highest gray value above the light around.
    pub peak: f64,
    /// Why it is no spot, if it is none.
    pub refused: Option<Refusal>,
}

/// Why a lump of light is no spot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Refusal {
    /// Hardly brighter than the roughness around.
    Rough,
    /// As bright as a spot may be, but no brighter than what a shadow leaves lit.
    Faint,
    /// Smaller than the sun's image can be.
    Small,
    /// A line.
    Thin,
    /// It grows towards the target's edge: stray light, or a spot whose middle is not on the target.
    GrowsOutwards,
}

/// A spot, or why there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Spot {
    /// What became of the frame. Without a position ([`SpotStatus::has_position`]) all numbers below are not a number.
    pub status: SpotStatus,
    /// What else is to be known.
    pub flags: Flags,
    /// The centre in the frame \[px\]: the pixel at which the place (u, v) is seen.
    pub x_px: f64,
    /// See `x_px`.
    pub y_px: f64,
    /// The centre right of the target's centre \[m\].
    pub u_m: f64,
    /// The centre down of the target's centre \[m\].
    pub v_m: f64,
    /// Of a spot that the target's edge cuts: where the centre would be with the part beyond the edge, by a Gaussian
    /// through what is seen; (u, v) is the centre of the part that is seen, and its covariance has the difference.
    pub completed_m: Option<[f64; 2]>,
    /// Covariance of (u, v) from the picture alone \[m²\].
    pub covariance_m2: [[f64; 2]; 2],
    /// Covariance of (u, v) with that of the way from pixels to metres \[m²\].
    pub covariance_with_plane_m2: [[f64; 2]; 2],
    /// Gray value above which light counts as the spot's, at the centre.
    pub threshold: f64,
    /// Area that counts \[px\].
    pub area_px: f64,
    /// Brightest gray value (mean of a cell).
    pub peak: f64,
    /// Gray value of the light around, at the centre.
    pub background: f64,
}

impl Spot {
    fn without(status: SpotStatus, flags: Flags) -> Self {
        Self {
            status,
            flags,
            x_px: f64::NAN,
            y_px: f64::NAN,
            u_m: f64::NAN,
            v_m: f64::NAN,
            completed_m: None,
            covariance_m2: [[f64::NAN; 2]; 2],
            covariance_with_plane_m2: [[f64::NAN; 2]; 2],
            threshold: f64::NAN,
            area_px: f64::NAN,
            peak: f64::NAN,
            background: f64::NAN,
        }
    }

    /// One standard deviation per component \[m\]: the mean over directions of `covariance_with_plane_m2`.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        let [[uu, _], [_, vv]] = self.covariance_with_plane_m2;
        (0.5 * (uu + vv)).sqrt()
    }
}

/// Room for the work on one frame after another. One per thread.
#[derive(Debug, Default)]
pub struct SpotScratch {
    cells: Cells,
    light: LightScratch,
    edge: EdgeScratch,
    lumps: Lumps,
    centre: CentreScratch,
    candidates: Vec<(f64, Candidate, Lump)>,
}

impl SpotScratch {
    /// The lumps of light of the last frame, best first.
    pub fn candidates(&self) -> impl ExactSizeIterator<Item = &Candidate> {
        self.candidates.iter().map(|(_, candidate, _)| candidate)
    }

    /// The outline of the light that counted in the last frame: pieces of it, each from one place in the frame to another
    /// \[px\], in no order. None where no spot was found.
    pub fn outline_px(&self) -> impl Iterator<Item = [[f64; 2]; 2]> {
        let sides = self.centre.sides();
        sides.map(|side| side.map(|[column, row]| self.cells.middle_px(column, row)))
    }
}

/// A lump's peak stands so many standard deviations out of the roughness around, at least.
const OUTSTANDING: f32 = 10.0;
/// And by so much of the light around; of that and of the step at a shadow's edge, whose softness is not known, where a
/// shadow's light may be taken for a spot.
const CONTRAST: f64 = 0.05;
const CONTRAST_OF_LIT: f64 = 0.12;
/// Its top touches the target's edge along so many of its radii, at most: a disc cut through its middle has 2.8, cut half-way
/// to its rim 1.9, whole 0.
const CONTACT: f64 = 2.0;
const CONTACT_OF_FEW: f64 = 1.0;
const CONTACT_OF_LIT: f64 = 1.0;
/// And at most so many if its top is on the target by a fit.
const CONTACT_OF_CUT: f64 = 3.2;
/// It is in a corner if that is within so many of its radii, or, of a large one, if the half of its peak reaches beside the
/// mark there; how large is told by its radius, in halves of the target, where the mark is in halves of its sides.
const CORNER: f64 = 2.2;
const SMALL_CORNER: f64 = 0.3;
const BESIDE_MARK: f64 = 0.8;
/// A lump has so many coarse cells above half of its peak, at least: a disc of 5 % of the target's longer side across.
const SMALLEST: u32 = 8;
/// And is not so many times longer than wide.
const LONGEST: f64 = 12.0;
const LONGEST_OF_LIT: f64 = 6.0;
/// Nor so many times, where a shadow's light may be taken for it.
const COMPACT: f64 = 3.0;
/// A spot reaches over the edge where it has this part of its peak there.
const CUT: f32 = 0.2;
/// And from this part on what may lie beyond is asked for.
const TOUCHES: f32 = 0.02;
/// The centre of a spot that hardly reaches there is this part of the way to it off.
const OF_TOUCHING: f64 = 0.6;
/// A shadow's edge explains the light better by so much, the logarithm of a tile's likelihood.
const EDGE_GAIN: f64 = 0.2;
/// And is so many standard deviations high.
const EDGE_STEP: f64 = 4.0;
/// Another spot with this part of the best one's light is worth a flag.
const SEVERAL: f64 = 0.05;
/// And with this part, which one is meant is open; where a place is expected this part of its probability.
const AMBIGUOUS: f64 = 0.3;
/// A spot with less than this part of white above the light around is faint.
const FAINT: f64 = 0.1;
/// The light around that changes by this part of the spot's peak over the spot is uneven.
const UNEVEN: f64 = 0.15;
/// The middle of light that grows outwards is within this part of the target, where a spot may have it.
const FAR_IN: f64 = 0.6;
/// A target of which this part is as bright as the camera can tell shows nothing.
const ALL_WHITE: f64 = 0.5;
/// The light under a beam that leaves hardly any of it to be seen is known to this part of the beam's peak.
const LEVEL_DOUBT: f64 = 0.2;
/// A spot of whose brighter half so much is saturated has lost its shape.
const SATURATED: f64 = 0.6;

/// Finds the spot on the target.
///
/// The same bits come out whatever the scratch was used for before.
///
/// # Errors
/// [`SpotError::BadOption`].
pub fn find_spot<P: Gray>(
    view: View<'_, P>,
    plane: &Plane,
    options: &RobustOptions,
    scratch: &mut SpotScratch,
) -> Result<Spot, SpotError> {
    if let Some((u_m, v_m, sigma_m)) = options.expected {
        for (what, value) in [("expected u", u_m), ("expected v", v_m)] {
            if !value.is_finite() {
                return Err(SpotError::BadOption {
                    what,
                    wanted: "a number of metres",
                    value,
                });
            }
        }
        if !(sigma_m > 0.0 && sigma_m.is_finite()) {
            return Err(SpotError::BadOption {
                what: "standard deviation of the expected place",
                wanted: "a number of metres above 0",
                value: sigma_m,
            });
        }
    }
    let white = match options.white {
        Some(0) => {
            return Err(SpotError::BadOption {
                what: "white",
                wanted: "above 0",
                value: 0.0,
            });
        }
        Some(white) => f64::from(white.min(P::WHITE)),
        None => f64::from(P::WHITE),
    };
    scratch.centre.clear();
    Ok(
        find(view, plane, options, white, scratch).unwrap_or_else(|status| {
            scratch.candidates.clear();
            scratch.centre.clear();
            Spot::without(status, Flags::none())
        }),
    )
}

fn find<P: Gray>(
    view: View<'_, P>,
    plane: &Plane,
    options: &RobustOptions,
    white: f64,
    scratch: &mut SpotScratch,
) -> Result<Spot, SpotStatus> {
    let SpotScratch {
        cells,
        light: light_scratch,
        edge: edge_scratch,
        lumps,
        centre: centre_scratch,
        candidates,
    } = scratch;
    let outline = outline(plane).ok_or(SpotStatus::NoTarget)?;
    if !cells.fill(view, &outline) {
        return Err(SpotStatus::NoTarget);
    }
    let floor = white / (4.0 * 255.0);
    let fine = [cells.fine.width, cells.fine.height];
    let mut light = light_scratch
        .fit(&cells.tiles, fine, Ground::Curved, white)
        .ok_or(SpotStatus::NoTarget)?;
    if let Some(edge) = edge_scratch.find(cells, floor)
        && let Some(shaded) = light_scratch.fit(&cells.tiles, fine, Ground::Shaded(edge), white)
        && shaded.cost(white) < light.cost(white) - EDGE_GAIN
        && shaded.step() > EDGE_STEP * shaded.tile_sigma
    {
        light = shaded;
    }
    // Twice, since the first surface may have followed the marks.
    for _ in 0..2 {
        if !cells.leave_out_dark(|column, row| light.least_at_coarse(column, row) as f32) {
            break;
        }
        // Of what little may be left the surface before is good enough.
        let Some(better) = light_scratch.fit(&cells.tiles, fine, Ground::of(light.edge), white)
        else {
            break;
        };
        light = better;
    }
    lumps.find(cells, &light, floor);
    rank(lumps, cells, &light, plane, options, candidates);
    let is_spot = |candidates: &[(f64, Candidate, Lump)]| {
        let first = candidates.first();
        first.is_some_and(|(_, candidate, _)| candidate.refused.is_none())
    };
    // A beam so large that the surface rises with it: under it the light may be a plane.
    let (bulges, swells) = (light.bulges(white), light.swells());
    if bulges
        && !is_spot(candidates)
        && let Some(level) = light_scratch.fit(&cells.tiles, fine, Ground::Level, white)
    {
        lumps.find(cells, &level, floor);
        rank(lumps, cells, &level, plane, options, candidates);
        light = level;
    }
    if bulges && let Some((_, best, _)) = candidates.first() {
        light.doubt = LEVEL_DOUBT * best.peak;
    }
    // Light that grows outwards and is all there is may yet have its middle on the target.
    if let Some((_, first, lump)) = candidates.first_mut()
        && first.refused == Some(Refusal::GrowsOutwards)
        && lump.may_be_cut
        && let Some(centre) = centre_scratch.of(lump, lumps, cells, &light, plane, white)
        && centre_scratch.is_topped(&centre, plane)
    {
        first.refused = None;
    }

    let mut flags = Flags::none();
    let mut spots = candidates.iter().filter(|(_, c, _)| c.refused.is_none());
    let Some((score, best, lump)) = spots.next() else {
        let outwards = candidates
            .first()
            .filter(|(_, candidate, _)| candidate.refused == Some(Refusal::GrowsOutwards));
        // Most of stray light is near the edge.
        let far_in = outwards.is_some_and(|(_, candidate, _)| {
            2.0 * candidate.u_m.abs() < FAR_IN * plane.board().width_m
                && 2.0 * candidate.v_m.abs() < FAR_IN * plane.board().height_m
        });
        // Seen, but too small or too faint to be told from specks and from what a shadow leaves.
        let glimpsed = candidates.iter().any(|(_, candidate, lump)| {
            lump.apart && matches!(candidate.refused, Some(Refusal::Small | Refusal::Faint))
        });
        let white = cells.share_above(centre::SATURATED * white) > ALL_WHITE;
        flags = flags
            .with_if(outwards.is_some(), Flags::CUT)
            .with_if(white, Flags::SATURATED);
        let status = if white || bulges || swells || far_in || glimpsed {
            SpotStatus::Unclear
        } else {
            SpotStatus::Empty
        };
        return Ok(Spot::without(status, flags));
    };
    let mut centre = centre_scratch
        .of(lump, lumps, cells, &light, plane, white)
        .ok_or(SpotStatus::Empty)?;
    let cut = lump.at_edge > CUT * lump.peak;
    let beyond = if lump.at_edge > TOUCHES * lump.peak {
        centre_scratch.beyond(&centre, plane, f64::from(lump.at_edge / lump.peak))
    } else {
        None
    };
    if let Some(way) = beyond {
        centre.spread(if cut { 1.0 } else { OF_TOUCHING }, way);
    }
    let completed_m = beyond
        .filter(|_| cut)
        .map(|way| [0, 1].map(|k| centre.place_m[k] + way[k]));
    let [u_m, v_m] = centre.place_m;
    let pixel = plane.to_pixels([u_m, v_m]).ok_or(SpotStatus::NoTarget)?;
    let of_plane = plane.covariance_m2(pixel).ok_or(SpotStatus::NoTarget)?;
    let mut with_plane = centre.covariance_m2;
    for r in 0..2 {
        for c in 0..2 {
            with_plane[r][c] += of_plane[r][c];
        }
    }

    let mut ambiguous = false;
    for (other_score, other, _) in spots {
        if other.light_m2 > SEVERAL * best.light_m2 {
            flags = flags.with(Flags::SEVERAL);
        }
        ambiguous |= other_score - score > libm::log(AMBIGUOUS);
    }
    flags = flags.with_if(lump.seam || centre.twin, Flags::SEVERAL);
    let saturated = centre.saturated_area > SATURATED * centre.half_area;
    flags = flags
        .with_if(cut, Flags::CUT)
        .with_if(centre.saturated_area > 0.0, Flags::SATURATED)
        .with_if(best.peak < FAINT * white, Flags::FAINT)
        .with_if(
            light.step() > 0.05 * best.peak
                || centre.beside
                || uneven(lump, &light) > UNEVEN * best.peak,
            Flags::UNEVEN_LIGHT,
        );
    if let Some((u, v, sigma)) = options.expected {
        let far = (u_m - u).hypot(v_m - v) > 3.0 * sigma.hypot(centre.sigma_m());
        flags = flags.with_if(far, Flags::FAR_FROM_EXPECTED);
    }
    let status = if ambiguous {
        SpotStatus::Ambiguous
    } else if cut {
        SpotStatus::Cut
    } else if saturated {
        SpotStatus::Saturated
    } else {
        SpotStatus::Ok
    };
    let at = cells.of_px(pixel);
    let background = light.at(at[0], at[1]);
    Ok(Spot {
        status,
        flags,
        x_px: pixel[0],
        y_px: pixel[1],
        u_m,
        v_m,
        completed_m,
        covariance_m2: centre.covariance_m2,
        covariance_with_plane_m2: with_plane,
        threshold: background + 0.75 * centre.foot,
        area_px: centre.area * (cells.block * cells.block) as f64,
        peak: centre.brightest,
        background,
    })
}

/// How much the light around changes over a lump.
fn uneven(lump: &Lump, light: &Light) -> f64 {
    // A Gaussian's half is a disc of 1.2 standard deviations.
    let reach = 2.0 * lumps::FINE * (f64::from(lump.half_cells) / std::f64::consts::PI).sqrt();
    let [x, y] = lump.middle.map(|at| lumps::FINE * at + 1.5);
    let about = [(reach, 0.0), (-reach, 0.0), (0.0, reach), (0.0, -reach)];
    let levels = about.map(|(right, down)| light.at(x + right, y + down));
    levels.into_iter().fold(f64::NEG_INFINITY, f64::max)
        - levels.into_iter().fold(f64::INFINITY, f64::min)
}

/// The lumps as candidates, best first.
fn rank(
    lumps: &Lumps,
    cells: &Cells,
    light: &Light,
    plane: &Plane,
    options: &RobustOptions,
    candidates: &mut Vec<(f64, Candidate, Lump)>,
) {
    let half = [0.5 * plane.board().width_m, 0.5 * plane.board().height_m];
    candidates.clear();
    for mut lump in lumps.found.iter().copied() {
        let [x, y] = cells.middle_px(
            lumps::FINE * lump.middle[0] + 1.5,
            lumps::FINE * lump.middle[1] + 1.5,
        );
        let (Some([u_m, v_m]), Some(metres)) =
            (plane.to_target([x, y]), plane.metres_per_px([x, y]))
        else {
            continue;
        };
        let side_m = metres * (cells.block * cells::COARSE) as f64;
        let around = light.at(
            lumps::FINE * lump.middle[0] + 1.5,
            lumps::FINE * lump.middle[1] + 1.5,
        );
        // What a shadow leaves bright of a target is in a corner, or along an edge that is known.
        let off = [u_m.abs() - half[0], v_m.abs() - half[1]];
        let radius_m = side_m * (f64::from(lump.half_cells) / std::f64::consts::PI).sqrt();
        let small = radius_m < SMALL_CORNER * half[0].max(half[1]);
        let near = off[0].hypot(off[1]) < CORNER * radius_m;
        let inwards = [
            BESIDE_MARK * half[0].copysign(u_m),
            BESIDE_MARK * half[1].copysign(v_m),
        ];
        let corner = if small {
            near
        } else {
            plane.to_pixels(inwards).is_some_and(|pixel| {
                let at = cells.of_px(pixel);
                lumps.reaches(&lump, at.map(|at| (at - 1.5) / lumps::FINE))
            })
        };
        let lit = light.edge.is_some() || corner;
        let contrast = if lit || lump.contact > 0.0 {
            CONTRAST_OF_LIT
        } else {
            CONTRAST
        };
        // Along how much of the edge a top of few cells lies is not to be told.
        let contact = match (lit, lump.top_cells < SMALLEST) {
            (true, _) => CONTACT_OF_LIT,
            (false, true) => CONTACT_OF_FEW,
            (false, false) => CONTACT,
        };
        let peak = f64::from(lump.peak);
        let stands_out = lump.peak >= OUTSTANDING * lumps.sigma as f32;
        lump.apart = lump.along < COMPACT * lump.across && lump.contact == 0.0 && !corner;
        let refused = if !stands_out || peak < contrast * around.max(light.step()) {
            let large = lump.half_cells >= SMALLEST;
            if stands_out && lump.apart && large && peak > CONTRAST * around {
                Some(Refusal::Faint)
            } else {
                Some(Refusal::Rough)
            }
        } else if lump.half_cells < SMALLEST {
            Some(Refusal::Small)
        } else if lump.along > if lit { LONGEST_OF_LIT } else { LONGEST } * lump.across {
            Some(Refusal::Thin)
        } else if lump.contact > contact {
            Some(Refusal::GrowsOutwards)
        } else {
            None
        };
        lump.may_be_cut = !lit && lump.top_cells >= SMALLEST && lump.contact < CONTACT_OF_CUT;
        let candidate = Candidate {
            u_m,
            v_m,
            light_m2: lump.sum * side_m * side_m,
            peak,
            refused,
        };
        let mut score = libm::log(candidate.light_m2);
        if let Some((u, v, sigma)) = options.expected {
            let [a, b] = [(u_m - u) / sigma, (v_m - v) / sigma];
            score -= 0.5 * (a * a + b * b);
        }
        candidates.push((score, candidate, lump));
    }
    candidates.sort_by(|(a, one, _), (b, other, _)| {
        let spots_first = one.refused.is_some().cmp(&other.refused.is_some());
        spots_first.then(b.total_cmp(a))
    });
}

/// Points along the target's sides in the frame \[px\]; a lens bends them.
fn outline(plane: &Plane) -> Option<Vec<[f64; 2]>> {
    let steps = if plane.lens().is_some() { 16 } else { 1 };
    let half = [0.5 * plane.board().width_m, 0.5 * plane.board().height_m];
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut outline = Vec::with_capacity(4 * steps);
    for side in 0..4 {
        let (from, to) = (corners[side], corners[(side + 1) % 4]);
        for step in 0..steps {
            let share = step as f64 / steps as f64;
            let place = [0, 1].map(|k| half[k] * (from[k] + share * (to[k] - from[k])));
            outline.push(plane.to_pixels(place)?);
        }
    }
    Some(outline)
}

#[cfg(test)]
mod tests;
