//! SHA-256, to say which inputs a result comes from.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use sha2::Digest;

use crate::IoError;

/// SHA-256 (FIPS 180-4) of what it is given piece by piece.
///
/// ```
/// use helio_io::Sha256;
/// let mut hash = Sha256::default();
/// hash.update(b"abc");
/// assert!(hash.finish().starts_with("ba7816bf8f01cfea"));
/// ```
#[derive(Debug, Clone, Default)]
pub struct Sha256(sha2::Sha256);

impl Sha256 {
    /// Takes more bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The digest in 64 hexadecimal digits.
    #[must_use]
    pub fn finish(self) -> String {
        let digest = self.0.finalize();
        digest.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// SHA-256 of a file's contents, in hexadecimal digits: what `sha256sum` prints.
///
/// # Errors
/// [`IoError`] if it cannot be read.
pub fn hash_file(path: &Path) -> Result<String, IoError> {
    let refuse = |error| IoError::read(path, error);
    let mut file = File::open(path).map_err(refuse)?;
    let mut hash = Sha256::default();
    let mut buffer = vec![0; 1 << 18];
    loop {
        match file.read(&mut buffer).map_err(refuse)? {
            0 => return Ok(hash.finish()),
            count => hash.update(&buffer[..count]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(bytes: &[u8], piece: usize) -> String {
        let mut hash = Sha256::default();
        for part in bytes.chunks(piece) {
            hash.update(part);
        }
        hash.finish()
    }

    // The examples of FIPS 180-4 and of NIST's test vectors.
    #[test]
    fn known_digests() {
        let long = vec![b'a'; 1_000_000];
        for (text, digest) in [
            (
                &b""[..],
                "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
            ),
            (
                b"abc",
                "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
            ),
            (
                b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq",
                "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1",
            ),
            (
                &long,
                "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0",
            ),
        ] {
            for piece in [1, 7, 64, 1000, usize::MAX] {
                assert_eq!(of(text, piece), digest);
            }
        }
    }
}
