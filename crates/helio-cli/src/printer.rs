//! Everything that is said: data on standard output, talk and progress on standard error.

use std::fmt::{Arguments, Display};
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use helio_io::IoError;
use helio_io::output::Destination;
pub(crate) use helio_io::{Counted, Grouped, Tally};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::failure::Failure;

/// A run shorter than this needs no progress where nobody watches a terminal.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time between lines of progress that are not drawn over each other.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

const STDOUT: &str = "standard output";

/// Talks, unless asked to be quiet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Printer {
    quiet: bool,
}

impl Printer {
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet }
    }

    /// A line on standard error.
    pub(crate) fn say(&self, line: Arguments<'_>) {
        if !self.quiet {
            // Talk that nobody can hear is no failure.
            let _ = writeln!(std::io::stderr(), "{line}");
        }
    }

    pub(crate) fn note(&self, line: Arguments<'_>) {
        self.say(format_args!("note: {line}"));
    }

    pub(crate) fn warn(&self, line: impl Display) {
        self.say(format_args!("warning: {line}"));
    }

    /// Errors are said even if asked to be quiet.
    pub(crate) fn error(&self, failure: &Failure) {
        let _ = writeln!(std::io::stderr(), "error: {}", failure.chain());
    }

    /// Text as data.
    pub(crate) fn data(&self, text: &str) -> Result<(), Failure> {
        let mut out = std::io::stdout().lock();
        out.write_all(text.as_bytes())
            .and_then(|()| out.flush())
            .map_err(|e| Failure::Io(IoError::write(Path::new(STDOUT), e)))
    }

    /// Standard output as the destination of a table.
    pub(crate) fn stdout_table(&self) -> Destination {
        Destination::Stream {
            name: STDOUT.to_owned(),
            writer: Box::new(std::io::stdout()),
        }
    }

    pub(crate) fn stdout_is_terminal(&self) -> bool {
        std::io::stdout().is_terminal()
    }

    /// Progress of a run of `total` suns.
    pub(crate) fn progress(&self, total: u64) -> Progress {
        self.progress_of(total, "suns")
    }

    /// Progress of a run of `total` things.
    pub(crate) fn progress_of(&self, total: u64, things: &'static str) -> Progress {
        let now = Instant::now();
        let bar = if self.quiet {
            None
        } else if std::io::stderr().is_terminal() {
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
            let style = format!(
                "{{bar:30}} {{percent}} %  {{pos}}/{{len}} {things}  {{elapsed}} gone, {{eta}} left"
            );
            bar.set_style(
                ProgressStyle::with_template(&style)
                    .unwrap_or_else(|_| ProgressStyle::default_bar()),
            );
            Some(bar)
        } else {
            Some(ProgressBar::hidden())
        };
        if let Some(bar) = &bar {
            bar.set_length(total);
        }
        Progress {
            printer: *self,
            bar,
            began: now,
            next_line: now + PATIENCE,
            done: 0,
            total,
            things,
        }
    }
}

/// Progress with the time left: a bar on a terminal, a line now and then elsewhere.
pub(crate) struct Progress {
    printer: Printer,
    bar: Option<ProgressBar>,
    began: Instant,
    next_line: Instant,
    done: u64,
    total: u64,
    things: &'static str,
}

impl Progress {
    pub(crate) fn advance(&mut self, more: u64) {
        self.done += more;
        let Some(bar) = &self.bar else { return };
        bar.inc(more);
        if bar.is_hidden() && Instant::now() >= self.next_line && self.done < self.total {
            self.next_line = Instant::now() + BETWEEN_LINES;
            let part = self.done as f64 / self.total.max(1) as f64;
            let left_s = self.began.elapsed().as_secs_f64() * (1.0 - part) / part.max(1e-9);
            let (percent, left) = (100.0 * part, clock(left_s));
            self.printer.say(format_args!(
                "{percent:.0} % of {} {}, {left} left",
                Grouped(self.total),
                self.things
            ));
        }
    }

    /// Takes the bar away and tells the time since the start.
    pub(crate) fn finish(self) -> Duration {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        self.began.elapsed()
    }
}

fn clock(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s} s"),
        (h, m, _) => format!("{h} h {m} min"),
    }
}

/// A number of bytes as people say it.
pub(crate) struct Bytes(pub(crate) u64);

impl Display for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let bytes = self.0 as f64;
        match self.0 {
            0..1_000 => write!(f, "{} bytes", self.0),
            1_000..1_000_000 => write!(f, "{:.1} kB", bytes / 1e3),
            1_000_000..1_000_000_000 => write!(f, "{:.1} MB", bytes / 1e6),
            _ => write!(f, "{:.2} GB", bytes / 1e9),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(Grouped(0).to_string(), "0");
        assert_eq!(Grouped(104_000_000).to_string(), "104,000,000");
        assert_eq!(Grouped(1_234).to_string(), "1,234");
        assert_eq!(Bytes(1_875_438_816).to_string(), "1.88 GB");
        assert_eq!(clock(3_700.0), "1 h 1 min");
    }
}
