//! A file that grows, read as if it had no end.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read, Seek},
    path::Path,
    thread,
    time::Duration,
};

use crate::store::StoreError;

/// How long a new record may stay unnoticed.
const POLL: Duration = Duration::from_millis(200);

/// Opens a log so that reading waits at its end for more.
pub(super) fn open(path: &Path) -> Result<Box<dyn BufRead>, StoreError> {
    match File::open(path) {
        Ok(file) => Ok(Box::new(BufReader::new(Growing { file }))),
        Err(source) => Err(StoreError::Unreadable { path: path.into(), source }),
    }
}

struct Growing {
    file: File,
}

impl Read for Growing {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.file.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            if self.file.metadata()?.len() < self.file.stream_position()? {
                return Err(io::Error::other("the file became shorter; show it again"));
            }
            thread::sleep(POLL);
        }
    }
}
