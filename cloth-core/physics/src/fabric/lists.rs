//! Lists of different lengths.

use energy_solve::index;

/// Lists of different lengths, one after the other in memory: sums over all of them read memory in order.
#[derive(Clone, Debug)]
pub(super) struct Lists<T> {
    items: Vec<T>,
    /// Index of the first item of each list, then the number of items.
    bounds: Vec<u32>,
}

impl<T> Lists<T> {
    /// Returns the number of lists.
    pub fn len(&self) -> usize {
        self.bounds.len() - 1
    }

    #[inline(always)]
    pub fn get(&self, number: usize) -> &[T] {
        &self.items[self.bounds[number] as usize..self.bounds[number + 1] as usize]
    }

    pub fn get_mut(&mut self, number: usize) -> &mut [T] {
        &mut self.items[self.bounds[number] as usize..self.bounds[number + 1] as usize]
    }

    pub fn iter(&self) -> impl Iterator<Item = &[T]> + Clone {
        (0..self.len()).map(|number| self.get(number))
    }

    /// Returns the items of all lists.
    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// Returns the items of all lists.
    pub fn items_mut(&mut self) -> &mut [T] {
        &mut self.items
    }
}

impl<T> Default for Lists<T> {
    fn default() -> Self {
        Self { items: Vec::new(), bounds: vec![0] }
    }
}

impl<T, I: IntoIterator<Item = T>> FromIterator<I> for Lists<T> {
    fn from_iter<L: IntoIterator<Item = I>>(lists: L) -> Self {
        let mut all = Self::default();
        for list in lists {
            all.items.extend(list);
            all.bounds.push(index(all.items.len()));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::Lists;

    #[test]
    fn lists_keep_their_items() {
        let mut lists: Lists<u8> = [vec![1, 2], vec![], vec![3]].into_iter().collect();
        assert_eq!((lists.len(), lists.get(0), lists.get(1), lists.get(2)), (3, &[1, 2][..], &[][..], &[3][..]));
        lists.get_mut(2)[0] = 7;
        assert_eq!(lists.items(), [1, 2, 7]);
        assert_eq!(lists.iter().map(<[u8]>::len).collect::<Vec<_>>(), [2, 0, 1]);
        assert_eq!(Lists::<u8>::default().len(), 0);
    }
}
