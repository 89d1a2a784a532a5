use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Results of several threads, with the numbers of their items.
pub(super) struct Results<R> {
    list: Mutex<Vec<(usize, R)>>,
    /// The number of results, for threads that wait: if they took the lock to look, they would delay the others.
    count: AtomicUsize,
}

impl<R> Default for Results<R> {
    fn default() -> Self {
        Self { list: Mutex::new(Vec::new()), count: AtomicUsize::new(0) }
    }
}

impl<R> Results<R> {
    pub(super) fn add(&self, number: usize, result: R) {
        self.list.lock().expect("no thread panics while it adds a result").push((number, result));
        self.count.fetch_add(1, Ordering::Release);
    }

    pub(super) fn count(&self) -> usize {
        self.count.load(Ordering::Acquire)
    }

    /// Returns the results in the order of their numbers.
    pub(super) fn in_order(self) -> Vec<R> {
        let mut results = self.list.into_inner().expect("no thread panics while it adds a result");
        results.sort_unstable_by_key(|(number, _)| *number);
        results.into_iter().map(|(_, result)| result).collect()
    }
}
