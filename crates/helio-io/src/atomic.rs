//! Files that appear whole or not at all.

use std::ffi::{OsStr, OsString};
use std::fs::{File, TryLockError};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

use crate::error::IoError;

/// A file being written under a temporary name beside its own, renamed into place by
/// [`finish`](Self::finish). Dropped before that, it leaves nothing behind and whatever stood in
/// its place stays as it was.
///
/// A process that is killed cannot clear up: what it leaves (`.helio-NAME-XXXXXX.part`) is removed by the next
/// file begun for the same place. A temporary file is locked for as long as its process writes it, so
/// that another process at work on the same place is not disturbed; the last to finish is then what stands there.
///
/// A place that is no regular file, such as a pipe or `/dev/null`, is written to directly; a
/// symbolic link is followed, so that the file it points to is replaced, or made where there is none yet.
///
/// ```
/// use std::io::Write;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("angles.csv");
/// let mut file = helio_io::AtomicFile::create(&path)?;
/// file.write_all(b"id,azimuth_deg\n")?;
/// assert!(!path.exists());
/// file.finish()?;
/// assert_eq!(std::fs::read(&path)?, b"id,azimuth_deg\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    destination: PathBuf,
    target: Target,
    /// After the target, so that a file is listed for as long as it is there.
    listed: Option<Listed>,
}

/// The temporary files of this process.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A place in the list of temporary files.
#[derive(Debug)]
struct Listed(PathBuf);

impl Drop for Listed {
    fn drop(&mut self) {
        unfinished().retain(|path| *path != self.0);
    }
}

/// Removes every file that an [`AtomicFile`] of this process has begun and not finished: for a
/// program that is about to exit without unwinding, as on a second Ctrl-C.
pub fn remove_unfinished_files() {
    for path in unfinished().drain(..) {
        // It may have been renamed into place this very moment.
        let _ = std::fs::remove_file(path);
    }
}

#[derive(Debug)]
enum Target {
    Temporary(BufWriter<NamedTempFile>),
    Direct(BufWriter<File>),
}

/// What the name of a temporary file ends with.
const SUFFIX: &str = ".part";

/// What the names of a place's temporary files begin with.
fn temporary_prefix(destination: &Path) -> OsString {
    let mut prefix = OsString::from(".helio-");
    if let Some(name) = destination.file_name() {
        // A file name has 255 bytes; the others of a longer one would leave no room.
        match name.to_str() {
            Some(text) => prefix.push(text.chars().take(48).collect::<String>()),
            None => prefix.push("file"),
        }
    }
    prefix.push("-");
    prefix
}

/// Removes what killed processes left of a place: temporary files that nobody holds a lock on.
fn remove_abandoned(folder: &Path, prefix: &OsStr) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let bytes = name.as_encoded_bytes();
        let drawn = bytes
            .strip_prefix(prefix.as_encoded_bytes())
            .and_then(|rest| rest.strip_suffix(SUFFIX.as_bytes()));
        if !drawn.is_some_and(|drawn| drawn.len() == 6 && drawn.is_ascii()) {
            continue;
        }
        let path = entry.path();
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file && let Ok(file) = File::options().write(true).open(&path) {
            match file.try_lock() {
                // While it is locked here nobody takes it for his own.
                Ok(()) => drop(std::fs::remove_file(&path)),
                Err(TryLockError::WouldBlock | TryLockError::Error(_)) => {}
            }
        }
    }
}

/// Where a path leads, through symbolic links whose file does not exist yet too.
fn followed(path: &Path) -> PathBuf {
    if let Ok(place) = path.canonicalize() {
        return place;
    }
    let mut place = path.to_path_buf();
    // As many as Linux follows.
    for _ in 0..40 {
        let Ok(to) = std::fs::read_link(&place) else {
            return place;
        };
        place = place.parent().unwrap_or(Path::new("")).join(to);
    }
    path.to_path_buf()
}

/// Bytes gathered before a write: large enough that system calls cost nothing beside formatting.
const BUFFER_BYTES: usize = 1 << 18;

impl AtomicFile {
    /// Starts a file that will stand at `path`.
    ///
    /// # Errors
    /// [`IoError`] if the folder does not exist or cannot be written, or `path` is a folder.
    pub fn create(path: &Path) -> Result<Self, IoError> {
        let refuse = |error| IoError::write(path, error);
        match std::fs::metadata(path) {
            Ok(found) if found.is_dir() => {
                return Err(refuse(io::ErrorKind::IsADirectory.into()));
            }
            Ok(found) if !found.is_file() => {
                let file = File::options().write(true).open(path).map_err(refuse)?;
                let target = Target::Direct(BufWriter::with_capacity(BUFFER_BYTES, file));
                let path = path.to_path_buf();
                return Ok(Self {
                    destination: path.clone(),
                    path,
                    target,
                    listed: None,
                });
            }
            // A file that may not be written stays, although its folder would let us replace it.
            Ok(found) if found.permissions().readonly() => {
                return Err(refuse(io::ErrorKind::PermissionDenied.into()));
            }
            _ => {}
        }
        if path.file_name().is_none() {
            return Err(refuse(io::Error::new(
                io::ErrorKind::InvalidInput,
                "it has no file name",
            )));
        }
        let destination = followed(path);
        let folder = match destination.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            let reason = format!("its folder {} does not exist", folder.display());
            return Err(refuse(io::Error::other(reason)));
        }
        let prefix = temporary_prefix(&destination);
        remove_abandoned(folder, &prefix);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(SUFFIX);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As File::create would: the process's umask takes its share.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = loop {
            let file = builder.tempfile_in(folder).map_err(refuse)?;
            // Another process may take it for abandoned before it is locked. Some file systems know no
            // locks: there nothing is taken for abandoned.
            match file.as_file().try_lock() {
                Err(TryLockError::WouldBlock) => {}
                Ok(()) | Err(TryLockError::Error(_)) if file.path().exists() => break file,
                _ => {}
            }
        };
        let listed = Listed(file.path().to_path_buf());
        unfinished().push(listed.0.clone());
        let target = Target::Temporary(BufWriter::with_capacity(BUFFER_BYTES, file));
        Ok(Self {
            path: path.to_path_buf(),
            destination,
            target,
            listed: Some(listed),
        })
    }

    /// Refuses a place where no file can be made, as [`create`](Self::create) does, and leaves nothing there:
    /// for a result that is written at the end of a long run. What is no regular file, such as a pipe, is not
    /// opened before its time.
    ///
    /// # Errors
    /// [`IoError`] as for [`create`](Self::create).
    pub fn check(path: &Path) -> Result<(), IoError> {
        match std::fs::metadata(path) {
            Ok(found) if !found.is_file() && !found.is_dir() => Ok(()),
            _ => Self::create(path).map(drop),
        }
    }

    /// The place the file will have.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes what is left and renames the file into place.
    ///
    /// # Errors
    /// [`IoError`] if that fails; nothing half-written remains then.
    pub fn finish(self) -> Result<(), IoError> {
        let Self {
            path,
            destination,
            target,
            listed: _listed,
        } = self;
        let refuse = |error| IoError::write(&path, error);
        match target {
            Target::Direct(mut file) => file.flush().map_err(refuse),
            Target::Temporary(file) => {
                let file = file
                    .into_inner()
                    .map_err(|error| refuse(error.into_error()))?;
                // The rename must not reach the disk before the contents do.
                file.as_file().sync_data().map_err(refuse)?;
                file.persist(&destination)
                    .map_err(|error| refuse(error.error))?;
                Ok(())
            }
        }
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.target {
            Target::Temporary(file) => file.write(bytes),
            Target::Direct(file) => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.target {
            Target::Temporary(file) => file.flush(),
            Target::Direct(file) => file.flush(),
        }
    }
}

/// Writes a whole file at once, so that it appears whole or not at all.
///
/// # Errors
/// [`IoError`] as for [`AtomicFile`].
pub fn write_file(path: &Path, contents: &[u8]) -> Result<(), IoError> {
    write_file_with(path, |out| out.write_all(contents))
}

/// Writes a file piece by piece, so that it appears whole or not at all.
///
/// # Errors
/// [`IoError`] as for [`AtomicFile`], also of what `write` says.
///
/// ```
/// use std::io::Write;
/// let path = tempfile::tempdir()?.keep().join("numbers.txt");
/// helio_io::write_file_with(&path, |out| (1..4).try_for_each(|k| writeln!(out, "{k}")))?;
/// assert_eq!(std::fs::read_to_string(path)?, "1\n2\n3\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_file_with(
    path: &Path,
    write: impl FnOnce(&mut AtomicFile) -> io::Result<()>,
) -> Result<(), IoError> {
    let mut file = AtomicFile::create(path)?;
    write(&mut file).map_err(|error| IoError::write(path, error))?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_dropped_file_leaves_the_old_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        write_file(&path, b"old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(&[b'x'; 1 << 20]).unwrap();
        assert_eq!(names(folder.path()).len(), 2);
        drop(file);
        assert_eq!(names(folder.path()), ["out.csv"]);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        write_file(&path, b"new").unwrap();
        assert_eq!(names(folder.path()), ["out.csv"]);
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn finished_and_dropped_files_are_not_listed() {
        let folder = tempfile::tempdir().unwrap();
        let listed = || {
            let list = unfinished();
            list.iter()
                .filter(|path| path.starts_with(folder.path()))
                .count()
        };
        let file = AtomicFile::create(&folder.path().join("a")).unwrap();
        let other = AtomicFile::create(&folder.path().join("b")).unwrap();
        assert_eq!(listed(), 2);
        drop(file);
        other.finish().unwrap();
        assert_eq!(listed(), 0);
        assert_eq!(names(folder.path()), ["b"]);
    }

    #[test]
    fn what_a_killed_process_left_is_removed_and_what_is_at_work_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        // Left by a kill, of two places; and a file that is nobody's leftover.
        for name in [
            ".helio-out.csv-abcdef.part",
            ".helio-out.csv-ghijkl.part",
            ".helio-other.csv-abcdef.part",
            ".helio-out.csv-notes.part",
        ] {
            std::fs::write(at(name), "half").unwrap();
        }
        let mut first = AtomicFile::create(&at("out.csv")).unwrap();
        let left = [".helio-other.csv-abcdef.part", ".helio-out.csv-notes.part"];
        assert_eq!(names(folder.path()).len(), 3);
        // Two at once on one place and one on another: each is whole, and the last to finish stands.
        let mut second = AtomicFile::create(&at("out.csv")).unwrap();
        let mut third = AtomicFile::create(&at("other.csv")).unwrap();
        assert_eq!(names(folder.path()).len(), 4);
        first.write_all(b"first").unwrap();
        second.write_all(b"second").unwrap();
        third.write_all(b"third").unwrap();
        second.finish().unwrap();
        assert_eq!(std::fs::read(at("out.csv")).unwrap(), b"second");
        first.finish().unwrap();
        third.finish().unwrap();
        assert_eq!(std::fs::read(at("out.csv")).unwrap(), b"first");
        assert_eq!(std::fs::read(at("other.csv")).unwrap(), b"third");
        assert_eq!(names(folder.path()), [left[1], "other.csv", "out.csv"]);
        // A long name leaves room for what is drawn.
        let long = "x".repeat(250);
        write_file(&at(&long), b"x").unwrap();
        assert!(at(&long).exists());
    }

    #[test]
    fn a_place_is_checked_without_a_trace() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        AtomicFile::check(&path).unwrap();
        assert!(names(folder.path()).is_empty());
        std::fs::write(&path, "old").unwrap();
        AtomicFile::check(&path).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["out.csv"]);
        for bad in [
            folder.path(),
            &path.join("x.csv"),
            &folder.path().join("no/x.csv"),
        ] {
            let said = AtomicFile::create(bad).unwrap_err().to_string();
            assert_eq!(AtomicFile::check(bad).unwrap_err().to_string(), said);
        }
    }

    #[test]
    fn places_that_cannot_be_written_are_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no").join("out.csv");
        assert!(
            AtomicFile::create(&missing)
                .unwrap_err()
                .to_string()
                .contains("does not exist")
        );
        assert!(
            AtomicFile::create(folder.path())
                .unwrap_err()
                .to_string()
                .contains("folder")
        );
        assert!(AtomicFile::create(Path::new("")).is_err());
        assert!(AtomicFile::create(Path::new("/")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed_and_permissions_are_ordinary() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (
            folder.path().join("real.csv"),
            folder.path().join("link.csv"),
        );
        std::fs::write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_file(&link, b"new").unwrap();
        assert_eq!(std::fs::read(&real).unwrap(), b"new");
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        // One whose file does not exist yet, by way of another.
        let (new, near, far) = (
            folder.path().join("new.csv"),
            folder.path().join("near.csv"),
            folder.path().join("far.csv"),
        );
        std::os::unix::fs::symlink("new.csv", &near).unwrap();
        std::os::unix::fs::symlink(&near, &far).unwrap();
        write_file(&far, b"made").unwrap();
        assert_eq!(std::fs::read(&new).unwrap(), b"made");
        for link in [&near, &far] {
            assert!(std::fs::symlink_metadata(link).unwrap().is_symlink());
        }
        let plain = folder.path().join("plain.csv");
        File::create(&plain).unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&real), mode(&plain));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_device_is_an_error_and_the_null_device_is_not() {
        write_file(Path::new("/dev/null"), b"gone").unwrap();
        let error = write_file(Path::new("/dev/full"), b"x").unwrap_err();
        assert_eq!(
            error.to_string(),
            "/dev/full: cannot be written: no space left"
        );
        assert_eq!(error.io_kind(), Some(io::ErrorKind::StorageFull));
    }
}
