//! PNG files made without a library: stored, not compressed.

/// Bytes of a PNG file of 8-bit values, row by row. `channels` is 1 (grey), 2 (grey, alpha), 3 or 4 (red, green, blue,
/// alpha).
///
/// # Panics
/// If there are not `width * height * channels` values.
pub fn png(width: u32, height: u32, channels: u8, values: &[u8]) -> Vec<u8> {
    let row = width as usize * usize::from(channels);
    assert_eq!(values.len(), row * height as usize, "values");
    let color = [0, 4, 2, 6][usize::from(channels) - 1];
    let mut raw = Vec::new();
    for row in values.chunks(row) {
        raw.push(0);
        raw.extend(row);
    }
    let mut data = vec![0x78, 0x01];
    let count = raw.chunks(65535).count();
    for (index, block) in raw.chunks(65535).enumerate() {
        let length = block.len() as u16;
        data.push(u8::from(index + 1 == count));
        data.extend(length.to_le_bytes());
        data.extend((!length).to_le_bytes());
        data.extend(block);
    }
    let (mut a, mut b) = (1_u32, 0_u32);
    for &byte in &raw {
        a = (a + u32::from(byte)) % 65521;
        b = (b + a) % 65521;
    }
    data.extend((b << 16 | a).to_be_bytes());
    let mut header = Vec::new();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, color, 0, 0, 0]);
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for (kind, data) in [(b"IHDR", header), (b"IDAT", data), (b"IEND", Vec::new())] {
        bytes.extend((data.len() as u32).to_be_bytes());
        let chunk = [&kind[..], &data].concat();
        bytes.extend(&chunk);
        bytes.extend(crc(&chunk).to_be_bytes());
    }
    bytes
}

/// CRC-32 of PNG (ISO 3309).
fn crc(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 {
                crc >> 1 ^ 0xedb8_8320
            } else {
                crc >> 1
            };
        }
    }
    !crc
}

/// PNG file of `pixel(x, y)`, with alpha.
pub fn painted(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let values: Vec<u8> = places.flat_map(|(x, y)| pixel(x, y)).collect();
    png(width, height, 4, &values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_the_standard() {
        assert_eq!(crc(b"123456789"), 0xcbf4_3926);
        assert!(png(1, 1, 1, &[7]).ends_with(b"IEND\xaeB`\x82"));
    }
}
