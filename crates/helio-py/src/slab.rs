//! Memory of an answer: its five columns in one allocation, each beginning on a cache line.
//!
//! NumPy's arrays look into it, and it is given back when the last of them is gone; some of what is given
//! back is kept for the next answer of the same size, since asking the system for fresh pages costs more
//! than computing what goes into them.
#![allow(unsafe_code)]

use std::alloc::{Layout, alloc_zeroed, dealloc};
use std::ops::Range;
use std::ptr::NonNull;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use helio_core::Status;
use helio_core::tracking::TrackingColumns;

use crate::failure::Failure;

/// Bytes of a cache line, and of the widest vector store.
const LINE: usize = 64;
/// Most slabs, and most bytes of them, kept for later.
const SPARE_SLABS: usize = 8;
const SPARE_BYTES: usize = 64 << 20;

static SPARE: Mutex<Vec<Spare>> = Mutex::new(Vec::new());

/// What is kept of an answer that is gone.
struct Spare {
    memory: Memory,
    rows: usize,
    excess_dirty: bool,
}

/// An allocation.
#[derive(Debug)]
struct Memory {
    start: NonNull<u8>,
    layout: Layout,
}

// SAFETY: it owns what it points to.
unsafe impl Send for Memory {}
// SAFETY: a shared reference to it reads nothing but the address.
unsafe impl Sync for Memory {}

impl Memory {
    /// Zeros, or nothing where there is not so much memory. The layout is not empty.
    fn zeroed(layout: Layout) -> Option<Self> {
        debug_assert!(layout.size() > 0);
        // SAFETY: the layout is not empty.
        let start = NonNull::new(unsafe { alloc_zeroed(layout) })?;
        Some(Self { start, layout })
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: allocated with this layout by `zeroed`, and nobody else has it.
        unsafe { dealloc(self.start.as_ptr(), self.layout) };
    }
}

/// A column of doubles.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Double {
    Axis1 = 0,
    Axis2 = 1,
    Incidence = 2,
    LimitExcess = 3,
}

/// Columns of `rows` rows: four of doubles, then the status.
#[derive(Debug)]
pub(crate) struct Slab {
    start: NonNull<u8>,
    /// There until it is dropped.
    memory: Option<Memory>,
    rows: usize,
    /// True if `limit_excess` may hold something else than zero.
    excess_dirty: AtomicBool,
}

// SAFETY: `start` is that of the memory it owns, and everything that writes there by way of a shared
// reference is unsafe.
unsafe impl Send for Slab {}
// SAFETY: as above.
unsafe impl Sync for Slab {}

impl Slab {
    /// Memory for some rows, all of it initialised.
    ///
    /// # Errors
    /// `OutOfMemoryError` if there is not so much.
    pub(crate) fn new(rows: usize) -> Result<Self, Failure> {
        let layout = layout(rows).ok_or_else(|| too_large(rows))?;
        let (memory, excess_dirty) = match spare(layout) {
            // Of another number of rows the columns begin elsewhere.
            Some(spare) => (spare.memory, spare.excess_dirty || spare.rows != rows),
            None => (
                Memory::zeroed(layout).ok_or_else(|| too_large(rows))?,
                false,
            ),
        };
        Ok(Self {
            start: memory.start,
            memory: Some(memory),
            rows,
            excess_dirty: AtomicBool::new(excess_dirty),
        })
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// Where a column of doubles begins.
    pub(crate) fn doubles(&self, column: Double) -> *mut f64 {
        if matches!(column, Double::LimitExcess) {
            // Who looks may write.
            self.excess_dirty.store(true, Ordering::Relaxed);
        }
        self.column(column as usize).cast()
    }

    /// Where the column of status begins.
    pub(crate) fn statuses(&self) -> *mut u8 {
        self.column(4)
    }

    fn column(&self, number: usize) -> *mut u8 {
        // SAFETY: `layout` made room for four strides and the rows' bytes of status.
        unsafe { self.start.as_ptr().add(number * stride(self.rows)) }
    }

    /// The columns, ready to be filled from the first row on.
    ///
    /// # Safety
    /// For as long as the columns are used nobody else may read or write this memory, other than by
    /// NumPy arrays whose users were told not to.
    pub(crate) unsafe fn begin(&self) {
        // Users may write any byte into a column of theirs, but not every byte is a `Status`.
        // SAFETY: the column is as long as that.
        unsafe { self.statuses().write_bytes(0, self.rows) };
        if self.excess_dirty.swap(false, Ordering::Relaxed) {
            // SAFETY: the column is as long as that, and zero bytes are 0.0.
            unsafe {
                self.column(Double::LimitExcess as usize)
                    .write_bytes(0, self.rows * size_of::<f64>());
            };
        }
    }

    /// Some rows of all columns.
    ///
    /// # Safety
    /// As [`begin`](Self::begin), which must have been called; and no two uses of the same rows at once.
    ///
    /// # Panics
    /// If there are no such rows.
    #[allow(
        clippy::mut_from_ref,
        reason = "the caller promises to be the only one"
    )]
    pub(crate) unsafe fn columns(&self, rows: Range<usize>) -> TrackingColumns<'_> {
        assert!(rows.start <= rows.end && rows.end <= self.rows);
        let doubles = |column: Double| {
            // SAFETY: within the column, which is initialised; exclusive by this function's contract.
            unsafe {
                let start = self.column(column as usize).cast::<f64>().add(rows.start);
                std::slice::from_raw_parts_mut(start, rows.len())
            }
        };
        TrackingColumns {
            axis1_rad: doubles(Double::Axis1),
            axis2_rad: doubles(Double::Axis2),
            incidence_rad: doubles(Double::Incidence),
            limit_excess_rad: doubles(Double::LimitExcess),
            // SAFETY: as above; `begin` has made every byte a status, and only statuses came since.
            status: unsafe {
                let start = self.statuses().add(rows.start).cast::<Status>();
                std::slice::from_raw_parts_mut(start, rows.len())
            },
        }
    }

    /// Remembers that `limit_excess` is not zero everywhere.
    pub(crate) fn excess_written(&self) {
        self.excess_dirty.store(true, Ordering::Relaxed);
    }
}

impl Drop for Slab {
    fn drop(&mut self) {
        let Some(memory) = self.memory.take() else {
            return;
        };
        if memory.layout.size() > SPARE_BYTES {
            return;
        }
        let kept = Spare {
            memory,
            rows: self.rows,
            excess_dirty: self.excess_dirty.load(Ordering::Relaxed),
        };
        // Never waits: a lock held by a thread that a fork left behind is never released.
        let Ok(mut spare) = SPARE.try_lock() else {
            return;
        };
        spare.push(kept);
        // The oldest go first.
        let mut bytes: usize = spare.iter().map(|spare| spare.memory.layout.size()).sum();
        while spare.len() > SPARE_SLABS || bytes > SPARE_BYTES {
            bytes -= spare.remove(0).memory.layout.size();
        }
    }
}

/// What somebody gave back, of the size wanted: the newest, which is likeliest to be in the caches.
fn spare(layout: Layout) -> Option<Spare> {
    let mut spare = SPARE.try_lock().ok()?;
    let found = spare
        .iter()
        .rposition(|spare| spare.memory.layout == layout)?;
    Some(spare.remove(found))
}

fn stride(rows: usize) -> usize {
    (rows * size_of::<f64>()).next_multiple_of(LINE)
}

fn layout(rows: usize) -> Option<Layout> {
    let bytes = rows.checked_mul(size_of::<f64>())?;
    let stride = bytes.checked_next_multiple_of(LINE)?;
    let size = stride.checked_mul(4)?.checked_add(rows)?;
    Layout::from_size_align(size.checked_next_multiple_of(LINE)?.max(LINE), LINE).ok()
}

#[cold]
fn too_large(rows: usize) -> Failure {
    let message = format!(
        "no memory for {rows} rows of 33 bytes; track fewer suns at a time, with out= for the rest"
    );
    Failure::new("OutOfMemoryError", message)
}
