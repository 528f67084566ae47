//! What a world learned, and keeps when its instances move.
//!
//! Nodes of objects and of the ground keep their order by themselves. The top level is built again for every frame, so
//! the world keeps the order of its items: their places among all items when the top level is traversed from its root.

use alloc::vec;
use alloc::vec::Vec;

use super::World;
use crate::api::child_order::{ChildOrder, Ranks};
use crate::api::recipe::Recipe;
use crate::builder::top_level::TopChild;
use crate::ray::Ray;
use crate::tree::node::ChildKind;

impl World {
    /// Learns the child order of everything again, for these rays in the world as it is now: see
    /// [`Bvh::relearn`](crate::Bvh::relearn).
    /// Returns the order for copies of the world.
    ///
    /// The order is kept until the next call. Where instances have moved, the top level keeps it by their places in the
    /// list, and new ones come last.
    pub fn relearn(&mut self, rays: &[Ray], recipe: &Recipe) -> ChildOrder {
        let mut order = self.bvh.relearn_from(self.top_room, rays, recipe);
        if !rays.is_empty() && recipe.order.learns() {
            self.ranks = self.ranks_now();
        }
        order.ranks.clone_from(&self.ranks);
        order
    }

    /// Puts children in the order that a copy of this world [learned](World::relearn). Children in objects and in the
    /// ground move at once, in less than a millisecond for a hundred thousand triangles. Children of the top level move when the instances are
    /// set next. Answers stay.
    ///
    /// Both worlds may have changed since they were copied, as for [`Bvh::adopt`](crate::Bvh::adopt).
    pub fn adopt(&mut self, order: &ChildOrder) {
        self.bvh.adopt_from(self.top_room, order);
        self.ranks.clone_from(&order.ranks);
    }

    /// The places of items in the top level as it is now.
    fn ranks_now(&self) -> Ranks {
        let tree = &self.bvh.tree;
        let mut ranks = Ranks {
            ground: vec![0; self.ground.items.len()],
            instances: vec![0; self.instances.len()],
        };
        let mut subtrees: Vec<_> = (self.ground.items.iter().enumerate())
            .filter_map(|(index, item)| match item.child {
                TopChild::Subtree(child) => Some((child.0, index)),
                TopChild::Instance(_) => None,
            })
            .collect();
        subtrees.sort_unstable();
        let mut rank = 0;
        let mut open = vec![(0, 0)];
        while let Some((node, slot)) = open.pop() {
            if slot == tree.nodes.get(node).len() {
                continue;
            }
            open.push((node, slot + 1));
            let child = tree.nodes.get(node).child(slot);
            let place = match child.kind() {
                ChildKind::Inner(index) if index < self.top_nodes => {
                    open.push((index, 0));
                    continue;
                }
                ChildKind::Instance(index) => {
                    let inst_id = tree.instances[index].placement.inst_id as usize;
                    &mut ranks.instances[inst_id]
                }
                _ => match subtrees.binary_search_by_key(&child.0, |(child, _)| *child) {
                    Ok(found) => &mut ranks.ground[subtrees[found].1],
                    Err(_) => continue,
                },
            };
            *place = rank;
            rank += 1;
        }
        ranks
    }
}
