//! Textures, whose images are read together.

use antumbra_image::Allowance;

use super::Builder;
use crate::directive::Quoted;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::texture::{self, TextureSpace};

impl Builder<'_> {
    pub(super) fn texture_space(&self) -> TextureSpace {
        TextureSpace {
            world_from_texture: self.state.now.transforms.start,
            origin: self.options.origin,
        }
    }

    pub(super) fn texture(
        &mut self,
        at: Span,
        [name, value_type, class]: [Quoted; 3],
        params: Params,
        report: &mut Report,
    ) {
        if self.transforms().is_animated() {
            let message = "textures do not move: the transformation at the start is taken";
            report.note(at, message);
        }
        self.pending_textures.push(texture::Declaration {
            at,
            name,
            value_type,
            class,
            params,
            space: self.texture_space(),
        });
    }

    /// Memory that images may take.
    pub(super) fn allowance(&self, report: &Report) -> Allowance {
        Allowance::new(self.budget.left(report))
    }

    /// Defines the pending textures, after reading all their images together.
    pub(super) fn define_textures(&mut self, report: &mut Report) {
        let pending = std::mem::take(&mut self.pending_textures);
        let names: Vec<&str> = pending.iter().filter_map(|t| t.image_name()).collect();
        if !names.is_empty() {
            let allowance = self.allowance(report);
            self.images
                .read_ahead(&report.sources.folder, &names, &allowance);
        }
        for declaration in pending {
            let at = declaration.at;
            self.images.allowed = self.budget.left(report);
            texture::define(&mut self.state, declaration, &mut self.images, report);
            self.budget.take(self.images.newly_used(), at, report);
        }
    }
}
