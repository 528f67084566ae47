//! Files with tables of scattering (.bsdf), as layerlab writes them for pbrt-v3. A file that is named several times is read once.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `SCATFUN` and 1 |
//! | 9 x 4 | whole numbers: 1, cosines, coefficients, longest series, channels, 1, three that are left out |
//! | 5 x 4 | index of refraction, four numbers that are left out |
//! | 4 per cosine | cosines |
//! | 4 per pair of cosines | integrals |
//! | 8 per pair of cosines | place and length of the series |
//! | 4 per coefficient | coefficients |
//! | any | left out |
//!
//! All numbers are little-endian.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use antumbra_scene::FourierTable;

use crate::source::{Sources, read_regular_file};

/// Bytes in front of the cosines.
const HEAD: usize = 8 + 9 * 4 + 5 * 4;

/// Tables read so far, or why not.
#[derive(Default)]
pub(crate) struct Tables {
    by_path: HashMap<PathBuf, Result<Arc<FourierTable>, String>>,
    bytes: u64,
}

impl Tables {
    /// The table of a file. All of them together take no more memory than the texts of a scene may.
    pub fn read(&mut self, name: &str, sources: &mut Sources) -> Result<Arc<FourierTable>, String> {
        let path = sources.folder.join(name);
        if let Some(known) = self.by_path.get(&path) {
            return known.clone();
        }
        let allowed = sources.limit.saturating_sub(self.bytes);
        let table = read_regular_file(&path, allowed)
            .map_err(|error| error.to_string())
            .and_then(|bytes| {
                self.bytes += bytes.len() as u64;
                parse(name, &bytes)
            });
        sources.note(path.clone());
        let table = table.map(Arc::new);
        self.by_path.insert(path, table.clone());
        table
    }
}

/// Reads a file in memory.
fn parse(name: &str, bytes: &[u8]) -> Result<FourierTable, String> {
    let found = bytes.len();
    let Some((head, mut rest)) = bytes.split_at_checked(HEAD) else {
        return Err(format!("the file has {found} bytes, too few for its head"));
    };
    if head[..8] != *b"SCATFUN\x01" {
        return Err("the file does not begin as a table of scattering".into());
    }
    let word = |index: usize| -> [u8; 4] {
        let place = 8 + 4 * index;
        [0, 1, 2, 3].map(|byte| head[place + byte])
    };
    let number = |index| i32::from_le_bytes(word(index));
    let [flags, cosines, coefficients, _, channels, bases] = [0, 1, 2, 3, 4, 5].map(number);
    if flags != 1 || bases != 1 {
        return Err(format!(
            "flags {flags} and {bases} bases are not supported; pbrt-v3 reads flags 1 and 1 basis"
        ));
    }
    let count = |what: &str, number: i32| {
        u64::try_from(number).map_err(|_| format!("the file has {number} {what}"))
    };
    let (cosines, coefficients) = (
        count("cosines", cosines)?,
        count("coefficients", coefficients)?,
    );
    let pairs = cosines * cosines;
    let expected = pairs
        .checked_mul(12)
        .and_then(|all| all.checked_add(4 * (cosines + coefficients)));
    // What follows says how the table was made.
    if expected.is_none_or(|expected| expected > rest.len() as u64) {
        return Err(format!(
            "the file has {found} bytes, too few for {cosines} cosines and {coefficients} coefficients"
        ));
    }
    let mut words = |count: u64| -> Vec<[u8; 4]> {
        // The file has as many.
        let (taken, left) = rest.split_at(4 * count as usize);
        rest = left;
        let (words, _) = taken.as_chunks::<4>();
        words.to_vec()
    };
    let floats = |words: Vec<[u8; 4]>| words.into_iter().map(f32::from_le_bytes).collect();
    let table = FourierTable {
        name: name.to_owned(),
        eta: f32::from_le_bytes(word(9)),
        channels: count("channels", channels)? as u32,
        cosines: floats(words(cosines)),
        integrals: floats(words(pairs)),
        series: (words(2 * pairs).chunks_exact(2))
            .map(|pair| [pair[0], pair[1]].map(u32::from_le_bytes))
            .collect(),
        coefficients: floats(words(coefficients)),
    };
    table.check()?;
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cosines, and one coefficient for each pair.
    fn file() -> Vec<u8> {
        let mut bytes = b"SCATFUN\x01".to_vec();
        for number in [1, 2, 4, 1, 1, 1, 0, 0, 0] {
            bytes.extend(i32::to_le_bytes(number));
        }
        let floats = |bytes: &mut Vec<u8>, floats: &[f32]| {
            bytes.extend(floats.iter().flat_map(|x| x.to_le_bytes()));
        };
        floats(&mut bytes, &[1.5, 0.0, 0.0, 0.0, 0.0]);
        floats(&mut bytes, &[-1.0, 1.0]);
        floats(&mut bytes, &[0.0, 0.4, 0.0, 0.6]);
        for place in 0..4_u32 {
            bytes.extend([place, 1].into_iter().flat_map(u32::to_le_bytes));
        }
        floats(&mut bytes, &[0.1, 0.3, 0.2, 0.4]);
        bytes
    }

    #[test]
    fn a_table_is_what_the_file_says() {
        let table = parse("t.bsdf", &file()).expect("a table");
        assert_eq!((table.eta, table.channels), (1.5, 1));
        assert_eq!(table.cosines, [-1.0, 1.0]);
        assert_eq!(table.series[2], [2, 1]);
        assert_eq!(table.coefficients, [0.1, 0.3, 0.2, 0.4]);
    }

    #[test]
    fn broken_files_are_refused() {
        let good = file();
        for len in 0..good.len() {
            assert!(parse("t", &good[..len]).is_err(), "{len}");
        }
        let with = |place: usize, value: [u8; 4]| {
            let mut bytes = good.clone();
            bytes[place..place + 4].copy_from_slice(&value);
            parse("t", &bytes).expect_err("it is broken")
        };
        assert!(with(8, 2_i32.to_le_bytes()).contains("flags 2"));
        assert!(with(12, (-2_i32).to_le_bytes()).contains("-2 cosines"));
        assert!(with(12, i32::MAX.to_le_bytes()).contains("too few"));
        assert!(with(24, 2_i32.to_le_bytes()).contains("2 channels"));
        assert!(with(44, f32::NAN.to_le_bytes()).contains("refraction"));
        assert!(with(64, 1.5_f32.to_le_bytes()).contains("ascend"));
        assert!(with(72, f32::INFINITY.to_le_bytes()).contains("finite"));
        assert!(with(92, 9_u32.to_le_bytes()).contains("ends behind"));
    }
}
