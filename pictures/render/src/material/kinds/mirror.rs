//! Material `mirror`.

use antumbra_scene::material::Mirror;

use super::{Here, Shade, positive};
use crate::material::bsdf::{Bsdf, Specular};
use crate::texture::Place;

impl Shade for Mirror<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let kr = positive(self.kr);
        Bsdf::black().with_delta(Specular::Mirror { kr })
    }
}
