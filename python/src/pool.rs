//! The threads that predictions run on.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::{exceptions::PyValueError, prelude::*};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Most threads that can be asked for.
const MOST: usize = 1024;

/// The pool that was used last.
struct Held {
    process: u32,
    threads: Option<usize>,
    pool: Arc<ThreadPool>,
}

static HELD: Mutex<Option<Held>> = Mutex::new(None);

/// A pool of so many threads of this process; without a number, as many as `RAYON_NUM_THREADS` says, else one
/// for each core.
///
/// A forked child has none of its parent's threads: whatever waits for them waits for ever. So it gets a pool of
/// its own, and the parent's is forgotten there, because dropping it would wait too. The lock is only held
/// together with the interpreter's, without which no thread forks, so that no child finds it taken.
pub(crate) fn pool(_py: Python<'_>, threads: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    if threads.is_some_and(|count| !(1..=MOST).contains(&count)) {
        let count = threads.unwrap_or_default();
        return Err(PyValueError::new_err(format!("threads is {count}: it must be 1 to {MOST}")));
    }
    let process = std::process::id();
    let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    match held.take() {
        Some(known) if known.process == process && known.threads == threads => {
            let pool = known.pool.clone();
            *held = Some(known);
            return Ok(pool);
        }
        Some(known) if known.process != process => std::mem::forget(known),
        _ => {}
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .thread_name(|index| format!("sonard-{index}"))
        .build()
        .map_err(|error| PyValueError::new_err(format!("no threads to predict on: {error}")))?;
    let pool = Arc::new(pool);
    *held = Some(Held { process, threads, pool: pool.clone() });
    Ok(pool)
}

/// Something that threads share, made anew in a forked child: a parent's thread may have held a lock in it.
pub(crate) struct OfProcess<T> {
    held: Mutex<(u32, Arc<T>)>,
}

impl<T> OfProcess<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { held: Mutex::new((std::process::id(), Arc::new(value))) }
    }

    /// This process's own, with `make` for a child's first use. As above, the lock is only held together with
    /// the interpreter's.
    pub(crate) fn get<E>(
        &self,
        _py: Python<'_>,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<Arc<T>, E> {
        let process = std::process::id();
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        if held.0 != process {
            let parents = std::mem::replace(&mut *held, (process, Arc::new(make()?)));
            std::mem::forget(parents);
        }
        Ok(held.1.clone())
    }
}
