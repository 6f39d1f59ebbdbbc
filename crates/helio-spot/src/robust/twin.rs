//! Whether a lump is one beam: by measures that vanish for a single one whatever its profile.
//!
//! The light of a single beam is taken to have level lines that are ellipses of one shape about one centre: a round, a
//! long and a flat-topped one alike, whatever its light falls off like. In coordinates in which its covariance is 1 it is
//! round, `z = x + i y` has no preferred direction, and the means (weighted with the light)
//! `<|z|^2 z>`, `<z^3>`, `<|z|^2 z^2>`, `<z^4>` are nought but for noise. Cumulants of sums add up. Of two such beams with the
//! parts `p` and `q` of the light, `d` apart in the direction `e = exp(i t)` there, the first two are
//! `p q (p - q) d^3 e` and `p q (p - q) d^3 e^3` **whatever the beams look like**, for these have none of their own: as
//! large, and the direction of the one is thrice that of the other. Light that is uneven in some other way, as of facets
//! that do not meet, has no reason for that. The last two, `A e^2` and `B e^4` with real A and B that depend on the shape, tell
//! two of like strength, of which the first two vanish.

use super::cells::COARSE;
use super::centre::{Centre, CentreScratch, Part};
use super::light::Light;

/// A direction and size; the plane of the whitened places.
#[derive(Debug, Clone, Copy, Default)]
struct Complex(f64, f64);

impl Complex {
    fn times(self, other: Self) -> Self {
        Self(
            self.0 * other.0 - self.1 * other.1,
            self.0 * other.1 + self.1 * other.0,
        )
    }

    fn size(self) -> f64 {
        (self.0 * self.0 + self.1 * self.1).sqrt()
    }

    /// Turned back by `turns` times the angle of another one.
    fn against(self, other: Self, turns: u32) -> Self {
        let size = other.size();
        let back = Self(other.0 / size, -other.1 / size);
        (0..turns).fold(self, |product, _| product.times(back))
    }
}

/// A mean that is nought of a single beam, and one standard deviation of its size.
#[derive(Debug, Clone, Copy)]
struct Harmonic {
    value: Complex,
    sigma: f64,
}

impl Harmonic {
    fn is_sure(&self, least: f64) -> bool {
        self.value.size() > (SURE * self.sigma).max(least)
    }

    /// Whether it lies along the real axis once turned back, within so many standard deviations.
    fn is_along(&self, turned: Complex, sigmas: f64) -> bool {
        turned.1.abs() < ASKEW * turned.0.abs() + sigmas * self.sigma
    }
}

/// The whitened coordinates of a lump.
struct White {
    middle_m: [f64; 2],
    /// Light from which on cells count wholly, from half of it on in part: above what the target's edge cuts off.
    foot: f64,
    /// Long and short axis.
    axes: [[f64; 2]; 2],
    /// Standard deviations along them.
    deviations_m: [f64; 2],
}

impl White {
    /// Part of a cell that counts.
    fn part(&self, part: &Part) -> f64 {
        if self.foot > 0.0 {
            (2.0 * part.smooth / self.foot - 1.0).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    fn place(&self, part: &Part) -> Complex {
        let off = [0, 1].map(|k| part.place_m[k] - self.middle_m[k]);
        let [x, y] = [0, 1]
            .map(|k| (self.axes[k][0] * off[0] + self.axes[k][1] * off[1]) / self.deviations_m[k]);
        Complex(x, y)
    }

    /// On the target.
    fn unwhitened(&self, Complex(x, y): Complex) -> [f64; 2] {
        let [x, y] = [x * self.deviations_m[0], y * self.deviations_m[1]];
        [0, 1].map(|k| x * self.axes[0][k] + y * self.axes[1][k])
    }
}

/// What the light of a lump is found to be.
enum Shape {
    /// As of a single beam, as far as can be seen.
    Single,
    /// Two melted into one: with one standard deviation of the way to the one that is meant.
    Pair(Way),
    /// Neither: by its unevenness.
    Uneven(f64),
}

enum Way {
    Along(Complex),
    Anywhere(f64),
}

/// What the light of a cell weighs in the means about the centre: the influence it has on them, that on the centre and on
/// the covariance included. `fourth` is the mean of |z|^4.
fn influences(z: Complex, fourth: f64) -> [Complex; 4] {
    let square = z.times(z);
    let Complex(x, y) = z;
    let from_middle = x * x + y * y;
    let scaled = |Complex(x, y): Complex, by: f64| Complex(by * x, by * y);
    [
        scaled(z, from_middle - 4.0),
        square.times(z),
        scaled(square, from_middle - 0.75 * fourth),
        square.times(square),
    ]
}

impl CentreScratch {
    /// Whether two beams have melted into one; the covariance gets what that makes of the centre.
    pub(super) fn twin(&self, centre: &mut Centre, light: &Light, peak: f64) -> bool {
        // Of what is not seen as a whole no symmetry can be asked.
        if centre.at_edge > CUT_OFF * peak || centre.beside {
            return self.round_pair(centre);
        }
        let Some((white, shape)) = self.shape(centre, light, peak) else {
            return self.round_pair(centre);
        };
        match shape {
            Shape::Single => self.round_pair(centre),
            Shape::Uneven(share) => {
                self.round_pair(centre);
                for k in 0..2 {
                    centre.spread(share * white.deviations_m[k], white.axes[k]);
                }
                false
            }
            Shape::Pair(way) => {
                self.round_pair(centre);
                match way {
                    Way::Along(way) => centre.spread(1.0, white.unwhitened(way)),
                    Way::Anywhere(way) => {
                        for k in 0..2 {
                            centre.spread(way * white.deviations_m[k], white.axes[k]);
                        }
                    }
                }
                true
            }
        }
    }

    fn whitened(&self, centre: &Centre) -> Option<White> {
        // At the edge half of the foot.
        let mut white = White {
            middle_m: [0.0; 2],
            foot: if centre.at_edge > centre.foot {
                2.0 * centre.at_edge
            } else {
                0.0
            },
            axes: [[0.0; 2]; 2],
            deviations_m: [0.0; 2],
        };
        let (mut weight, mut first, mut second) = (0.0, [0.0; 2], [0.0; 3]);
        for part in &self.parts {
            let [x, y] = [0, 1].map(|k| part.place_m[k] - centre.place_m[k]);
            let light = part.light * white.part(part);
            weight += light;
            first[0] += light * x;
            first[1] += light * y;
            second[0] += light * x * x;
            second[1] += light * x * y;
            second[2] += light * y * y;
        }
        let [a, b] = first.map(|sum| sum / weight);
        white.middle_m = [centre.place_m[0] + a, centre.place_m[1] + b];
        let [xx, xy, yy] = second.map(|sum| sum / weight);
        let [xx, xy, yy] = [xx - a * a, xy - a * b, yy - b * b];
        let (sine, cosine) = libm::sincos(0.5 * libm::atan2(2.0 * xy, xx - yy));
        let (mean, spread) = (
            0.5 * (xx + yy),
            (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt(),
        );
        // Not a number where light that is darker than that around outweighs.
        if mean.is_nan() || mean <= spread {
            return None;
        }
        white.axes = [[cosine, sine], [-sine, cosine]];
        white.deviations_m = [(mean + spread).sqrt(), (mean - spread).sqrt()];
        Some(white)
    }

    /// The foot is cut off where smoothed light ends: along rounder lines than those of a long beam, which leaves less of
    /// it along than across. How much rounder: the square of a coarse cell's side, over which light is smoothed, times the
    /// inverse of the variance across less that of the variance along.
    fn rounding(&self, white: &White) -> f64 {
        let beside = |pair: &&[Part]| pair[0].row == pair[1].row;
        let side_squared = self.parts.windows(2).find(beside).map_or(0.0, |pair| {
            let cells = (pair[1].column - pair[0].column) / COARSE as f64;
            let [x, y] = [0, 1].map(|k| (pair[1].place_m[k] - pair[0].place_m[k]) / cells);
            x * x + y * y
        });
        let [along, across] = white.deviations_m.map(|deviation| deviation * deviation);
        side_squared * (1.0 / across - 1.0 / along)
    }

    fn shape(&self, centre: &Centre, light: &Light, peak: f64) -> Option<(White, Shape)> {
        let white = self.whitened(centre)?;
        let (mut weight, mut fourth, mut flat) = (0.0, 0.0, 0.0);
        let mut sums = [Complex::default(); 4];
        for part in &self.parts {
            let z = white.place(part);
            let from_middle = z.0 * z.0 + z.1 * z.1;
            let square = z.times(z);
            let light = part.light * white.part(part);
            weight += light;
            fourth += light * from_middle * from_middle;
            if part.covered > 0.0 {
                flat += light * part.light / part.covered;
            }
            let terms = [
                Complex(from_middle * z.0, from_middle * z.1),
                square.times(z),
                Complex(from_middle * square.0, from_middle * square.1),
                square.times(square),
            ];
            for (sum, term) in sums.iter_mut().zip(terms) {
                sum.0 += light * term.0;
                sum.1 += light * term.1;
            }
        }
        let fourth = fourth / weight;
        let flat = flat / (weight * peak);
        // What form a shadow's edge has is not known; of 120 beams on such targets 3 would be two, as it is 1 is.
        let edged = self
            .parts
            .iter()
            .any(|part| light.steepness(part.column, part.row) != 0.0);
        let doubtful = if edged { EDGED } else { 1.0 };
        let harmonics: [Harmonic; 4] = std::array::from_fn(|k| {
            let [[xx, _], [_, yy]] = self.doubt_of(light, |part| {
                let Complex(x, y) = influences(white.place(part), fourth)[k];
                [x, y].map(|factor| white.part(part) * factor)
            });
            // What is under marks may be as it seems, or nought.
            let (mut x, mut y) = (0.0, 0.0);
            for part in self.parts.iter().filter(|part| part.hidden > 0.0) {
                let influence = influences(white.place(part), fourth)[k];
                x += part.hidden * influence.0;
                y += part.hidden * influence.1;
            }
            Harmonic {
                value: Complex(sums[k].0 / weight, sums[k].1 / weight),
                sigma: doubtful * (xx + yy + x * x + y * y).sqrt() / weight,
            }
        });
        let [first, third, second, last] = harmonics;
        let lopsided = first.is_sure(LOPSIDED);
        // Of what is hardly lopsided the directions are as good as noise allows.
        let size = first.value.size();
        let sigmas = if size < SLIGHT { SURE } else { 0.25 * SURE };
        let turned = third.value.against(first.value, 3);
        let one_way = third.is_along(turned, sigmas)
            && turned.0 + sigmas * third.sigma > LEAST_RATIO * size
            && turned.0 - sigmas * third.sigma < MOST_RATIO * size
            && second.is_along(second.value.against(first.value, 2), sigmas)
            && last.is_along(last.value.against(first.value, 4), sigmas);
        let shape = if lopsided && one_way {
            let way = WAY * libm::cbrt(size.max(0.5 * (size + third.value.size()))) / size;
            Shape::Pair(Way::Along(Complex(
                way * first.value.0,
                way * first.value.1,
            )))
        } else if lopsided || third.is_sure(UNEVEN) {
            let third = third.value.size();
            Shape::Uneven(OF_UNEVEN * (size * size + third * third).sqrt())
        } else {
            let turned = last.value.against(second.value, 2);
            let rounder = ROUNDER * self.rounding(&white);
            let more = Complex(second.value.0 + rounder, second.value.1).size();
            let long = more > (SURE_OF_LIKE * second.sigma).max(STRETCHED + PERHAPS * rounder)
                && turned.0 < SURE * last.sigma
                && last.is_along(turned, SURE);
            let stepped = last.is_sure(SQUARE) && fourth < SHARP && flat < STEPPED;
            if long || stepped {
                let part = (last.value.size() / OF_LAST).sqrt().min(1.0);
                Shape::Pair(Way::Anywhere(WAY * part.sqrt()))
            } else {
                Shape::Single
            }
        };
        Some((white, shape))
    }

    /// Two round beams alike in width, `d` apart with the parts `p` and `q` of the light, have along their line the
    /// variance `E = p q d^2` more than across, the third moment `k3 = p q (p - q) d^3` and the fourth cumulant
    /// `k4 = p q (1 - 6 p q) d^4`, whence `k3^2 - k4 E = 2 E^3`, while a long beam has `E` alone. So far as that holds,
    /// the covariance gets the way to the stronger of the two, `q d`, as one standard deviation. True where it is much.
    fn round_pair(&self, centre: &mut Centre) -> bool {
        let off = |part: &Part| [0, 1].map(|k| part.place_m[k] - centre.place_m[k]);
        let (mut weight, mut second) = (0.0, [0.0; 3]);
        for part in &self.parts {
            let [x, y] = off(part);
            weight += part.light;
            second[0] += part.light * x * x;
            second[1] += part.light * x * y;
            second[2] += part.light * y * y;
        }
        let [xx, xy, yy] = second.map(|sum| sum / weight);
        let (sine, cosine) = libm::sincos(0.5 * libm::atan2(2.0 * xy, xx - yy));
        // Along and across.
        let (mut squares, mut fourth, mut third) = ([0.0; 2], [0.0; 2], 0.0);
        for part in &self.parts {
            let [x, y] = off(part);
            let along = cosine * x + sine * y;
            let places = [along, cosine * y - sine * x];
            for k in 0..2 {
                let square = places[k] * places[k];
                squares[k] += part.light / weight * square;
                fourth[k] += part.light / weight * square * square;
            }
            third += part.light / weight * along * along * along;
        }
        let [along, across] = squares;
        // Noise makes a round beam long by some five times its part in the centre.
        let noise = TWIN_NOISE * centre.sigma_m() / across.sqrt();
        let excess = along / across - 1.0;
        let sure = excess - noise;
        let direction = [cosine, sine];
        // Of two beams nearer than their width hardly more than that is seen.
        let little = LONG * excess.min(LONG_MOST) * across.sqrt();
        centre.spread(little, direction);
        if sure.is_nan() || sure <= 0.0 {
            return false;
        }
        // All in units of the deviation across. What the foot cuts off changes both fourth moments alike.
        let third = third / (across * across.sqrt());
        let fourth =
            (fourth[0] / (along * along) - fourth[1] / (across * across)) * (1.0 + excess).powi(2);
        let alike = (third * third - fourth * excess) / (2.0 * excess * excess * excess);
        let alike = alike * (excess + 0.2) / (0.62 * excess);
        let rising = (alike - TWIN_FROM) / (TWIN_SURE - TWIN_FROM);
        let falling = (TWIN_NOT - alike) / (0.5 * TWIN_NOT);
        // Hardly long beams may be two near each other, which no moment tells.
        let near = TWIN_NEAR * (1.0 - excess / TWIN_NEAR_MOST);
        let part = rising.min(falling).clamp(0.0, 1.0).max(near);
        let tilt = third.abs() / sure;
        let way = 0.5 * ((tilt * tilt + 4.0 * sure).sqrt() - tilt);
        centre.spread(part * way * across.sqrt(), direction);
        part * way > TWIN
    }
}

/// A harmonic is not nought if it is so many times its standard deviation: of 180 single simulated ellipses none is. For the
/// third, that of a long beam's foot is cut off less long than the beam, a little more.
const SURE: f64 = 6.0;
const SURE_OF_LIKE: f64 = 6.0;
/// And so large, where there is hardly any noise: single round, long and flat beams have up to 0.034, 0.12 and 0.02 (the last
/// beyond what the rounding of the foot takes).
const LOPSIDED: f64 = 0.03;
const UNEVEN: f64 = 0.12;
const STRETCHED: f64 = 0.03;
/// What the [rounding](CentreScratch::rounding) of the foot takes from the third: 0.35 to 0.47 of it in single ellipses of 0.3 m to
/// 0.6 m and axes of 2:1 and 3:1 in pictures of 384 to 2,688 columns, 0.26 to 0.33 in one of 0.2 m; and what part of that is
/// not sure.
const ROUNDER: f64 = 0.37;
const PERHAPS: f64 = 0.1;
/// From this size of the first on its direction is known well: of real and faceted beams hardly any is below.
const SLIGHT: f64 = 0.1;
/// Across a shadow's edge standard deviations are so many times as large.
const EDGED: f64 = 2.0;
/// Directions agree to so much, as a tangent: 25 degrees, those of 60 simulated pairs of ellipses and Gaussians within 23.
const ASKEW: f64 = 0.47;
/// The second over the first of the harmonics of a pair: 1 for discs, up to 1.95 where the foot that is cut off has light.
const LEAST_RATIO: f64 = 0.8;
const MOST_RATIO: f64 = 2.2;
/// One standard deviation of the way to the beam that is meant, in cube roots of `p q (p - q) d^3`: the whole way is 0.37 of
/// them where the other has 0.2 of its light, 0.79 at a half, 2 at nine tenths.
const WAY: f64 = 0.6;
/// Of two alike `E = p q d^2` is the root of the last harmonic over 2 (round Gaussians) to 3 (discs).
const OF_LAST: f64 = 2.5;
/// Two sharp-edged beams that overlap have a step: the mean of |z|^4 is as low as that of a disc (5.8, a Gaussian's is 6.8),
/// but not so large a part of the light is as bright as its top (discs 0.81 or more, pairs 0.65 to 0.78), and level lines
/// are no ellipses, by so much of the last harmonic.
const SHARP: f64 = 5.97;
const STEPPED: f64 = 0.78;
const SQUARE: f64 = 0.2;
/// What unevenness without a direction makes of the centre, in its size times the beam's standard deviations: faceted
/// pairs are within five of it.
const OF_UNEVEN: f64 = 0.2;
/// Light at the edge from this part of the peak on leaves too little to ask.
const CUT_OFF: f64 = 0.3;

/// See [`CentreScratch::round_pair`]: times the noise of the centre in deviations of the beam; likeness from which on, from
/// which on surely, and from which on no longer; and the deviations of the beam that are worth a flag.
const TWIN_NOISE: f64 = 4.0;
const TWIN_FROM: f64 = 0.35;
const TWIN_SURE: f64 = 0.8;
const TWIN_NOT: f64 = 3.2;
const TWIN: f64 = 0.1;
const TWIN_NEAR: f64 = 0.25;
const TWIN_NEAR_MOST: f64 = 0.4;
const LONG: f64 = 0.3;
const LONG_MOST: f64 = 0.15;
