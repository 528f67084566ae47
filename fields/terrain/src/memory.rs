//! Lists as long as the caller's lists: an error where there is no memory for them.

use crate::Error;

/// An empty list with room for so many items. `what` names them.
pub fn room<T>(what: &'static str, items: usize) -> Result<Vec<T>, Error> {
    let mut list = Vec::new();
    grow(&mut list, what, items)?;
    Ok(list)
}

/// A list of equal items.
pub fn filled<T: Clone>(what: &'static str, items: usize, value: T) -> Result<Vec<T>, Error> {
    let mut list = room(what, items)?;
    list.resize(items, value);
    Ok(list)
}

/// Makes room for more items of a list.
pub fn grow<T>(list: &mut Vec<T>, what: &'static str, more: usize) -> Result<(), Error> {
    let items = list.len().saturating_add(more);
    let reserved = list.try_reserve(more);
    reserved.map_err(|_| Error::NoMemory {
        what,
        items,
        bytes: size_of::<T>() as u128 * items as u128,
    })
}
