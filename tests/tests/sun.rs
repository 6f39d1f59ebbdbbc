//! Sun positions: the report's example, recorded positions, and bulk against direct evaluation.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // also in helpers outside the tests proper

use std::env;
use std::fs;
use std::path::Path;

use helio_core::angle::{degrees, radians, wrap_pi};
use helio_core::sun::{
    SunEphemeris, SunError, SunPosition, SunPositions, SunSite, estimated_delta_t_s, position,
    positions, refraction_rad, standard_pressure_hpa,
};
use helio_core::{Enu, EnuUnit, SimdLevel};

const SECOND: i64 = 1_000_000_000;
const HALF_DAY: i64 = 43_200 * SECOND;
const DAY: i64 = 2 * HALF_DAY;
/// 1950-01-01T00:00:00Z and 2050-01-01T00:00:00Z
const Y1950: i64 = -631_152_000 * SECOND;
const Y2050: i64 = 2_524_608_000 * SECOND;
/// 1900-01-01T00:00:00Z and 2100-01-01T00:00:00Z
const Y1900: i64 = -2_208_988_800 * SECOND;
const Y2100: i64 = 4_102_444_800 * SECOND;

/// The bar: bulk within this of direct evaluation.
const BAR_DEG: f64 = 1e-8;

/// SplitMix64: the same numbers on every machine.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn instant(&mut self, from: i64, to: i64) -> i64 {
        from + (self.bits() % from.abs_diff(to)) as i64
    }
}

fn site(latitude_deg: f64, longitude_deg: f64, elevation_m: f64) -> SunSite {
    SunSite::new(radians(latitude_deg), radians(longitude_deg), elevation_m).unwrap()
}

/// Sites from pole to pole, some in the tropics, one far below the sea and one far above.
fn sites() -> Vec<SunSite> {
    [
        (50.913_421, 6.387_825, 87.0),      // Jülich
        (40.063, 94.426, 1138.0),           // Dunhuang
        (34.962_276, -106.509_606, 1700.0), // Albuquerque
        (-22.77, -69.48, 1100.0),           // Atacama
        (-33.86, 151.2, 20.0),              // Sydney
        (0.0, 0.0, 0.0),
        (12.3, 179.999, 8000.0),
        (-15.0, -179.999, -430.0),
        (69.7, 18.9, 100.0), // Tromsø
        (90.0, 0.0, 2800.0),
        (-90.0, 30.0, 2835.0),
    ]
    .map(|(latitude, longitude, elevation)| site(latitude, longitude, elevation))
    .to_vec()
}

/// Largest differences seen, in degrees.
#[derive(Debug, Default)]
struct Worst {
    geometric_elevation: f64,
    apparent_elevation: f64,
    level_azimuth: f64,
    geometric_separation: f64,
    apparent_separation: f64,
}

impl Worst {
    fn see(&mut self, got: SunPosition, want: SunPosition) {
        let grow = |worst: &mut f64, difference_rad: f64| {
            // a NaN must not pass for small
            let difference = degrees(difference_rad).abs();
            *worst = if difference <= *worst {
                *worst
            } else {
                difference
            };
        };
        let apart = |a: EnuUnit, b: EnuUnit| (a.as_enu() - b.as_enu()).norm();
        grow(
            &mut self.geometric_elevation,
            got.geometric_elevation_rad - want.geometric_elevation_rad,
        );
        grow(
            &mut self.apparent_elevation,
            got.apparent_elevation_rad - want.apparent_elevation_rad,
        );
        grow(
            &mut self.level_azimuth,
            wrap_pi(got.azimuth_rad - want.azimuth_rad) * want.geometric_elevation_rad.cos(),
        );
        grow(
            &mut self.geometric_separation,
            apart(got.geometric_direction(), want.geometric_direction()),
        );
        grow(
            &mut self.apparent_separation,
            apart(got.direction(), want.direction()),
        );
    }

    fn all(&self) -> [f64; 5] {
        [
            self.geometric_elevation,
            self.apparent_elevation,
            self.level_azimuth,
            self.geometric_separation,
            self.apparent_separation,
        ]
    }

    fn assert_below(&self, bar_deg: f64) {
        println!("{self:?}");
        for value in self.all() {
            assert!(value < bar_deg, "{self:?}");
        }
    }
}

fn bits(suns: &SunPositions) -> Vec<[u64; 3]> {
    suns.iter()
        .map(|sun| {
            [
                sun.azimuth_rad.to_bits(),
                sun.apparent_elevation_rad.to_bits(),
                sun.geometric_elevation_rad.to_bits(),
            ]
        })
        .collect()
}

// NREL/TP-560-34302 appendix A.5
#[test]
fn the_reports_worked_example() {
    let golden = site(39.742_476, -105.1786, 1830.14)
        .with_pressure_hpa(820.0)
        .unwrap()
        .with_temperature_c(11.0)
        .unwrap();
    let unix_ns = 1_066_419_030 * SECOND; // 2003-10-17T12:30:30-07:00
    let direct = position(&golden, unix_ns, Some(67.0), 0.0).unwrap();
    let bulk = positions(&golden, &[unix_ns], Some(67.0), 0.0)
        .unwrap()
        .get(0)
        .unwrap();
    for sun in [direct, bulk] {
        let geometric_deg = degrees(sun.geometric_elevation_rad);
        let apparent_deg = degrees(sun.apparent_elevation_rad);
        assert!((geometric_deg - 39.872_046).abs() < 5e-7, "{geometric_deg}");
        assert!((apparent_deg - geometric_deg - 0.016_332).abs() < 5e-7);
        assert!((90.0 - apparent_deg - 50.111_62).abs() < 5e-6);
        assert!((degrees(sun.azimuth_rad) - 194.340_24).abs() < 5e-6);
        assert!(!sun.is_below_horizon());
    }
}

#[test]
fn recorded_positions_of_juelich() {
    let Some(data) = env::var_os("HELIO_DATA") else {
        println!("skipped: HELIO_DATA is not set");
        return;
    };
    let path = Path::new(&data).join("juelich/sun_positions.csv");
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap().trim_end(),
        "timestamp_utc,sun_azimuth_south_deg,sun_elevation_apparent_deg"
    );
    let rows: Vec<(i64, f64, f64)> = lines
        .map(|line| {
            let cells: Vec<&str> = line.trim_end().split(',').collect();
            (
                unix_ns(cells[0]),
                180.0 - cells[1].parse::<f64>().unwrap(),
                cells[2].parse().unwrap(),
            )
        })
        .collect();
    assert_eq!(rows.len(), 955);
    let instants: Vec<i64> = rows.iter().map(|row| row.0).collect();
    // temperature 12 °C is the default
    let plant = site(50.913_421_122_592_574, 6.387_824_755_874_856, 87.0)
        .with_pressure_hpa(1013.25)
        .unwrap();
    let suns = positions(&plant, &instants, None, 0.0).unwrap();
    let mut both_within = 0;
    let mut elevations = Vec::new();
    let mut azimuths = Vec::new();
    let mut worst = Worst::default();
    for (sun, &(instant, azimuth_deg, elevation_deg)) in suns.iter().zip(&rows) {
        let elevation = degrees(sun.apparent_elevation_rad) - elevation_deg;
        let azimuth = degrees(wrap_pi(sun.azimuth_rad - radians(azimuth_deg)));
        both_within += usize::from(elevation.abs() < 0.003 && azimuth.abs() < 0.007);
        elevations.push(elevation);
        azimuths.push(azimuth);
        worst.see(sun, position(&plant, instant, None, 0.0).unwrap());
    }
    let median = |values: &[f64]| {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let magnitudes = |values: &[f64]| values.iter().map(|x| x.abs()).collect::<Vec<_>>();
    println!(
        "{both_within} of {}; medians {:.5} and {:.5}, of magnitudes {:.5} and {:.5} deg",
        rows.len(),
        median(&elevations),
        median(&azimuths),
        median(&magnitudes(&elevations)),
        median(&magnitudes(&azimuths)),
    );
    // 99.8 %
    assert!(both_within >= 953);
    assert!((median(&elevations) - 0.0003).abs() < 5e-5);
    assert!((median(&azimuths) - 0.0016).abs() < 5e-5);
    assert!(median(&magnitudes(&elevations)) < 0.0005);
    assert!(median(&magnitudes(&azimuths)) < 0.0017);
    worst.assert_below(BAR_DEG);
}

/// A time stamp like 2022-01-06T12:50:41Z, by the days of the civil calendar.
fn unix_ns(stamp: &str) -> i64 {
    assert!(stamp.len() == 20 && stamp.ends_with('Z'), "{stamp}");
    let number = |range: std::ops::Range<usize>| stamp[range].parse::<i64>().unwrap();
    let (year, month, day) = (number(0..4), number(5..7), number(8..10));
    let leap = |y: i64| y % 4 == 0 && (y % 100 != 0 || y % 400 == 0);
    let lengths = [
        31,
        28 + i64::from(leap(year)),
        31,
        30,
        31,
        30,
        31,
        31,
        30,
        31,
        30,
    ];
    let days = (1970..year).map(|y| 365 + i64::from(leap(y))).sum::<i64>()
        + lengths[..month as usize - 1].iter().sum::<i64>()
        + day
        - 1;
    (days * 86_400 + number(11..13) * 3600 + number(14..16) * 60 + number(17..19)) * SECOND
}

#[test]
fn bulk_agrees_with_direct_evaluation_everywhere() {
    let mut random = Random(1);
    let ephemeris = SunEphemeris::new(Y1950, Y2050, None, 0.0).unwrap();
    let mut worst = Worst::default();
    let mut suns = SunPositions::default();
    for site in sites() {
        let instants: Vec<i64> = (0..12_000).map(|_| random.instant(Y1950, Y2050)).collect();
        ephemeris
            .positions_into(&site, &instants, None, &mut suns)
            .unwrap();
        for (row, &instant) in instants.iter().enumerate() {
            let want = position(&site, instant, None, 0.0).unwrap();
            worst.see(suns.get(row).unwrap(), want);
        }
    }
    worst.assert_below(BAR_DEG);
}

#[test]
fn bulk_agrees_with_direct_evaluation_for_any_time_scale() {
    let mut random = Random(2);
    let mut worst = Worst::default();
    for (from, to, delta_t_s, ut1_utc_s) in [
        (Y1900, Y1950, None, 0.0),
        (Y2050, Y2100, None, 0.37),
        (Y1950, Y2050, Some(0.0), -0.9),
        (Y1950, Y2050, Some(8000.0), 10.0),
        (Y1950, Y2050, Some(-8000.0), -10.0),
        (i64::MIN, i64::MIN + DAY, None, -10.0),
        (i64::MAX - DAY, i64::MAX, None, 10.0),
    ] {
        let site = site(
            random.between(-80.0, 80.0),
            random.between(-180.0, 180.0),
            500.0,
        );
        let instants: Vec<i64> = (0..4000)
            .map(|_| random.instant(from, to))
            .chain([from, to])
            .collect();
        let suns = positions(&site, &instants, delta_t_s, ut1_utc_s).unwrap();
        for (sun, &instant) in suns.iter().zip(&instants) {
            worst.see(sun, position(&site, instant, delta_t_s, ut1_utc_s).unwrap());
        }
    }
    worst.assert_below(BAR_DEG);
}

#[test]
fn bulk_agrees_with_direct_evaluation_beside_the_zenith() {
    let mut random = Random(3);
    let mut worst = Worst::default();
    let mut highest = 0.0_f64;
    let pole = site(90.0, 0.0, 0.0);
    for _ in 0..5000 {
        let instant = random.instant(Y1950, Y2050);
        // Seen from the pole, elevation and azimuth are declination and hour angle.
        let there = position(&pole, instant, None, 0.0).unwrap();
        let spread = 10_f64.powf(random.between(-7.0, 0.0));
        let below = SunSite::new(
            there.geometric_elevation_rad + radians(spread * random.between(-1.0, 1.0)),
            wrap_pi(std::f64::consts::PI - there.azimuth_rad)
                + radians(spread * random.between(-1.0, 1.0)).clamp(-1e-3, 1e-3) * 1e-3,
            0.0,
        );
        let Ok(below) = below else { continue };
        let want = position(&below, instant, None, 0.0).unwrap();
        let got = positions(&below, &[instant], None, 0.0)
            .unwrap()
            .get(0)
            .unwrap();
        highest = highest.max(degrees(want.geometric_elevation_rad));
        worst.see(got, want);
    }
    assert!(highest > 89.999, "{highest}");
    worst.assert_below(BAR_DEG);
}

/// Half days are where one polynomial hands over to the next, months and years where estimates of delta
/// T change: the sun must not jump there.
#[test]
fn nothing_jumps_between_half_days() {
    let site = site(37.4, -6.2, 60.0);
    let mut worst = Worst::default();
    let mut worst_jump = Worst::default();
    for ut1_utc_s in [0.0, -0.25] {
        let shift = (ut1_utc_s * 1e9) as i64;
        // a year around each end of a delta T polynomial, and some others
        for year_start in [
            -283_996_800,
            504_921_600,
            1_104_537_600,
            1_420_070_400,
            1_782_864_000,
        ] {
            let from = (year_start - 180 * 86_400) * SECOND - shift;
            let from = from.div_euclid(HALF_DAY) * HALF_DAY - shift;
            let instants: Vec<i64> = (1..720)
                .flat_map(|k| [from + k * HALF_DAY - 1, from + k * HALF_DAY])
                .collect();
            let suns = positions(&site, &instants, None, ut1_utc_s).unwrap();
            for (row, &instant) in instants.iter().enumerate() {
                let sun = suns.get(row).unwrap();
                worst.see(sun, position(&site, instant, None, ut1_utc_s).unwrap());
                if row % 2 == 1 {
                    worst_jump.see(sun, suns.get(row - 1).unwrap());
                }
            }
        }
    }
    worst.assert_below(BAR_DEG);
    // a nanosecond of motion is 4e-12°
    worst_jump.assert_below(1e-9);
}

#[test]
fn same_bits_for_every_level_batch_and_span() {
    let mut random = Random(4);
    let from = 1_767_225_600 * SECOND;
    let sorted: Vec<i64> = (0..3000).map(|k| from + k * 37 * SECOND + k).collect();
    let mixed: Vec<i64> = (0..3000)
        .map(|_| random.instant(from, from + 40 * DAY))
        .collect();
    let wide = SunEphemeris::new(from - 300 * DAY, from + 300 * DAY, None, 0.1).unwrap();
    for site in sites() {
        for instants in [&sorted, &mixed] {
            let want = bits(&positions(&site, instants, None, 0.1).unwrap());
            let mut out = SunPositions::default();
            for &level in SimdLevel::available() {
                wide.positions_into(&site, instants, Some(level), &mut out)
                    .unwrap();
                assert!(bits(&out) == want, "{level}");
                for batch in [1, 7, 8, 31, 33, 127, 128, 129, 1000] {
                    let parts = instants.chunks(batch).zip(want.chunks(batch)).step_by(3);
                    for (part, want) in parts {
                        wide.positions_into(&site, part, Some(level), &mut out)
                            .unwrap();
                        assert!(bits(&out) == want, "{level}, {batch} at a time");
                    }
                }
            }
        }
    }
}

#[test]
fn few_instants_far_apart_have_the_same_bits_too() {
    let site = site(-20.0, 100.0, 300.0);
    let mut instants: Vec<i64> = (0..20)
        .map(|k| Y1950 + k * 1500 * DAY + k * 12_345)
        .collect();
    instants.extend([instants[3] + SECOND, instants[3] + 2 * SECOND, Y2050]);
    let ephemeris = SunEphemeris::new(Y1950, Y2050, None, 0.0).unwrap();
    let mut dense = SunPositions::default();
    ephemeris
        .positions_into(&site, &instants, None, &mut dense)
        .unwrap();
    assert_eq!(
        bits(&positions(&site, &instants, None, 0.0).unwrap()),
        bits(&dense)
    );
}

#[test]
fn columns_follow_the_question() {
    let site = site(10.0, 20.0, 0.0);
    let ephemeris = SunEphemeris::new(0, DAY, None, 0.0).unwrap();
    assert_eq!((ephemeris.from_unix_ns(), ephemeris.to_unix_ns()), (0, DAY));
    let mut out = SunPositions::default();
    for instants in [vec![], vec![0, DAY], vec![DAY], vec![5; 300]] {
        ephemeris
            .positions_into(&site, &instants, None, &mut out)
            .unwrap();
        assert_eq!(out.len(), instants.len());
        assert_eq!(out.apparent_elevation_rad.len(), instants.len());
        assert_eq!(out.geometric_elevation_rad.len(), instants.len());
        assert_eq!(out.is_empty(), instants.is_empty());
        assert_eq!(out.iter().count(), instants.len());
        assert!(out.get(instants.len()).is_none());
    }
    assert!(positions(&site, &[], None, 0.0).unwrap().is_empty());
}

#[test]
fn angles_lie_in_their_ranges_and_refraction_ends_below_the_horizon() {
    let mut random = Random(5);
    for site in sites() {
        let instants: Vec<i64> = (0..2000)
            .map(|_| random.instant(0, 4 * 365 * DAY))
            .collect();
        for sun in positions(&site, &instants, None, 0.0).unwrap().iter() {
            assert!((0.0..std::f64::consts::TAU).contains(&sun.azimuth_rad));
            let lift = sun.apparent_elevation_rad - sun.geometric_elevation_rad;
            let want = refraction_rad(
                sun.geometric_elevation_rad,
                site.pressure_hpa(),
                site.temperature_c(),
            );
            assert!((lift - want).abs() < 1e-15);
            if degrees(sun.geometric_elevation_rad) < -0.83338 {
                assert_eq!(lift, 0.0);
                assert!(sun.is_below_horizon());
            }
        }
    }
}

#[test]
fn directions_point_where_the_angles_say() {
    let noon = position(&site(50.9, 6.4, 87.0), 1_655_810_000 * SECOND, None, 0.0).unwrap();
    let Enu { east, north, up } = noon.direction().as_enu();
    assert!((up - noon.apparent_elevation_rad.sin()).abs() < 1e-15);
    assert!((wrap_pi(east.atan2(north) - noon.azimuth_rad)).abs() < 1e-15);
    assert!(north < -0.4, "a noon sun stands in the south");
    assert!(noon.geometric_direction().as_enu().up < up);
}

#[test]
fn the_standard_atmosphere() {
    // ICAO Doc 7488
    for (elevation_m, pressure_hpa) in [
        (-500.0, 1074.78),
        (0.0, 1013.25),
        (1000.0, 898.75),
        (3000.0, 701.09),
        (11_000.0, 226.32),
    ] {
        let got = standard_pressure_hpa(elevation_m);
        assert!((got - pressure_hpa).abs() < 0.02, "{elevation_m}: {got}");
    }
    assert_eq!(
        site(0.0, 0.0, 3000.0).pressure_hpa(),
        standard_pressure_hpa(3000.0)
    );
}

#[test]
fn delta_t_runs_without_steps() {
    // IERS: 1973.0 43.37 s, 2000.0 63.83 s, 2017.0 68.59 s, 2023.0 69.20 s
    for (unix_s, observed_s) in [
        (94_694_400, 43.37),
        (946_684_800, 63.83),
        (1_483_228_800, 68.59),
        (1_672_531_200, 69.2),
    ] {
        let got = estimated_delta_t_s(unix_s * SECOND).unwrap();
        assert!((got - observed_s).abs() < 0.3, "{unix_s}: {got}");
    }
    let mut before = estimated_delta_t_s(Y1900).unwrap();
    for step in 1..73_000 {
        let here = estimated_delta_t_s(Y1900 + step * DAY).unwrap();
        assert!((here - before).abs() < 0.3, "{step}");
        before = here;
    }
}

#[test]
fn wrong_calls_say_what_is_wrong() {
    let good = site(10.0, 20.0, 0.0);
    let says = |error: SunError, want: &str| assert_eq!(error.to_string(), want);
    says(
        SunSite::new(50.9, 0.1, 0.0).unwrap_err(),
        "sun position: latitude_rad must be within ±π/2 (±90°), got 50.9",
    );
    says(
        SunSite::new(0.1, f64::NAN, 0.0).unwrap_err(),
        "sun position: longitude_rad must be within ±π (±180°), got NaN",
    );
    says(
        SunSite::new(0.1, 0.1, 12_000.0).unwrap_err(),
        "sun position: elevation_m must be between -500 and 11000 m, got 12000",
    );
    says(
        good.with_pressure_hpa(101_325.0).unwrap_err(),
        "sun position: pressure_hpa must be between 0 and 2000 hPa, got 101325",
    );
    says(
        good.with_temperature_c(285.15).unwrap_err(),
        "sun position: temperature_c must be between -100 and 100 °C, got 285.15",
    );
    says(
        position(&good, 0, Some(f64::INFINITY), 0.0).unwrap_err(),
        "sun position: delta_t_s must be within ±8000 s, got inf",
    );
    says(
        position(&good, 0, None, 69.2).unwrap_err(),
        "sun position: ut1_utc_s must be within ±10 s, got 69.2",
    );
    says(
        SunEphemeris::new(5, 4, None, 0.0).unwrap_err(),
        "sun ephemeris: the span must not end before it begins, got from 5 ns to 4 ns since 1970",
    );
    let ephemeris = SunEphemeris::new(0, DAY, None, 0.0).unwrap();
    let mut out = SunPositions::default();
    for (instants, row, unix_ns) in [
        (vec![0, DAY, DAY + 1, -1], 2, DAY + 1),
        (vec![i64::MIN], 0, i64::MIN),
    ] {
        let error = ephemeris
            .positions_into(&good, &instants, None, &mut out)
            .unwrap_err();
        let want = SunError::OutsideSpan {
            row,
            unix_ns,
            from_unix_ns: 0,
            to_unix_ns: DAY,
        };
        assert_eq!(error, want);
        assert!(out.is_empty());
    }
    says(
        ephemeris
            .positions_into(&good, &[-7], None, &mut out)
            .unwrap_err(),
        "sun position: row 0 (counted from 0) must lie between 0 ns and 86400000000000 ns since \
         1970, the ephemeris's span, got -7 ns",
    );
    if SimdLevel::best() < SimdLevel::Avx512 {
        let error = ephemeris.positions_into(&good, &[0], Some(SimdLevel::Avx512), &mut out);
        assert!(matches!(error, Err(SunError::LevelUnavailable { .. })));
    }
}
