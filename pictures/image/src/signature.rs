//! The mark of this program in the pictures that it writes, by which its own files are recognised.
//!
//! An EXR file has the attribute `software`, a PNG file the text `Software`, and a Radiance HDR file the variable
//! `SOFTWARE`. None changes a pixel.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Name of the program as it is written in pictures. Without a version, so that equal pictures are equal files.
pub(crate) const SOFTWARE: &str = "antumbra";

/// Bytes at the beginning of a picture that may hold the mark.
const SEARCHED: u64 = 4096;

/// Whether a file is a picture that this program wrote: an EXR, PNG or HDR file with its mark.
///
/// # Errors
/// The file cannot be read.
pub fn is_our_picture(path: impl AsRef<Path>) -> io::Result<bool> {
    let mut head = Vec::new();
    File::open(path)?.take(SEARCHED).read_to_end(&mut head)?;
    Ok(has_mark(&head))
}

fn has_mark(head: &[u8]) -> bool {
    let mark = if head.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        let mut mark = b"software\0string\0".to_vec();
        mark.extend((SOFTWARE.len() as u32).to_le_bytes());
        mark
    } else if head.starts_with(b"\x89PNG\r\n\x1a\n") {
        b"tEXtSoftware\0".to_vec()
    } else if head.starts_with(b"#?RADIANCE\n") {
        b"\nSOFTWARE=".to_vec()
    } else {
        return false;
    };
    let mark = [&mark, SOFTWARE.as_bytes()].concat();
    head.windows(mark.len()).any(|bytes| bytes == mark)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Image, Window, atomic_write};

    #[test]
    fn pictures_of_this_program_are_known() {
        let folder = tempfile::tempdir().expect("a folder");
        let image = Image::new(2, 1, Window::full(2, 1), vec![[0.5; 3]; 2]).expect("an image");
        for name in ["a.exr", "a.png", "a.hdr"] {
            let path = folder.path().join(name);
            image.write(&path).expect("a file");
            assert!(is_our_picture(&path).expect("a file"), "{name}");
            let mut bytes = std::fs::read(&path).expect("a file");
            let at = bytes.windows(8).position(|word| word == b"antumbra");
            bytes[at.expect("a mark")] = b'A';
            atomic_write(&path, |file| file.write_all(&bytes)).expect("a file");
            assert!(!is_our_picture(&path).expect("a file"), "{name}");
        }
        let path = folder.path().join("empty.png");
        std::fs::write(&path, "").expect("a file");
        assert!(!is_our_picture(&path).expect("a file"));
    }
}
