use std::sync::Mutex;

/// Results of several threads, with the numbers of what they belong to.
pub(super) struct Results<R>(Mutex<Vec<(usize, R)>>);

impl<R> Default for Results<R> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<R> Results<R> {
    pub(super) fn add(&self, number: usize, result: R) {
        self.0.lock().expect("no thread panics while it adds a result").push((number, result));
    }

    pub(super) fn count(&self) -> usize {
        self.0.lock().expect("no thread panics while it adds a result").len()
    }

    /// Returns the results in the order of their numbers.
    pub(super) fn in_order(self) -> Vec<R> {
        let mut results = self.0.into_inner().expect("no thread panics while it adds a result");
        results.sort_unstable_by_key(|(number, _)| *number);
        results.into_iter().map(|(_, result)| result).collect()
    }
}
