//! What of a run is finished already, and by which program.

use std::path::{Path, PathBuf};

use helio_io::{Finished, IoError, Provenance, Sha256, hash_file};

use crate::failure::Failure;
use crate::plan;

/// What of the run is finished already. Two builds of one version may differ in the last digit, so a run
/// is resumed by the program that began it; and with as many observations `used`, as which of them are of a time
/// still to come depends on the clock.
pub(super) fn finished(
    out: &Path,
    resume: bool,
    provenance: &Provenance,
    used: usize,
    build: Result<String, String>,
) -> Result<(Finished, Vec<String>), Failure> {
    if let (Err(why), true) = (&build, resume && Finished::path_of(out).exists()) {
        return Err(Failure::refused(format!(
            "{}: not resumed: whether this program is the one that began it cannot be told ({why}); remove \
             the file to begin anew",
            Finished::path_of(out).display()
        )));
    }
    let key = hash_text(&format!(
        "{} {} {} {} {} {used}",
        provenance.version,
        build.as_deref().unwrap_or("unknown"),
        provenance.field_hash,
        provenance.observations_hash,
        provenance.options_hash
    ));
    Ok(if resume {
        Finished::resume(out, &key)?
    } else {
        (Finished::begin(out, &key)?, Vec::new())
    })
}

/// SHA-256 of the running program, or why there is none.
pub(super) fn build_hash(program: std::io::Result<PathBuf>) -> Result<String, String> {
    let path = program.map_err(|error| format!("its own path is not known: {error}"))?;
    hash_file(&path).map_err(|error| error.to_string())
}

/// True for a path that is or will be a regular file.
pub(super) fn is_plain(path: &Path) -> bool {
    !plan::is_stdout(path) && std::fs::metadata(path).map_or(true, |found| found.is_file())
}

pub(super) fn hash_text(text: &str) -> String {
    let mut hash = Sha256::default();
    hash.update(text.as_bytes());
    hash.finish()
}

pub(super) fn hash_files(files: &[PathBuf]) -> Result<String, IoError> {
    let hashes: Result<Vec<String>, IoError> = files.iter().map(|path| hash_file(path)).collect();
    Ok(hash_text(&hashes?.join(" ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_cannot_be_read_is_not_the_one_that_began() {
        let unknown = build_hash(Err(std::io::ErrorKind::NotFound.into()));
        assert!(unknown.unwrap_err().contains("its own path is not known"));
        let folder = tempfile::tempdir().unwrap();
        let gone = build_hash(Ok(folder.path().join("helio-rs (deleted)")));
        assert!(gone.unwrap_err().contains("cannot be read"));
        let own = build_hash(std::env::current_exe()).unwrap();
        assert_eq!(own.len(), 64);

        let out = folder.path().join("c.csv");
        let (provenance, lost) = (Provenance::default(), || Err("gone".to_owned()));
        // Without parts there is nothing to mix, with parts they stay as they are.
        drop(finished(&out, true, &provenance, 0, lost()).unwrap());
        let part = std::fs::read(Finished::path_of(&out)).unwrap();
        for (resume, said) in [
            (true, "(gone); remove the file"),
            (false, "--resume goes on"),
        ] {
            let refused = finished(&out, resume, &provenance, 0, lost()).unwrap_err();
            assert!(refused.to_string().contains(said), "{refused}");
        }
        let refused = finished(&out, true, &provenance, 0, Ok(own)).unwrap_err();
        assert!(refused.to_string().contains("another build"), "{refused}");
        assert_eq!(std::fs::read(Finished::path_of(&out)).unwrap(), part);
    }
}
