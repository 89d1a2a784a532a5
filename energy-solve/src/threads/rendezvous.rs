use std::hint::spin_loop;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock};

use super::barrier::SpinBarrier;
use super::pool::{pool, spin_while, with_helpers};
use super::results::Results;

/// Divides the items among threads and applies `work` to each part, all parts at the same time. The threads may wait
/// for each other at the barrier. They are at most `threads`, and no more than come at once: a thread that is busy or
/// wakes late does not take part. So results must not depend on their number.
pub(crate) fn in_parts<I: Send, R: Send>(
    threads: usize,
    items: Vec<I>,
    work: impl Fn(Vec<I>, &SpinBarrier) -> R + Sync,
) -> Vec<R> {
    if items.is_empty() {
        return Vec::new();
    }
    let threads = threads.min(items.len());
    let Some(pool) = pool(threads) else {
        return vec![work(items, &SpinBarrier::new(1))];
    };
    let threads = threads.min(pool.current_num_threads());
    let (rendezvous, agreed, results) = (Rendezvous::default(), OnceLock::new(), Results::default());
    let take_part = |number: usize, (barrier, parts): &(SpinBarrier, Vec<Mutex<Vec<I>>>)| {
        let part = std::mem::take(&mut *parts[number].lock().expect("no thread panics while it takes a part"));
        let _participation = barrier.participate();
        results.add(number, work(part, barrier));
    };
    let help = || {
        let Some(number) = rendezvous.join() else { return };
        let agreed = loop {
            match agreed.get() {
                Some(agreed) => break agreed,
                None => spin_loop(),
            }
        };
        take_part(number, agreed);
    };
    let lead = || {
        let participants = rendezvous.begin(threads);
        let parts = split(items, participants).into_iter().map(Mutex::new).collect();
        take_part(0, agreed.get_or_init(|| (SpinBarrier::new(participants), parts)));
    };
    with_helpers(pool, threads - 1, help, lead);
    results.in_order()
}

/// The threads that have come to work together.
#[derive(Debug, Default)]
struct Rendezvous(AtomicUsize);

impl Rendezvous {
    /// Is added when the work begins.
    const BEGUN: usize = 1 << (usize::BITS - 1);

    /// Joins as the participant of the returned number; `None` if the work has begun.
    fn join(&self) -> Option<usize> {
        let before = self.0.fetch_add(1, Ordering::AcqRel);
        (before < Self::BEGUN).then_some(before + 1)
    }

    /// Begins once `wanted` participants are there, or after a short time. Returns the number of participants,
    /// including the calling thread.
    fn begin(&self, wanted: usize) -> usize {
        spin_while(|| self.0.load(Ordering::Acquire) + 1 < wanted);
        self.0.fetch_add(Self::BEGUN, Ordering::AcqRel) + 1
    }
}

/// Splits the items into runs of about the same length. There are at least as many items as parts.
fn split<I>(items: Vec<I>, parts: usize) -> Vec<Vec<I>> {
    let (count, mut items) = (items.len(), items.into_iter());
    let length = |part: usize| (part + 1) * count / parts - part * count / parts;
    (0..parts).map(|part| items.by_ref().take(length(part)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_item_is_in_one_part() {
        for threads in [1, 2, 3, 8] {
            for count in [0, 1, 2, 7, 20] {
                let parts = in_parts(threads, (0..count).collect(), |part: Vec<usize>, barrier| {
                    barrier.wait();
                    part
                });
                assert_eq!(parts.concat(), (0..count).collect::<Vec<_>>(), "{threads} threads");
                assert!(parts.len() <= threads && parts.iter().all(|part| !part.is_empty()), "{parts:?}");
            }
        }
    }

    #[test]
    fn a_thread_that_comes_too_late_does_not_take_part() {
        let rendezvous = Rendezvous::default();
        assert_eq!(rendezvous.join(), Some(1));
        assert_eq!(rendezvous.begin(3), 2);
        assert_eq!(rendezvous.join(), None);
    }

    #[test]
    #[should_panic(expected = "panicked")]
    fn a_panic_keeps_no_thread_waiting() {
        in_parts(2, vec![0, 1], |parts, barrier| {
            assert!(!parts.contains(&1), "one panicked");
            barrier.wait();
        });
    }
}
