//! Where on the earth a scene is, by its coordinate system, beside what the command line says.

use antumbra_bake::{Orientation, UpAxis};
use antumbra_load::{Extent, Loaded};
use antumbra_raster::{Crs, Site, unit_name};

use super::map;
use crate::args::{NorthArgs, PlaceArgs, RasterArgs, UnitArgs};
use crate::exit::{Failure, say, tell};

/// Degrees that grid north may differ from what the command line says.
const MOST_TURNED: f64 = 0.1;

/// Coordinates within so many units of 0 are of a drawing, and not of a map. No system has land there that is built on.
const NEAR: f64 = 10_000.0;

/// Flags that a coordinate system may answer.
pub struct Asked<'a> {
    /// `--crs`.
    pub crs: Option<&'a Crs>,
    pub units: Option<&'a UnitArgs>,
    pub north: Option<&'a NorthArgs>,
}

impl<'a> Asked<'a> {
    /// The flags of a command that places sensors.
    pub fn new(raster: &'a RasterArgs, places: &'a PlaceArgs) -> Self {
        Self {
            crs: raster.crs.as_ref(),
            units: Some(&places.units),
            north: Some(&places.north),
        }
    }

    /// The place of a scene that was read and is so large. Settles unit and north.
    pub fn of(
        &self,
        (loaded, extent): (&Loaded, Option<Extent>),
        up: UpAxis,
    ) -> Result<Option<Site>, Failure> {
        let raster = loaded.raster.as_ref();
        let own = raster.and_then(|raster| raster.grid.crs.as_ref());
        let middle = extent.map(|all| all.low.midpoint(all.high));
        let plan = Orientation::new(up, 0.0).map_err(Failure::usage)?;
        let middle = plan.local(middle.unwrap_or_default().to_array());
        self.settle(&loaded.scene.name, own, middle)
    }

    /// The place of a scene whose middle is known, to the east, to the north and up.
    pub fn settle(
        &self,
        name: &str,
        own: Option<&Crs>,
        [x, y, _]: [f64; 3],
    ) -> Result<Option<Site>, Failure> {
        let Some(crs) = self.crs.or(own) else {
            return Ok(None);
        };
        if let (Some(asked), Some(own)) = (self.crs.and_then(Crs::epsg), own.and_then(Crs::epsg))
            && asked != own
        {
            say(format_args!(
                "warning: {name}: it is in EPSG:{own}, and --crs says EPSG:{asked}, which is taken"
            ));
        }
        if let (Some(metres), Some(units)) = (crs.metres(), self.units) {
            let asked = units.settle(metres);
            if own.is_some() && (asked / metres - 1.0).abs() > 1e-5 {
                say(format_args!(
                    "warning: {name}: coordinates in {} are in {}, and --units says {}, which is taken",
                    crs.name(),
                    unit_name(metres),
                    unit_name(asked)
                ));
            }
        }
        let scale = match own {
            Some(_) => 1.0,
            None => self.units.map_or(1.0, UnitArgs::metres) / crs.metres().unwrap_or(1.0),
        };
        let middle = [scale * x, scale * y];
        let is_drawing = own.is_none() && middle.iter().all(|x| x.abs() < NEAR);
        let Some(site) = crs.site(middle).filter(|_| !is_drawing) else {
            let why = match is_drawing {
                true => "its coordinates are near 0 0, which is no place in",
                false => "the place on the earth is not known in",
            };
            tell(format_args!("{name}: {why} {}", crs.name()));
            return Ok(None);
        };
        if let Some(scale) = site.stretch() {
            return Err(Failure::Usage(format!(
                "--crs: lengths in {} are {scale:.3} times as long as on the ground at {:.2} degrees of latitude; give coordinates in \
                 a system such as {}",
                crs.name(),
                site.latitude,
                site.utm()
            )));
        }
        let side = if site.north < 0.0 { "west" } else { "east" };
        tell(format_args!(
            "{name}: at {} by {}; true north is {:.2} degrees {side} of grid north",
            map::place(site.latitude, site.longitude),
            crs.name(),
            site.north.abs()
        ));
        self.settle_north(name, crs, &site);
        Ok(Some(site))
    }

    /// Grid north follows from the place, unless it is given.
    fn settle_north(&self, name: &str, crs: &Crs, site: &Site) {
        if let Some(north) = self.north {
            let asked = north.settle(site.north);
            let apart = (asked - site.north + 180.0).rem_euclid(360.0) - 180.0;
            if apart.abs() > MOST_TURNED {
                say(format_args!(
                    "warning: {name}: true north is {:.2} degrees from grid north in {}, and --north says {asked}, which is taken",
                    site.north,
                    crs.name()
                ));
            }
        }
    }
}
