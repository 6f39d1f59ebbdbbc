//! What of a long run is done already, kept beside its output until it is complete.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::error::{IoError, Place, Problem, quoted};
use crate::hash::Sha256;

/// Finished parts of a run, one line of text each, in `OUT.part` beside the output `OUT`.
///
/// Its first line names the run by a key, such as a hash of everything that the result depends on; a
/// run of another key is refused. Each line stands in the file as soon as it is added, so that no
/// end of the process loses it, and carries a checksum: a line cut short by the end is not read.
///
/// ```
/// use helio_io::Finished;
/// let folder = tempfile::tempdir()?;
/// let out = folder.path().join("calibration.csv");
/// let mut run = Finished::begin(&out, "key")?;
/// run.add("first")?;
/// drop(run); // as a kill would
/// let (run, lines) = Finished::resume(&out, "key")?;
/// assert_eq!(lines, ["first"]);
/// run.remove()?;
/// assert!(Finished::resume(&out, "key")?.1.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Finished {
    path: PathBuf,
    file: File,
    /// When the file was last forced to the disk.
    synced: Instant,
}

/// Time after which lines also survive a failure of the machine.
const BETWEEN_SYNCS: Duration = Duration::from_secs(5);
/// What the first line begins with.
const MAGIC: &str = "helio-rs finished parts of run ";

impl Finished {
    /// Where the finished parts of an output stand: its name and `.part`.
    #[must_use]
    pub fn path_of(out: &Path) -> PathBuf {
        let mut name = out.as_os_str().to_owned();
        name.push(".part");
        name.into()
    }

    /// Begins a run.
    ///
    /// # Errors
    /// [`IoError`] if there are finished parts of an earlier run, another process is at work on them, or the file
    /// cannot be written.
    pub fn begin(out: &Path, key: &str) -> Result<Self, IoError> {
        let path = Self::path_of(out);
        let file = OpenOptions::new().write(true).create_new(true).open(&path);
        let file = match file {
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
                if let Ok(file) = File::open(&path) {
                    lock(&path, &file)?;
                }
                let message = "it holds what an interrupted run has finished; --resume goes on \
                               from there, or remove it to begin anew";
                return Err(conflict(&path, message.into()));
            }
            other => other.map_err(|error| IoError::write(&path, error))?,
        };
        Self::start(path, file, key)
    }

    fn start(path: PathBuf, mut file: File, key: &str) -> Result<Self, IoError> {
        lock(&path, &file)?;
        file.write_all(format!("{MAGIC}{key}\n").as_bytes())
            .map_err(|error| IoError::write(&path, error))?;
        Ok(Self {
            path,
            file,
            synced: Instant::now(),
        })
    }

    /// Goes on with a run: the lines that it has finished, in the order in which they were added. Begins
    /// one if there is none.
    ///
    /// # Errors
    /// [`IoError`] if the finished parts are of another key, another process is at work on them, or the
    /// file cannot be read or written.
    pub fn resume(out: &Path, key: &str) -> Result<(Self, Vec<String>), IoError> {
        let path = Self::path_of(out);
        let mut file = match OpenOptions::new().read(true).write(true).open(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Ok((Self::begin(out, key)?, Vec::new()));
            }
            other => other.map_err(|error| IoError::read(&path, error))?,
        };
        lock(&path, &file)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)
            .map_err(|error| IoError::read(&path, error))?;
        let refuse = |error| IoError::write(&path, error);
        let mut rest = bytes.as_slice();
        let Some(head) = next_line(&mut rest) else {
            // The run ended before its first line was whole.
            if !MAGIC
                .as_bytes()
                .starts_with(&bytes[..bytes.len().min(MAGIC.len())])
            {
                return Err(foreign(&path));
            }
            file.set_len(0).map_err(refuse)?;
            file.rewind().map_err(refuse)?;
            drop(file);
            let file = OpenOptions::new().write(true).open(&path).map_err(refuse)?;
            return Ok((Self::start(path, file, key)?, Vec::new()));
        };
        let Some(theirs) = head.strip_prefix(MAGIC) else {
            return Err(foreign(&path));
        };
        if theirs != key {
            let message = format!(
                "it holds what a run with other inputs, options or another build has finished \
                 (its hash is {}, this run's {}); repeat that run with --resume, or remove the file \
                 to begin anew",
                quoted(theirs.get(..16).unwrap_or(theirs)),
                quoted(key.get(..16).unwrap_or(key))
            );
            return Err(conflict(&path, message));
        }
        let mut lines = Vec::new();
        let mut good = bytes.len() - rest.len();
        while let Some(line) = next_line(&mut rest) {
            let Some((sum, text)) = line.split_once(' ') else {
                break;
            };
            if sum != checksum(text) {
                break;
            }
            lines.push(text.to_string());
            good = bytes.len() - rest.len();
        }
        file.set_len(good as u64).map_err(refuse)?;
        file.seek(SeekFrom::Start(good as u64)).map_err(refuse)?;
        let resumed = Self {
            path,
            file,
            synced: Instant::now(),
        };
        Ok((resumed, lines))
    }

    /// Adds a finished part: a text without line breaks.
    ///
    /// # Errors
    /// [`IoError`] if it cannot be written.
    pub fn add(&mut self, text: &str) -> Result<(), IoError> {
        debug_assert!(!text.contains('\n'));
        let line = format!("{} {text}\n", checksum(text));
        self.file
            .write_all(line.as_bytes())
            .and_then(|()| {
                if self.synced.elapsed() < BETWEEN_SYNCS {
                    return Ok(());
                }
                self.synced = Instant::now();
                self.file.sync_data()
            })
            .map_err(|error| IoError::write(&self.path, error))
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Removes the file, once the output is complete.
    ///
    /// # Errors
    /// [`IoError`] if that fails.
    pub fn remove(self) -> Result<(), IoError> {
        std::fs::remove_file(&self.path).map_err(|error| IoError::write(&self.path, error))
    }
}

/// The text of the next whole line.
fn next_line<'a>(rest: &mut &'a [u8]) -> Option<&'a str> {
    let end = rest.iter().position(|byte| *byte == b'\n')?;
    let line = std::str::from_utf8(&rest[..end]).ok()?;
    *rest = &rest[end + 1..];
    Some(line)
}

fn checksum(text: &str) -> String {
    let mut hash = Sha256::default();
    hash.update(text.as_bytes());
    let mut sum = hash.finish();
    sum.truncate(16);
    sum
}

fn lock(path: &Path, file: &File) -> Result<(), IoError> {
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(conflict(
            path,
            "another process is at work on it; wait for it, or write to another --out".into(),
        )),
        // Some file systems know no locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(()),
    }
}

fn conflict(path: &Path, message: String) -> IoError {
    IoError::new(Place::file(path), Problem::Conflict { message })
}

fn foreign(path: &Path) -> IoError {
    conflict(
        path,
        "it is no file of finished parts of a run; move it away".into(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_cut_short_is_written_again() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("t.csv");
        let mut run = Finished::begin(&out, "k").unwrap();
        for text in ["one", "two", "three"] {
            run.add(text).unwrap();
        }
        drop(run);
        let whole = std::fs::read(Finished::path_of(&out)).unwrap();
        let ends: Vec<usize> = (0..whole.len()).filter(|&i| whole[i] == b'\n').collect();
        for length in 0..=whole.len() {
            std::fs::write(Finished::path_of(&out), &whole[..length]).unwrap();
            let (mut run, lines) = Finished::resume(&out, "k").unwrap();
            let complete = ends.iter().filter(|&&end| end < length).count();
            assert_eq!(lines.len(), complete.saturating_sub(1), "{length}");
            for text in &["one", "two", "three"][lines.len()..] {
                run.add(text).unwrap();
            }
            drop(run);
            assert_eq!(std::fs::read(Finished::path_of(&out)).unwrap(), whole);
        }
    }

    #[test]
    fn other_runs_other_files_and_other_processes_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("t.csv");
        let run = Finished::begin(&out, "k").unwrap();
        let said =
            |result: Result<(Finished, Vec<String>), IoError>| result.unwrap_err().to_string();
        #[cfg(unix)]
        {
            assert!(said(Finished::resume(&out, "k")).contains("another process"));
            let again = Finished::begin(&out, "k").unwrap_err().to_string();
            assert!(again.contains("another process"), "{again}");
        }
        drop(run);
        assert!(said(Finished::resume(&out, "other")).contains("other inputs"));
        assert!(
            Finished::begin(&out, "k")
                .unwrap_err()
                .to_string()
                .contains("--resume")
        );
        for text in ["id,east_m\n", "x"] {
            std::fs::write(Finished::path_of(&out), text).unwrap();
            assert!(said(Finished::resume(&out, "k")).contains("no file of finished parts"));
        }
    }
}
