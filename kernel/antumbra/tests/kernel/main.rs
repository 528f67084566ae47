//! Tests of the kernel through its public interface.
//!
//! - [`oracle`]: every tree, order and level against brute force, on every kind of geometry
//! - [`watertight`]: closed meshes do not leak
//! - [`orders`]: what orders do to costs, logs, errors
//! - [`learning`]: trees learned from logs: the same answers, lower costs, no harm to other rays
//! - [`build`]: trees are valid, complete and deterministic
//! - [`cutouts`]: partly transparent triangles: what counts as a hit, and that every tree agrees
//! - [`filters`]: what their filters are asked: no more than is needed
//! - [`far_away`]: meshes in double precision
//! - [`queries`]: single rays on a shared tree, normals, closed intervals, columns, sorted batches, pools
//! - [`visits`]: all hits of a ray, and queries that leave out a primitive
//! - [`conditions`]: masks, and functions that decide about hits
//! - [`quads`]: quads against the triangles that they are
//! - [`curves`]: thin curves: segments, joints, cubics
//! - [`disks`]: disks, sound and not
//! - [`user`]: user geometry, sound and not
//! - [`saved`]: trees, objects and worlds in files
//! - [`dropped`]: what was dropped is named; trees know their primitives
//! - [`beyond`]: learning while running, small leaves
//! - [`batches`]: batches of every length, on one thread and several
//! - [`groups`]: rays of many points in the same directions
//! - [`origin_offset`]: rays that leave a surface visit nothing of it
//! - [`instances`]: scenes on two levels: every tree against brute force
//! - [`instances_learning`]: the same: costs, logs, surface rays
//! - [`known_answers`]: check sums of answers that never change
//! - [`small`]: a little of everything, for an interpreter
//! - [`world`]: objects that are built once and move;  [`refit`]: vertices that move
//! - [`points`]: what is near a point, and what is around it;  [`precise`]: hits on long walls
//! - [`moving`]: scenes that move while rays are traced
//! - [`monitor`]: builds that are watched, and stopped
//! - [`support`], [`transforms`]: what these share

mod batches;
mod beyond;
mod build;
mod conditions;
mod curves;
mod cutouts;
mod disks;
mod dropped;
mod far_away;
mod filters;
mod groups;
mod instances;
mod instances_learning;
mod known_answers;
mod learning;
mod monitor;
mod moving;
mod oracle;
mod orders;
mod origin_offset;
mod points;
mod precise;
mod quads;
mod queries;
mod refit;
mod saved;
mod small;
mod support;
mod transforms;
mod user;
mod visits;
mod watertight;
mod world;
