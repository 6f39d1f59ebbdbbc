//! Where bytes go: a thread that writes what the encoders hand over, in order.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

use super::KeptColumns;
use crate::{AtomicFile, IoError, Place, Problem};

/// Pieces (of a megabyte at most) that may wait for the writing thread: bounds the memory.
const QUEUE: usize = 32;

/// Where a table goes.
pub enum Destination {
    /// A file, replaced when the table is complete.
    File(PathBuf),
    /// A stream, for instance standard output.
    Stream {
        /// What to call it in messages.
        name: String,
        /// The stream.
        writer: Box<dyn Write + Send>,
    },
    /// Memory, for whoever goes on computing with it: small tables only, in no format at all.
    Columns(KeptColumns),
}

impl std::fmt::Debug for Destination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(path) => f.debug_tuple("File").field(path).finish(),
            Self::Stream { name, .. } => f.debug_tuple("Stream").field(name).finish(),
            Self::Columns(_) => f.debug_tuple("Columns").finish(),
        }
    }
}

/// An opened destination.
enum Target {
    File(Box<AtomicFile>),
    Stream(Box<dyn Write + Send>),
}

impl Target {
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::File(file) => file.write_all(bytes),
            Self::Stream(writer) => writer.write_all(bytes),
        }
    }

    fn finish(self, name: &Path) -> Result<(), IoError> {
        match self {
            Self::File(file) => file.finish(),
            Self::Stream(mut writer) => writer.flush().map_err(|e| IoError::write(name, e)),
        }
    }
}

/// Bytes on their way.
pub(super) enum Piece {
    Owned(Vec<u8>),
    /// A few bytes whose buffer is not worth keeping.
    Small(Vec<u8>),
    Shared(Arc<[u8]>),
    /// Nothing more comes: the file may take its place. Hanging up without it means "forget it".
    Complete,
}

impl AsRef<[u8]> for Piece {
    fn as_ref(&self) -> &[u8] {
        match self {
            Self::Owned(bytes) | Self::Small(bytes) => bytes,
            Self::Shared(bytes) => bytes,
            Self::Complete => &[],
        }
    }
}

/// The handing-over end of the writing thread.
#[derive(Debug)]
pub(super) struct Sink {
    name: PathBuf,
    pieces: Option<SyncSender<Piece>>,
    /// Buffers that were written and may be filled again.
    used: Receiver<Vec<u8>>,
    thread: Option<JoinHandle<Result<(), IoError>>>,
    bytes: u64,
}

impl Sink {
    pub(super) fn open(destination: Destination) -> Result<Self, IoError> {
        let (name, target) = match destination {
            Destination::File(path) => {
                let file = AtomicFile::create(&path)?;
                (path, Target::File(Box::new(file)))
            }
            Destination::Stream { name, writer } => (name.into(), Target::Stream(writer)),
            Destination::Columns(_) => {
                let message = "only small tables are kept in memory".to_string();
                let problem = Problem::Conflict { message };
                return Err(IoError::new(Place::default(), problem));
            }
        };
        let (pieces, queue) = sync_channel(QUEUE);
        let (back, used) = channel();
        let thread_name = name.clone();
        let thread = std::thread::Builder::new()
            .name("helio-writer".to_owned())
            .spawn(move || drain(target, &thread_name, &queue, &back))
            .map_err(|e| IoError::write(&name, e))?;
        Ok(Self {
            name,
            pieces: Some(pieces),
            used,
            thread: Some(thread),
            bytes: 0,
        })
    }

    /// The destination, for messages.
    pub(super) fn name(&self) -> &Path {
        &self.name
    }

    /// Bytes handed over so far: where the next piece will stand in the file.
    pub(super) fn position(&self) -> u64 {
        self.bytes
    }

    /// Buffers to fill, used ones first: fresh memory costs page faults.
    pub(super) fn buffers(&self, count: usize) -> Vec<Vec<u8>> {
        let mut buffers: Vec<_> = self.used.try_iter().take(count).collect();
        buffers.resize_with(count, Vec::new);
        buffers
    }

    /// Hands a piece over; waits while too many are on their way.
    pub(super) fn send(&mut self, piece: Piece) -> Result<(), IoError> {
        self.bytes += piece.as_ref().len() as u64;
        if let Some(pieces) = &self.pieces
            && pieces.send(piece).is_ok()
        {
            return Ok(());
        }
        // The thread only stops listening after a failure, which is what to report.
        self.join()?;
        Err(self.stopped())
    }

    /// Waits for everything to be written and puts the file in place.
    pub(super) fn finish(&mut self) -> Result<u64, IoError> {
        self.send(Piece::Complete)?;
        self.join()?;
        Ok(self.bytes)
    }

    fn join(&mut self) -> Result<(), IoError> {
        self.pieces = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            _ => Err(self.stopped()),
        }
    }

    fn stopped(&self) -> IoError {
        IoError::write(
            &self.name,
            io::Error::other("the writing thread has stopped"),
        )
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        // Hanging up makes the thread drop the unfinished file, which removes it; waiting for that
        // makes sure it has happened before the caller goes on.
        if self.thread.is_some() {
            let _ = self.join();
        }
    }
}

fn drain(
    mut target: Target,
    name: &Path,
    queue: &Receiver<Piece>,
    back: &Sender<Vec<u8>>,
) -> Result<(), IoError> {
    while let Ok(piece) = queue.recv() {
        if matches!(piece, Piece::Complete) {
            return target.finish(name);
        }
        target
            .write_all(piece.as_ref())
            .map_err(|e| IoError::write(name, e))?;
        if let Piece::Owned(mut buffer) = piece {
            buffer.clear();
            // Nobody needs it any more once the encoder has gone.
            let _ = back.send(buffer);
        }
    }
    Ok(())
}
