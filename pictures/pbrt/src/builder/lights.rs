//! Lights without a surface, which are measured from the origin of the scene.

use antumbra_scene::Light;

use super::Builder;
use crate::directive::Quoted;
use crate::light;
use crate::lookup::read;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::state::Transforms;

impl Builder<'_> {
    pub(super) fn light(&mut self, at: Span, kind: &Quoted, params: &Params, report: &mut Report) {
        let mut transforms = self.state.now.transforms;
        let Transforms { start, end, .. } = transforms;
        transforms.set([start, end].map(|matrix| self.to_origin(matrix)));
        self.images.allowed = self.budget.left(report);
        let images = &mut self.images;
        let light = read("light", at, (kind, params), report, |lookup| {
            light::read(lookup, &transforms, images)
        });
        let bytes = size_of::<Light>() as u64 + self.images.newly_used();
        if self.budget.take(bytes, at, report) {
            self.lights.extend(light);
        }
    }
}
