//! What the input says, and arrays that it fills.

/// What the input says, byte by byte; zeros when it has said everything.
pub struct Script<'a>(pub &'a [u8]);

/// Numbers that are worth a byte.
const TELLING: [f32; 8] = [
    0.0,
    f32::NAN,
    f32::INFINITY,
    f32::MAX,
    1e-45,
    1e-15,
    1e15,
    -0.0,
];

impl Script<'_> {
    pub fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    pub fn below(&mut self, end: u8) -> usize {
        usize::from(self.byte() % end)
    }

    /// True for one byte among `of`.
    pub fn rarely(&mut self, of: u8) -> bool {
        self.byte() % of == of - 1
    }

    pub fn number(&mut self) -> f32 {
        match self.byte() {
            kind @ 0..8 => TELLING[usize::from(kind)],
            value => (f32::from(value) - 132.0) / 16.0,
        }
    }

    /// An index that is now and then too large.
    pub fn index(&mut self, count: usize) -> u32 {
        match self.rarely(64) {
            true => u32::MAX,
            false => u32::from(self.byte()) % count.max(1) as u32,
        }
    }
}

/// An array that ends with its last item, at any alignment that is a multiple of 4 bytes, so that a sanitizer sees who goes on.
pub struct Array {
    bytes: Vec<u8>,
    skipped: usize,
    pub stride: usize,
}

impl Array {
    /// `width` words of 4 bytes for each of `count` items, made by a function of the place of a word.
    pub fn new(
        script: &mut Script,
        count: usize,
        width: usize,
        mut word: impl FnMut(&mut Script) -> u32,
    ) -> Self {
        let stride = match script.below(8) {
            0 => 4 * width + 4 * script.below(4),
            1 => 4 * width + script.below(8),
            2 if script.rarely(8) => script.below(12),
            _ => 0,
        };
        let step = if stride == 0 { 4 * width } else { stride };
        let skipped = 4 * script.below(3);
        let length = count
            .checked_sub(1)
            .map_or(0, |last| last * step + 4 * width);
        let mut bytes = vec![0u8; skipped + length];
        for item in 0..count {
            for place in 0..width {
                let first = skipped + item * step + 4 * place;
                bytes[first..first + 4].copy_from_slice(&word(script).to_ne_bytes());
            }
        }
        bytes.shrink_to_fit();
        Self {
            bytes,
            skipped,
            stride,
        }
    }

    pub fn numbers(script: &mut Script, count: usize, width: usize) -> Self {
        Self::new(script, count, width, |script| script.number().to_bits())
    }

    pub fn first<T>(&self) -> *const T {
        self.bytes[self.skipped..].as_ptr().cast()
    }

    pub fn words(&self) -> *const f32 {
        self.first()
    }
}
