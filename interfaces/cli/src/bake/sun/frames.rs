//! Moving shadows: `sun --frames`.

use std::path::{Path, PathBuf};

use antumbra_bake::{Hourly, Moment, SunFound, Sunlight};
use antumbra_image::atomic_write;
use antumbra_map::{Animation, Drawing, Steps};

use super::Baked;
use crate::bake::map;
use crate::exit::Failure;
use crate::interrupt;
use crate::output::{self, Files};

/// Most maps of a command. A day in steps of a minute has fewer.
const MOST: usize = 1500;

/// Classes of places, with quiet colours: most of a map is one of them.
const CLASSES: [(&str, [u8; 3]); 2] = [("shadow", [88, 98, 128]), ("sun", [250, 232, 176])];

/// Time that a map is shown.
const SECONDS: f32 = 0.2;

/// Whether a file of moving shadows is a .gif; otherwise maps are .png.
pub fn is_gif(path: &Path) -> Result<bool, Failure> {
    match ["gif", "png"].map(|known| output::is_one_of(path, &[known])) {
        [false, false] => Err(Failure::name(
            path,
            "moving shadows are written as gif or png",
        )),
        [is_gif, _] => Ok(is_gif),
    }
}

/// Name of a map among many.
fn numbered(path: &Path, number: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{number:04}.png"))
}

/// Steps of time with a sun, each of which has a map.
fn steps(hourly: &Hourly<'_>) -> Result<Vec<usize>, Failure> {
    let steps = (0..hourly.len()).filter(|&step| hourly.sun(step).is_some());
    let steps: Vec<usize> = steps.collect();
    if steps.is_empty() || steps.len() > MOST {
        let found = steps.len();
        let reason = format!(
            "--frames: {found} steps of time have a sun, wanted 1 to {MOST}; choose a day with --from and --to"
        );
        return Err(Failure::Usage(reason));
    }
    Ok(steps)
}

/// Notes the numbered files, and refuses times with no map or too many, before anything is computed.
pub fn declare(path: &Path, sunlight: &Sunlight, files: &mut Files) -> Result<(), Failure> {
    let count = steps(&Hourly::new(sunlight)?)?.len();
    if is_gif(path)? {
        return Ok(());
    }
    for number in 1..=count {
        let map = numbered(path, number);
        output::check_own(&map, "choose another name for --frames")?;
        files.writes("--frames", &map)?;
    }
    files.check()
}

impl Baked<'_> {
    /// Writes a map for each step of time with a sun: as a .gif, or as numbered .png files.
    pub fn frames(&self, path: &Path, found: &SunFound) -> Result<(), Failure> {
        let hourly = Hourly::new(self.sunlight)?;
        let suns = &self.sunlight.suns;
        let steps = steps(&hourly)?;
        let sheet = self.sheet()?;
        let draw = |step: usize| -> Result<Drawing, Failure> {
            let sun = hourly.sun(step).unwrap_or_default();
            let lit = (0..self.sensors.points.len()).map(|row| {
                let is_lit = found.suns_seen.get(row, sun);
                if is_lit { 1.0 } else { 0.0 }
            });
            let lit = self.of_cells(lit.collect());
            let begin = hourly.begin(step).unix(0.0);
            let middle = Moment::at_unix(begin + 1800.0 * suns.hours[sun], 0.0);
            let words = self.words(("Sunlight", ""), Some(map::moment(&middle)));
            sheet.draw(&words, &lit, Steps::classes(&CLASSES))
        };
        let mut animation = is_gif(path)?.then(|| Animation::new(SECONDS));
        for (index, &step) in steps.iter().enumerate() {
            interrupt::check()?;
            let pixels = draw(step)?.pixels().map_err(Failure::work)?;
            match &mut animation {
                Some(animation) => animation.add(&pixels).map_err(Failure::work)?,
                None => pixels.write(numbered(path, index + 1))?,
            }
        }
        let Some(animation) = animation else {
            return Ok(());
        };
        let bytes = animation.finish().map_err(Failure::work)?;
        Ok(atomic_write(path, |file| file.write_all(&bytes))?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_numbered_in_the_folder_of_the_name() {
        let name = numbered(Path::new("out/a.b.png"), 7);
        assert_eq!(name, Path::new("out/a.b-0007.png"));
        assert!(is_gif(Path::new("a.GIF")).expect("a format"));
        assert!(!is_gif(Path::new("a.png")).expect("a format"));
        assert!(is_gif(Path::new("a.mp4")).is_err());
    }
}
