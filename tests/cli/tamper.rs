//! A device with wrong replies: a mock, with a proxy on its line that changes
//! what it answers. The frames stay right.

use std::{
    fs::{File, OpenOptions},
    io::{ErrorKind, Read as _, Write as _},
    os::unix::fs::OpenOptionsExt as _,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use firmware_protocol::{
    frame::{Frame, FrameDecoder, Received},
    messages::Reply,
};
use rustix::fs::OFlags;
use sonard::link::Pty;

/// Changes a reply on its way to the host.
pub(crate) type Change = Box<dyn FnMut(&mut Reply) + Send>;

/// The line with its proxy, which runs until the value is dropped.
pub(crate) struct Tampered {
    port: String,
    stop: Arc<AtomicBool>,
    passing_on: Option<JoinHandle<()>>,
}

impl Tampered {
    /// Connects the proxy between hosts and the device at `port`.
    pub(crate) fn start(port: &str, change: Change) -> Self {
        let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
        let device = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits().cast_signed())
            .open(port)
            .expect("the device's port opens");
        let pty = Pty::open(None).expect("a pty");
        let port = pty.path().to_str().expect("plain path").to_owned();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let passing_on = std::thread::spawn(move || pass_on(&pty, device, change, &stopped));
        Self { port, stop, passing_on: Some(passing_on) }
    }

    pub(crate) fn port(&self) -> &str {
        &self.port
    }
}

impl Drop for Tampered {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(passing_on) = self.passing_on.take() {
            drop(passing_on.join());
        }
    }
}

fn pass_on(pty: &Pty, mut device: File, mut change: Change, stop: &AtomicBool) {
    let mut decoder = FrameDecoder::new();
    let mut buffer = [0; 512];
    while !stop.load(Ordering::Relaxed) {
        let mut idle = true;
        if let Some(count) = some(pty.read(&mut buffer)) {
            device.write_all(&buffer[..count]).expect("a request is short");
            idle = false;
        }
        if let Some(count) = some(device.read(&mut buffer)) {
            for &byte in &buffer[..count] {
                let Received::Frame(raw) = decoder.push(byte) else { continue };
                let mut reply = Reply::decode(raw.body).expect("a reply");
                change(&mut reply);
                let frame = Frame::encode(raw.header, &reply).expect("it fits a frame");
                // A full pty drops unread bytes.
                drop(pty.write(&frame));
            }
            idle = false;
        }
        if idle {
            std::thread::sleep(Duration::from_micros(300));
        }
    }
}

/// Returns the bytes that were available, if any.
fn some(read: std::io::Result<usize>) -> Option<usize> {
    match read {
        Ok(count) => Some(count).filter(|&count| count > 0),
        Err(error) => {
            let expected = [ErrorKind::WouldBlock, ErrorKind::Interrupted, ErrorKind::Other];
            assert!(expected.contains(&error.kind()) || error.raw_os_error() == Some(5), "{error}");
            None
        }
    }
}
