//! Work divided among threads. The results do not depend on the number of threads.

use std::ops::Range;
use std::panic::resume_unwind;
use std::sync::{Mutex, OnceLock};

use rayon_core::{ThreadPool, ThreadPoolBuilder};

/// Bytes of stack of each thread of the pool. While a thread waits for others, it may begin the step of another
/// simulation.
const STACK: usize = 16 << 20;

/// The threads, one per core, which sleep between two calls: to wake one takes a tenth of the time that it takes to
/// start one. `None` if the system refuses to start them, or in a forked process, which inherits no threads.
fn pool() -> Option<&'static ThreadPool> {
    static POOL: OnceLock<(u32, Option<ThreadPool>)> = OnceLock::new();
    let start = || {
        let name = |number| format!("energy-solve {number}");
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let builder = ThreadPoolBuilder::new().num_threads(cores).stack_size(STACK).thread_name(name);
        (std::process::id(), builder.build().ok())
    };
    let (process, pool) = POOL.get_or_init(start);
    pool.as_ref().filter(|_| *process == std::process::id())
}

/// Applies `work` to every item on at most `threads` threads, including the calling one. Each thread takes one item
/// after the other, so one that starts late takes fewer. Results are in the order of the items.
pub fn for_each<I: Send, R: Send>(threads: usize, items: Vec<I>, work: impl Fn(I) -> R + Sync) -> Vec<R> {
    let count = items.len();
    let threads = threads.min(count);
    let Some(pool) = (threads > 1).then(pool).flatten() else {
        return items.into_iter().map(work).collect();
    };
    let waiting = Mutex::new(items.into_iter().enumerate());
    let done = Mutex::new(Vec::with_capacity(count));
    let next = || waiting.lock().expect("no thread panics while it takes an item").next();
    let until_none_waits = || {
        while let Some((number, item)) = next() {
            let result = work(item);
            done.lock().expect("no thread panics while it adds a result").push((number, result));
        }
    };
    pool.in_place_scope(|scope| {
        (1..threads).for_each(|_| scope.spawn(|_| until_none_waits()));
        until_none_waits();
    });
    let mut done = done.into_inner().expect("no thread panics while it adds a result");
    done.sort_unstable_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Runs `work` on a thread of the pool if it may use several threads. Within it, [`for_each`] does not wait for a
/// thread that wakes too late to help.
pub fn in_pool<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    match (threads > 1).then(pool).flatten() {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// Collects what `work` makes of consecutive ranges of the numbers below `count`, of this length, on at most `threads`
/// threads. One thread takes all numbers at once, so entries must depend on their own number alone.
pub fn collect<R: Send>(
    threads: usize,
    count: usize,
    length: usize,
    work: impl Fn(Range<usize>) -> Vec<R> + Sync,
) -> Vec<R> {
    concatenated(for_each(threads, ranges(threads, count, length), work))
}

/// Concatenates lists. A single one is not copied.
#[must_use]
pub fn concatenated<R>(parts: Vec<Vec<R>>) -> Vec<R> {
    let count = parts.iter().map(Vec::len).sum::<usize>();
    let mut parts = parts.into_iter();
    let mut all = parts.next().unwrap_or_default();
    all.reserve_exact(count - all.len());
    parts.for_each(|part| all.extend(part));
    all
}

/// Collects what `work` makes of each number below `count`, on at most `threads` threads. Each takes consecutive
/// numbers, this many at a time.
pub fn collect_each<R: Send>(threads: usize, count: usize, length: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
    collect(threads, count, length, |range| range.map(&work).collect())
}

/// Divides the numbers below `count` into consecutive ranges of this length for [`for_each`], or into a single one for
/// one thread.
#[must_use]
pub fn ranges(threads: usize, count: usize, length: usize) -> Vec<Range<usize>> {
    let length = if threads <= 1 { count } else { length };
    (0..count).step_by(length.max(1)).map(|first| first..count.min(first + length)).collect()
}

/// Divides the items among at most `threads` threads and applies `work` to each part, all parts at the same time.
pub fn in_parts<I: Send, R: Send>(threads: usize, items: Vec<I>, work: impl Fn(Vec<I>) -> R + Sync) -> Vec<R> {
    let mut parts = split(items, threads).into_iter();
    let Some(own) = parts.next() else { return Vec::new() };
    std::thread::scope(|scope| {
        let work = &work;
        let others: Vec<_> = parts.map(|part| scope.spawn(move || work(part))).collect();
        let mut results = vec![work(own)];
        results.extend(others.into_iter().map(|other| other.join().unwrap_or_else(|panic| resume_unwind(panic))));
        results
    })
}

/// Splits the items into at most `parts` non-empty runs of about the same length.
fn split<I>(items: Vec<I>, parts: usize) -> Vec<Vec<I>> {
    let (count, parts) = (items.len(), parts.clamp(1, items.len().max(1)));
    let mut items = items.into_iter();
    let run = |part: usize| items.by_ref().take((part + 1) * count / parts - part * count / parts).collect::<Vec<I>>();
    (0..parts).map(run).filter(|run| !run.is_empty()).collect()
}

/// Splits a slice into consecutive parts of these lengths.
pub(crate) fn split_mut<T>(mut slice: &mut [T], lengths: impl IntoIterator<Item = usize>) -> Vec<&mut [T]> {
    let mut parts = Vec::new();
    for length in lengths {
        let (part, rest) = slice.split_at_mut(length);
        parts.push(part);
        slice = rest;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_items() {
        for threads in [1, 2, 3, 8] {
            for count in [0, 1, 2, 7, 20] {
                let results = for_each(threads, (0..count).collect(), |item: usize| item * item);
                let squares: Vec<_> = (0..count).map(|item| item * item).collect();
                assert_eq!(results, squares, "{threads} threads");
                let in_pool = in_pool(threads, || for_each(threads, (0..count).collect(), |item: usize| item * item));
                assert_eq!(in_pool, squares, "{threads} threads of the pool");
            }
        }
    }

    #[test]
    fn ranges_cover_all_numbers() {
        for (threads, count) in [(1, 7), (2, 0), (2, 3), (2, 7), (3, 20)] {
            let numbers = collect(threads, count, 3, |range| {
                assert!(threads == 1 || range.len() <= 3);
                range.collect()
            });
            assert_eq!(numbers, (0..count).collect::<Vec<_>>(), "{threads} threads");
            let squares = collect_each(threads, count, 3, |number| number * number);
            assert_eq!(squares, (0..count).map(|number| number * number).collect::<Vec<_>>(), "{threads} threads");
        }
    }

    #[test]
    #[should_panic(expected = "item 5")]
    fn a_panic_is_passed_on() {
        for_each(3, (0..9).collect(), |item: usize| assert!(item != 5, "item {item}"));
    }
}
