//! The only place where the host machine meets a line and a clock.

use std::time::Duration;

use firmware_protocol::host::{Command, Host, HostConfig, HostError, HostEvent, Outcome};
use tokio::{
    io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _},
    time::{Instant, sleep_until},
};

/// A host machine on a line. It owns both; whoever wants something of the device asks it.
#[derive(Debug)]
pub struct Driver<L> {
    line: L,
    host: Host,
    epoch: Instant,
    hung_up: bool,
    outgoing: Vec<u8>,
}

impl<L: AsyncRead + AsyncWrite + Unpin> Driver<L> {
    /// A driver on an open line.
    pub fn new(line: L, config: HostConfig) -> Self {
        Self {
            line,
            host: Host::new(config),
            epoch: Instant::now(),
            hung_up: false,
            outgoing: Vec::new(),
        }
    }

    /// The machine, for its statistics.
    pub const fn host(&self) -> &Host {
        &self.host
    }

    /// Microseconds since the driver was made: the time line of the machine's events.
    pub fn now_us(&self) -> u64 {
        u64::try_from(self.epoch.elapsed().as_micros()).unwrap_or(u64::MAX)
    }

    /// Carries out one command and hands every event on the way to `on_event`.
    ///
    /// Cancel-safe: what was received stays in the machine, and the command goes on when driven
    /// again with [`Self::finish`].
    ///
    /// # Errors
    /// The machine's own, which name the cause.
    pub async fn perform(
        &mut self,
        command: Command,
        on_event: impl FnMut(HostEvent),
    ) -> Result<Outcome, HostError> {
        let now_us = self.now_us();
        self.host.start(now_us, command).map_err(|_busy| HostError::Busy)?;
        self.finish(on_event).await
    }

    /// Waits for the end of the command under way.
    ///
    /// # Errors
    /// The machine's own, which name the cause.
    pub async fn finish(
        &mut self,
        mut on_event: impl FnMut(HostEvent),
    ) -> Result<Outcome, HostError> {
        loop {
            match self.next_event().await {
                HostEvent::Done(outcome) => return Ok(outcome),
                HostEvent::Failed(error) => return Err(error),
                event => on_event(event),
            }
        }
    }

    /// The machine's next event. Cancel-safe.
    async fn next_event(&mut self) -> HostEvent {
        loop {
            if let Some(event) = self.host.poll_event() {
                return event;
            }
            while let Some(frame) = self.host.poll_transmit() {
                self.outgoing.extend_from_slice(&frame);
            }
            self.wait().await;
        }
    }

    /// Waits for bytes, room for bytes, or the machine's next deadline, and tells the machine.
    async fn wait(&mut self) {
        let deadline = self
            .host
            .poll_timeout()
            .map(|(_, at_us)| self.epoch + Duration::from_micros(at_us));
        let timer = async {
            match deadline {
                Some(at) => sleep_until(at).await,
                None => std::future::pending().await,
            }
        };
        let mut buffer = [0; 1024];
        // After a hangup the line would answer at once, for ever: it is not asked again.
        tokio::select! {
            read = self.line.read(&mut buffer), if !self.hung_up => match read {
                Ok(count) if count > 0 => {
                    let now_us = self.now_us();
                    self.host.handle_bytes(now_us, buffer.get(..count).unwrap_or_default());
                }
                _ => self.hang_up(),
            },
            written = self.line.write(&self.outgoing), if !self.hung_up && !self.outgoing.is_empty() => {
                match written {
                    Ok(count) if count > 0 => drop(self.outgoing.drain(..count)),
                    _ => self.hang_up(),
                }
            }
            () = timer => {
                let now_us = self.now_us();
                self.host.handle_timeout(now_us);
            }
        }
    }

    fn hang_up(&mut self) {
        self.hung_up = true;
        self.outgoing.clear();
        let now_us = self.now_us();
        self.host.handle_hangup(now_us);
    }
}
