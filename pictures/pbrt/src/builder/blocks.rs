//! Sections of the file, and blocks that save and restore the graphics state.

use glam::DMat4;

use super::Builder;
use crate::directive::{Directive, Phase};
use crate::report::Report;
use crate::source::Span;
use crate::state::{BlockKind, Transforms};

/// Largest depth of nested blocks. Each open block takes some hundred bytes.
const MAX_BLOCKS: usize = 10_000;

impl Builder<'_> {
    /// Returns true if a directive is allowed in the current section. Otherwise reports it.
    pub(super) fn check_phase(&self, at: Span, directive: &Directive, report: &mut Report) -> bool {
        if self.phase == Phase::Done {
            let feature = "directives after WorldEnd (several pictures in one file) are";
            report.unsupported(at, feature);
            return false;
        }
        if directive.phase().is_none_or(|phase| phase == self.phase) {
            return true;
        }
        let name = String::from_utf8_lossy(report.sources.slice(at)).into_owned();
        match (directive, self.phase) {
            (Directive::WorldBegin(), _) => report.error(at, "WorldBegin within a world block"),
            (Directive::WorldEnd(), _) => report.error(at, "WorldEnd without WorldBegin"),
            (_, Phase::Options) => {
                let message = format!("{name} belongs between WorldBegin and WorldEnd");
                report.error_once(at, message, None);
            }
            _ => report.error_once(at, format!("{name} belongs before WorldBegin"), None),
        }
        false
    }

    pub(super) fn world_begin(&mut self) {
        self.phase = Phase::World;
        *self.transforms() = Transforms::default();
        self.coordinate_systems
            .insert("world".into(), [DMat4::IDENTITY; 2]);
    }

    pub(super) fn world_end(&mut self, report: &mut Report) {
        self.report_open_blocks(report);
        self.phase = Phase::Done;
        if !self.is_version4 {
            // As in pbrt-v3, where the camera is made when the world ends.
            self.camera.medium = self.medium(1, report);
        }
    }

    pub(super) fn report_open_blocks(&mut self, report: &mut Report) {
        for block in self.state.blocks() {
            let [begin, end] = block.kind.names();
            let message = format!("the {begin} has no {end} before the world ends");
            report.error(block.begun_at, message);
        }
        while !self.state.blocks().is_empty() {
            self.state.pop();
        }
    }

    pub(super) fn begin_block(&mut self, kind: BlockKind, at: Span, report: &mut Report) {
        if self.state.blocks().len() == MAX_BLOCKS {
            self.refused_blocks += 1;
            let message = format!("blocks are nested more than {MAX_BLOCKS} deep");
            report.error_once(at, message, None);
            return;
        }
        self.state.push(kind, at);
    }

    /// Ends a block. Inner blocks that are still open are reported and ended too.
    pub(super) fn end_block(&mut self, kind: BlockKind, at: Span, report: &mut Report) {
        if self.refused_blocks > 0 {
            self.refused_blocks -= 1;
            return;
        }
        let [begin, end] = kind.names();
        let blocks = self.state.blocks();
        let Some(depth) = blocks.iter().rposition(|block| block.kind == kind) else {
            report.error(at, format!("{end} without {begin}"));
            return;
        };
        for block in &blocks[depth + 1..] {
            let [inner_begin, inner_end] = block.kind.names();
            let message = format!(
                "{end} comes before the {inner_end} of the {inner_begin} in line {}",
                block.begun_at.line
            );
            report.error_help(at, message, format!("add {inner_end} before it"));
        }
        while self.state.blocks().len() > depth {
            self.state.pop();
        }
        report.color_space = self.state.now.color_space;
    }
}
