//! Service loop of the board on a pseudo-terminal or an in-memory port, in real or virtual time.

use std::{
    collections::VecDeque,
    io,
    path::{Path, PathBuf},
    time::Duration,
};

use sonard_device::link::Pty;
use tokio::{
    io::unix::AsyncFd,
    sync::mpsc::UnboundedReceiver,
    time::{Instant, sleep, sleep_until},
};

use super::{
    board::{MockBoard, WakeKind},
    identity::Pace,
    memory::{MemoryLine, MemorySocket},
    note::Note,
    world::EchoTable,
};

/// Interval at which a lock left behind by a killed host is cleared.
const LOCK_CHECK_INTERVAL: Duration = Duration::from_millis(200);
/// Time for which the port is unavailable after a hangup.
const HANGUP_DURATION: Duration = Duration::from_millis(300);
const TICK_HZ: u64 = firmware_protocol::messages::limits::TICK_HZ as u64;

/// Board on a port that hosts can open.
#[derive(Debug)]
pub struct MockPort {
    board: MockBoard,
    line: BoardLine,
    epoch: Instant,
    epoch_ticks: u64,
    to_host: DelayedBytes,
    to_board: DelayedBytes,
    lock_check: Instant,
    moves: Option<UnboundedReceiver<EchoTable>>,
}

/// Board's side of the port.
#[derive(Debug)]
enum BoardLine {
    /// Pseudo-terminal, with the symbolic link to it.
    Pty {
        pty: AsyncFd<Pty>,
        link: Option<PathBuf>,
    },
    Memory(MemoryLine),
}

impl BoardLine {
    /// Waits for bytes from the host. Cancel-safe.
    async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Pty { pty, .. } => read_some(pty, buffer).await,
            Self::Memory(line) => line.read(buffer).await,
        }
    }

    /// Writes without blocking. Like a serial line without a reader, a full pipe loses bytes.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Pty { pty, .. } => match pty.get_ref().write(bytes) {
                Err(error) if error.kind() != io::ErrorKind::WouldBlock => Err(error),
                _written => Ok(()),
            },
            Self::Memory(line) => {
                line.write(bytes);
                Ok(())
            }
        }
    }

    /// Clears a lock left behind by a killed host.
    fn clear_lock(&self) {
        if let Self::Pty { pty, .. } = self {
            pty.get_ref().clear_exclusive();
        }
    }

    /// Removes the port for [`HANGUP_DURATION`] and restores it under the same name, as when
    /// replugged.
    async fn hang_up(&mut self) -> io::Result<()> {
        match self {
            Self::Pty { pty, link } => {
                // The old pty must be closed before its link can be created again.
                let parked = open_watched(None)?;
                drop(std::mem::replace(pty, parked));
                sleep(HANGUP_DURATION).await;
                if let Some(link) = link.as_deref() {
                    *pty = open_watched(Some(link))?;
                }
            }
            Self::Memory(line) => {
                line.unplug();
                sleep(HANGUP_DURATION).await;
                line.replug();
            }
        }
        Ok(())
    }
}

/// Queue of delayed bytes in one direction of the line.
#[derive(Debug, Default)]
struct DelayedBytes {
    chunks: VecDeque<(Instant, Vec<u8>)>,
}

impl DelayedBytes {
    /// Appends bytes; the order is kept whatever the delays.
    fn push(&mut self, bytes: Vec<u8>, delay: Duration) {
        let earliest = self.chunks.back().map(|(at, _)| *at);
        let at = Instant::now() + delay;
        self.chunks.push_back((earliest.map_or(at, |earliest| at.max(earliest)), bytes));
    }

    fn pop_due(&mut self) -> Option<Vec<u8>> {
        let due = self.chunks.front().is_some_and(|(at, _)| *at <= Instant::now());
        due.then(|| self.chunks.pop_front()).flatten().map(|(_, bytes)| bytes)
    }

    fn next_due(&self) -> Option<Instant> {
        self.chunks.front().map(|(at, _)| *at)
    }
}

impl MockPort {
    /// Opens the pty. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// Any system error; `AlreadyExists` if `link` exists and is not a link left by a mock.
    pub fn open(board: MockBoard, link: Option<&Path>) -> io::Result<Self> {
        let pty = open_watched(link)?;
        Ok(Self::with_line(board, BoardLine::Pty { pty, link: link.map(Path::to_path_buf) }))
    }

    /// Plugs the board into an in-memory port. Must be called within a tokio runtime, whose clock
    /// may be paused.
    #[must_use]
    pub fn in_memory(board: MockBoard, socket: MemorySocket) -> Self {
        Self::with_line(board, BoardLine::Memory(MemoryLine::plug(socket)))
    }

    fn with_line(board: MockBoard, line: BoardLine) -> Self {
        Self {
            epoch: Instant::now(),
            epoch_ticks: board.now(),
            line,
            board,
            to_host: DelayedBytes::default(),
            to_board: DelayedBytes::default(),
            lock_check: Instant::now() + LOCK_CHECK_INTERVAL,
            moves: None,
        }
    }

    /// Sets a channel of echoes for a board that is moved. A received table applies from then on,
    /// and before any byte sent later.
    #[must_use]
    pub fn with_moves(self, moves: UnboundedReceiver<EchoTable>) -> Self {
        Self { moves: Some(moves), ..self }
    }

    /// Path of the pseudo-terminal for hosts; empty for an in-memory port.
    #[must_use]
    pub fn path(&self) -> &Path {
        match &self.line {
            BoardLine::Pty { pty, .. } => pty.get_ref().path(),
            BoardLine::Memory(_) => Path::new(""),
        }
    }

    /// Runs the board until `shutdown` is ready, passing its messages to `on_note`.
    ///
    /// # Errors
    /// If the pty fails.
    pub async fn run(
        mut self,
        shutdown: impl Future<Output = ()>,
        mut on_note: impl FnMut(Note),
    ) -> io::Result<()> {
        tokio::pin!(shutdown);
        loop {
            while let Some(soundings) = self.moves.as_mut().and_then(|moves| moves.try_recv().ok())
            {
                self.board.world().set_echo_table(soundings);
            }
            let due = self.due();
            self.board.advance(due);
            while !self.board.stalled()
                && let Some(bytes) = self.to_board.pop_due()
            {
                self.board.handle_bytes(&bytes);
            }
            self.send()?;
            self.board.take_notes().into_iter().for_each(&mut on_note);
            if self.board.take_hangup() {
                self.hang_up().await?;
            }
            tokio::select! {
                biased;
                () = &mut shutdown => return self.drain().await,
                waited = self.wait() => waited?,
            }
        }
    }

    /// Present device time.
    fn due(&mut self) -> u64 {
        let real = self.epoch_ticks + ticks(self.epoch.elapsed());
        let Some(at) = self.jump().filter(|&at| at > real) else { return real };
        // After a jump, real time and with it the host's lease is measured from here.
        self.epoch = Instant::now();
        self.epoch_ticks = at;
        at
    }

    /// Device time to which virtual time may jump.
    fn jump(&self) -> Option<u64> {
        let wake = self.board.next_wake().filter(|wake| wake.kind == WakeKind::Work)?;
        (self.board.pace() == Pace::Virtual).then_some(wake.at)
    }

    /// Waits for bytes from the host or for the next event.
    async fn wait(&mut self) -> io::Result<()> {
        let at = match self.jump() {
            Some(_) => Some(Instant::now()),
            None => self.board.next_wake().map(|wake| self.real_time(wake.at)),
        };
        let lines = [self.to_host.next_due(), self.to_board.next_due()];
        let stalled_lines =
            if self.board.stalled() { None } else { lines.into_iter().flatten().min() };
        let wake_at = [at, stalled_lines].into_iter().flatten().fold(self.lock_check, Instant::min);
        let timer = async {
            // Yields so that the host's bytes are processed before the jump.
            if wake_at <= Instant::now() {
                tokio::task::yield_now().await;
            } else {
                sleep_until(wake_at).await;
            }
        };
        let mut buffer = [0; 1024];
        let count = tokio::select! {
            biased;
            read = self.line.read(&mut buffer) => read?,
            () = timer => {
                self.check_lock();
                return Ok(());
            }
        };
        let delay = Duration::from_millis(self.board.line_delay_ms().into());
        self.to_board.push(buffer.get(..count).unwrap_or_default().to_vec(), delay);
        Ok(())
    }

    fn check_lock(&mut self) {
        if self.lock_check <= Instant::now() {
            self.line.clear_lock();
            self.lock_check = Instant::now() + LOCK_CHECK_INTERVAL;
        }
    }

    fn real_time(&self, at_ticks: u64) -> Instant {
        let ahead = at_ticks.saturating_sub(self.epoch_ticks);
        self.epoch + Duration::from_nanos(ahead * (1_000_000_000 / TICK_HZ))
    }

    fn send(&mut self) -> io::Result<()> {
        let mut bytes = Vec::new();
        self.board.poll_transmit(&mut bytes);
        if !bytes.is_empty() {
            let delay = Duration::from_millis(self.board.line_delay_ms().into());
            self.to_host.push(bytes, delay);
        }
        while let Some(bytes) = self.to_host.pop_due() {
            self.line.write(&bytes)?;
        }
        Ok(())
    }

    async fn hang_up(&mut self) -> io::Result<()> {
        self.to_host.chunks.clear();
        self.to_board.chunks.clear();
        self.line.hang_up().await
    }

    /// Waits until the host has read the queued bytes, which closing the master would discard.
    async fn drain(&mut self) -> io::Result<()> {
        self.send()?;
        sleep(Duration::from_millis(20)).await;
        Ok(())
    }
}

#[expect(unsafe_code, reason = "tokio offers no safe way to watch a descriptor of one's own")]
fn open_watched(link: Option<&Path>) -> io::Result<AsyncFd<Pty>> {
    let pty = Pty::open(link)?;
    // SAFETY: `Pty` owns its master descriptor from `open` to `drop` and never replaces it.
    Ok(unsafe { AsyncFd::register(pty) }?)
}

async fn read_some(pty: &AsyncFd<Pty>, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        let mut ready = pty.readable().await?;
        match ready.try_io(|pty| pty.get_ref().read(buffer)) {
            Ok(read) => return read,
            Err(_would_block) => {}
        }
    }
}

fn ticks(elapsed: Duration) -> u64 {
    u64::try_from(elapsed.as_nanos() * u128::from(TICK_HZ) / 1_000_000_000).unwrap_or(u64::MAX)
}
