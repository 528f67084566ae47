//! Lists of nodes, one per ray, packed: they are most of what learning keeps in memory.

/// Ascending lists of nodes, some of them marked; to be read one after the other.
///
/// A list is its length and then, for each node, how many nodes were skipped since the one before it, with the mark in the
/// lowest bit. Numbers are written seven bits at a time, the lowest first, the eighth telling that more follow (LEB128).
/// Depth-first order keeps steps short, so a node takes 1.1 to 1.4 bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NodeLists {
    bytes: Vec<u8>,
}

impl NodeLists {
    /// Set in a node that is marked. Nodes are below it.
    pub const MARK: u32 = 1 << 31;

    /// Adds a list.
    pub fn push(&mut self, list: &[u32]) {
        self.write(list.len() as u32);
        let mut next = 0;
        for &entry in list {
            let node = entry & !Self::MARK;
            debug_assert!(node >= next, "{node} after {next}");
            self.write((node - next) << 1 | entry >> 31);
            next = node + 1;
        }
    }

    /// Adds all lists of `other`.
    pub fn append(&mut self, other: &Self) {
        self.bytes.extend_from_slice(&other.bytes);
    }

    /// Goes through all lists in the order in which they were added.
    pub fn for_each(&self, mut f: impl FnMut(&[u32])) {
        let mut bytes = &self.bytes[..];
        let mut list = Vec::new();
        while !bytes.is_empty() {
            list.clear();
            let len = read(&mut bytes);
            let mut next = 0;
            for _ in 0..len {
                let number = read(&mut bytes);
                let node = next + (number >> 1);
                list.push(node | number << 31);
                next = node + 1;
            }
            f(&list);
        }
    }

    fn write(&mut self, mut number: u32) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
    }
}

/// Takes a number off the front; 0 of nothing.
#[inline(always)]
fn read(bytes: &mut &[u8]) -> u32 {
    let mut number = 0;
    let mut shift = 0;
    while let [byte, rest @ ..] = *bytes {
        *bytes = rest;
        number |= u32::from(byte & 0x7f) << shift;
        shift += 7;
        if *byte < 0x80 {
            break;
        }
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ascending nodes, marked or not, with small and large steps and both ends.
    fn list() -> impl Strategy<Value = Vec<u32>> {
        let node = prop_oneof![0..300_u32, 0..NodeLists::MARK, Just(NodeLists::MARK - 1)];
        proptest::collection::btree_map(node, any::<bool>(), 0..40).prop_map(|nodes| {
            let marked = |(node, mark)| node | u32::from(mark) << 31;
            nodes.into_iter().map(marked).collect()
        })
    }

    proptest! {
        #[test]
        fn lists_are_read_as_they_were_added(lists in proptest::collection::vec(list(), 0..20), first in 0..20_usize) {
            let packed = |lists: &[Vec<u32>]| {
                let mut packed = NodeLists::default();
                lists.iter().for_each(|list| packed.push(list));
                packed
            };
            let (head, tail) = lists.split_at(first.min(lists.len()));
            let mut joined = packed(head);
            joined.append(&packed(tail));
            prop_assert_eq!(&joined, &packed(&lists));
            let mut read = Vec::new();
            joined.for_each(|list| read.push(list.to_vec()));
            prop_assert_eq!(read, lists);
        }
    }

    #[test]
    fn a_step_within_64_nodes_takes_a_byte() {
        let mut lists = NodeLists::default();
        lists.push(&[0, 1, 65, 66 | NodeLists::MARK]);
        assert_eq!(lists.bytes.len(), 5);
    }
}
