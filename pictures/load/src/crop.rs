//! [`Crop`], a rectangle of pixels.

use std::str::FromStr;

/// Rectangle of pixels inside a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crop {
    /// Column and row of the upper left pixel.
    pub corner: [u32; 2],
    /// Width and height.
    pub size: [u32; 2],
}

impl FromStr for Crop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not X,Y,WxH in pixels, such as 100,50,320x200");
        let mut parts = text.splitn(3, ',').map(str::trim);
        let mut number = || parts.next()?.parse().ok();
        let corner = [number().ok_or_else(wrong)?, number().ok_or_else(wrong)?];
        let size = parts.next().and_then(|size| size.split_once('x'));
        let (width, height) = size.ok_or_else(wrong)?;
        let size = [width, height].map(|side| side.parse().unwrap_or(0));
        if size.contains(&0) {
            return Err(wrong());
        }
        Ok(Self { corner, size })
    }
}
