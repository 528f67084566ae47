//! Spectra that scenes of pbrt-v4 name: metals, glasses and illuminants, from published tables.
//!
//! Metals are pairs of index of refraction n and absorption coefficient k by wavelength:
//!
//! - silver, gold, copper: Johnson and Christy 1972, *Optical Constants of the Noble Metals*, table I
//! - aluminium: Smith, Shiles and Inokuti in Palik 1985, *Handbook of Optical Constants of Solids*
//! - magnesium oxide: the dispersion formula of Stephens and Malitson 1952; titanium dioxide: the formula of Devore 1951, ordinary ray
//!
//! Glasses have the index of refraction at 587.6 nm of the catalogue of Schott, the same for all colours. Illuminants are
//! the chromaticities of CIE 15:2004, at luminance 1.

use glam::DVec3;

use crate::spectrum;

/// Spectrum by its name.
pub(crate) enum Named {
    /// Wavelengths in nanometres, and values.
    Samples(Vec<[f64; 2]>),
    /// Index of refraction of a glass.
    Index(f64),
    /// Linear RGB of an illuminant at luminance 1.
    Light(DVec3),
}

/// Wavelength in micrometres, n and k.
type Optical = [f64; 3];

#[rustfmt::skip]
const SILVER: &[Optical] = &[
    [0.3679, 0.07, 1.657], [0.3815, 0.05, 1.864], [0.3974, 0.05, 2.070], [0.4133, 0.05, 2.275], [0.4305, 0.04, 2.462],
    [0.4509, 0.04, 2.657], [0.4714, 0.05, 2.869], [0.4959, 0.05, 3.093], [0.5209, 0.05, 3.324], [0.5486, 0.06, 3.586],
    [0.5821, 0.05, 3.858], [0.6168, 0.06, 4.152], [0.6595, 0.05, 4.483], [0.7045, 0.04, 4.838], [0.7560, 0.03, 5.242],
];

#[rustfmt::skip]
const GOLD: &[Optical] = &[
    [0.3679, 1.48, 1.895], [0.3815, 1.46, 1.933], [0.3974, 1.47, 1.952], [0.4133, 1.46, 1.958], [0.4305, 1.45, 1.948],
    [0.4509, 1.38, 1.914], [0.4714, 1.31, 1.849], [0.4959, 1.04, 1.833], [0.5209, 0.62, 2.081], [0.5486, 0.43, 2.455],
    [0.5821, 0.29, 2.863], [0.6168, 0.21, 3.272], [0.6595, 0.14, 3.697], [0.7045, 0.13, 4.103], [0.7560, 0.14, 4.542],
];

#[rustfmt::skip]
const COPPER: &[Optical] = &[
    [0.3974, 1.17, 2.116], [0.4133, 1.18, 2.207], [0.4305, 1.18, 2.305], [0.4509, 1.17, 2.397], [0.4714, 1.15, 2.483],
    [0.4959, 1.13, 2.564], [0.5209, 1.12, 2.597], [0.5486, 1.02, 2.577], [0.5821, 0.70, 2.704], [0.6168, 0.30, 3.205],
    [0.6595, 0.22, 3.747], [0.7045, 0.21, 4.205], [0.7560, 0.24, 4.665],
];

// Some absorption coefficients look like other constants.
#[allow(clippy::approx_constant)]
#[rustfmt::skip]
const ALUMINIUM: &[Optical] = &[
    [0.3647, 0.407, 4.426], [0.3875, 0.460, 4.708], [0.4133, 0.523, 5.024], [0.4428, 0.598, 5.385], [0.4769, 0.695, 5.800],
    [0.5166, 0.826, 6.283], [0.5636, 1.018, 6.846], [0.6199, 1.304, 7.479], [0.6526, 1.488, 7.821], [0.6888, 1.766, 8.205],
    [0.7293, 2.143, 8.573], [0.7749, 2.625, 8.597],
];

/// Glass and index of refraction at 587.6 nm. The names of the last three leave out an S.
const GLASSES: &[(&str, f64)] = &[
    ("glass-BK7", 1.51680),
    ("glass-BAF10", 1.67003),
    ("glass-FK51A", 1.48656),
    ("glass-LASF9", 1.85025),
    ("glass-F5", 1.67270),
    ("glass-F10", 1.72825),
    ("glass-F11", 1.78472),
];

/// Illuminant and chromaticity.
const ILLUMINANTS: &[(&str, [f64; 2])] = &[
    ("stdillum-A", [0.44757, 0.40745]),
    ("stdillum-D50", [0.34567, 0.35850]),
    ("stdillum-D65", [0.31271, 0.32902]),
    ("stdillum-F1", [0.31310, 0.33727]),
    ("stdillum-F2", [0.37208, 0.37529]),
    ("stdillum-F3", [0.40910, 0.39430]),
    ("stdillum-F4", [0.44018, 0.40329]),
    ("stdillum-F5", [0.31379, 0.34531]),
    ("stdillum-F6", [0.37790, 0.38835]),
    ("stdillum-F7", [0.31292, 0.32933]),
    ("stdillum-F8", [0.34588, 0.35875]),
    ("stdillum-F9", [0.37417, 0.37281]),
    ("stdillum-F10", [0.34609, 0.35986]),
    ("stdillum-F11", [0.38052, 0.37713]),
    ("stdillum-F12", [0.43695, 0.40441]),
    ("illum-acesD60", [0.32168, 0.33767]),
];

#[cfg(test)]
const METALS: &[&str] = &["Ag", "Al", "Au", "Cu", "MgO", "TiO2"];

/// All names, metals without their ending.
#[cfg(test)]
pub(crate) fn names() -> Vec<String> {
    let metals = METALS.iter().map(|metal| format!("metal-{metal}"));
    let others = GLASSES.iter().map(|(name, _)| *name);
    let others = others.chain(ILLUMINANTS.iter().map(|(name, _)| *name));
    metals.chain(others.map(str::to_owned)).collect()
}

/// Relative power of CIE D65 from 360 to 830 nm, every 10 nm.
#[rustfmt::skip]
const D65: [f64; 48] = [
    46.6383, 52.0891, 49.9755, 54.6482, 82.7549, 91.486, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923,
    108.811, 109.354, 107.802, 104.79, 107.689, 104.405, 104.046, 100.0, 96.3342, 95.788, 88.6856, 90.0062, 89.5991,
    87.6987, 83.2886, 83.6992, 80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.349, 61.604, 69.8856, 75.087,
    63.5927, 46.4182, 66.8054, 63.3828, 64.304, 59.4519, 51.959, 57.4406, 60.3125,
];

/// Relative power of daylight (CIE D65) at a wavelength in nanometres.
pub(crate) fn daylight(nm: f64) -> f64 {
    let place = ((nm - 360.0) / 10.0).clamp(0.0, (D65.len() - 1) as f64);
    let index = (place as usize).min(D65.len() - 2);
    D65[index] + (D65[index + 1] - D65[index]) * (place - index as f64)
}

/// Spectrum of a name. `None`: there is none.
pub(crate) fn find(name: &str) -> Option<Named> {
    if let Some((_, index)) = GLASSES.iter().find(|(known, _)| *known == name) {
        return Some(Named::Index(*index));
    }
    if let Some((_, xy)) = ILLUMINANTS.iter().find(|(known, _)| *known == name) {
        return Some(Named::Light(spectrum::from_chromaticity(*xy)));
    }
    let (metal, part) = name.strip_prefix("metal-")?.rsplit_once('-')?;
    let column = match part {
        "eta" => 1,
        "k" => 2,
        _ => return None,
    };
    let table = match metal {
        "Ag" => SILVER.to_vec(),
        "Au" => GOLD.to_vec(),
        "Cu" => COPPER.to_vec(),
        "Al" => ALUMINIUM.to_vec(),
        "MgO" => transparent(magnesium_oxide),
        "TiO2" => transparent(titanium_dioxide),
        _ => return None,
    };
    let samples = table.iter().map(|row| [1000.0 * row[0], row[column]]);
    Some(Named::Samples(samples.collect()))
}

/// Index of refraction of a glass, or of another transparent substance at 587.6 nm. `None`: the name is of nothing transparent.
pub(crate) fn index(name: &str) -> Option<f64> {
    match (name, find(name)?) {
        (_, Named::Index(index)) => Some(index),
        ("metal-MgO-eta" | "metal-TiO2-eta", Named::Samples(samples)) => {
            Some(spectrum::interpolated(samples)(587.6))
        }
        _ => None,
    }
}

/// Table of a substance without absorption, by the square of n for the square of a wavelength in micrometres.
fn transparent(squared: impl Fn(f64) -> f64) -> Vec<Optical> {
    let row = |i: u32| {
        let wavelength = 0.36 + 0.02 * f64::from(i);
        [wavelength, squared(wavelength * wavelength).sqrt(), 0.0]
    };
    (0..=24).map(row).collect()
}

fn magnesium_oxide(w2: f64) -> f64 {
    let term = |strength: f64, pole: f64| strength * w2 / (w2 - pole * pole);
    1.0 + term(1.111033, 0.0712465) + term(0.8460085, 0.1375204) + term(7.808527, 26.89302)
}

fn titanium_dioxide(w2: f64) -> f64 {
    5.913 + 0.2441 / (w2 - 0.0803)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reflectance straight on of n and k at a wavelength.
    fn reflectance(metal: &str, nm: f64) -> f64 {
        let at = |part: &str| match find(&format!("metal-{metal}-{part}")) {
            Some(Named::Samples(samples)) => spectrum::interpolated(samples)(nm),
            _ => panic!("{metal}"),
        };
        let (n, k) = (at("eta"), at("k"));
        ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k)
    }

    /// Published reflectances of polished metals (CRC Handbook of Chemistry and Physics), at normal incidence.
    #[test]
    fn metals_have_their_reflectance() {
        for (metal, nm, expected, tolerance) in [
            ("Ag", 550.0, 0.98, 0.02),
            ("Ag", 420.0, 0.96, 0.03),
            ("Al", 550.0, 0.917, 0.01),
            ("Al", 450.0, 0.923, 0.01),
            ("Au", 650.0, 0.96, 0.02),
            ("Au", 450.0, 0.39, 0.03),
            ("Cu", 650.0, 0.94, 0.02),
            ("Cu", 500.0, 0.60, 0.02),
            ("MgO", 589.3, 0.0726, 0.0005),
            ("TiO2", 589.3, 0.1994, 0.001),
        ] {
            let found = reflectance(metal, nm);
            assert!(
                (found - expected).abs() < tolerance,
                "{metal} {nm}: {found}"
            );
        }
        for metal in METALS {
            for part in ["eta", "k"] {
                assert!(find(&format!("metal-{metal}-{part}")).is_some());
            }
        }
        assert!(find("metal-Au").is_none() && find("metal-Au-n").is_none() && find("Au").is_none());
    }

    #[test]
    fn illuminants_have_luminance_1() {
        for (name, _) in ILLUMINANTS {
            let Some(Named::Light(color)) = find(name) else {
                panic!("{name}");
            };
            let luminance = color.dot(DVec3::new(0.212671, 0.715160, 0.072169));
            assert!((luminance - 1.0).abs() < 1e-4, "{name} {luminance}");
        }
        let Some(Named::Light(white)) = find("stdillum-D65") else {
            panic!()
        };
        assert!((white - DVec3::ONE).abs().max_element() < 2e-3, "{white}");
    }

    #[test]
    fn glasses_have_one_index() {
        assert_eq!(index("glass-BK7"), Some(1.5168));
        assert!((index("metal-MgO-eta").unwrap() - 1.7375).abs() < 1e-3);
        assert_eq!(index("metal-Ag-eta"), None);
        assert_eq!(index("stdillum-D65"), None);
        assert_eq!(index("ice"), None);
    }
}
