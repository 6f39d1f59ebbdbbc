//! Days and hours of UTC from nanoseconds, and round ones along an axis.

const SECOND: i64 = 1_000_000_000;
const DAY: i64 = 86_400 * SECOND;

/// Year, month and day of a count of days from 1970-01-01 (Gregorian, proleptic).
fn civil(days: i64) -> (i64, i64, i64) {
    // Years run from March, so that the leap day is their last.
    let from_0000_03_01 = days + 719_468;
    let era = from_0000_03_01.div_euclid(146_097);
    let day = from_0000_03_01.rem_euclid(146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let (in_month, month) = (
        day - (153 * month + 2) / 5 + 1,
        if month < 10 { month + 3 } else { month - 9 },
    );
    (year + era * 400 + i64::from(month <= 2), month, in_month)
}

/// Days from 1970-01-01 to the first of a month; months may run past 12.
fn first_of(year: i64, month: i64) -> i64 {
    let (year, month) = (
        year + (month - 1).div_euclid(12),
        (month - 1).rem_euclid(12) + 1,
    );
    let (year, month) = if month <= 2 {
        (year - 1, month + 9)
    } else {
        (year, month - 3)
    };
    let (era, in_era) = (year.div_euclid(400), year.rem_euclid(400));
    let day = in_era * 365 + in_era / 4 - in_era / 100 + (153 * month + 2) / 5;
    era * 146_097 + day - 719_468
}

/// Such as "2022-06-10".
pub(crate) fn day(unix_ns: i64) -> String {
    let (y, m, d) = civil(unix_ns.div_euclid(DAY));
    format!("{y:04}-{m:02}-{d:02}")
}

/// Such as "12:15".
fn clock(unix_ns: i64) -> String {
    let second = unix_ns.rem_euclid(DAY) / SECOND;
    format!("{:02}:{:02}", second / 3600, second / 60 % 60)
}

/// Such as "2022-06-10 12:15".
pub(crate) fn minute(unix_ns: i64) -> String {
    format!("{} {}", day(unix_ns), clock(unix_ns))
}

/// Round times within a range with their labels, at most nine or so, and what the axis shows.
pub(crate) fn ticks(from: i64, to: i64) -> (Vec<(i64, String)>, String) {
    let span_s = (to as f64 - from as f64) / SECOND as f64;
    if span_s <= 2.0 * 86_400.0 {
        let steps = [60, 300, 900, 1800, 3600, 7200, 10_800, 21_600];
        let step = SECOND
            * steps
                .into_iter()
                .find(|&s| span_s / s as f64 <= 9.0)
                .unwrap_or(21_600);
        let name = if day(from) == day(to) {
            format!("time on {} (UTC)", day(from))
        } else {
            format!("time from {} to {} (UTC)", day(from), day(to))
        };
        return (every(from, to, step, clock), name);
    }
    if span_s <= 75.0 * 86_400.0 {
        let steps = [1, 2, 5, 10];
        let step = steps
            .into_iter()
            .find(|&s| span_s / 86_400.0 / s as f64 <= 9.0)
            .unwrap_or(10);
        return (every(from, to, step * DAY, day), "date (UTC)".to_owned());
    }
    let months = span_s / 86_400.0 / 30.44;
    let steps = [1, 2, 3, 6, 12, 24, 60, 120, 600, 1200];
    let step = steps
        .into_iter()
        .find(|&s| months / s as f64 <= 9.0)
        .unwrap_or(12_000);
    let (year, month, _) = civil(from.div_euclid(DAY));
    let first = (year * 12 + month - 1).div_euclid(step);
    let marks = (first..=first + 11)
        .filter_map(|k| {
            let at = first_of(0, k * step + 1).checked_mul(DAY)?;
            let label = if step >= 12 {
                day(at)[..4].to_owned()
            } else {
                day(at)[..7].to_owned()
            };
            (from..=to).contains(&at).then_some((at, label))
        })
        .collect();
    (marks, "date (UTC)".to_owned())
}

fn every(from: i64, to: i64, step: i64, label: fn(i64) -> String) -> Vec<(i64, String)> {
    let first = from.div_euclid(step);
    (first..=first + 12)
        .filter_map(|k| k.checked_mul(step))
        .filter(|at| (from..=to).contains(at))
        .map(|at| (at, label(at)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        // From `date --utc --date @N`.
        for (second, text) in [
            (0, "1970-01-01 00:00"),
            (951_782_400, "2000-02-29 00:00"),
            (1_654_863_359, "2022-06-10 12:15"),
            (4_107_542_399, "2100-02-28 23:59"),
            (-1, "1969-12-31 23:59"),
        ] {
            assert_eq!(minute(second * SECOND), text);
        }
        for month in -30..2000 {
            let (y, m, d) = civil(first_of(1970, month));
            assert_eq!((y * 12 + m - 1, d), (1970 * 12 + month - 1, 1));
        }
        assert_eq!(day(i64::MAX), "2262-04-11");
    }

    #[test]
    fn ticks_lie_inside_and_are_few() {
        for exponent in 0..19 {
            for from in [0, 1_654_863_359 * SECOND] {
                let (marks, _) = ticks(from, from + 9 * 10_i64.pow(exponent) / 2);
                assert!(marks.len() <= 11, "{exponent}: {marks:?}");
            }
        }
        let june_to_may = (1_654_863_359 * SECOND, 1_716_481_000 * SECOND);
        let (marks, name) = ticks(june_to_may.0, june_to_may.1);
        assert_eq!(name, "date (UTC)");
        assert_eq!(marks[0].1, "2022-07");
    }
}
