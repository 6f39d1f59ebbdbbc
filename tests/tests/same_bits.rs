//! The same bits for every instruction set, number of threads, batch size and grouping of suns.

#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail and talk"
)]

use helio_core::{
    AxisLimits, EnuUnit, Field, Heliostat, OffsetForm, Present, SimdLevel, Status, TrackOptions,
    Tracker, Tracking, TrackingMode,
};
use helio_tests::cases::{self, MODES};
use helio_tests::{Rng, V3};

const LARGEST: usize = 100_003;
const SIZES: [usize; 9] = [1, 7, 8, 31, 32, 33, 1000, 12_345, LARGEST];
const THREADS: [usize; 4] = [1, 2, 7, 16];
const FORMS: [OffsetForm; 4] = [
    OffsetForm::Exact,
    OffsetForm::Approximate,
    OffsetForm::Iterated(2),
    OffsetForm::None,
];

#[derive(Debug, Clone, Copy, PartialEq)]
enum Limited {
    No,
    Uniform,
    PerHeliostat,
}

fn modes() -> Vec<TrackingMode> {
    (0..MODES - 1)
        .map(|number| cases::mode(number, 0.6))
        .collect()
}

/// A few hundred heliostats of every fate, then repeated at other places up to a size.
fn heliostats(rng: &mut Rng, mode: TrackingMode, sun: V3, count: usize) -> Vec<Heliostat> {
    let mut all: Vec<Heliostat> = (0..777)
        .map(|row| {
            // stretches where all is well, for the fast paths, and others where nothing is
            if row % 300 < 200 {
                cases::heliostat(rng, cases::Kind::Anywhere, mode, sun)
            } else {
                cases::messy(rng, mode, sun)
            }
        })
        .collect();
    while all.len() < count {
        let mut h = all[rng.below(777)];
        h.aim.east += rng.within(1e-3);
        h.errors.azimuth_reference_rad = rng.within(3.0);
        all.push(h);
    }
    all.truncate(count);
    all
}

fn limit(all: &mut [Heliostat], limited: Limited) {
    for (row, h) in all.iter_mut().enumerate() {
        match limited {
            Limited::No => h.limits = AxisLimits::NONE,
            Limited::Uniform => {
                h.limits = AxisLimits {
                    axis1_min_rad: -4.0,
                    axis1_max_rad: 5.0,
                    axis2_min_rad: -2.2,
                    axis2_max_rad: 3.9,
                };
            }
            // wide open where the fast path is to be met
            Limited::PerHeliostat if row % 300 < 100 => {
                h.limits = AxisLimits {
                    axis1_min_rad: -7.0,
                    axis1_max_rad: 9.0,
                    axis2_min_rad: -8.0,
                    axis2_max_rad: 8.0,
                };
            }
            Limited::PerHeliostat => {}
        }
    }
}

type Bits = (u64, u64, u64, u64, Status);

fn bits(tracking: &Tracking, row: usize) -> Bits {
    (
        tracking.axis1_rad()[row].to_bits(),
        tracking.axis2_rad()[row].to_bits(),
        tracking.incidence_rad()[row].to_bits(),
        tracking.limit_excess_rad()[row].to_bits(),
        tracking.status()[row],
    )
}

fn compare(want: &[Bits], got: &Tracking, what: &dyn Fn() -> String) {
    assert_eq!(want.len(), got.status().len(), "{}", what());
    for (row, want) in want.iter().enumerate() {
        assert_eq!(*want, bits(got, row), "row {row}: {}", what());
    }
}

fn all_bits(tracking: &Tracking) -> Vec<Bits> {
    (0..tracking.status().len())
        .map(|row| bits(tracking, row))
        .collect()
}

fn options(threads: usize, level: SimdLevel) -> TrackOptions {
    TrackOptions {
        threads,
        level: Some(level),
    }
}

fn part(field: &Field, count: usize) -> Field {
    cases::field(field.mode(), &field.heliostats()[..count])
}

fn present(rng: &mut Rng, count: usize) -> [Vec<f64>; 2] {
    let mut column = || -> Vec<f64> {
        (0..count)
            .map(|_| {
                if rng.chance(0.1) {
                    f64::NAN
                } else {
                    rng.within(9.0)
                }
            })
            .collect()
    };
    [column(), column()]
}

fn pools() -> Vec<(usize, rayon::ThreadPool)> {
    THREADS
        .iter()
        .map(|&threads| {
            (
                threads,
                rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap(),
            )
        })
        .collect()
}

/// Instruction sets × threads × batch sizes × offset forms × limits × present × modes.
#[test]
fn the_same_bits_however_it_is_computed() {
    let pools = pools();
    let mut calls = 0_usize;
    let mut seen = [0_usize; 7];
    for (number, mode) in modes().into_iter().enumerate() {
        for (kind, limited) in [Limited::No, Limited::Uniform, Limited::PerHeliostat]
            .into_iter()
            .enumerate()
        {
            let mut rng = Rng::new(50 + 10 * number as u64 + kind as u64);
            let sun = cases::sun(&mut rng);
            let mut all = heliostats(&mut rng, mode, sun.into(), LARGEST);
            limit(&mut all, limited);
            let field = cases::field(mode, &all);
            let parts: Vec<Field> = SIZES.iter().map(|&size| part(&field, size)).collect();
            let columns = present(&mut rng, LARGEST);
            for form in FORMS {
                let trackers: Vec<Tracker> = parts
                    .iter()
                    .map(|part| Tracker::new(part, form).unwrap())
                    .collect();
                for with_present in [false, true] {
                    let here = |size: usize| {
                        with_present.then(|| Present {
                            axis1_rad: &columns[0][..size],
                            axis2_rad: &columns[1][..size],
                        })
                    };
                    let mut out = Tracking::default();
                    // the scalar path on one thread is the oracle
                    let one = options(1, SimdLevel::Scalar);
                    trackers[SIZES.len() - 1]
                        .track_into(&[sun], here(LARGEST), &one, &mut out)
                        .unwrap();
                    let oracle = all_bits(&out);
                    for (_, _, _, _, status) in &oracle {
                        seen[usize::from(status.code())] += 1;
                    }
                    for (tracker, &size) in trackers.iter().zip(&SIZES) {
                        for &level in SimdLevel::available() {
                            for (threads, pool) in &pools {
                                // without a present only large batches have work for a second thread;
                                // the scalar path of the largest is the oracle itself
                                if size < 20_000 && *threads == 7 {
                                    continue;
                                }
                                let what = || {
                                    format!(
                                        "{mode:?} {limited:?} {form:?} present {with_present} size {size} {level} threads {threads}"
                                    )
                                };
                                pool.install(|| {
                                    tracker.track_into(
                                        &[sun],
                                        here(size),
                                        &options(*threads, level),
                                        &mut out,
                                    )
                                })
                                .unwrap();
                                compare(&oracle[..size], &out, &what);
                                calls += 1;
                            }
                        }
                    }
                }
            }
        }
    }
    eprintln!("{calls} calls; rows of the oracles by status: {seen:?}");
    for status in Status::ALL {
        if !matches!(status, Status::SunBelowHorizon | Status::MissesTarget) {
            assert!(seen[usize::from(status.code())] > 1000, "{status}");
        }
    }
}

/// So large that answers are written past the caches, and several suns at once, in buffers reused
/// from calls of another size.
#[test]
fn many_suns_are_as_many_calls() {
    let pools = pools();
    let mut rng = Rng::new(51);
    let mut out = Tracking::default();
    for (number, count) in [
        (0, 100_000),
        (0, 33_333),
        (1, 30_000),
        (2, 24_576),
        (3, 1_001),
        (0, 640),
        (1, 5),
    ] {
        let mode = cases::mode(number, 0.6);
        let mut suns: Vec<EnuUnit> = (0..7).map(|_| cases::sun(&mut rng)).collect();
        let down = V3::from(suns[3]);
        suns[3] = EnuUnit::try_new(V3(down.0, down.1, -down.2).enu()).unwrap();
        for limited in [Limited::No, Limited::PerHeliostat] {
            let mut all = heliostats(&mut rng, mode, suns[0].into(), count);
            limit(&mut all, limited);
            let tracker = Tracker::new(&cases::field(mode, &all), OffsetForm::Exact).unwrap();
            let mut oracle = Vec::new();
            let mut single = Tracking::default();
            for sun in &suns {
                tracker
                    .track_into(&[*sun], None, &options(1, SimdLevel::Scalar), &mut single)
                    .unwrap();
                oracle.extend(all_bits(&single));
            }
            assert_eq!(all_bits(&tracker.track(suns[1])), oracle[count..2 * count]);
            for &level in SimdLevel::available() {
                for (threads, pool) in &pools {
                    pool.install(|| {
                        tracker.track_into(&suns, None, &options(*threads, level), &mut out)
                    })
                    .unwrap();
                    assert_eq!((out.suns(), out.heliostats()), (suns.len(), count));
                    assert_eq!(out.rows_of_sun(2), 2 * count..3 * count);
                    compare(&oracle, &out, &|| {
                        format!("{mode:?} {count} {level} threads {threads}")
                    });
                }
                // a pool of its own size, threads left to it
                tracker
                    .track_into(
                        &suns,
                        None,
                        &TrackOptions {
                            threads: 0,
                            level: Some(level),
                        },
                        &mut out,
                    )
                    .unwrap();
                compare(&oracle, &out, &|| {
                    format!("{mode:?} {count} {level} threads 0")
                });
            }
        }
    }
}

/// One sun over so many heliostats that answers go past the caches.
#[test]
fn one_sun_over_a_large_field() {
    let mut rng = Rng::new(52);
    let mode = TrackingMode::AzimuthElevation;
    let sun = cases::sun(&mut rng);
    for count in [524_288, 600_001] {
        let mut all = heliostats(&mut rng, mode, sun.into(), count);
        limit(&mut all, Limited::No);
        let tracker = Tracker::new(&cases::field(mode, &all), OffsetForm::Exact).unwrap();
        let mut out = Tracking::default();
        tracker
            .track_into(&[sun], None, &options(1, SimdLevel::Scalar), &mut out)
            .unwrap();
        let oracle = all_bits(&out);
        for &level in SimdLevel::available() {
            for threads in THREADS {
                tracker
                    .track_into(&[sun], None, &options(threads, level), &mut out)
                    .unwrap();
                compare(&oracle, &out, &|| {
                    format!("{count} {level} threads {threads}")
                });
            }
        }
    }
}

/// Chained from a present position: several suns at once are as many calls, each from the answer before.
#[test]
fn a_chain_of_suns_is_as_many_calls() {
    let mut rng = Rng::new(53);
    for number in 0..MODES {
        let mode = cases::mode(number, 0.6);
        let mut suns: Vec<EnuUnit> = (0..5).map(|_| cases::sun(&mut rng)).collect();
        let down = V3::from(suns[2]);
        suns[2] = EnuUnit::try_new(V3(down.0, down.1, -down.2).enu()).unwrap();
        let count = 2_345;
        let all = heliostats(&mut rng, mode, suns[0].into(), count);
        let tracker = Tracker::new(&cases::field(mode, &all), OffsetForm::Exact).unwrap();
        let [mut axis1, mut axis2] = present(&mut rng, count);
        let start = [axis1.clone(), axis2.clone()];
        let mut single = Tracking::default();
        let mut oracle = Vec::new();
        for sun in &suns {
            let here = Present {
                axis1_rad: &axis1,
                axis2_rad: &axis2,
            };
            tracker
                .track_into(
                    &[*sun],
                    Some(here),
                    &options(1, SimdLevel::Scalar),
                    &mut single,
                )
                .unwrap();
            oracle.extend(all_bits(&single));
            for row in 0..count {
                if single.status()[row] == Status::Ok {
                    axis1[row] = single.axis1_rad()[row];
                    axis2[row] = single.axis2_rad()[row];
                }
            }
        }
        let here = Present {
            axis1_rad: &start[0],
            axis2_rad: &start[1],
        };
        let mut out = Tracking::default();
        for &level in SimdLevel::available() {
            for threads in [0, 1, 2, 7] {
                tracker
                    .track_into(&suns, Some(here), &options(threads, level), &mut out)
                    .unwrap();
                compare(&oracle, &out, &|| {
                    format!("{mode:?} {level} threads {threads}")
                });
            }
        }
    }
}

/// Heliostats without limits get the same bits whether or not another one has some; and a present
/// that is nowhere known is none.
#[test]
fn a_limited_neighbour_changes_nothing() {
    let mut rng = Rng::new(54);
    for number in 0..MODES {
        let mode = cases::mode(number, 0.6);
        let sun = cases::sun(&mut rng);
        let mut all = heliostats(&mut rng, mode, sun.into(), 1_500);
        limit(&mut all, Limited::No);
        for form in FORMS {
            let alone = Tracker::new(&cases::field(mode, &all), form).unwrap();
            let oracle = all_bits(&alone.track(sun));
            let mut with_other = all.clone();
            let mut other = all[0];
            other.limits = AxisLimits {
                axis1_min_rad: -1.0,
                axis1_max_rad: 1.0,
                ..AxisLimits::NONE
            };
            with_other.push(other);
            let both = Tracker::new(&cases::field(mode, &with_other), form).unwrap();
            let nan = vec![f64::NAN; 1_500];
            let unknown = Present {
                axis1_rad: &nan,
                axis2_rad: &nan,
            };
            let mut out = Tracking::default();
            for &level in SimdLevel::available() {
                both.track_into(&[sun], None, &options(1, level), &mut out)
                    .unwrap();
                for (row, want) in oracle.iter().enumerate() {
                    assert_eq!(
                        *want,
                        bits(&out, row),
                        "{mode:?} {form:?} {level} row {row}"
                    );
                }
                alone
                    .track_into(&[sun], Some(unknown), &options(1, level), &mut out)
                    .unwrap();
                compare(&oracle, &out, &|| {
                    format!("unknown present {mode:?} {form:?} {level}")
                });
            }
        }
    }
}

/// Forward is the same for the first heliostats of a larger field.
#[test]
fn forward_of_a_part_is_part_of_forward() {
    let mut rng = Rng::new(55);
    for number in 0..MODES {
        let mode = cases::mode(number, 0.6);
        let sun = cases::sun(&mut rng);
        let all = heliostats(&mut rng, mode, sun.into(), 1_003);
        let field = cases::field(mode, &all);
        let axes: [Vec<f64>; 2] = [0, 1].map(|_| (0..1_003).map(|_| rng.within(20.0)).collect());
        let whole = Tracker::new(&field, OffsetForm::Exact)
            .unwrap()
            .forward(&axes[0], &axes[1])
            .unwrap();
        for size in [1, 3, 7, 8, 9, 31, 64, 1_000] {
            let tracker = Tracker::new(&part(&field, size), OffsetForm::None).unwrap();
            let some = tracker.forward(&axes[0][..size], &axes[1][..size]).unwrap();
            for (a, b) in some.iter().zip(&whole) {
                let bits = |n: &EnuUnit| {
                    let v = n.as_enu();
                    [v.east.to_bits(), v.north.to_bits(), v.up.to_bits()]
                };
                assert_eq!(bits(a), bits(b), "{mode:?} {size}");
            }
        }
    }
}
