//! Flags of bakes that are done in chunks.

use antumbra_render::Shard;
use clap::Args;

use super::{MachineArgs, heading};

/// Flags about unfinished work and shares of it, and about the machine that does it.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::CHECKPOINTS)]
pub struct ChunkArgs {
    /// Forget what an interrupted run has done
    ///
    /// Otherwise the same command goes on from OUT.checkpoint, which is written every 20 seconds and when the command is
    /// interrupted, and is removed at the end.
    #[arg(long)]
    pub restart: bool,
    /// Do one of N shares of the work, to a .part
    ///
    /// I runs from 0 to N - 1. `merge` joins the parts; run it where the mesh can be read under the same name.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    #[command(flatten)]
    pub machine: MachineArgs,
}
