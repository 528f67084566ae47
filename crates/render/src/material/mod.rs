//! Materials ready for shading. Those whose parameters are the same everywhere are lowered once; the others
//! become a [`Bsdf`] at every point.

pub mod bsdf;
mod patch;

use antumbra::{Hit, Ray};
use antumbra_scene::{Param, Rgb};
use glam::Vec3;

use crate::surface::{Frame, Shapes, Surface};
use crate::texture::{Input, Place, Textures};
use bsdf::{
    Blend, Bsdf, Diffuse, Fresnel, GlossyReflection, GlossyTransmission, Lobe, Specular,
    TrowbridgeReitz,
};
pub use patch::Patch;

/// What has to be done to shade a point of a material.
#[derive(Clone, Debug)]
pub enum Material {
    /// Nothing: there is no surface.
    None,
    /// Its [`Bsdf`] is the same everywhere.
    Constant(Bsdf),
    /// Its [`Bsdf`] has to be made.
    Varying(Box<Varying>),
}

/// A material that depends on the place.
#[derive(Clone, Debug)]
pub struct Varying {
    recipe: Recipe,
    /// Bumps, as a height above the surface.
    height: Option<Input<f32>>,
}

/// A material of the scene, see [`antumbra_scene::Material`], with its parameters ready to be asked.
#[derive(Clone, Debug)]
enum Recipe {
    Black,
    Matte {
        kd: Input<Rgb>,
        sigma: Input<f32>,
    },
    Plastic {
        kd: Input<Rgb>,
        ks: Input<Rgb>,
        roughness: Roughness,
    },
    Mirror {
        kr: Input<Rgb>,
    },
    Glass {
        kr: Input<Rgb>,
        kt: Input<Rgb>,
        eta: Input<f32>,
        roughness: Roughness,
    },
    Metal {
        eta: Input<Rgb>,
        k: Input<Rgb>,
        roughness: Roughness,
    },
    Uber {
        kd: Input<Rgb>,
        ks: Input<Rgb>,
        kr: Input<Rgb>,
        kt: Input<Rgb>,
        opacity: Input<Rgb>,
        eta: Input<f32>,
        roughness: Roughness,
    },
    Substrate {
        kd: Input<Rgb>,
        ks: Input<Rgb>,
        roughness: Roughness,
    },
    Translucent {
        kd: Input<Rgb>,
        ks: Input<Rgb>,
        reflect: Input<Rgb>,
        transmit: Input<Rgb>,
        roughness: Roughness,
    },
    Mix {
        recipes: Box<[Recipe; 2]>,
        amount: Input<Rgb>,
    },
}

/// Roughness along u and v, and whether it is mapped to that of microfacets.
#[derive(Clone, Debug)]
struct Roughness {
    along: [Input<f32>; 2],
    remap: bool,
}

impl Roughness {
    fn values(&self, place: &Place) -> [f32; 2] {
        let [u, v] = &self.along;
        [u.at(place), v.at(place)]
    }

    fn facets(&self, place: &Place) -> TrowbridgeReitz {
        TrowbridgeReitz::new(self.values(place), self.remap)
    }
}

impl Material {
    /// Lowers a material of the scene.
    pub fn new(material: &antumbra_scene::Material, textures: &mut Textures) -> Self {
        if let antumbra_scene::Material::None = material {
            return Self::None;
        }
        let mut lowering = Lowering {
            textures,
            varies: false,
        };
        let recipe = lowering.recipe(material);
        let height = bumps(material).map(|height| lowering.textures.input(height));
        // A height that is the same everywhere moves the surface and tilts nothing.
        let height = height.filter(|height| matches!(height, Input::Texture(_)));
        if lowering.varies || height.is_some() {
            Self::Varying(Box::new(Varying { recipe, height }))
        } else {
            Self::Constant(recipe.bsdf(&Place::default()))
        }
    }
}

/// The height whose bumps a material has: as in pbrt-v3, those of the first of two that are mixed.
fn bumps(material: &antumbra_scene::Material) -> Option<&Param<f32>> {
    match material {
        antumbra_scene::Material::Bumped { height, .. } => Some(height),
        antumbra_scene::Material::Mix { materials, .. } => bumps(&materials[0]),
        _ => None,
    }
}

/// Lowers parameters, remembering whether all of them were constant.
struct Lowering<'a> {
    textures: &'a mut Textures,
    varies: bool,
}

impl Lowering<'_> {
    fn input<T: crate::texture::Value>(&mut self, param: &Param<T>) -> Input<T> {
        self.varies |= param.constant().is_none();
        self.textures.input(param)
    }

    fn roughness(&mut self, [u, v]: [&Param<f32>; 2], remap: bool) -> Roughness {
        Roughness {
            along: [self.input(u), self.input(v)],
            remap,
        }
    }

    fn recipe(&mut self, material: &antumbra_scene::Material) -> Recipe {
        use antumbra_scene::Material as Scene;
        match material {
            Scene::None => Recipe::Black,
            Scene::Matte { kd, sigma } => Recipe::Matte {
                kd: self.input(kd),
                sigma: self.input(sigma),
            },
            Scene::Plastic {
                kd,
                ks,
                roughness,
                remap_roughness,
            } => Recipe::Plastic {
                kd: self.input(kd),
                ks: self.input(ks),
                roughness: self.roughness([roughness; 2], *remap_roughness),
            },
            Scene::Mirror { kr } => Recipe::Mirror { kr: self.input(kr) },
            Scene::Glass {
                kr,
                kt,
                eta,
                roughness,
                remap_roughness,
            } => Recipe::Glass {
                kr: self.input(kr),
                kt: self.input(kt),
                eta: self.input(eta),
                roughness: self.roughness(roughness.each_ref(), *remap_roughness),
            },
            Scene::Metal {
                eta,
                k,
                roughness,
                remap_roughness,
            } => Recipe::Metal {
                eta: self.input(eta),
                k: self.input(k),
                roughness: self.roughness(roughness.each_ref(), *remap_roughness),
            },
            Scene::Uber {
                kd,
                ks,
                kr,
                kt,
                roughness,
                opacity,
                eta,
                remap_roughness,
            } => Recipe::Uber {
                kd: self.input(kd),
                ks: self.input(ks),
                kr: self.input(kr),
                kt: self.input(kt),
                opacity: self.input(opacity),
                eta: self.input(eta),
                roughness: self.roughness(roughness.each_ref(), *remap_roughness),
            },
            Scene::Substrate {
                kd,
                ks,
                roughness,
                remap_roughness,
            } => Recipe::Substrate {
                kd: self.input(kd),
                ks: self.input(ks),
                roughness: self.roughness(roughness.each_ref(), *remap_roughness),
            },
            Scene::Translucent {
                kd,
                ks,
                reflect,
                transmit,
                roughness,
                remap_roughness,
            } => Recipe::Translucent {
                kd: self.input(kd),
                ks: self.input(ks),
                reflect: self.input(reflect),
                transmit: self.input(transmit),
                roughness: self.roughness([roughness; 2], *remap_roughness),
            },
            Scene::Mix { materials, amount } => Recipe::Mix {
                recipes: Box::new([self.recipe(&materials[0]), self.recipe(&materials[1])]),
                amount: self.input(amount),
            },
            Scene::Bumped { material, .. } => self.recipe(material),
        }
    }
}

impl Recipe {
    /// How a place scatters light. Negative colours count as 0, as in pbrt.
    fn bsdf(&self, place: &Place) -> Bsdf {
        let color = |input: &Input<Rgb>| input.at(place).max(Vec3::ZERO);
        match self {
            Self::Black => Bsdf::Black,
            Self::Matte { kd, sigma } => Bsdf::diffuse(Diffuse::new(color(kd), sigma.at(place))),
            Self::Plastic { kd, ks, roughness } => {
                // Index 1.5 on the side of the normal: the coat seen from inside, as pbrt has it.
                let fresnel = Fresnel::Dielectric(1.0 / 1.5);
                let coat = GlossyReflection::new(color(ks), roughness.facets(place), fresnel);
                Bsdf::plastic(Diffuse::new(color(kd), 0.0), coat)
            }
            Self::Mirror { kr } => Bsdf::specular(Specular::Mirror { kr: color(kr) }),
            Self::Glass {
                kr,
                kt,
                eta,
                roughness,
            } => {
                let (kr, kt, eta) = (color(kr), color(kt), eta.at(place));
                if roughness.values(place) == [0.0, 0.0] {
                    return Bsdf::specular(Specular::Glass { kr, kt, eta });
                }
                let facets = roughness.facets(place);
                Bsdf::rough_glass(
                    GlossyReflection::new(kr, facets, Fresnel::Dielectric(eta)),
                    GlossyTransmission::new(kt, facets, eta),
                )
            }
            Self::Metal { eta, k, roughness } => {
                let fresnel = Fresnel::Conductor {
                    eta: eta.at(place),
                    k: k.at(place),
                };
                let facets = roughness.facets(place);
                Bsdf::Glossy(GlossyReflection::new(Vec3::ONE, facets, fresnel))
            }
            Self::Uber {
                kd,
                ks,
                kr,
                kt,
                opacity,
                eta,
                roughness,
            } => {
                let (opacity, eta) = (color(opacity), eta.at(place));
                let facets = roughness.facets(place);
                let coat = color(ks) * opacity;
                Bsdf::lobes(vec![
                    Lobe::Diffuse(Diffuse::new(color(kd) * opacity, 0.0)),
                    Lobe::Glossy(GlossyReflection::new(
                        coat,
                        facets,
                        Fresnel::Dielectric(eta),
                    )),
                    Lobe::Specular(Specular::Glass {
                        kr: color(kr) * opacity,
                        kt: color(kt) * opacity,
                        eta,
                    }),
                    Lobe::Specular(Specular::Through {
                        share: (Vec3::ONE - opacity).max(Vec3::ZERO),
                    }),
                ])
            }
            Self::Substrate { kd, ks, roughness } => {
                let (kd, ks) = (color(kd), color(ks));
                if kd == Vec3::ZERO && ks == Vec3::ZERO {
                    return Bsdf::Black;
                }
                let blend = Blend::new(kd, ks, roughness.facets(place));
                Bsdf::lobes(vec![Lobe::Blend(blend)])
            }
            Self::Translucent {
                kd,
                ks,
                reflect,
                transmit,
                roughness,
            } => {
                let (kd, ks) = (color(kd), color(ks));
                let (reflect, transmit) = (color(reflect), color(transmit));
                let (facets, eta) = (roughness.facets(place), 1.5);
                Bsdf::lobes(vec![
                    Lobe::Diffuse(Diffuse::new(kd * reflect, 0.0)),
                    Lobe::DiffuseTransmission(kd * transmit),
                    Lobe::Glossy(GlossyReflection::new(
                        ks * reflect,
                        facets,
                        Fresnel::Dielectric(eta),
                    )),
                    Lobe::GlossyTransmission(GlossyTransmission::new(ks * transmit, facets, eta)),
                ])
            }
            Self::Mix { recipes, amount } => {
                let first = color(amount);
                let shares = [first, (Vec3::ONE - first).max(Vec3::ZERO)];
                let mut lobes = Vec::new();
                for (recipe, share) in recipes.iter().zip(shares) {
                    let scaled = recipe.bsdf(place).into_lobes().into_iter();
                    lobes.extend(scaled.map(|lobe| lobe.scaled(share)));
                }
                Bsdf::lobes(lobes)
            }
        }
    }
}

impl Varying {
    /// How the surface scatters light where it was hit, and the frame in which it does so. `neighbours` as for
    /// [`Patch::at`].
    pub fn shade(
        &self,
        shapes: &Shapes,
        surface: &Surface,
        hit: &Hit,
        neighbours: Option<&[Ray; 2]>,
    ) -> (Bsdf, Frame) {
        let patch = Patch::at(shapes, surface, hit, neighbours);
        let bsdf = self.recipe.bsdf(&patch.place);
        let frame = match &self.height {
            Some(height) => {
                let [u, v] = bumped(surface, &patch, height);
                let normal = u.cross(v).try_normalize().unwrap_or(surface.shading_normal);
                // On the side of the geometric normal, which bumps do not tilt.
                let turned = normal.dot(surface.normal) < 0.0;
                Frame::along(if turned { -normal } else { normal }, u)
            }
            None if bsdf.is_anisotropic() => {
                Frame::along(surface.shading_normal, patch.tangents[0])
            }
            None => Frame::around(surface.shading_normal),
        };
        (bsdf, frame)
    }
}

/// Tangents of the surface displaced along its normal, by differences of the height half a sample further, or a
/// little further where samples are not known (Blinn 1978; constants as in pbrt-v3).
fn bumped(surface: &Surface, patch: &Patch, height: &Input<f32>) -> [Vec3; 2] {
    const LITTLE: f32 = 0.0005;
    let place = &patch.place;
    let here = height.at(place);
    let reach = 0.5 * (place.uv_steps[0].abs() + place.uv_steps[1].abs());
    [0, 1].map(|axis| {
        let reach = if reach[axis] == 0.0 {
            LITTLE
        } else {
            reach[axis]
        };
        let tangent = patch.bump_tangents[axis];
        let mut there = *place;
        there.point += tangent * reach;
        there.uv[axis] += reach;
        let slope = (height.at(&there) - here) / reach;
        tangent + surface.shading_normal * slope + patch.normal_changes[axis] * here
    })
}

#[cfg(test)]
mod tests;
