//! Parameters of a material: lowered once, and turned into a [`Bsdf`] where they are evaluated.

use std::sync::Arc;

use antumbra_scene::{FourierTable, Param, Rgb};
use glam::Vec3;

use super::bsdf::{
    Blend, Bsdf, Diffuse, Fourier, Fresnel, GlossyReflection, GlossyTransmission, Hair, Interface,
    Lobe, Metallic, MetallicParameters, Specular, Subsurface, TrowbridgeReitz, absorption_of_color,
    absorption_of_melanin, albedo_of,
};
use super::disney::Disney;
use crate::medium::Coefficients;
use crate::texture::{Input, Place, Textures, Value};

/// Lowered parameters of an [`antumbra_scene::Material`].
#[derive(Clone, Debug)]
pub enum Parameters {
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
    Metallic {
        color: Input<Rgb>,
        metallic: Input<f32>,
        roughness: Input<f32>,
        coat: Input<Rgb>,
        transparent: Input<f32>,
    },
    Disney(Box<Disney>),
    CoatedDiffuse {
        reflectance: Input<Rgb>,
        eta: Input<f32>,
        roughness: Input<f32>,
    },
    CoatedConductor {
        eta: Input<Rgb>,
        k: Input<Rgb>,
        roughness: Roughness,
        coat_eta: Input<f32>,
        coat_roughness: Roughness,
    },
    ThinDielectric {
        eta: Input<f32>,
    },
    Subsurface {
        kr: Input<Rgb>,
        kt: Input<Rgb>,
        eta: f32,
        roughness: Roughness,
        interior: Interior,
        asymmetry: f32,
    },
    Hair {
        pigment: Pigment,
        eta: Input<f32>,
        roughness: [Input<f32>; 2],
        tilt: Input<f32>,
    },
    Fourier(Arc<FourierTable>),
    Mix {
        parameterss: Box<[Parameters; 2]>,
        amount: Input<Rgb>,
    },
}

/// Absorption inside of hair.
#[derive(Clone, Debug)]
pub enum Pigment {
    Absorption(Input<Rgb>),
    Color(Input<Rgb>),
    Melanin([Input<f32>; 2]),
}

/// Inside of a body.
#[derive(Clone, Debug)]
pub enum Interior {
    /// Absorption and scattering, and the factor of both.
    Coefficients([Input<Rgb>; 2], f32),
    /// Diffuse reflectance and mean free path, and the factor of the second.
    Diffuse([Input<Rgb>; 2], f32),
}

impl Interior {
    fn coefficients(&self, place: &Place, eta: f32, asymmetry: f32) -> Coefficients {
        /// Shortest mean free path. Zero would let no light travel.
        const SHORTEST: Vec3 = Vec3::splat(1e-8);
        match self {
            Self::Coefficients(inputs, scale) => {
                let [a, s] = inputs
                    .each_ref()
                    .map(|input| input.at(place).max(Vec3::ZERO));
                Coefficients::new(a * scale, s * scale)
            }
            Self::Diffuse([reflectance, path], scale) => {
                let albedo = albedo_of(reflectance.at(place), eta, asymmetry);
                let attenuation = (path.at(place) * scale).max(SHORTEST).recip();
                let scattering = attenuation * albedo;
                Coefficients::new(attenuation - scattering, scattering)
            }
        }
    }
}

/// Roughness along u and v, and whether to map it to the alpha of microfacets.
#[derive(Clone, Debug)]
pub struct Roughness {
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

/// Lowers parameters, and remembers whether one of them varies.
pub struct Lowering<'a> {
    pub textures: &'a mut Textures,
    /// Whether a parameter so far varies.
    pub varies: bool,
}

impl Lowering<'_> {
    /// Lowers one parameter.
    pub fn input<T: Value>(&mut self, param: &Param<T>) -> Input<T> {
        self.varies |= param.constant().is_none();
        self.textures.input(param)
    }

    fn roughness(&mut self, [u, v]: [&Param<f32>; 2], remap: bool) -> Roughness {
        Roughness {
            along: [self.input(u), self.input(v)],
            remap,
        }
    }

    /// Lowers the parameters of a material.
    pub fn parameters(&mut self, material: &antumbra_scene::Material) -> Parameters {
        use antumbra_scene::Material as Scene;
        match material {
            Scene::None => Parameters::Black,
            Scene::Matte { kd, sigma } => Parameters::Matte {
                kd: self.input(kd),
                sigma: self.input(sigma),
            },
            Scene::Plastic {
                kd,
                ks,
                roughness,
                remap_roughness,
            } => Parameters::Plastic {
                kd: self.input(kd),
                ks: self.input(ks),
                roughness: self.roughness([roughness; 2], *remap_roughness),
            },
            Scene::Mirror { kr } => Parameters::Mirror { kr: self.input(kr) },
            Scene::Glass {
                kr,
                kt,
                eta,
                roughness,
                remap_roughness,
            } => Parameters::Glass {
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
            } => Parameters::Metal {
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
            } => Parameters::Uber {
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
            } => Parameters::Substrate {
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
            } => Parameters::Translucent {
                kd: self.input(kd),
                ks: self.input(ks),
                reflect: self.input(reflect),
                transmit: self.input(transmit),
                roughness: self.roughness([roughness; 2], *remap_roughness),
            },
            Scene::CoatedDiffuse {
                reflectance,
                eta,
                roughness,
            } => Parameters::CoatedDiffuse {
                reflectance: self.input(reflectance),
                eta: self.input(eta),
                roughness: self.input(roughness),
            },
            Scene::CoatedConductor {
                eta,
                k,
                roughness,
                coat_eta,
                coat_roughness,
            } => Parameters::CoatedConductor {
                eta: self.input(eta),
                k: self.input(k),
                roughness: self.roughness(roughness.each_ref(), false),
                coat_eta: self.input(coat_eta),
                coat_roughness: self.roughness(coat_roughness.each_ref(), false),
            },
            Scene::Disney(disney) => Parameters::Disney(Box::new(Disney::new(disney, self))),
            Scene::ThinDielectric { eta } => Parameters::ThinDielectric {
                eta: self.input(eta),
            },
            Scene::Subsurface {
                kr,
                kt,
                eta,
                roughness: [u, v],
                remap_roughness,
                interior,
                asymmetry,
            } => Parameters::Subsurface {
                kr: self.input(kr),
                kt: self.input(kt),
                eta: *eta,
                roughness: self.roughness([u, v], *remap_roughness),
                interior: match interior {
                    antumbra_scene::Interior::Coefficients {
                        absorption,
                        scattering,
                        scale,
                    } => Interior::Coefficients(
                        [absorption, scattering].map(|p| self.input(p)),
                        *scale,
                    ),
                    antumbra_scene::Interior::Diffuse {
                        reflectance,
                        mean_free_path,
                        scale,
                    } => Interior::Diffuse(
                        [reflectance, mean_free_path].map(|p| self.input(p)),
                        *scale,
                    ),
                },
                asymmetry: *asymmetry,
            },
            Scene::Hair {
                pigment,
                eta,
                roughness,
                tilt,
            } => {
                // By the texture coordinate across the hair.
                self.varies = true;
                Parameters::Hair {
                    pigment: match pigment {
                        antumbra_scene::Pigment::Absorption(color) => {
                            Pigment::Absorption(self.input(color))
                        }
                        antumbra_scene::Pigment::Color(color) => Pigment::Color(self.input(color)),
                        antumbra_scene::Pigment::Melanin(melanin) => {
                            Pigment::Melanin(melanin.each_ref().map(|value| self.input(value)))
                        }
                    },
                    eta: self.input(eta),
                    roughness: roughness.each_ref().map(|value| self.input(value)),
                    tilt: self.input(tilt),
                }
            }
            Scene::Fourier(table) => Parameters::Fourier(Arc::clone(table)),
            Scene::Mix { materials, amount } => Parameters::Mix {
                parameterss: Box::new([
                    self.parameters(&materials[0]),
                    self.parameters(&materials[1]),
                ]),
                amount: self.input(amount),
            },
            Scene::Metallic {
                color,
                metallic,
                roughness,
                coat,
                transmission,
            } => Parameters::Metallic {
                color: self.input(color),
                metallic: self.input(metallic),
                roughness: self.input(roughness),
                coat: self.input(coat),
                transparent: self.input(transmission),
            },
            Scene::Bumped { material, .. } | Scene::NormalMapped { material, .. } => {
                self.parameters(material)
            }
        }
    }
}

impl Parameters {
    /// BSDF at a place. Negative colours count as 0, as in pbrt.
    pub fn bsdf(&self, place: &Place) -> Bsdf {
        let color = |input: &Input<Rgb>| input.at(place).max(Vec3::ZERO);
        match self {
            Self::Black => Bsdf::Black,
            Self::Matte { kd, sigma } => Bsdf::diffuse(Diffuse::new(color(kd), sigma.at(place))),
            Self::Plastic { kd, ks, roughness } => {
                // Index 1.5 on the side of the normal: the coat is seen from inside, as in pbrt.
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
            Self::Metallic {
                color: base,
                metallic,
                roughness,
                coat,
                transparent,
            } => {
                let (lobe, through) = Metallic::new(MetallicParameters {
                    color: color(base),
                    metallic: metallic.at(place),
                    roughness: roughness.at(place),
                    coat: color(coat),
                    transparent: transparent.at(place),
                });
                if through == Vec3::ZERO {
                    return Bsdf::metallic(lobe);
                }
                let sheet = Specular::Sheet {
                    kt: through,
                    coat: lobe.coat(),
                };
                Bsdf::lobes(vec![Lobe::Metallic(lobe), Lobe::Specular(sheet)])
            }
            Self::CoatedDiffuse {
                reflectance,
                eta,
                roughness,
            } => {
                let base = reflectance.at(place);
                Bsdf::metallic(Metallic::coated(base, eta.at(place), roughness.at(place)))
            }
            Self::CoatedConductor {
                eta,
                k,
                roughness,
                coat_eta,
                coat_roughness,
            } => {
                let coat = coat_eta.at(place).max(1e-3);
                let above = coat_roughness.values(place);
                let spread = seen_through(roughness.values(place), above, coat);
                let below = Fresnel::Coated {
                    eta: eta.at(place),
                    k: k.at(place),
                    coat,
                };
                let facets = TrowbridgeReitz::new(above, false);
                Bsdf::lobes(vec![
                    Lobe::Glossy(GlossyReflection::new(
                        Vec3::ONE,
                        facets,
                        Fresnel::Coat(coat),
                    )),
                    Lobe::Glossy(GlossyReflection::new(
                        Vec3::ONE,
                        TrowbridgeReitz::new(spread, false),
                        below,
                    )),
                ])
            }
            Self::Disney(disney) => disney.bsdf(place),
            Self::ThinDielectric { eta } => Bsdf::specular(Specular::Pane {
                scale: Vec3::ONE,
                eta: eta.at(place),
            }),
            Self::Subsurface {
                kr,
                kt,
                eta,
                roughness,
                interior,
                asymmetry,
            } => {
                let (kr, eta) = (color(kr), *eta);
                let surface = if roughness.values(place) == [0.0, 0.0] {
                    Bsdf::specular(Specular::Glass {
                        kr,
                        kt: Vec3::ZERO,
                        eta,
                    })
                } else {
                    let facets = roughness.facets(place);
                    let fresnel = Fresnel::Dielectric(eta);
                    let reflection = GlossyReflection::new(kr, facets, fresnel);
                    Bsdf::lobes(vec![Lobe::Glossy(reflection)])
                };
                Bsdf::Subsurface(Box::new(Subsurface {
                    surface,
                    kt: color(kt),
                    interface: Interface::new(eta),
                    coefficients: interior.coefficients(place, eta, *asymmetry),
                    asymmetry: *asymmetry,
                }))
            }
            Self::Hair {
                pigment,
                eta,
                roughness,
                tilt,
            } => {
                let roughness = roughness.each_ref().map(|value| value.at(place));
                let absorption = match pigment {
                    Pigment::Absorption(value) => color(value),
                    Pigment::Color(value) => absorption_of_color(color(value), roughness[1]),
                    Pigment::Melanin(melanin) => {
                        absorption_of_melanin(melanin.each_ref().map(|value| value.at(place)))
                    }
                };
                let (eta, tilt) = (eta.at(place).max(1e-3), tilt.at(place));
                let offset = 2.0 * place.uv.y - 1.0;
                let hair = Hair::new(eta, absorption, roughness, tilt, offset);
                Bsdf::lobes(vec![Lobe::Hair(hair)])
            }
            Self::Fourier(table) => {
                Bsdf::lobes(vec![Lobe::Fourier(Fourier::new(Arc::clone(table)))])
            }
            Self::Mix {
                parameterss,
                amount,
            } => {
                let first = color(amount);
                let shares = [first, (Vec3::ONE - first).max(Vec3::ZERO)];
                let mut lobes = Vec::new();
                for (parameters, share) in parameterss.iter().zip(shares) {
                    let scaled = parameters.bsdf(place).into_lobes().into_iter();
                    lobes.extend(scaled.map(|lobe| lobe.scaled(share)));
                }
                Bsdf::lobes(lobes)
            }
        }
    }
}

/// Alphas of facets that reflect as wide as facets seen through a rough coat.
///
/// A facet tilted by a small d turns the mirror direction by 2 d inside, and by 2 d eta outside. A facet of the coat turns
/// light by (eta - 1) d, on the way in and on the way out. Variances add up.
fn seen_through(below: [f32; 2], coat: [f32; 2], eta: f32) -> [f32; 2] {
    [0, 1].map(|axis| {
        let own = eta * below[axis];
        let passing = (eta - 1.0) * coat[axis];
        (own * own + 0.5 * passing * passing).sqrt().min(1.0)
    })
}
