//! Work divided among threads. The results do not depend on the number of threads.

use std::ops::Range;
use std::panic::resume_unwind;
use std::sync::Mutex;

/// Applies `work` to every item on at most `threads` threads, including the calling one. Each thread takes one item
/// after the other, so one that starts late takes fewer. Results are in the order of the items.
pub fn for_each<I: Send, R: Send>(threads: usize, items: Vec<I>, work: impl Fn(I) -> R + Sync) -> Vec<R> {
    let threads = threads.min(items.len());
    if threads <= 1 {
        return items.into_iter().map(work).collect();
    }
    let waiting = Mutex::new(items.into_iter().enumerate());
    let next = || waiting.lock().expect("no thread panics while it takes an item").next();
    let until_none_waits = |_| {
        let mut done = Vec::new();
        while let Some((number, item)) = next() {
            done.push((number, work(item)));
        }
        done
    };
    let mut done: Vec<(usize, R)> =
        in_parts(threads, vec![(); threads], until_none_waits).into_iter().flatten().collect();
    done.sort_unstable_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Collects what `work` makes of consecutive ranges of the numbers below `count`, of this length, on at most `threads`
/// threads. One thread takes all numbers at once, so entries must depend on their own number alone.
pub fn collect<R: Send>(
    threads: usize,
    count: usize,
    length: usize,
    work: impl Fn(Range<usize>) -> Vec<R> + Sync,
) -> Vec<R> {
    if threads <= 1 || count <= length {
        return work(0..count);
    }
    let ranges = (0..count).step_by(length).map(|first| first..count.min(first + length)).collect();
    let parts = for_each(threads, ranges, work);
    let mut all = Vec::with_capacity(count);
    parts.into_iter().for_each(|part| all.extend(part));
    all
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
                assert_eq!(results, (0..count).map(|item| item * item).collect::<Vec<_>>(), "{threads} threads");
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
        }
    }

    #[test]
    #[should_panic(expected = "item 5")]
    fn a_panic_is_passed_on() {
        for_each(3, (0..9).collect(), |item: usize| assert!(item != 5, "item {item}"));
    }
}
