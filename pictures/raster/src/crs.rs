//! Coordinate systems as GeoTIFF describes them: a directory of keys (OGC 19-008r4, GeoTIFF 1.1, section 7).

/// Keys of the coordinate system, with the lists that they point into.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crs {
    /// Version, revisions and number of keys, and then four numbers for each key: tag `GeoKeyDirectory`.
    pub directory: Vec<u16>,
    /// Parameters: tag `GeoDoubleParams`.
    pub doubles: Vec<f64>,
    /// Names: tag `GeoAsciiParams`.
    pub names: String,
}

/// Key of the kind of coordinates.
const MODEL_TYPE: u16 = 1024;
const PROJECTED: u16 = 1;
const GEOGRAPHIC: u16 = 2;
/// Key that says whether a value holds for an area or a point.
const RASTER_TYPE: u16 = 1025;
const AREA: u16 = 1;
const POINT: u16 = 2;
/// Keys of the projected system, and of units of length.
const PROJECTED_CRS: u16 = 3072;
const LINEAR_UNIT: u16 = 3076;
const VERTICAL_UNIT: u16 = 4099;
const METRE: u16 = 9001;

/// Codes of geographic systems that are often given by mistake: WGS 84, ETRS89, NAD83, NAD27, CGCS2000.
const DEGREES: [u16; 5] = [4326, 4258, 4269, 4267, 4490];

impl Crs {
    /// The projected system with a code of EPSG, such as 25832.
    ///
    /// # Errors
    /// The code is outside its range, or known to be a system in degrees.
    pub fn from_epsg(code: u16) -> Result<Self, String> {
        if DEGREES.contains(&code) {
            return Err(format!(
                "EPSG:{code} has degrees; wanted a projected system, in metres"
            ));
        }
        if !(1024..=32_766).contains(&code) {
            return Err(format!("found {code}, wanted a code from 1024 to 32766"));
        }
        Ok(Self::of(&[
            (MODEL_TYPE, PROJECTED),
            (RASTER_TYPE, AREA),
            (PROJECTED_CRS, code),
        ]))
    }

    /// Some system in degrees.
    pub(crate) fn degrees() -> Self {
        Self::of(&[(MODEL_TYPE, GEOGRAPHIC)])
    }

    fn of(keys: &[(u16, u16)]) -> Self {
        let mut directory = vec![1, 1, 0, keys.len() as u16];
        for &(key, value) in keys {
            directory.extend([key, 0, 1, value]);
        }
        Self {
            directory,
            ..Self::default()
        }
    }

    /// Value of a key that is a number.
    fn key(&self, wanted: u16) -> Option<u16> {
        let (keys, _) = self.directory.get(4..)?.as_chunks::<4>();
        keys.iter()
            .find(|&&[key, place, ..]| key == wanted && place == 0)
            .map(|&[.., value]| value)
    }

    /// Whether coordinates are degrees.
    pub fn is_geographic(&self) -> bool {
        self.key(MODEL_TYPE) == Some(GEOGRAPHIC)
    }

    /// Code of EPSG of a projected system, if the keys have one.
    pub fn epsg(&self) -> Option<u16> {
        self.key(PROJECTED_CRS).filter(|&code| code != 32_767)
    }

    /// Whether the file measures places at centres of cells, and not at their corners.
    pub(crate) fn is_point(&self) -> bool {
        self.key(RASTER_TYPE) == Some(POINT)
    }

    /// Codes of EPSG of the units along the ground and of heights, where they are given and differ from each other or from
    /// metres.
    pub fn odd_units(&self) -> Option<[u16; 2]> {
        let ground = self.key(LINEAR_UNIT);
        let height = self.key(VERTICAL_UNIT);
        match (ground, height) {
            (None | Some(METRE), None | Some(METRE)) => None,
            _ => Some([ground.unwrap_or(METRE), height.unwrap_or(METRE)]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_come_back() {
        let utm = Crs::from_epsg(25_832).expect("a code");
        assert_eq!(utm.epsg(), Some(25_832));
        assert!(!utm.is_geographic() && !utm.is_point());
        assert_eq!(utm.odd_units(), None);
        assert!(Crs::from_epsg(4326).is_err() && Crs::from_epsg(7).is_err());
        assert!(Crs::degrees().is_geographic());
        let feet = Crs::of(&[(LINEAR_UNIT, 9003)]);
        assert_eq!(feet.odd_units(), Some([9003, METRE]));
        assert_eq!(Crs::default().epsg(), None);
    }
}
