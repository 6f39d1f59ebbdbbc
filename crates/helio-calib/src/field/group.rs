//! Eight heliostats side by side.

use helio_core::lanes::{BLOCK, Columns, Lanes, prefetch};
use helio_core::{Enu, TargetPlane};

use super::Campaign;
use super::formula::{AXIS1, AXIS2, ROW, SPOT, SUN, Segment, WEIGHT};
use super::lane::{Eight, Lane};
use crate::model::Real;
use crate::observation::{Mount, Observation};

/// Rows that are filled at once.
const TOGETHER: usize = 8;

/// Cache lines of an observation.
const LINES: usize = size_of::<Observation>().div_ceil(64);

/// Asks for the memory of the observation `ahead` places on.
#[inline(always)]
fn ask_for(observation: &Observation, ahead: usize) {
    for line in 0..LINES {
        prefetch(observation, ahead, line);
    }
}

/// Asks for the first observations of campaigns to come: [`Group::fill`] asks for the others as it goes.
pub(super) fn ask_for_first<'a>(campaigns: impl Iterator<Item = &'a Campaign<'a>>) {
    for campaign in campaigns {
        for observation in campaign.observations.iter().take(TOGETHER) {
            ask_for(observation, 0);
        }
    }
}

/// Greatest departure of a plane's axes from square ones of length one.
const SQUARE: f64 = 1e-12;

/// Room for eight heliostats, used again and again.
#[derive(Debug, Default)]
pub(super) struct Group {
    /// May be longer than the last segment's end.
    pub rows: Vec<Columns<ROW>>,
    pub segments: Vec<Segment>,
    /// Of each segment, along east, north and up: xi, eta, nt; then pivot → centre along xi and eta.
    world: Vec<Columns<11>>,
    pub offset_m: Eight,
    /// 1 where a sigma is stated; where none is, residuals are their own weighted ones.
    pub stated: Eight,
    /// How many observations state a sigma.
    stated_count: [usize; BLOCK],
    planes: [Vec<OfPlane>; BLOCK],
}

/// Observations of one heliostat on one plane.
#[derive(Debug)]
struct OfPlane {
    plane: TargetPlane,
    rows: Vec<usize>,
}

#[inline(always)]
fn numbers(plane: &TargetPlane) -> [f64; 12] {
    let [n, r, d] = [
        plane.normal.as_enu(),
        plane.right.as_enu(),
        plane.down.as_enu(),
    ];
    let c = plane.centre;
    [
        c.east, c.north, c.up, n.east, n.north, n.up, r.east, r.north, r.up, d.east, d.north, d.up,
    ]
}

/// Zero if they are the same to the last bit. Without a branch for each number, as most are the same.
#[inline(always)]
fn difference(a: &TargetPlane, b: &TargetPlane) -> u64 {
    let (a, b) = (numbers(a), numbers(b));
    let mut apart = 0;
    for k in 0..a.len() {
        apart |= a[k].to_bits() ^ b[k].to_bits();
    }
    apart
}

fn same(a: &TargetPlane, b: &TargetPlane) -> bool {
    difference(a, b) == 0
}

/// True if the kernel's frame of the target is one: square, of length one, and of the hand of `TargetPlane::level`.
fn is_frame(plane: &TargetPlane) -> bool {
    let [n, r, d] = [plane.normal, plane.right, plane.down].map(|axis| axis.as_enu());
    let away = [
        r.dot(r) - 1.0,
        d.dot(d) - 1.0,
        r.dot(d),
        (r.cross(d) + n).norm(),
    ];
    away.iter().all(|x| x.abs() < SQUARE)
}

impl Group {
    /// Takes eight campaigns, none without observations. False where they are not for the lanes: a plane's axes are
    /// not square, or some observations state a sigma and others none.
    ///
    /// Not part of the kernel: with its instructions the compiler would gather and scatter, which is slower.
    pub fn fill(&mut self, campaigns: &[&Campaign<'_>; BLOCK]) -> [bool; BLOCK] {
        if !self.fill_alike(campaigns) {
            self.fill_mixed(campaigns);
        }
        let mut fit = [true; BLOCK];
        for (lane, campaign) in campaigns.iter().enumerate() {
            self.offset_m[lane] = campaign.mount.mirror_offset_m;
            self.stated[lane] = f64::from(u8::from(self.stated_count[lane] > 0));
            let first = campaign.observations.first();
            let stated = self.stated_count[lane];
            fit[lane] = (stated == 0 || stated == campaign.observations.len())
                && first.is_none_or(|o| is_frame(&o.plane))
                && (self.segments.len() == 1
                    || self.planes[lane].iter().all(|of| is_frame(&of.plane)));
        }
        fit
    }

    /// If every heliostat saw one target only.
    fn fill_alike(&mut self, campaigns: &[&Campaign<'_>; BLOCK]) -> bool {
        self.segments.clear();
        self.world.clear();
        let counts = campaigns.map(|campaign| campaign.observations.len());
        let longest = counts.into_iter().max().unwrap_or(0);
        self.start_segment(
            campaigns,
            longest,
            &campaigns.map(|c| c.observations[0].plane),
        );
        if self.rows.len() < longest {
            self.rows.resize(longest, Columns([[0.0; BLOCK]; ROW]));
        }
        let mut apart = 0;
        self.stated_count = [0; BLOCK];
        // Some rows of each heliostat in turn: reads follow memory, writes stay in the nearest cache.
        for (block, rows) in self.rows[..longest].chunks_mut(TOGETHER).enumerate() {
            let begin = block * TOGETHER;
            for (lane, campaign) in campaigns.iter().enumerate() {
                let observations = campaign.observations;
                let first = &observations[0];
                let some = observations.get(begin..).unwrap_or(&[]);
                for (row, observation) in rows.iter_mut().zip(some) {
                    ask_for(observation, TOGETHER);
                    apart |= difference(&first.plane, &observation.plane);
                    place(row, lane, observation);
                    self.stated_count[lane] += usize::from(observation.sigma_m.is_some());
                }
                for row in rows.iter_mut().skip(some.len()) {
                    place(row, lane, first);
                    row.0[WEIGHT][lane] = f64::INFINITY;
                }
            }
        }
        apart == 0
    }

    fn start_segment(
        &mut self,
        campaigns: &[&Campaign<'_>; BLOCK],
        end: usize,
        planes: &[TargetPlane; BLOCK],
    ) {
        let mut segment = Segment {
            plane: Columns([[0.0; BLOCK]; 10]),
            end,
        };
        let mut world = Columns([[0.0; BLOCK]; 11]);
        for (lane, (campaign, plane)) in campaigns.iter().zip(planes).enumerate() {
            place_plane(&campaign.mount, plane, lane, &mut segment.plane, &mut world);
        }
        self.segments.push(segment);
        self.world.push(world);
    }

    /// If some heliostat saw several targets: those with most observations side by side.
    #[inline(never)]
    fn fill_mixed(&mut self, campaigns: &[&Campaign<'_>; BLOCK]) {
        for (lane, campaign) in campaigns.iter().enumerate() {
            self.sort_by_plane(lane, campaign.observations);
        }
        self.rows.clear();
        self.segments.clear();
        self.world.clear();
        let count = self.planes.iter().map(Vec::len).max().unwrap_or(0);
        for number in 0..count {
            let first = self.rows.len();
            let longest = self
                .planes
                .iter()
                .map(|of| of.get(number).map_or(0, |of| of.rows.len()));
            let end = first + longest.max().unwrap_or(0);
            self.rows.resize(end, Columns([[0.0; BLOCK]; ROW]));
            let planes = core::array::from_fn(|lane| {
                let own = self.planes[lane].get(number);
                own.map_or(campaigns[lane].observations[0].plane, |of| of.plane)
            });
            self.start_segment(campaigns, end, &planes);
            for (lane, campaign) in campaigns.iter().enumerate() {
                let observations = campaign.observations;
                let chosen = self.planes[lane].get(number).map_or(&[][..], |of| &of.rows);
                for (row, &which) in self.rows[first..end].iter_mut().zip(chosen) {
                    place(row, lane, &observations[which]);
                }
                let filler = chosen
                    .first()
                    .map_or(&observations[0], |&k| &observations[k]);
                for row in &mut self.rows[first + chosen.len()..end] {
                    place(row, lane, filler);
                    row.0[WEIGHT][lane] = f64::INFINITY;
                }
            }
        }
    }

    /// The planes of a lane, those with most observations first.
    fn sort_by_plane(&mut self, lane: usize, observations: &[Observation]) {
        let planes = &mut self.planes[lane];
        let mut used = 0;
        let mut last = 0;
        for (row, observation) in observations.iter().enumerate() {
            if used == 0 || !same(&planes[last].plane, &observation.plane) {
                let found = planes[..used]
                    .iter()
                    .position(|of| same(&of.plane, &observation.plane));
                last = found.unwrap_or(used);
                if last == used {
                    if used == planes.len() {
                        planes.push(OfPlane {
                            plane: observation.plane,
                            rows: Vec::new(),
                        });
                    }
                    planes[used].plane = observation.plane;
                    planes[used].rows.clear();
                    used += 1;
                }
            }
            planes[last].rows.push(row);
        }
        planes.truncate(used);
        planes.sort_by_key(|of| core::cmp::Reverse(of.rows.len()));
    }

    /// From observations as given to sightings of some lanes, in place. The greatest encoder angle of each
    /// lane, and its least weight that is not zero: what is not fit for the kernel.
    #[inline(always)]
    pub fn prepare<L: Lanes>(&mut self, lane: usize) -> [Lane<L>; 2] {
        let zero = Lane::splat(0.0);
        let mut greatest = zero;
        let mut least = Lane::splat(f64::INFINITY);
        let mut first = 0;
        for (segment, world) in self.segments.iter().zip(&self.world) {
            let mut axes = [Lane::<L>::splat(0.0); 11];
            for (axis, column) in axes.iter_mut().zip(&world.0) {
                *axis = Lane::read(column, lane);
            }
            for row in &mut self.rows[first..segment.end] {
                let columns = &mut row.0;
                let mut sun = [Lane::<L>::splat(0.0); 3];
                for k in 0..3 {
                    sun[k] = Lane::read(&columns[SUN + k], lane);
                }
                let mut turned = sun;
                for k in 0..3 {
                    let [east, north, up] = [axes[3 * k], axes[3 * k + 1], axes[3 * k + 2]];
                    turned[k] = sun[2].mul_add(up, sun[1].mul_add(north, sun[0] * east));
                }
                let spot = [
                    Lane::read(&columns[SPOT], lane) + axes[9],
                    Lane::read(&columns[SPOT + 1], lane) + axes[10],
                ];
                let angles = [
                    Lane::<L>::read(&columns[AXIS1], lane),
                    Lane::<L>::read(&columns[AXIS2], lane),
                ];
                let weight = Lane::splat(1.0) / Lane::<L>::read(&columns[WEIGHT], lane);
                weight.write(&mut columns[WEIGHT], lane);
                least = least.min(Lane::select(zero.lt(weight), weight, Lane::splat(1.0)));
                least = Lane::select(weight.lt(zero), weight, least);
                greatest = greatest.max(angles[0].abs().max(angles[1].abs()));
                for (k, value) in turned.into_iter().enumerate() {
                    value.write(&mut columns[SUN + k], lane);
                }
                for (k, value) in spot.into_iter().enumerate() {
                    value.write(&mut columns[SPOT + k], lane);
                }
                for (angle, place) in angles.into_iter().zip([AXIS1, AXIS2]) {
                    let (sine, cosine) = angle.sin_cos();
                    cosine.write(&mut columns[place], lane);
                    sine.write(&mut columns[place + 1], lane);
                }
            }
            first = segment.end;
        }
        [greatest, least]
    }
}

#[inline(always)]
fn place(row: &mut Columns<ROW>, lane: usize, observation: &Observation) {
    let sun = observation.sun.as_enu();
    let columns = &mut row.0;
    columns[SUN][lane] = sun.east;
    columns[SUN + 1][lane] = sun.north;
    columns[SUN + 2][lane] = sun.up;
    columns[AXIS1][lane] = observation.axis1_rad;
    columns[AXIS2][lane] = observation.axis2_rad;
    columns[SPOT][lane] = observation.u_m;
    columns[SPOT + 1][lane] = observation.v_m;
    // Until the lanes take its reciprocal. An infinite one is none, but would count as a place to fill.
    let sigma_m = observation.sigma_m.unwrap_or(1.0);
    columns[WEIGHT][lane] = if sigma_m == f64::INFINITY {
        f64::NAN
    } else {
        sigma_m
    };
}

fn place_plane(
    mount: &Mount,
    plane: &TargetPlane,
    lane: usize,
    along_mount: &mut Columns<10>,
    along_world: &mut Columns<11>,
) {
    let centre = plane.centre - mount.pivot;
    let axes: [Enu; 3] = [plane.right, plane.down, plane.normal].map(|axis| axis.as_enu());
    for (k, axis) in axes.into_iter().enumerate() {
        let components = mount.components(axis);
        for (j, value) in components.into_iter().enumerate() {
            along_mount.0[3 * k + j][lane] = value;
        }
        for (j, value) in [axis.east, axis.north, axis.up].into_iter().enumerate() {
            along_world.0[3 * k + j][lane] = value;
        }
    }
    along_world.0[9][lane] = axes[0].dot(centre);
    along_world.0[10][lane] = axes[1].dot(centre);
    along_mount.0[9][lane] = axes[2].dot(centre);
}
