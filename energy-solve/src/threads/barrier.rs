use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Number of spins before a waiting thread yields.
const PATIENCE: u32 = 1 << 12;

/// Spin barrier for waits of a few microseconds, in which threads do not sleep.
#[derive(Debug)]
pub(crate) struct SpinBarrier {
    participants: usize,
    arrived: AtomicUsize,
    round: AtomicUsize,
    /// Whether a thread panicked, for which the others would wait forever.
    is_broken: AtomicBool,
}

/// The time in which a thread may wait at a barrier.
#[derive(Debug)]
pub(super) struct Participation<'a>(&'a SpinBarrier);

impl Drop for Participation<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.is_broken.store(true, Ordering::Release);
        }
    }
}

impl SpinBarrier {
    /// Creates a barrier for `participants` threads.
    pub(super) fn new(participants: usize) -> Self {
        let (arrived, round) = (AtomicUsize::new(0), AtomicUsize::new(0));
        Self { participants, arrived, round, is_broken: AtomicBool::new(false) }
    }

    /// Begins the participation of a thread. If it panics meanwhile, the other threads panic instead of waiting.
    pub(super) fn participate(&self) -> Participation<'_> {
        Participation(self)
    }

    /// Waits until all threads have called this. Everything they wrote before is visible afterwards.
    pub(crate) fn wait(&self) {
        if self.participants == 1 {
            return;
        }
        let round = self.round.load(Ordering::Acquire);
        if self.arrived.fetch_add(1, Ordering::AcqRel) + 1 == self.participants {
            self.arrived.store(0, Ordering::Relaxed);
            self.round.store(round.wrapping_add(1), Ordering::Release);
            return;
        }
        let mut looks = 0;
        while self.round.load(Ordering::Acquire) == round {
            assert!(!self.is_broken.load(Ordering::Acquire), "another thread of the solver panicked");
            looks += 1;
            if looks < PATIENCE { std::hint::spin_loop() } else { std::thread::yield_now() }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_all_threads_wrote_before_a_barrier_is_visible_after_it() {
        const THREADS: usize = 3;
        let (barrier, written) = (SpinBarrier::new(THREADS), AtomicUsize::new(0));
        let take_turns = || {
            let _participation = barrier.participate();
            for round in 1..=200 {
                written.fetch_add(1, Ordering::Relaxed);
                barrier.wait();
                assert_eq!(written.load(Ordering::Relaxed), THREADS * round);
                barrier.wait();
            }
        };
        std::thread::scope(|scope| (0..THREADS).for_each(|_| drop(scope.spawn(take_turns))));
    }
}
