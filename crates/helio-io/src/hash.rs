//! SHA-256, to say which inputs a result comes from.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::IoError;

/// SHA-256 (FIPS 180-4) of what it is given piece by piece.
///
/// ```
/// use helio_io::Sha256;
/// let mut hash = Sha256::default();
/// hash.update(b"abc");
/// assert!(hash.finish().starts_with("ba7816bf8f01cfea"));
/// ```
#[derive(Debug, Clone)]
pub struct Sha256 {
    state: [u32; 8],
    block: [u8; 64],
    /// Bytes taken so far.
    length: u64,
}

impl Default for Sha256 {
    fn default() -> Self {
        Self {
            state: fractions(8, f64::sqrt),
            block: [0; 64],
            length: 0,
        }
    }
}

/// The first 32 bits of the fractional parts of roots of the first primes.
///
/// A double holds the whole part and twenty bits more than these; the tests compare known digests.
fn fractions<const N: usize>(count: usize, root: fn(f64) -> f64) -> [u32; N] {
    let mut primes = (2_u32..).filter(|n| (2..*n).take_while(|d| d * d <= *n).all(|d| n % d != 0));
    let mut values = [0; N];
    for value in values.iter_mut().take(count) {
        let prime = f64::from(primes.next().unwrap_or(2));
        *value = (root(prime).fract() * 4_294_967_296.0) as u32;
    }
    values
}

fn round_constants() -> &'static [u32; 64] {
    static CONSTANTS: std::sync::LazyLock<[u32; 64]> =
        std::sync::LazyLock::new(|| fractions(64, f64::cbrt));
    &CONSTANTS
}

impl Sha256 {
    /// Takes more bytes.
    pub fn update(&mut self, mut bytes: &[u8]) {
        let constants = round_constants();
        while !bytes.is_empty() {
            // Whole blocks need no copy.
            if self.length.is_multiple_of(64)
                && let Some((block, rest)) = bytes.split_first_chunk()
            {
                self.compress(block, constants);
                self.length += 64;
                bytes = rest;
                continue;
            }
            let filled = (self.length % 64) as usize;
            let take = bytes.len().min(64 - filled);
            self.block[filled..filled + take].copy_from_slice(&bytes[..take]);
            self.length += take as u64;
            bytes = &bytes[take..];
            if filled + take == 64 {
                let block = self.block;
                self.compress(&block, constants);
            }
        }
    }

    /// The digest in 64 hexadecimal digits.
    #[must_use]
    pub fn finish(mut self) -> String {
        let bits = self.length * 8;
        let padding = 1 + (119 - self.length % 64) % 64;
        let mut tail = vec![0_u8; padding as usize];
        tail[0] = 0x80;
        tail.extend_from_slice(&bits.to_be_bytes());
        self.update(&tail);
        self.state
            .iter()
            .map(|word| format!("{word:08x}"))
            .collect()
    }

    fn compress(&mut self, block: &[u8; 64], constants: &[u32; 64]) {
        // The last sixteen words of the schedule; the oldest makes room for the newest.
        let mut w = [0_u32; 16];
        for (word, bytes) in w.iter_mut().zip(block.chunks_exact(4)) {
            *word = u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        }
        let mut turned = self.state;
        for (round, constants) in constants.chunks_exact(16).enumerate() {
            for t in 0..16 {
                if round > 0 {
                    let (a, b) = (w[(t + 1) % 16], w[(t + 14) % 16]);
                    let s0 = a.rotate_right(7) ^ a.rotate_right(18) ^ (a >> 3);
                    let s1 = b.rotate_right(17) ^ b.rotate_right(19) ^ (b >> 10);
                    w[t] = w[t]
                        .wrapping_add(s0)
                        .wrapping_add(w[(t + 9) % 16])
                        .wrapping_add(s1);
                }
                let [a, b, c, d, e, f, g, h] = turned;
                let s1 = e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25);
                let choice = (e & f) ^ (!e & g);
                let first = h
                    .wrapping_add(s1)
                    .wrapping_add(choice)
                    .wrapping_add(constants[t])
                    .wrapping_add(w[t]);
                let s0 = a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22);
                let majority = (a & b) ^ (a & c) ^ (b & c);
                let second = s0.wrapping_add(majority);
                turned = [
                    first.wrapping_add(second),
                    a,
                    b,
                    c,
                    d.wrapping_add(first),
                    e,
                    f,
                    g,
                ];
            }
        }
        for (state, value) in self.state.iter_mut().zip(turned) {
            *state = state.wrapping_add(value);
        }
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

    #[test]
    fn roots_of_primes_are_the_printed_constants() {
        let k = round_constants();
        assert_eq!(
            (k[0], k[31], k[63]),
            (0x428a_2f98, 0x1429_2967, 0xc671_78f2)
        );
    }
}
