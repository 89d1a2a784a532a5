//! Work on several threads, with results in the order of the items.

use std::cmp::Reverse;
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Applies `work` to each item and returns the results in the order of the items, which does not depend on the number
/// of threads. `None` uses all processors.
///
/// Threads take items from a shared queue, those of the highest `cost` first: no thread waits long for the last item.
///
/// ```
/// let squares = verify::parallel::map(&[1, 2, 3], None, |&x| x, |x| x * x);
/// assert_eq!(squares, [1, 4, 9]);
/// ```
///
/// # Panics
/// If `work` panics.
pub fn map<T: Sync, R: Send>(
    items: &[T],
    threads: Option<NonZero<usize>>,
    cost: impl Fn(&T) -> usize,
    work: impl Fn(&T) -> R + Sync,
) -> Vec<R> {
    let mut queue: Vec<usize> = (0..items.len()).collect();
    queue.sort_by_key(|&number| Reverse(cost(&items[number])));
    let next = AtomicUsize::new(0);
    let run = || {
        let numbers = std::iter::from_fn(|| queue.get(next.fetch_add(1, Ordering::Relaxed)).copied());
        numbers.map(|number| (number, work(&items[number]))).collect::<Vec<(usize, R)>>()
    };
    let threads = threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZero::get);
    let mut results = std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads.min(items.len())).map(|_| scope.spawn(run)).collect();
        let mut results = run();
        for other in others {
            results.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        results
    });
    results.sort_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_keep_their_order_for_any_number_of_threads() {
        let items: Vec<usize> = (0..100).collect();
        for threads in [1, 2, 7, 200] {
            let results = map(&items, NonZero::new(threads), |&item| item % 10, |&item| 2 * item);
            assert_eq!(results, items.iter().map(|item| 2 * item).collect::<Vec<_>>(), "{threads} threads");
        }
        assert_eq!(map(&[0_usize; 0], None, |_| 0, |&item| item), [0; 0]);
    }

    /// With one thread, the order of work is the queue: the item of the highest cost comes first.
    #[test]
    fn the_costliest_item_is_first() {
        let order = std::sync::Mutex::new(Vec::new());
        map(&[1, 3, 2], NonZero::new(1), |&item| item, |&item| order.lock().unwrap().push(item));
        assert_eq!(order.into_inner().unwrap(), [3, 2, 1]);
    }
}
