/// A fixed-length array of generic length: `[Item; N]` for every `N`.
pub trait Array<Item>: Copy + AsRef<[Item]> + AsMut<[Item]> {
    /// Number of items.
    const LEN: usize;

    /// Creates the array whose `i`-th item is `item(i)`.
    fn from_fn(item: impl FnMut(usize) -> Item) -> Self;

    /// Creates an array of equal items.
    fn repeat(item: Item) -> Self;
}

impl<Item: Copy, const N: usize> Array<Item> for [Item; N] {
    const LEN: usize = N;

    fn from_fn(item: impl FnMut(usize) -> Item) -> Self {
        std::array::from_fn(item)
    }

    #[inline(always)]
    fn repeat(item: Item) -> Self {
        [item; N]
    }
}
