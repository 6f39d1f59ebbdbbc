//! Asking for memory before it is needed.
#![allow(unsafe_code)]

/// Bytes that memory moves at once.
const LINE_BYTES: usize = 64;

/// Asks for a cache line of the item that stands `ahead` items behind this one in memory. Where there is
/// none, nothing happens: no address makes it fail, and no answer depends on it.
#[inline(always)]
pub fn prefetch<T>(item: &T, ahead: usize, line: usize) {
    let there = core::ptr::from_ref(item)
        .wrapping_add(ahead)
        .cast::<u8>()
        .wrapping_add(line.wrapping_mul(LINE_BYTES));
    #[cfg(target_arch = "x86_64")]
    {
        use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, part of every x86-64; it neither faults nor reads, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(there.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = there;
}

#[cfg(test)]
mod tests {
    #[test]
    fn any_address_will_do() {
        let numbers = [1.0_f64; 3];
        for ahead in [0, 1, 1 << 20, usize::MAX / 8, usize::MAX] {
            for line in [0, 1, 1 << 30, usize::MAX] {
                super::prefetch(&numbers[0], ahead, line);
            }
        }
        assert_eq!(numbers, [1.0; 3]);
    }
}
