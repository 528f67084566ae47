//! Coordinate systems as GeoTIFF describes them: a directory of keys (OGC 19-008r4, GeoTIFF 1.1, section 7), and where on the earth
//! their coordinates are.

use proj4rs::Proj;
use proj4rs::transform::transform;

/// Keys of the coordinate system, with the lists that they point into.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Crs {
    /// Version, revisions and number of keys, and then four numbers for each key: tag `GeoKeyDirectory`.
    pub directory: Vec<u16>,
    /// Parameters: tag `GeoDoubleParams`.
    pub doubles: Vec<f64>,
    /// Names: tag `GeoAsciiParams`.
    pub names: String,
    /// The projection as a string of PROJ, where a `.prj` file has it; otherwise empty.
    pub projection: String,
}

/// Key of the kind of coordinates.
const MODEL_TYPE: u16 = 1024;
const PROJECTED: u16 = 1;
const GEOGRAPHIC: u16 = 2;
/// Key that says whether a value holds for an area or a point.
const RASTER_TYPE: u16 = 1025;
const AREA: u16 = 1;
const POINT: u16 = 2;
/// Key of the name, and place of names: tag `GeoAsciiParams`.
const CITATION: u16 = 1026;
const NAMES: u16 = 34_737;
/// Keys of the projected system, and of its unit.
const PROJECTED_CRS: u16 = 3072;
const LINEAR_UNIT: u16 = 3076;
const LINEAR_UNIT_SIZE: u16 = 3077;
/// Place of parameters that are floats: tag `GeoDoubleParams`.
const DOUBLES: u16 = 34_736;
/// Keys of the system of heights, and of their unit.
const VERTICAL_CRS: u16 = 4096;
const VERTICAL_UNIT: u16 = 4099;
const METRE: u16 = 9001;

/// Metres in the units that a key names: metre, foot, US survey foot, kilometre.
const UNITS: [(u16, f64); 4] = [
    (METRE, 1.0),
    (9002, 0.3048),
    (9003, US_FOOT),
    (9036, 1000.0),
];
pub(crate) const US_FOOT: f64 = 1200.0 / 3937.0;

/// A place on the earth, and how a map shows its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Degrees north of the equator, on the ellipsoid of the map.
    pub latitude: f64,
    /// Degrees east of Greenwich.
    pub longitude: f64,
    /// Degrees from the y axis of the map to true north, clockwise as seen from above.
    pub north: f64,
    /// Lengths on the map over lengths on the ground, to the north and to the east.
    pub scale: [f64; 2],
}

impl Crs {
    /// The projected system with a code of EPSG, such as 25832.
    ///
    /// # Errors
    /// The code is outside its range, or of a system in degrees.
    pub fn from_epsg(code: u16) -> Result<Self, String> {
        let known = crs_definitions::from_code(code);
        let is_map = |text: &str| !text.contains("=longlat") && !text.contains("=geocent");
        if known.is_some_and(|known| !is_map(known.proj4)) {
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

    /// The system that the text of a `.prj` file (WKT) describes, if it is understood.
    pub(crate) fn from_wkt(text: &str) -> Option<Self> {
        let kind = text.trim().to_ascii_uppercase();
        let degrees = ["GEOGC", "GEODC", "GEODETICC", "GEOGRAPHICC"];
        if degrees.iter().any(|start| kind.starts_with(start)) {
            return Some(Self::degrees());
        }
        let projection = proj4wkt::wkt_to_projstring(text).ok()?;
        // The code of the whole is last, as in `AUTHORITY["EPSG","25832"]]` or `ID["EPSG",25832]]`.
        let last = text.rsplit("\"EPSG\",").next().unwrap_or_default();
        let code = last.trim_matches(|c: char| c.is_whitespace() || "\"]".contains(c));
        let code = code
            .parse()
            .ok()
            .filter(|&code| crs_definitions::from_code(code).is_some());
        if let Some(known) = code.and_then(|code| Self::from_epsg(code).ok()) {
            return Some(known);
        }
        let names = format!("{}|", text.split('"').nth(1).unwrap_or_default());
        let length = names.len() as u16;
        let mut directory = vec![1, 1, 0, 3, MODEL_TYPE, 0, 1, PROJECTED];
        directory.extend([RASTER_TYPE, 0, 1, AREA, CITATION, NAMES, length, 0]);
        Some(Self {
            directory,
            names,
            projection,
            ..Self::default()
        })
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

    /// Value of a key that is a float.
    fn double(&self, wanted: u16) -> Option<f64> {
        let (keys, _) = self.directory.get(4..)?.as_chunks::<4>();
        let entry = keys
            .iter()
            .find(|&&[key, place, ..]| key == wanted && place == DOUBLES);
        let number = self.doubles.get(usize::from(entry?[3])).copied();
        number.filter(|number| *number > 0.0 && number.is_finite())
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

    /// The code of EPSG, or else the names that the file gives.
    pub fn name(&self) -> String {
        match self.epsg() {
            Some(code) => format!("EPSG:{code}"),
            None if self.names.is_empty() => "without a name".to_owned(),
            None => self.names.trim_end_matches('|').to_owned(),
        }
    }

    /// The projection, if its code is known; its datum is left out.
    fn projection(&self) -> Option<Proj> {
        if !self.projection.is_empty() {
            return Proj::from_proj_string(&without_grids(&self.projection)).ok();
        }
        // The table has no axes of the Austrian cadastre of 1817, which point south and west.
        let code = self.epsg().filter(|code| !matches!(code, 8044 | 8045))?;
        let known = crs_definitions::from_code(code)?;
        Proj::from_proj_string(&without_grids(known.proj4)).ok()
    }

    /// Metres in a unit of map coordinates, if it is known.
    pub fn metres(&self) -> Option<f64> {
        let of_key = self.key(LINEAR_UNIT).and_then(metres);
        let of_size = || self.double(LINEAR_UNIT_SIZE);
        of_key
            .or_else(of_size)
            .or_else(|| self.projection().map(|projection| projection.to_meter()))
    }

    /// Metres in a unit of heights, if the file says so.
    pub(crate) fn height_metres(&self) -> Option<f64> {
        let of_system = || match self.key(VERTICAL_CRS)? {
            6130 | 6131 | 6132 | 8050 | 8228 => Some(0.3048),
            5702 | 6360 | 8052 => Some(US_FOOT),
            5754 => Some(0.304_800_749_1),
            // All others of EPSG are in metres.
            code => (1024..=32_766).contains(&code).then_some(1.0),
        };
        self.key(VERTICAL_UNIT).and_then(metres).or_else(of_system)
    }

    /// Where map coordinates are on the earth. `None` if the projection is not known, or does not reach there.
    ///
    /// Directions and lengths are differences between places 60 m apart, so all projections are treated alike. The ellipsoid is the
    /// one of the map: its latitudes differ from latitudes of WGS 84 by less than 0.01 degrees.
    pub fn site(&self, [x, y]: [f64; 2]) -> Option<Site> {
        let projection = self.projection()?;
        // A file that names another unit than its system does speaks against itself.
        if (self.metres()? / projection.to_meter() - 1.0).abs() > 1e-5 {
            return None;
        }
        // Without a datum, so that none is changed.
        let globe = Proj::from_proj_string("+proj=longlat +ellps=WGS84").ok()?;
        let mut place = (x, y, 0.0);
        transform(&projection, &globe, &mut place).ok()?;
        let (longitude, latitude, _) = place;
        let on_map = |east: f64, north: f64| {
            let mut place = (longitude + east, latitude + north, 0.0);
            transform(&globe, &projection, &mut place).ok()?;
            Some([place.0, place.1])
        };
        let step = 1e-5;
        let between = |east: f64, north: f64| {
            let ends = [on_map(-east, -north)?, on_map(east, north)?];
            Some([ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]])
        };
        let [e, n] = [between(step, 0.0)?, between(0.0, step)?];
        // Radii of curvature of WGS 84, of the meridian and of the circle of latitude.
        let (sine, cosine) = latitude.sin_cos();
        let bulge = 1.0 - 0.006_694_38 * sine * sine;
        let radius = 6_378_137.0 / bulge.sqrt();
        let [meridian, circle] = [radius * (1.0 - 0.006_694_38) / bulge, radius * cosine];
        let metres = projection.to_meter() / (2.0 * step);
        let scale = [
            metres * n[0].hypot(n[1]) / meridian,
            metres * e[0].hypot(e[1]) / circle,
        ];
        let back = on_map(0.0, 0.0)?;
        let is_there = (back[0] - x).hypot(back[1] - y) * projection.to_meter() < 1.0;
        // East is to the right of north; in systems whose axes point south and west it may not be.
        let is_right = e[0] * n[1] - e[1] * n[0] > 0.0;
        let site = Site {
            latitude: latitude.to_degrees(),
            longitude: longitude.to_degrees(),
            north: n[0].atan2(n[1]).to_degrees(),
            scale,
        };
        (is_there && is_right && scale.iter().all(|x| x.is_finite())).then_some(site)
    }
}

impl Site {
    /// Most that lengths on a map may differ from lengths on the ground. National and continental systems stay within it, and so do
    /// shadows and slopes; Web Mercator leaves it 11 degrees from the equator.
    pub const MOST_STRETCH: f64 = 0.02;

    /// Lengths on the map over lengths on the ground, where they differ by more than [`MOST_STRETCH`](Self::MOST_STRETCH).
    pub fn stretch(&self) -> Option<f64> {
        let [north, east] = self.scale;
        let is_most =
            |scale: f64| (scale - 1.0).abs() >= (north - 1.0).abs().max((east - 1.0).abs());
        let scale = if is_most(east) { east } else { north };
        ((scale - 1.0).abs() > Self::MOST_STRETCH).then_some(scale)
    }

    /// The system of EPSG with the zone of UTM that the place is in.
    pub fn utm(&self) -> String {
        utm(self.latitude, self.longitude)
    }

    /// Kilometres along the ground to another place.
    pub fn kilometres(&self, latitude: f64, longitude: f64) -> f64 {
        let [a, b] = [self.latitude, latitude].map(f64::to_radians);
        let apart = (longitude - self.longitude).to_radians();
        let half = |angle: f64| (0.5 * angle).sin().powi(2);
        let square = half(b - a) + a.cos() * b.cos() * half(apart);
        2.0 * 6371.0 * square.sqrt().min(1.0).asin()
    }
}

/// The system with the zone of UTM of a place, or of a pole.
pub(crate) fn utm(latitude: f64, longitude: f64) -> String {
    let zone = 1 + ((longitude + 180.0).rem_euclid(360.0) / 6.0) as u32;
    let code = match latitude {
        ..-80.0 => 32_761,
        ..0.0 => 32_700 + zone,
        84.0.. => 32_661,
        _ => 32_600 + zone,
    };
    format!("EPSG:{code}")
}

/// A projection without grids of its datum, which are files that are not there, and move a place by 200 m at most.
fn without_grids(projection: &str) -> String {
    let words = projection.split_whitespace();
    let words: Vec<&str> = words.filter(|word| !word.contains("grids")).collect();
    words.join(" ")
}

fn metres(unit: u16) -> Option<f64> {
    let known = UNITS.iter().find(|(code, _)| *code == unit);
    known.map(|&(_, metres)| metres)
}

/// Name of a unit of so many metres.
pub fn unit_name(metres: f64) -> String {
    let is = |other: f64| (metres / other - 1.0).abs() < 1e-9;
    let known = [
        (1.0, "m"),
        (0.3048, "ft"),
        (US_FOOT, "US survey ft"),
        (1000.0, "km"),
    ];
    match known.into_iter().find(|&(length, _)| is(length)) {
        Some((_, name)) => name.to_owned(),
        None => format!("units of {metres} m"),
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
        assert_eq!((utm.metres(), utm.height_metres()), (Some(1.0), None));
        for code in [4326, 4258, 4617, 7] {
            assert!(Crs::from_epsg(code).is_err(), "{code}");
        }
        assert!(Crs::degrees().is_geographic());
        let heights = |code| Crs::of(&[(VERTICAL_CRS, code)]).height_metres();
        assert_eq!(
            [5703, 6360, 8228].map(heights),
            [1.0, US_FOOT, 0.3048].map(Some)
        );
        let feet = Crs::of(&[(LINEAR_UNIT, 9003), (VERTICAL_UNIT, 9001)]);
        assert_eq!(feet.metres(), Some(US_FOOT));
        assert_eq!(feet.height_metres(), Some(1.0));
        let own = Crs {
            directory: vec![1, 1, 0, 1, LINEAR_UNIT_SIZE, DOUBLES, 1, 1],
            doubles: vec![9.0, 0.5],
            names: "local|".into(),
            projection: String::new(),
        };
        assert_eq!((own.metres(), &*own.name()), (Some(0.5), "local"));
        assert_eq!(Crs::default().epsg(), None);
    }

    /// Code, x and y, latitude and longitude on the system's own ellipsoid, degrees from grid north to true north, scales to the north
    /// and to the east: by pyproj 3.7.
    const SITES: [[f64; 8]; 34] = [
        [
            25832.0, 691184.2, 5335055.3, 48.1400001, 11.5699996, -1.914655, 1.000049, 1.000049,
        ],
        [
            32632.0, 423974.7, 5205649.3, 46.9999996, 8.0000002, 0.731388, 0.999671, 0.999671,
        ],
        [
            32756.0,
            333510.7,
            6250800.2,
            -33.8700004,
            151.2000005,
            -1.003389,
            0.999942,
            0.999942,
        ],
        [
            32719.0,
            351205.1,
            6303223.8,
            -33.3999996,
            -70.5999996,
            -0.880931,
            0.999873,
            0.999873,
        ],
        [
            31467.0, 3513229.8, 5403513.5, 48.7699998, 9.1799993, -0.135372, 1.000002, 1.000002,
        ],
        [
            31468.0, 4468001.9, 5333539.7, 48.1399996, 11.5699995, 0.320257, 1.000013, 1.000013,
        ],
        [
            27700.0, 530478.2, 179625.1, 51.5000003, -0.1199997, -1.471510, 0.999810, 0.999810,
        ],
        [
            2154.0, 652301.6, 6861302.7, 48.8499998, 2.3500005, 0.471645, 0.999888, 0.999888,
        ],
        [
            2263.0,
            987022.8,
            194305.5,
            40.7000000,
            -73.9900000,
            -0.006541,
            0.999998,
            0.999998,
        ],
        [
            2227.0,
            6006747.1,
            2108528.9,
            37.7699999,
            -122.4200001,
            1.175486,
            0.999929,
            0.999929,
        ],
        [
            26913.0,
            476952.9,
            4427792.1,
            39.9999998,
            -105.2699996,
            0.173553,
            0.999607,
            0.999607,
        ],
        [
            6420.0,
            6273137.1,
            2151714.2,
            37.9000001,
            -121.5000000,
            0.612232,
            0.999933,
            0.999933,
        ],
        [
            2056.0, 2683103.2, 1247004.1, 47.3700004, 8.5400005, -0.804169, 1.000027, 1.000027,
        ],
        [
            21781.0, 600031.7, 199732.6, 46.9500000, 7.4399998, -0.000304, 1.000000, 1.000000,
        ],
        [
            28992.0, 121793.9, 486901.3, 52.3700002, 4.8999997, 0.385641, 0.999918, 0.999918,
        ],
        [
            31370.0, 148768.5, 171006.2, 50.8499999, 4.3499995, 0.013494, 0.999951, 0.999951,
        ],
        [
            3031.0,
            1419227.9,
            -819391.6,
            -75.0000002,
            119.9999997,
            120.000000,
            0.989626,
            0.989626,
        ],
        [
            3413.0,
            0.0,
            -1965440.7,
            71.9999997,
            -45.0000000,
            0.000000,
            0.994180,
            0.994180,
        ],
        [
            3035.0, 3962799.5, 2999718.9, 50.0000004, 5.0000006, 3.855322, 1.000236, 0.999765,
        ],
        [
            5070.0,
            -338390.6,
            1894100.1,
            39.9999996,
            -100.0000001,
            2.411611,
            1.009114,
            0.990969,
        ],
        [
            2193.0,
            1261271.2,
            5004716.0,
            -45.0299998,
            168.7000000,
            -3.045034,
            1.001011,
            1.001011,
        ],
        [
            31256.0, 2725.3, 340121.8, 48.1999997, 16.3699995, -0.027334, 1.000000, 1.000000,
        ],
        [
            5514.0, -742392.1, -1043996.2, 50.0799996, 14.4299997, 7.826530, 0.999904, 0.999904,
        ],
        [
            3006.0, 674647.9, 6580824.6, 59.3300002, 18.0700003, -2.641228, 0.999974, 0.999974,
        ],
        [
            25833.0, 651628.7, 7726106.4, 69.6000002, 18.8999998, -3.656087, 0.999881, 0.999881,
        ],
        [
            6677.0,
            -12069.0,
            -35494.2,
            35.6799999,
            139.7000000,
            0.077768,
            0.999902,
            0.999902,
        ],
        [
            7856.0,
            333510.7,
            6250800.2,
            -33.8700004,
            151.2000005,
            -1.003389,
            0.999942,
            0.999942,
        ],
        [
            2180.0, 636548.4, 486767.5, 52.2300000, 20.9999997, -1.581194, 0.999529, 0.999529,
        ],
        [
            29903.0, 315855.5, 234718.9, 53.3499997, -6.2599997, -1.396151, 1.000200, 1.000200,
        ],
        [
            2285.0,
            1278588.9,
            222309.8,
            47.6000000,
            -122.2999999,
            1.091963,
            0.999983,
            0.999983,
        ],
        [
            2048.0,
            55496.1,
            3752731.4,
            -33.9000003,
            18.4000003,
            179.665345,
            1.000038,
            1.000038,
        ],
        [
            3347.0,
            7471636.5,
            1188239.5,
            45.3999997,
            -75.7000005,
            -14.562773,
            1.015517,
            1.015517,
        ],
        [
            23700.0, 650107.6, 239532.9, 47.4999999, 19.0500000, -0.001047, 0.999949, 0.999949,
        ],
        [
            3435.0,
            1175784.3,
            1899646.8,
            41.8800000,
            -87.6299998,
            -0.469539,
            1.000017,
            1.000017,
        ],
    ];

    #[test]
    fn places_are_those_of_proj() {
        for [code, x, y, latitude, longitude, north, to_north, to_east] in SITES {
            let site = Crs::from_epsg(code as u16).expect("a code").site([x, y]);
            let site = site.unwrap_or_else(|| panic!("EPSG:{code} has no place"));
            let differ = [
                site.latitude - latitude,
                site.longitude - longitude,
                site.north - north,
                site.scale[0] - to_north,
                site.scale[1] - to_east,
            ];
            for (differ, most) in differ.into_iter().zip([1e-6, 1e-6, 1e-4, 1e-3, 1e-3]) {
                assert!(differ.abs() < most, "EPSG:{code}: {site:?}");
            }
        }
    }

    #[test]
    fn systems_come_from_the_text_of_prj_files() {
        let globe = r#"GEOGCS["GCS_ETRS_1989",DATUM["D_ETRS_1989",SPHEROID["GRS_1980",6378137.0,298.257222101]],PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]]"#;
        let map = |unit: &str| {
            let plane = r#"PROJECTION["Transverse_Mercator"],PARAMETER["False_Easting",500000.0],PARAMETER["False_Northing",0.0],PARAMETER["Central_Meridian",9.0],PARAMETER["Scale_Factor",0.9996],PARAMETER["Latitude_Of_Origin",0.0]"#;
            ["PROJCS[\"ETRS_1989_UTM_Zone_32N\"", globe, plane, unit].join(",")
        };
        let own = Crs::from_wkt(&map(r#"UNIT["Meter",1.0]]"#)).expect("a system");
        let code = Crs::from_epsg(25_832).expect("a code");
        let place = [691_184.2, 5_335_055.3];
        assert_eq!(own.site(place), code.site(place));
        assert_eq!(
            (own.metres(), &*own.name()),
            (Some(1.0), "ETRS_1989_UTM_Zone_32N")
        );
        let ends = [
            r#"UNIT["metre",1,AUTHORITY["EPSG","9001"]],AUTHORITY["EPSG","25832"]]"#,
            r#"UNIT["metre",1],ID["EPSG",25832]]"#,
        ];
        assert!(
            ends.iter()
                .all(|end| Crs::from_wkt(&map(end)) == Some(code.clone()))
        );
        let unit = Crs::from_wkt(&map(r#"UNIT["metre",1,AUTHORITY["EPSG","9001"]]]"#));
        assert_eq!(unit.expect("a system").epsg(), None);
        let feet = Crs::from_wkt(&map(r#"UNIT["Foot_US",0.3048006096012192]]"#)).expect("a system");
        assert!((feet.metres().expect("a unit") - US_FOOT).abs() < 1e-12);
        assert!(Crs::from_wkt(globe).expect("degrees").is_geographic());
        assert_eq!(Crs::from_wkt("a map"), None);
    }

    #[test]
    fn lengths_of_web_mercator_are_refused_away_from_the_equator() {
        let web = Crs::from_epsg(3857).expect("a code");
        let munich = web.site([1_288_000.0, 6_130_000.0]).expect("a place");
        let scale = munich.stretch().expect("a stretch");
        assert!(
            (scale * munich.latitude.to_radians().cos() - 1.0).abs() < 4e-3,
            "{scale}"
        );
        assert_eq!(munich.utm(), "EPSG:32632");
        assert_eq!(
            web.site([4_000_000.0, -100_000.0])
                .expect("a place")
                .stretch(),
            None
        );
        assert_eq!(utm(-33.9, 151.2), "EPSG:32756");
        assert_eq!(utm(40.0, -105.3), "EPSG:32613");
        assert_eq!(utm(-85.0, 0.0), "EPSG:32761");
    }

    #[test]
    fn unknown_systems_and_places_beyond_them_have_no_site() {
        assert_eq!(Crs::default().site([0.0; 2]), None);
        let utm = Crs::from_epsg(25_832).expect("a code");
        assert_eq!(utm.site([1e12, 1e12]), None);
        assert_eq!(utm.site([f64::NAN, 0.0]), None);
        let mut feet = utm.clone();
        feet.directory[3] += 1;
        feet.directory.extend([LINEAR_UNIT, 0, 1, 9002]);
        assert_eq!(feet.site([691_184.0, 5_335_055.0]), None);
        let near = utm.site([691_184.0, 5_335_055.0]).expect("a place");
        assert!((near.north + 1.91).abs() < 0.01, "{near:?}");
        assert!((near.kilometres(near.latitude + 0.45, near.longitude) - 50.0).abs() < 0.1);
    }
}
