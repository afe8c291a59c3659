//! Thread pool of the predictions.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::{exceptions::PyValueError, prelude::*};
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Maximum number of threads.
const MAX_THREADS: usize = 1024;

/// Most recently used pool.
struct CachedPool {
    process: u32,
    threads: Option<usize>,
    pool: Arc<ThreadPool>,
}

static CACHED_POOL: Mutex<Option<CachedPool>> = Mutex::new(None);

/// Returns a pool with the given number of threads for this process. The number defaults to
/// `RAYON_NUM_THREADS`, else to the number of cores.
///
/// A forked child has none of its parent's threads, so waiting for them would never end. The child
/// therefore gets a pool of its own and leaks the parent's, because dropping that would wait, too.
/// The lock is held only together with the interpreter lock, without which no thread forks, so no
/// child inherits a locked mutex.
pub(crate) fn pool(_py: Python<'_>, threads: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    if threads.is_some_and(|count| !(1..=MAX_THREADS).contains(&count)) {
        let count = threads.unwrap_or_default();
        return Err(PyValueError::new_err(format!(
            "threads is {count}: it must be 1 to {MAX_THREADS}"
        )));
    }
    let process = std::process::id();
    let mut cached = CACHED_POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match cached.take() {
        Some(entry) if entry.process == process && entry.threads == threads => {
            let pool = entry.pool.clone();
            *cached = Some(entry);
            return Ok(pool);
        }
        Some(entry) if entry.process != process => std::mem::forget(entry),
        _ => {}
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .thread_name(|index| format!("sonard-{index}"))
        .build()
        .map_err(|error| PyValueError::new_err(format!("no threads to predict on: {error}")))?;
    let pool = Arc::new(pool);
    *cached = Some(CachedPool { process, threads, pool: pool.clone() });
    Ok(pool)
}

/// Value shared by threads and created again in a forked child, because a thread of the parent may
/// have held a lock in it.
pub(crate) struct PerProcess<T> {
    cached: Mutex<(u32, Arc<T>)>,
}

impl<T> PerProcess<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { cached: Mutex::new((std::process::id(), Arc::new(value))) }
    }

    /// Returns the value of this process; `make` creates it on the first use in a child. As above,
    /// the lock is held only together with the interpreter lock.
    pub(crate) fn get<E>(
        &self,
        _py: Python<'_>,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<Arc<T>, E> {
        let process = std::process::id();
        let mut cached = self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        if cached.0 != process {
            let parents = std::mem::replace(&mut *cached, (process, Arc::new(make()?)));
            std::mem::forget(parents);
        }
        Ok(cached.1.clone())
    }
}
