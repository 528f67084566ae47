//! Changes of parameter lists: what a translation does to them.

use crate::params::{Param, ParamType, Params, Values};
use crate::source::Span;

impl Params {
    pub(super) fn find(&self, name: &str) -> Option<&Param> {
        self.list.iter().find(|param| param.name == name)
    }

    pub(super) fn drop(&mut self, name: &str) {
        self.list.retain(|param| param.name != name);
    }

    pub(super) fn rename(&mut self, from: &str, to: &str) {
        for param in &mut self.list {
            if param.name == from {
                to.clone_into(&mut param.name);
            }
        }
    }

    pub(super) fn string(&self, name: &str) -> Option<&str> {
        let param = self.find(name)?;
        match &param.values {
            Values::Strings(texts) if param.param_type == ParamType::String => {
                texts.first().map(String::as_str)
            }
            _ => None,
        }
    }

    pub(super) fn bool(&self, name: &str) -> Option<bool> {
        match &self.find(name)?.values {
            Values::Bools(values) => values.first().copied(),
            _ => None,
        }
    }

    /// Removes a single number.
    pub(super) fn take_float(&mut self, name: &str) -> Option<f32> {
        let found = match (self.find(name)?.param_type, &self.find(name)?.values) {
            (ParamType::Float, Values::Floats(values)) => values.first().copied(),
            _ => None,
        };
        if found.is_some() {
            self.drop(name);
        }
        found
    }

    fn set(&mut self, name: &str, param_type: ParamType, values: Values, at: Span) {
        self.drop(name);
        self.list.push(Param {
            param_type,
            name: name.to_owned(),
            declaration: at,
            values,
            list: at,
            value: at,
            is_attribute: false,
        });
    }

    pub(super) fn set_float(&mut self, name: &str, value: f32, at: Span) {
        self.set(name, ParamType::Float, Values::Floats(vec![value]), at);
    }

    pub(super) fn set_rgb(&mut self, name: &str, value: [f32; 3], at: Span) {
        self.set(name, ParamType::Rgb, Values::Floats(value.to_vec()), at);
    }

    pub(super) fn set_text(&mut self, name: &str, value: &str, at: Span) {
        self.set(
            name,
            ParamType::String,
            Values::Strings(vec![value.into()]),
            at,
        );
    }

    pub(super) fn set_texture(&mut self, name: &str, texture: &str, at: Span) {
        self.set(
            name,
            ParamType::Texture,
            Values::Strings(vec![texture.into()]),
            at,
        );
    }

    pub(super) fn set_bool(&mut self, name: &str, value: bool, at: Span) {
        self.set(name, ParamType::Bool, Values::Bools(vec![value]), at);
    }

    pub(super) fn set_string(&mut self, name: &str, value: String) {
        for param in &mut self.list {
            if param.name == name {
                param.values = Values::Strings(vec![value.clone()]);
            }
        }
    }

    pub(super) fn default_float(&mut self, name: &str, value: f32, at: Span) {
        if self.find(name).is_none() {
            self.set_float(name, value, at);
        }
    }

    pub(super) fn default_integer(&mut self, name: &str, value: i32, at: Span) {
        if self.find(name).is_none() {
            self.set(name, ParamType::Integer, Values::Integers(vec![value]), at);
        }
    }

    /// Makes a colour of a number.
    pub(super) fn widen(&mut self, name: &str) {
        for param in &mut self.list {
            if param.name == name
                && param.param_type == ParamType::Float
                && let Values::Floats(values) = &mut param.values
                && let [value] = values[..]
            {
                param.param_type = ParamType::Rgb;
                *values = vec![value; 3];
            }
        }
    }
}
