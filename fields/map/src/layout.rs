//! Where the parts of a map are.

/// Places of the parts, in pixels. Legend, arrow and scale bar are beside the map or below it, wherever the map gets larger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Layout {
    /// Height of an em of ordinary text.
    pub em: f32,
    /// Edges of the block of all parts.
    pub left: f32,
    pub right: f32,
    pub title_base: f32,
    pub subtitle_base: f32,
    pub source_base: f32,
    /// Corner and size of the map, whole pixels.
    pub map_at: [f32; 2],
    pub map_size: [f32; 2],
    /// Whether the legend is beside the map, with large values at the top. Otherwise it is below.
    pub is_upright: bool,
    /// Corner of the legend, length of its bar with both tips, and room for its name.
    pub legend_at: [f32; 2],
    pub legend_length: f32,
    pub legend_room: f32,
    /// Corner of the scale bar, and largest length.
    pub scale_at: [f32; 2],
    pub scale_room: f32,
    /// Middle of the top of the north arrow.
    pub arrow_at: [f32; 2],
}

impl Layout {
    /// Sizes of text in em.
    pub const TITLE: f32 = 1.75;
    pub const SOURCE: f32 = 0.78;

    /// Lengths in em: edge of the sheet, title and line below it, source line, gap beside the map, and the parts beside and
    /// below it.
    const EDGE: f32 = 1.8;
    const HEAD: f32 = 4.1;
    const FOOT: f32 = 1.7;
    const GAP: f32 = 1.3;
    const BESIDE: f32 = 10.5;
    const BELOW: f32 = 5.2;

    /// The layout of a sheet for a map with this ratio of width to height.
    pub fn new(size: [u32; 2], aspect: f32) -> Self {
        let [width, height] = size.map(|side| side as f32);
        let em = ((width * height).sqrt() / 78.0).max(8.0);
        let inner = width - 2.0 * Self::EDGE * em;
        let room = height - (2.0 * Self::EDGE + Self::HEAD + Self::FOOT) * em;
        let fitted = |[width, height]: [f32; 2]| {
            let high = (width / aspect).min(height).max(1.0);
            [(high * aspect).floor().max(1.0), high.floor()]
        };
        let beside = fitted([inner - (Self::GAP + Self::BESIDE) * em, room]);
        let below = fitted([inner, room - (Self::GAP + Self::BELOW) * em]);
        let is_upright = beside[0] >= below[0];
        let map_size = if is_upright { beside } else { below };

        // The block of all parts is in the middle of the sheet. It is never too narrow for text.
        let mut block = match is_upright {
            true => map_size[0] + (Self::GAP + Self::BESIDE) * em,
            false => map_size[0],
        };
        block = block.max((40.0 * em).min(inner));
        let left = ((width - block) / 2.0).floor();
        let top = (Self::EDGE + Self::HEAD) * em;
        let used = match is_upright {
            true => map_size[1],
            false => map_size[1] + (Self::GAP + Self::BELOW) * em,
        };
        let spare = (room - used).max(0.0);
        let map_at = [left, (top + 0.5 * spare).floor()];
        let head = map_at[1] - Self::HEAD * em;
        let end = [map_at[0] + map_size[0], map_at[1] + map_size[1]];
        let mut layout = Self {
            em,
            left,
            right: left + block,
            title_base: head + 1.45 * em,
            subtitle_base: head + 3.1 * em,
            source_base: height - Self::EDGE * em,
            map_at,
            map_size,
            is_upright,
            legend_at: [end[0] + Self::GAP * em, map_at[1]],
            legend_length: 0.0,
            legend_room: Self::BESIDE * em,
            scale_at: [end[0] + Self::GAP * em, end[1] - 1.65 * em],
            scale_room: 0.8 * Self::BESIDE * em,
            arrow_at: [end[0] + (Self::GAP + 0.8) * em, end[1] - 5.9 * em],
        };
        if is_upright {
            // The name of the values takes up to four lines above the bar.
            let name = 5.4 * em;
            let free = map_size[1] - name - 6.9 * em;
            layout.legend_length = free.clamp(5.0 * em, 22.0 * em);
        } else {
            let y = end[1] + Self::GAP * em;
            layout.legend_at = [left, y];
            layout.legend_length = (0.5 * block).min(30.0 * em);
            layout.legend_room = layout.legend_length;
            layout.scale_room = (0.25 * block).min(12.0 * em);
            layout.scale_at = [layout.right - layout.scale_room - 3.0 * em, y + 1.6 * em];
            layout.arrow_at = [layout.right - 0.8 * em, y];
        }
        layout
    }

    /// A size in pixels for a map with this ratio of width to height.
    pub fn usual_size(aspect: f32) -> [u32; 2] {
        let fill = |size: [u32; 2]| {
            let layout = Self::new(size, aspect);
            layout.map_size[0] * layout.map_size[1] / (size[0] as f32 * size[1] as f32)
        };
        // From upright to wide, all with as many pixels.
        let sizes = (0..=40).map(|i| {
            let ratio = 0.6 * (2.6_f32 / 0.6).powf(i as f32 / 40.0);
            let width = (1600.0 * (ratio * 3.0 / 4.0).sqrt() / 10.0).round() as u32 * 10;
            [width, (width as f32 / ratio / 10.0).round() as u32 * 10]
        });
        sizes
            .max_by(|a, b| fill(*a).total_cmp(&fill(*b)))
            .unwrap_or([1600, 1200])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_is_on_the_sheet() {
        for size in [
            [320, 320],
            [640, 480],
            [1600, 1200],
            [800, 2400],
            [3000, 600],
        ] {
            for aspect in [0.1, 0.5, 1.0, 2.0, 10.0] {
                let layout = Layout::new(size, aspect);
                let [width, height] = size.map(|side| side as f32);
                let inside = |[x, y]: [f32; 2]| {
                    assert!(
                        x >= 0.0 && x <= width && y >= 0.0 && y <= height,
                        "{x}, {y}: {size:?}, {aspect}: {layout:?}"
                    );
                };
                let [at, map] = [layout.map_at, layout.map_size];
                inside(at);
                inside([at[0] + map[0], at[1] + map[1]]);
                inside([layout.scale_at[0] + layout.scale_room, layout.scale_at[1]]);
                inside(layout.arrow_at);
                inside(layout.legend_at);
                assert!(layout.right <= width && layout.left >= 0.0);
                let ratio = map[0] / map[1] / aspect;
                let slack = 1.0 + 1.5 / map[0].min(map[1]);
                assert!(
                    ratio < slack && ratio > 1.0 / slack,
                    "{size:?}, {aspect}: {map:?}"
                );
            }
        }
    }

    #[test]
    fn usual_sizes_are_full() {
        for aspect in [0.5, 1.0, 1.6, 3.0] {
            let size = Layout::usual_size(aspect);
            let layout = Layout::new(size, aspect);
            let share = layout.map_size[0] * layout.map_size[1] / (size[0] * size[1]) as f32;
            assert!(share > 0.55, "{aspect}: {size:?}, {share}");
        }
    }
}
