//! Equality of materials, for finding equal ones by hashing.

use std::sync::Arc;

use antumbra_scene::{Material, Param, Rgb};

/// Hash key of a material: numbers by their bits, textures by identity.
///
/// A key is valid while the textures of its material live, which the scene's list of materials guarantees. Two
/// declarations of one texture count as different textures.
#[derive(PartialEq, Eq, Hash)]
pub(crate) struct MaterialKey(Vec<u64>);

impl MaterialKey {
    /// Makes the key of a material.
    pub fn new(material: &Material) -> Self {
        let mut key = Self(Vec::new());
        key.material(material);
        key
    }

    fn material(&mut self, material: &Material) {
        match material {
            Material::None => self.number(0),
            Material::Matte { kd, sigma } => {
                self.number(1);
                self.color(kd);
                self.float(sigma);
            }
            Material::Plastic {
                kd,
                ks,
                roughness,
                remap_roughness,
            } => {
                self.number(2);
                self.colors([kd, ks]);
                self.float(roughness);
                self.flag(*remap_roughness);
            }
            Material::Mirror { kr } => {
                self.number(3);
                self.color(kr);
            }
            Material::Glass {
                kr,
                kt,
                eta,
                roughness,
                remap_roughness,
            } => {
                self.number(4);
                self.colors([kr, kt]);
                self.float(eta);
                self.floats(roughness);
                self.flag(*remap_roughness);
            }
            Material::Metal {
                eta,
                k,
                roughness,
                remap_roughness,
            } => {
                self.number(5);
                self.colors([eta, k]);
                self.floats(roughness);
                self.flag(*remap_roughness);
            }
            Material::Uber {
                kd,
                ks,
                kr,
                kt,
                roughness,
                opacity,
                eta,
                remap_roughness,
            } => {
                self.number(6);
                self.colors([kd, ks, kr, kt, opacity]);
                self.float(eta);
                self.floats(roughness);
                self.flag(*remap_roughness);
            }
            Material::Substrate {
                kd,
                ks,
                roughness,
                remap_roughness,
            } => {
                self.number(7);
                self.colors([kd, ks]);
                self.floats(roughness);
                self.flag(*remap_roughness);
            }
            Material::Translucent {
                kd,
                ks,
                reflect,
                transmit,
                roughness,
                remap_roughness,
            } => {
                self.number(8);
                self.colors([kd, ks, reflect, transmit]);
                self.float(roughness);
                self.flag(*remap_roughness);
            }
            Material::Mix { materials, amount } => {
                self.number(9);
                self.color(amount);
                for material in materials {
                    self.material(material);
                }
            }
            Material::Bumped { material, height } => {
                self.number(10);
                self.float(height);
                self.material(material);
            }
            Material::Metallic {
                color,
                metallic,
                roughness,
                coat,
                transmission,
            } => {
                self.number(11);
                self.colors([color, coat]);
                for value in [metallic, roughness, transmission] {
                    self.float(value);
                }
            }
            Material::NormalMapped {
                material,
                normal,
                scale,
            } => {
                self.number(12);
                self.color(normal);
                self.number(scale.to_bits().into());
                self.material(material);
            }
        }
    }

    fn number(&mut self, number: u64) {
        self.0.push(number);
    }

    fn flag(&mut self, flag: bool) {
        self.number(flag.into());
    }

    fn color(&mut self, color: &Param<Rgb>) {
        match color {
            Param::Constant(rgb) => {
                self.number(0);
                self.0
                    .extend(rgb.to_array().map(|v| u64::from(v.to_bits())));
            }
            Param::Texture(texture) => self.texture(texture),
        }
    }

    fn float(&mut self, float: &Param<f32>) {
        match float {
            Param::Constant(value) => {
                self.number(0);
                self.number(value.to_bits().into());
            }
            Param::Texture(texture) => self.texture(texture),
        }
    }

    fn texture<T>(&mut self, texture: &Arc<T>) {
        self.number(1);
        self.number(Arc::as_ptr(texture) as usize as u64);
    }

    fn colors<const N: usize>(&mut self, colors: [&Param<Rgb>; N]) {
        for color in colors {
            self.color(color);
        }
    }

    fn floats(&mut self, floats: &[Param<f32>; 2]) {
        for float in floats {
            self.float(float);
        }
    }
}
