//! Lists that grow with a file: where the system refuses memory, loading ends in an error, not in an abort.

/// The system refused this much memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NoMemory {
    pub(crate) bytes: u64,
}

/// An empty list with room for `count` items.
pub(crate) fn list<T>(count: usize) -> Result<Vec<T>, NoMemory> {
    let mut list = Vec::new();
    list.try_reserve_exact(count).map_err(|_| NoMemory { bytes: bytes_of::<T>(count) })?;
    Ok(list)
}

/// Makes sure that messages, names and other small things still have room, which are not asked for one by one: asks for
/// a megabyte and gives it back.
pub(crate) fn spare() -> Result<(), NoMemory> {
    list::<u8>(1 << 20).map(drop)
}

/// Adds an item.
#[inline]
pub(crate) fn push<T>(list: &mut Vec<T>, item: T) -> Result<(), NoMemory> {
    if list.len() == list.capacity() {
        grow(list, 1)?;
    }
    list.push(item);
    Ok(())
}

/// Makes room for `more` items: twice the room there was where that can be had, else an eighth more.
pub(crate) fn grow<T>(list: &mut Vec<T>, more: usize) -> Result<(), NoMemory> {
    let least = more.max(list.len() / 8);
    let refused = NoMemory { bytes: bytes_of::<T>(list.len().saturating_add(least)) };
    list.try_reserve(more).or_else(|_| list.try_reserve_exact(least)).map_err(|_| refused)
}

const fn bytes_of<T>(count: usize) -> u64 {
    (count as u64).saturating_mul(size_of::<T>() as u64)
}
