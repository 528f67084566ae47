//! Plots as SVG that take their text colour from the page, so that they can be read on any background.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::Error;

/// Colours of series, none of them too light or too dark for a background.
const HUES: [RGBColor; 9] = [
    RGBColor(0x1f, 0x7a, 0xc4),
    RGBColor(0xdf, 0x7a, 0x1c),
    RGBColor(0x2f, 0x9e, 0x6e),
    RGBColor(0xc2, 0x41, 0x7c),
    RGBColor(0x8a, 0x63, 0xd2),
    RGBColor(0xb8, 0x95, 0x1d),
    RGBColor(0x1a, 0x9a, 0xa8),
    RGBColor(0xb4, 0x4a, 0x3c),
    RGBColor(0x80, 0x87, 0x92),
];

const WIDTH: u32 = 660;
/// Height of a line of a plot with names on its left, and of everything around the lines.
const LINE: u32 = 28;
const AROUND: u32 = 60;
const FONT: (&str, u32) = ("sans-serif", 15);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;
type NamedLines<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// A value on a line with a name.
pub struct Dot {
    pub line: usize,
    pub series: usize,
    pub value: f64,
    /// Large and solid.
    pub bold: bool,
}

/// Values on lines with names: which of many is where.
pub struct Dots {
    pub lines: Vec<String>,
    pub series: Vec<String>,
    pub dots: Vec<Dot>,
    pub axis: String,
    /// Whether the axis begins at 0.
    pub from_zero: bool,
    /// A value that is marked on the whole height, and its name.
    pub mark: Option<(f64, String)>,
}

/// Points in the plane, perhaps joined by lines.
pub struct Points {
    pub series: Vec<(String, Vec<(f64, f64)>)>,
    pub axes: [String; 2],
    pub joined: bool,
    /// Whether the x axis is logarithmic.
    pub logarithmic: bool,
    /// Offset and slope of a line to be drawn.
    pub fit: Option<[f64; 2]>,
}

/// Parts that add up, on lines with names.
pub struct Stacks {
    pub lines: Vec<(String, Vec<f64>)>,
    pub parts: Vec<String>,
    pub axis: String,
}

/// The colour of a series as the page writes it.
fn hue(series: usize) -> RGBColor {
    HUES[series % HUES.len()]
}

/// Draws below a legend, with a height of its own, and makes the result fit the page.
fn svg(height: u32, names: &[String], draw: impl FnOnce(&Area) -> Drawn) -> Result<String, Error> {
    let (places, legend) = legend_places(names);
    let height = height + legend;
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
        let whole = || -> Drawn {
            let (above, below) = root.split_vertically(legend);
            let style = FONT.into_font().color(&BLACK);
            for (series, (name, (x, y))) in names.iter().zip(places).enumerate() {
                let square = [(x, y + 3), (x + 11, y + 14)];
                above.draw(&Rectangle::new(square, hue(series).filled()))?;
                above.draw_text(name, &style, (x + 17, y))?;
            }
            draw(&below)?;
            Ok(root.present()?)
        };
        whole().map_err(|error| Error::report(format!("cannot draw a plot: {error}")))?;
    }
    // The size is the page's business; black is the colour of its text.
    let size = format!("width=\"{WIDTH}\" height=\"{height}\" ");
    let text = text.replacen(&size, "role=\"img\" ", 1);
    Ok(text.replace("#000000", "currentColor"))
}

/// The least and the largest value with some room around them.
fn range(values: impl Iterator<Item = f64>, from_zero: bool) -> std::ops::Range<f64> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for value in values.filter(|value| value.is_finite()) {
        low = low.min(value);
        high = high.max(value);
    }
    if low > high {
        return 0.0..1.0;
    }
    if from_zero {
        (low, high) = (low.min(0.0), high.max(0.0));
    }
    let room = 0.05 * (high - low).max(1e-3 * high.abs()).max(1e-9);
    let low = if from_zero && low == 0.0 {
        0.0
    } else {
        low - room
    };
    low..high + room
}

/// Where the names of a legend are, and its height; none of less than two names.
fn legend_places(names: &[String]) -> (Vec<(i32, i32)>, u32) {
    if names.len() < 2 {
        return (Vec::new(), 0);
    }
    let (mut x, mut y) = (8, 0);
    let mut places = Vec::new();
    for name in names {
        let width = 30 + 8 * name.chars().count() as i32;
        if x + width > WIDTH as i32 && x > 8 {
            x = 8;
            y += 20;
        }
        places.push((x, y));
        x += width;
    }
    (places, y as u32 + 26)
}

fn room_for(names: impl Iterator<Item = usize>) -> u32 {
    (8 * names.max().unwrap_or(0) as u32 + 18).clamp(48, 280)
}

fn faint() -> ShapeStyle {
    BLACK.mix(0.13).stroke_width(1)
}

impl Dots {
    /// Node tests per ray.
    pub fn tests(lines: Vec<String>, series: Vec<String>, dots: Vec<Dot>) -> Self {
        Self {
            lines,
            series,
            dots,
            axis: "node tests per ray".into(),
            from_zero: false,
            mark: None,
        }
    }

    /// Draws them.
    pub fn draw(&self) -> Result<String, Error> {
        let height = LINE * self.lines.len() as u32 + AROUND;
        svg(height, &self.series, |area| {
            let values = self.dots.iter().map(|dot| dot.value);
            let marked = self.mark.iter().map(|(value, _)| *value);
            let x = range(values.chain(marked), self.from_zero);
            let lines = self.lines.len() as f64;
            let names: Vec<_> = self.lines.iter().map(String::as_str).collect();
            let mut chart = named_lines(area, &names, x.clone(), &self.axis)?;
            for line in 0..self.lines.len() {
                let y = line as f64 + 0.5;
                chart.draw_series([PathElement::new([(x.start, y), (x.end, y)], faint())])?;
            }
            if let Some((value, name)) = &self.mark {
                let line = [(*value, 0.0), (*value, lines)];
                chart.draw_series([PathElement::new(line, BLACK.mix(0.5).stroke_width(1))])?;
                let place = Pos::new(HPos::Left, VPos::Bottom);
                let style = ("sans-serif", 13).into_font().color(&BLACK).pos(place);
                chart.draw_series([Text::new(format!(" {name}"), (*value, 0.28), style)])?;
            }
            for bold in [false, true] {
                let dots = self.dots.iter().filter(|dot| dot.bold == bold);
                let (size, strength) = if bold { (6, 1.0) } else { (4, 0.5) };
                chart.draw_series(dots.map(|dot| {
                    let style = hue(dot.series).mix(strength).filled();
                    Circle::new((dot.value, dot.line as f64 + 0.5), size, style)
                }))?;
            }
            Ok(())
        })
    }
}

/// A chart whose y axis counts lines from the top, with their names on the left.
fn named_lines<'a, 'b>(
    area: &'a Area<'b>,
    names: &[&str],
    x: Range<f64>,
    axis: &str,
) -> Result<NamedLines<'a, 'b>, Box<dyn std::error::Error>> {
    let start = x.start;
    let mut chart = ChartBuilder::on(area)
        .margin_right(18)
        .margin_top(8)
        .x_label_area_size(AROUND - 8)
        .y_label_area_size(room_for(names.iter().map(|name| name.chars().count())))
        .build_cartesian_2d(x, names.len() as f64..0.0)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .y_labels(0)
        .x_labels(7)
        .x_desc(axis)
        .bold_line_style(faint())
        .light_line_style(TRANSPARENT)
        .axis_style(TRANSPARENT)
        .label_style(FONT)
        .draw()?;
    let style = FONT.into_font().color(&BLACK);
    let style = style.pos(Pos::new(HPos::Right, VPos::Center));
    let (origin_x, origin_y) = area.get_base_pixel();
    for (line, name) in names.iter().enumerate() {
        let (x, y) = chart.backend_coord(&(start, line as f64 + 0.5));
        area.draw_text(name, &style, (x - origin_x - 8, y - origin_y))?;
    }
    Ok(chart)
}

impl Points {
    const HEIGHT: u32 = 330;

    /// Draws them.
    pub fn draw(&self) -> Result<String, Error> {
        let names: Vec<String> = self.series.iter().map(|(name, _)| name.clone()).collect();
        let all = || {
            self.series
                .iter()
                .flat_map(|(_, points)| points.iter().copied())
        };
        let x = range(all().map(|(x, _)| x), false);
        let y = range(all().map(|(_, y)| y), false);
        svg(Self::HEIGHT, &names, |area| {
            let mut builder = ChartBuilder::on(area);
            builder
                .margin_right(18)
                .margin_top(8)
                .x_label_area_size(50)
                .y_label_area_size(68);
            if self.logarithmic {
                // Without any point both ends are 1: the axis must not begin or end at infinity.
                let ends = all().fold([f64::INFINITY, 0.0], |[low, high], (x, _)| {
                    [low.min(x), high.max(x)]
                });
                let [low, high] = ends.map(|end| if end.is_finite() { end.max(1e-9) } else { 1.0 });
                let range = (low / 1.3..low.max(high) * 1.3).log_scale();
                self.fill(builder.build_cartesian_2d(range, y)?)
            } else {
                self.fill(builder.build_cartesian_2d(x, y)?)
            }
        })
    }

    fn fill<X>(
        &self,
        mut chart: ChartContext<'_, SVGBackend<'_>, Cartesian2d<X, RangedCoordf64>>,
    ) -> Drawn
    where
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        chart
            .configure_mesh()
            .x_desc(&*self.axes[0])
            .y_desc(&*self.axes[1])
            .x_labels(7)
            .y_labels(6)
            .bold_line_style(faint())
            .light_line_style(TRANSPARENT)
            .axis_style(BLACK.mix(0.4))
            .label_style(FONT)
            .draw()?;
        if let Some([offset, slope]) = self.fit {
            let all = || self.series.iter().flat_map(|(_, points)| points);
            let least = all().map(|point| point.0).fold(f64::INFINITY, f64::min);
            let most = all().map(|point| point.0).fold(f64::NEG_INFINITY, f64::max);
            if least <= most {
                let line = [least, most].map(|x| (x, offset + slope * x));
                chart.draw_series([PathElement::new(line, BLACK.mix(0.45).stroke_width(1))])?;
            }
        }
        for (series, (_, points)) in self.series.iter().enumerate() {
            let strength = if self.joined { 1.0 } else { 0.6 };
            let style = hue(series).mix(strength);
            if self.joined {
                chart.draw_series([PathElement::new(points.clone(), style.stroke_width(2))])?;
            }
            let dots = points
                .iter()
                .map(|&point| Circle::new(point, 4, style.filled()));
            chart.draw_series(dots)?;
        }
        Ok(())
    }
}

impl Stacks {
    /// Draws them.
    pub fn draw(&self) -> Result<String, Error> {
        let height = LINE * self.lines.len() as u32 + AROUND;
        let longest = self.lines.iter().map(|(_, parts)| parts.iter().sum());
        let x = 0.0..longest.fold(0.0_f64, f64::max).max(1e-9) * 1.02;
        svg(height, &self.parts, |area| {
            let names: Vec<_> = self.lines.iter().map(|(name, _)| name.as_str()).collect();
            let mut chart = named_lines(area, &names, x.clone(), &self.axis)?;
            for (line, (_, parts)) in self.lines.iter().enumerate() {
                let mut start = 0.0;
                for (part, value) in parts.iter().enumerate() {
                    let top = line as f64 + 0.18;
                    let corners = [(start, top), (start + value, top + 0.64)];
                    chart.draw_series([Rectangle::new(corners, hue(part).filled())])?;
                    start += value;
                }
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(svg: &str) {
        assert!(
            svg.starts_with("<svg role=\"img\" viewBox="),
            "{}",
            &svg[..80]
        );
        assert!(svg.contains("currentColor") && !svg.contains("#000000"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }

    #[test]
    fn plots_of_nothing_and_of_one_value_are_drawn() {
        let names = |count: usize| {
            (0..count)
                .map(|i| format!("<name {i}>"))
                .collect::<Vec<_>>()
        };
        for count in [0, 1, 3] {
            let dot = |line| Dot {
                line,
                series: line,
                value: 2.0,
                bold: line == 1,
            };
            let dots = Dots {
                lines: names(count),
                series: names(count),
                dots: (0..count).map(dot).collect(),
                axis: "tests".into(),
                from_zero: count == 1,
                mark: (count > 1).then(|| (1.0, "oracle".into())),
            };
            let svg = dots.draw().expect("a plot");
            check(&svg);
            assert!(!svg.contains("<name"), "names are escaped");
            for (joined, logarithmic, fit) in [
                (false, false, Some([1.0, 1.0])),
                (true, true, None),
                (true, false, None),
            ] {
                let points = Points {
                    series: names(count)
                        .into_iter()
                        .map(|name| (name, vec![(3.0, 4.0); count]))
                        .collect(),
                    axes: ["x".into(), "y".into()],
                    joined,
                    logarithmic,
                    fit,
                };
                check(&points.draw().expect("a plot"));
            }
            let stacks = Stacks {
                lines: names(count)
                    .into_iter()
                    .map(|name| (name, vec![1.0; 3]))
                    .collect(),
                parts: names(3),
                axis: "seconds".into(),
            };
            check(&stacks.draw().expect("a plot"));
        }
    }
}
