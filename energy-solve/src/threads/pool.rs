use std::cell::Cell;
use std::hint::spin_loop;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use rayon_core::{ThreadPool, ThreadPoolBuilder, Yield};

/// Bytes of stack of each thread of the pool. While a thread waits for others, it may begin the step of another
/// simulation.
const STACK: usize = 16 << 20;
/// The time for which a thread without work looks for some before it sleeps. Many loops are shorter than it takes to
/// wake a thread.
const PATIENCE: Duration = Duration::from_micros(200);

/// The threads, one per core, if work is for more than one. To wake one takes a tenth of the time that it takes to
/// start one. `None` also if the system refuses to start them, or in a forked process, which inherits no threads.
pub(super) fn pool(threads: usize) -> Option<&'static ThreadPool> {
    static POOL: OnceLock<(u32, Option<ThreadPool>)> = OnceLock::new();
    if threads <= 1 {
        return None;
    }
    let start = || {
        let name = |number| format!("energy-solve {number}");
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let builder = ThreadPoolBuilder::new().num_threads(cores).stack_size(STACK).thread_name(name);
        (std::process::id(), builder.build().ok())
    };
    let (process, pool) = POOL.get_or_init(start);
    pool.as_ref().filter(|_| *process == std::process::id())
}

/// Runs `work` on a thread of the pool if it may use several threads. Within it, [`for_each`](super::for_each) does not
/// wait for a thread that wakes too late to help.
pub fn in_pool<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    match pool(threads) {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// Runs `lead`, while this many threads of the pool run `help` as soon as they can. Returns when all have returned.
pub(super) fn with_helpers(pool: &ThreadPool, helpers: usize, help: impl Fn() + Sync, lead: impl FnOnce()) {
    let _busy = Busy(IS_BUSY.replace(true));
    let help = || {
        // First, because afterwards the waiting leader would take the job that it adds.
        stay_awake();
        help();
    };
    pool.in_place_scope(|scope| {
        (0..helpers).for_each(|_| scope.spawn(|_| help()));
        lead();
    });
}

thread_local! {
    /// Whether this thread leads others or looks for work already.
    static IS_BUSY: Cell<bool> = const { Cell::new(false) };
}

/// The time in which a thread leads others, and whether it was busy before.
struct Busy(bool);

impl Drop for Busy {
    fn drop(&mut self) {
        IS_BUSY.set(self.0);
    }
}

/// Lets this thread of the pool look for more work for a while after its current one.
fn stay_awake() {
    if IS_BUSY.get() {
        return;
    }
    let thread = rayon_core::current_thread_index();
    rayon_core::spawn(move || {
        // Another thread that has no work may have taken this job.
        if rayon_core::current_thread_index() != thread || IS_BUSY.replace(true) {
            return;
        }
        let mut since = Instant::now();
        while since.elapsed() < PATIENCE {
            match rayon_core::yield_now() {
                Some(Yield::Executed) => since = Instant::now(),
                _ => spin_loop(),
            }
        }
        IS_BUSY.set(false);
    });
}

/// Waits while this is so, for a short time at most.
pub(super) fn spin_while(is_so: impl Fn() -> bool) {
    let started = Instant::now();
    while is_so() && started.elapsed() < PATIENCE {
        spin_loop();
    }
}
