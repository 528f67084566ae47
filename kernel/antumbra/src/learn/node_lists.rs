//! Lists of nodes, one per ray, packed: they are most of what learning keeps in memory.

use alloc::vec;
use alloc::vec::Vec;

/// Ascending lists of nodes, some of them marked; to be read one after the other.
///
/// For each node there is a number of 16 bits: how many nodes were skipped since the one before it in the list, with
/// the mark in the lowest bit. Depth-first order keeps steps short; a node that is too far away is [`FAR`] and its 32
/// bits. (Numbers of as many bytes as each needs, 1.2 to 1.4, take twice as long to read.)
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NodeLists {
    numbers: Vec<u16>,
    /// Numbers per list.
    lens: Vec<u32>,
}

/// Precedes a node that is written in full, low half first.
const FAR: u16 = u16::MAX;

impl NodeLists {
    /// Set in a node that is marked. Nodes are below it.
    pub const MARK: u32 = 1 << 31;

    /// Adds a list. Returns the bytes of its nodes.
    pub fn push(&mut self, list: &[u32]) -> usize {
        let before = self.numbers.len();
        let mut next = 0;
        for &entry in list {
            let node = entry & !Self::MARK;
            debug_assert!(node >= next, "{node} after {next}");
            match u16::try_from(((node - next) << 1) | (entry >> 31)) {
                Ok(number) if number != FAR => self.numbers.push(number),
                _ => self
                    .numbers
                    .extend([FAR, entry as u16, (entry >> 16) as u16]),
            }
            next = node + 1;
        }
        let numbers = self.numbers.len() - before;
        self.lens.push(numbers as u32);
        size_of::<u16>() * numbers
    }

    /// Bytes of the nodes of all lists.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.numbers[..])
    }

    /// Makes room for all of these lists, and no more.
    pub fn reserve<'a>(&mut self, others: impl Iterator<Item = &'a Self> + Clone) {
        let numbers = others.clone().map(|other| other.numbers.len());
        self.numbers.reserve_exact(numbers.sum());
        self.lens
            .reserve_exact(others.map(|other| other.lens.len()).sum());
    }

    /// Adds all lists of `other`.
    pub fn append(&mut self, other: &Self) {
        self.numbers.extend_from_slice(&other.numbers);
        self.lens.extend_from_slice(&other.lens);
    }

    /// Number of lists.
    pub fn len(&self) -> usize {
        self.lens.len()
    }

    /// Goes through all lists in the order in which they were added.
    pub fn for_each(&self, mut f: impl FnMut(&[u32])) {
        let longest = self.lens.iter().copied().max().unwrap_or(0);
        let mut list = vec![0; longest as usize];
        let mut rest = &self.numbers[..];
        for &len in &self.lens {
            let (mut numbers, others) = rest.split_at(len as usize);
            rest = others;
            let mut next = 0;
            let mut entries = 0;
            // As many places as there are numbers are enough, and what is written in place need not check for room.
            for place in &mut list[..len as usize] {
                let [number, more @ ..] = numbers else { break };
                numbers = more;
                let mut entry = (next + u32::from(number >> 1)) | (u32::from(*number) << 31);
                if *number == FAR
                    && let [low, high, more @ ..] = numbers
                {
                    numbers = more;
                    entry = u32::from(*low) | (u32::from(*high) << 16);
                }
                *place = entry;
                next = (entry & !Self::MARK) + 1;
                entries += 1;
            }
            f(&list[..entries]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ascending nodes, marked or not, with small and large steps and both ends.
    fn list() -> impl Strategy<Value = Vec<u32>> {
        let edge = u32::from(FAR >> 1);
        let node = prop_oneof![
            0..300_u32,
            edge - 3..edge + 3,
            0..NodeLists::MARK,
            Just(NodeLists::MARK - 1)
        ];
        proptest::collection::btree_map(node, any::<bool>(), 0..40).prop_map(|nodes| {
            let marked = |(node, mark)| node | (u32::from(mark) << 31);
            nodes.into_iter().map(marked).collect()
        })
    }

    proptest! {
        #[test]
        fn lists_are_read_as_they_were_added(lists in proptest::collection::vec(list(), 0..20), first in 0..20_usize) {
            let packed = |lists: &[Vec<u32>]| {
                let mut packed = NodeLists::default();
                for list in lists {
                    packed.push(list);
                }
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
    fn a_short_step_takes_two_bytes() {
        let longest = u32::from(FAR >> 1);
        let mut lists = NodeLists::default();
        lists.push(&[0, 1, 2 + longest, (3 + longest) | NodeLists::MARK]);
        assert_eq!(lists.numbers.len(), 4);
        lists.push(&[longest | NodeLists::MARK]);
        assert_eq!(lists.numbers.len(), 7);
        assert_eq!(lists.len(), 2);
    }
}
