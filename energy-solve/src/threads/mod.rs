//! Work divided among threads. The results do not depend on the number of threads.

mod barrier;
mod pool;
mod rendezvous;
mod results;

use std::ops::Range;
use std::sync::Mutex;

use rayon_core::ThreadPool;

pub(crate) use barrier::SpinBarrier;
pub use pool::in_pool;
use pool::{pool, spin_while, with_helpers};
pub(crate) use rendezvous::in_parts;
use results::Results;

/// Applies `work` to every item on at most `threads` threads, including the calling one. Each thread takes one item
/// after the other, so one that starts late takes fewer. Results are in the order of the items.
pub fn for_each<I: Send, R: Send>(threads: usize, items: Vec<I>, work: impl Fn(I) -> R + Sync) -> Vec<R> {
    let threads = threads.min(items.len());
    match pool(threads) {
        Some(pool) => shared(pool, threads, items, &work),
        None => items.into_iter().map(work).collect(),
    }
}

/// [`for_each`] on several threads. Out of line, so that callers on one thread stay small.
#[inline(never)]
fn shared<I: Send, R: Send>(
    pool: &ThreadPool,
    threads: usize,
    items: Vec<I>,
    work: &(impl Fn(I) -> R + Sync),
) -> Vec<R> {
    let count = items.len();
    let waiting = Mutex::new(items.into_iter().enumerate());
    let results = Results::default();
    let next = || waiting.lock().expect("no thread panics while it takes an item").next();
    let until_none_waits = || {
        while let Some((number, item)) = next() {
            results.add(number, work(item));
        }
    };
    let lead = || {
        until_none_waits();
        spin_while(|| results.count() < count);
    };
    with_helpers(pool, threads - 1, until_none_waits, lead);
    results.in_order()
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

    /// More callers than threads of the pool, which also help each other.
    #[test]
    fn simultaneous_callers_do_not_wait_for_each_other() {
        let squares = |caller: usize| {
            in_pool(2, || {
                for round in 0..200 {
                    let numbers: Vec<usize> = (0..5 + round % 7).map(|number| caller * number).collect();
                    let expected: Vec<_> = numbers.iter().map(|number| number * number).collect();
                    assert_eq!(for_each(2, numbers.clone(), |number| number * number), expected);
                    let parts = in_parts(2, numbers, |part, barrier| {
                        barrier.wait();
                        part.into_iter().map(|number| number * number).collect::<Vec<_>>()
                    });
                    assert_eq!(parts.concat(), expected);
                }
            });
        };
        std::thread::scope(|scope| (0..8).for_each(|caller| drop(scope.spawn(move || squares(caller)))));
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
