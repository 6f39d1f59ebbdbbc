//! Findings in words.

use helio_calib::joint::{DAY_NS, Spell};

use super::JumpFound;
use crate::times::format_time;

/// Of a fit whose search ended early.
pub const STOPPED: &str = "the search for noise and wander stopped before its end: what is said of them, and what is \
                           expected of beams, is as it was found until then";

/// A value in its unit for people: angles in mrad, lengths in cm.
#[must_use]
pub fn for_people(unit: &str) -> (f64, &str) {
    match unit {
        "rad" => (1e3, "mrad"),
        "m" => (1e2, "cm"),
        other => (1.0, other),
    }
}

/// When a spell was.
#[must_use]
pub fn days_of(spell: &Spell) -> String {
    let [first, last] = spell.days.map(|day| {
        let time = format_time((day * DAY_NS) as i64);
        time.split('T').next().unwrap_or_default().to_owned()
    });
    match spell.lasts {
        true => format!("since {first}"),
        false if first == last => format!("on {first}"),
        false => format!("from {first} to {last}"),
    }
}

/// What is known of a jump.
#[must_use]
pub fn jump_words(jump: &JumpFound) -> String {
    let by = jump.size_rad.map_or(String::new(), |size| {
        format!(" by about {:+.1} mrad", 1e3 * size)
    });
    format!(
        "the zero point of axis {} {}{by} before {}{}",
        jump.axis + 1,
        if jump.certain {
            "jumped"
        } else {
            "may have jumped"
        },
        jump.unix_ns
            .map_or("a record without a time".to_owned(), format_time),
        jump.missed_mrad.map_or(String::new(), |mrad| format!(
            ", whose beam missed by {mrad:.1} mrad"
        ))
    )
}

/// Why a record at a time raised an alarm: as the third in a row that is not believed, or by the drift.
#[must_use]
pub fn alarm_words(unix_ns: i64, unbelieved: bool) -> String {
    let why = match unbelieved {
        true => "its last three records in a row are not believed",
        false => "it misses to one side by more than what is known of it explains",
    };
    format!("alarm at {}: {why}", format_time(unix_ns))
}
