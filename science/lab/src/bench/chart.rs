//! A bar chart of a benchmark: for every scene the speed of our queries, relative to Embree's single-ray
//! calls if there are any.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::engine::Query;
use super::record::{Document, KINDS, Row, distinct};

/// Pixels of a bar, of the gap between scenes, of the margins, and of a panel's height.
const BAR: u32 = 18;
const GAP: u32 = 34;
const SIDES: u32 = 110;
const PANEL: u32 = 320;
const HEADING: i32 = 30;
const LEGEND_BELOW: u32 = 34;

/// Hues of the kinds of rays; single rays are paler than batches.
const HUES: [RGBColor; 3] = [
    RGBColor(96, 125, 139),
    RGBColor(21, 101, 192),
    RGBColor(216, 107, 0),
];
const APIS: [(&str, f64); 2] = [("single", 0.45), ("batch", 1.0)];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The chart as SVG. It shows one configuration of ours: the first level, number of threads, width, and the last order.
///
/// # Errors
/// Message of the drawing library.
pub fn draw(document: &Document) -> Result<String, String> {
    let mut rows = document.rows.clone();
    rows.extend(document.means());
    let Some(shown) = configuration(document) else {
        return Err("there is nothing to draw".into());
    };
    rows.retain(|row| {
        row.label().tree == shown.label().tree
            && row.level == shown.level
            && row.threads == shown.threads
    });
    let scenes = distinct(rows.iter().map(|row| row.scene.clone()));
    let bars = (KINDS.len() * APIS.len()) as u32;
    let width = (SIDES + scenes.len() as u32 * (bars * BAR + GAP)).max(720);
    let height = 2 * PANEL + LEGEND_BELOW;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area();
        let failed = |error: &dyn std::fmt::Display| format!("cannot draw the chart: {error}");
        root.fill(&WHITE).map_err(|error| failed(&error))?;
        let (panels, below) = root.split_vertically(2 * PANEL);
        for (panel, query) in panels.split_evenly((2, 1)).iter().zip(Query::ALL) {
            let found: Vec<&Row> = rows
                .iter()
                .filter(|row| row.query == query.name())
                .collect();
            draw_panel(panel, &caption(&shown, query), &scenes, &found)
                .map_err(|error| failed(&error))?;
        }
        draw_legend(&below).map_err(|error| failed(&error))?;
        root.present().map_err(|error| failed(&error))?;
    }
    Ok(svg)
}

/// A row of ours of the configuration to be shown.
fn configuration(document: &Document) -> Option<Row> {
    let ours = || document.rows.iter().filter(|row| row.engine == "antumbra");
    let first = ours().next()?;
    let mut alike = ours().filter(|row| {
        let choices = |row: &Row| (row.level.clone(), row.threads, row.width);
        choices(row) == choices(first)
    });
    alike.next_back().cloned()
}

fn caption(shown: &Row, query: Query) -> String {
    let plural = if shown.threads == 1 { "" } else { "s" };
    let unit = match (shown.ratio_to_embree, query) {
        (None, _) => "millions of rays per second".to_owned(),
        (Some(_), Query::Occluded) => "speed relative to rtcOccluded1".to_owned(),
        (Some(_), Query::Intersect) => "speed relative to rtcIntersect1".to_owned(),
    };
    format!(
        "{query}: {unit} ({}, width {}, order {}, {} thread{plural})",
        shown.level,
        shown.width.unwrap_or_default(),
        shown.order.unwrap_or_default(),
        shown.threads,
    )
}

/// Length of a bar.
fn value(row: &Row) -> f64 {
    row.ratio_to_embree.unwrap_or(row.mrays_per_s)
}

fn draw_panel(
    area: &Area,
    caption: &str,
    scenes: &[String],
    rows: &[&Row],
) -> Result<(), Box<dyn std::error::Error>> {
    let bars = (KINDS.len() * APIS.len()) as f64;
    let gap = f64::from(GAP) / f64::from(BAR);
    let group = bars + gap;
    let highest = rows.iter().map(|row| value(row)).fold(1.0, f64::max);
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(HEADING)
        .y_label_area_size(48)
        .build_cartesian_2d(0.0..group * scenes.len() as f64, 0.0..highest * 1.12)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_labels(0)
        .light_line_style(TRANSPARENT)
        .y_label_style(("sans-serif", 12))
        .draw()?;
    let small = ("sans-serif", 10).into_font().color(&BLACK);
    let small = small.pos(Pos::new(HPos::Center, VPos::Bottom));
    let large = ("sans-serif", 13).into_font().color(&BLACK);
    let large = large.pos(Pos::new(HPos::Center, VPos::Top));
    for (place, scene) in scenes.iter().enumerate() {
        let left = group * place as f64 + 0.5 * gap;
        for (kind, hue) in KINDS.into_iter().zip(HUES) {
            for (api, strength) in APIS {
                let bar = 2 * KINDS.iter().position(|&other| other == kind).unwrap_or(0)
                    + usize::from(api == "batch");
                let mut rows = rows.iter();
                let Some(row) =
                    rows.find(|row| row.scene == *scene && row.rays == kind && row.api == api)
                else {
                    continue;
                };
                let (x, y) = (left + bar as f64, value(row));
                let corners = [(x + 0.06, 0.0), (x + 0.94, y)];
                chart.draw_series([Rectangle::new(corners, hue.mix(strength).filled())])?;
                let text = if y < 9.95 {
                    format!("{y:.1}")
                } else {
                    format!("{y:.0}")
                };
                chart.draw_series([Text::new(text, (x + 0.5, y), small.clone())])?;
            }
        }
        let below = chart.backend_coord(&(left + 0.5 * bars, 0.0));
        let (origin_x, origin_y) = area.get_base_pixel();
        let below = (below.0 - origin_x, below.1 - origin_y + 8);
        area.draw_text(scene, &large, below)?;
    }
    if rows.iter().any(|row| row.ratio_to_embree.is_some()) {
        let line = [(0.0, 1.0), (group * scenes.len() as f64, 1.0)];
        chart.draw_series([PathElement::new(line, BLACK.stroke_width(1))])?;
    }
    Ok(())
}

fn draw_legend(area: &Area) -> Result<(), Box<dyn std::error::Error>> {
    let style = ("sans-serif", 13).into_font().color(&BLACK);
    let mut x = 60;
    for (kind, hue) in KINDS.into_iter().zip(HUES) {
        for (api, strength) in APIS {
            let square = [(x, 10), (x + 12, 22)];
            area.draw(&Rectangle::new(square, hue.mix(strength).filled()))?;
            area.draw_text(&format!("{kind} {api}"), &style, (x + 18, 10))?;
            x += 108;
        }
    }
    Ok(())
}
