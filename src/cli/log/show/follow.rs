//! Reader of a growing file that waits at its end.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read, Seek},
    path::Path,
    thread,
    time::Duration,
};

use crate::store::StoreError;

/// Poll interval at the end of the file.
const POLL: Duration = Duration::from_millis(200);

/// Opens a log so that reads at its end wait for more data.
pub(super) fn open(path: &Path) -> Result<Box<dyn BufRead>, StoreError> {
    match File::open(path) {
        Ok(file) => Ok(Box::new(BufReader::new(FollowedFile { file }))),
        Err(source) => Err(StoreError::Unreadable { path: path.into(), source }),
    }
}

struct FollowedFile {
    file: File,
}

impl Read for FollowedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.file.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            if self.file.metadata()?.len() < self.file.stream_position()? {
                return Err(io::Error::other("the file was truncated; run the command again"));
            }
            thread::sleep(POLL);
        }
    }
}
