//! Scattering that was measured or simulated: a table of Fourier series.

use serde::Serialize;

/// Scattering of a surface that is the same in every direction around its normal, after Jakob, d'Eon, Jakob and Marschner 2014
/// ("A comprehensive framework for rendering layered materials").
///
/// For every pair of cosines there is an even Fourier series in the azimuth between both directions. Its value is the
/// scattering function times the cosine of the incident direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FourierTable {
    /// Name of the file, for messages.
    pub name: String,
    /// Index of refraction inside over outside.
    pub eta: f32,
    /// 1 for luminance, or 3: luminance, red and blue.
    pub channels: u32,
    /// Cosines of the angle to the normal, ascending from -1 to 1. At least 2. A cosine may occur twice, as 0 does where the
    /// table differs on both sides of it.
    #[serde(serialize_with = "crate::raw")]
    pub cosines: Vec<f32>,
    /// Integral over the incident cosine up to each of them of the first coefficient of luminance: `[n, n]`, a row for every
    /// outgoing cosine.
    #[serde(serialize_with = "crate::raw")]
    pub integrals: Vec<f32>,
    /// Place of the first coefficient of each pair, and the number of coefficients of each channel: `[n, n, 2]`, a row for
    /// every outgoing cosine.
    #[serde(serialize_with = "crate::raw")]
    pub series: Vec<[u32; 2]>,
    /// Coefficients of all series. A series has the coefficients of luminance, then of red, then of blue.
    #[serde(serialize_with = "crate::raw")]
    pub coefficients: Vec<f32>,
}

impl FourierTable {
    /// Checks that the table does not contradict itself.
    ///
    /// # Errors
    /// Description of the mistake, without the name of the table.
    pub fn check(&self) -> Result<(), String> {
        let count = self.cosines.len();
        let pairs = count.checked_mul(count);
        // 0 may occur twice, once for either side.
        let ascend = self.cosines.windows(2).all(|two| two[0] <= two[1])
            && self.cosines.windows(3).all(|three| three[0] < three[2])
            && self.cosines.first() < self.cosines.last();
        let coefficients = self.coefficients.len() as u64;
        let fits = |[first, count]: &[u32; 2]| {
            u64::from(*first) + u64::from(*count) * u64::from(self.channels) <= coefficients
        };
        let numbers = self.integrals.iter().chain(&self.coefficients);
        Err(match () {
            () if count < 2 => format!("it has {count} cosines, and needs 2 or more"),
            () if !ascend => "its cosines do not ascend".into(),
            () if !matches!(self.channels, 1 | 3) => {
                format!("it has {} channels, neither 1 nor 3", self.channels)
            }
            () if pairs != Some(self.series.len()) || pairs != Some(self.integrals.len()) => {
                format!("it does not have {count} x {count} series and integrals")
            }
            () if !self.series.iter().all(fits) => {
                "a series ends behind the last coefficient".into()
            }
            () if !(self.eta > 0.0 && self.eta.is_finite()) => {
                format!("its index of refraction is {}", self.eta)
            }
            () if !numbers.into_iter().all(|x| x.is_finite()) => "a number is not finite".into(),
            () => return Ok(()),
        })
    }
}
