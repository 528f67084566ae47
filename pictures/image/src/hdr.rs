//! Radiance HDR writer: three mantissas of 8 bits and a common exponent. Equal pixels give equal bytes.
//!
//! The format has no data window. Of a cropped picture, only the pixels of the window are written. Values below 0 and
//! NaN give 0, and a value keeps 7 bits or more of the largest of its pixel.

use ::image::codecs::hdr::HdrEncoder;
use ::image::{ExtendedColorType, ImageEncoder};

use crate::Image;
use crate::signature::SOFTWARE;

/// Largest power of two and smallest one that the exponent holds. The encoder does not check, and would wrap around.
const LARGEST: f32 = 8.5e37;
const SMALLEST: f32 = 2e-38;

/// Encodes linear values as a Radiance HDR file, with the name of this program in its header.
pub(crate) fn encode(image: &Image) -> Result<Vec<u8>, String> {
    let (width, height) = (image.window().width(), image.window().height());
    let [Ok(wide), Ok(high)] = [width, height].map(u32::try_from) else {
        return Err(format!("{width} x {height} pixels are too many"));
    };
    let held = |value: &f32| match *value {
        value if value >= SMALLEST => value.min(LARGEST),
        _ => 0.0,
    };
    let values = image.pixels().iter().flat_map(|pixel| {
        let pixel = pixel.each_ref().map(held);
        let most = pixel.iter().fold(0.0_f32, |most, value| most.max(*value));
        // The encoder cuts mantissas off. Half a step, 2⁻⁸ of the power of two below the largest value, makes that rounding.
        let half = f32::from_bits(most.to_bits() & f32::INFINITY.to_bits()) / 256.0;
        pixel.map(|value| (value + half).to_ne_bytes())
    });
    let values: Vec<u8> = values.flatten().collect();
    let mut bytes = Vec::new();
    let encoder = HdrEncoder::new(&mut bytes);
    let written = encoder.write_image(&values, wide, high, ExtendedColorType::Rgb32F);
    written.map_err(|error| error.to_string())?;
    let format = bytes.windows(7).position(|word| word == b"FORMAT=");
    let rest = bytes.split_off(format.unwrap_or_default());
    Ok([
        format!("#?RADIANCE\nSOFTWARE={SOFTWARE}\n").into_bytes(),
        rest,
    ]
    .concat())
}
