//! Pictures in false colours: the picture, and beside it a legend.

use std::path::Path;

use radiosa::export::{ExportError, image};
use radiosa::film::Film;
use radiosa::film::false_color::{Palette, Scale};

use crate::args::{self, FalseColor, ScaleKind};
use crate::render::output::draw_lines;
use crate::sheet::label::{self, Style};
use crate::sheet::page::Page;

/// Pixels: around everything, the bar of colours and the strokes beside it.
const MARGIN: u32 = 12;
const BAR: u32 = 20;
const STROKE: u32 = 5;
/// The legend has at least this height.
const LEAST: u32 = 160;

/// Values to be shown, row by row from the top left; NaN where there is nothing.
pub(crate) struct Values {
    pub(crate) values: Vec<f64>,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Pixels a value takes along either side.
    pub(crate) zoom: u32,
    /// What they are, for the legend.
    pub(crate) unit: String,
    /// How much of each value lines cover, where some are to be drawn over them.
    pub(crate) lines: Option<Vec<f32>>,
}

impl Values {
    /// The luminance of a film, nothing where it shows no surface.
    pub(crate) fn of(film: &Film, unit: String) -> Self {
        let alpha = film.plane("A");
        let width = film.width();
        let at = |i: u32| match alpha {
            Some(alpha) if alpha[i as usize] > 0.0 => f64::from(film.color(i % width, i / width).luminance()),
            _ => f64::NAN,
        };
        Self { values: (0..film.n_pixels() as u32).map(at).collect(), width, height: film.height(), zoom: 1, unit, lines: None }
    }
}

/// Writes values with their legend.
///
/// # Errors
/// When the file cannot be written.
pub(crate) fn write(shown: &Values, options: &FalseColor, path: &Path, recipe: &image::Recipe) -> Result<(), ExportError> {
    let is_logarithmic = options.color_scale == ScaleKind::Log;
    let palette = match options.false_color {
        Some(args::Palette::Cividis) => Palette::Cividis,
        _ => Palette::Viridis,
    };
    let mut scale = Scale::of(shown.values.iter().copied(), is_logarithmic);
    if let Some((low, high)) = options.color_range {
        scale = Scale { low: if is_logarithmic { low.max(high * 1e-9) } else { low }, high, is_logarithmic };
    }
    let zoom = shown.zoom.max(1) as usize;
    let (width, height) = (shown.width as usize * zoom, shown.height as usize * zoom);
    let zoomed: Vec<f64> =
        (0..width * height).map(|i| shown.values[i / width / zoom * shown.width as usize + i % width / zoom]).collect();
    let mut picture = scale.paint(&zoomed, width, palette, options.contours);
    if let Some(lines) = &shown.lines {
        draw_lines(&mut picture, lines);
    }
    let beyond = shown.values.iter().any(|v| *v > scale.high);
    let page = page((width as u32, height as u32), &picture, (&scale, beyond), palette, options.contours, &shown.unit);
    image::write_rgb8(path, page.width, page.height, &page.rgb, recipe)
}

/// The picture and the legend to its right.
fn page(
    (width, height): (u32, u32),
    picture: &[u8],
    (scale, beyond): (&Scale, bool),
    palette: Palette,
    contours: u32,
    unit: &str,
) -> Page {
    let style = Style::for_cells(140);
    // What lies beyond the scale has its last colour.
    let beyond = |v: f64| if beyond && v >= scale.high * (1.0 - 1e-9) { "+" } else { "" };
    let ticks: Vec<(f64, String)> = scale.ticks().into_iter().map(|v| (v, number(v) + beyond(v))).collect();
    let line = style.line_height();
    let words = ticks.iter().map(|(_, text)| label::width(text, style)).max().unwrap_or(0);
    let side = (BAR + 2 * STROKE + words).max(label::width(unit, style));
    let mut page = Page::new(width + 3 * MARGIN + side, height.max(LEAST) + 2 * MARGIN);
    page.paste((MARGIN, MARGIN), width, picture);
    let x = width + 2 * MARGIN;
    label::draw(&mut page, unit, style, x, MARGIN);
    let (top, bottom) = (MARGIN + line + line / 2, page.height - MARGIN - line / 2);
    let n = bottom - top;
    let value = |t: f64| {
        if scale.is_logarithmic { scale.low * (scale.high / scale.low).powf(t) } else { scale.low + t * (scale.high - scale.low) }
    };
    let column: Vec<f64> = (0..n).map(|k| value(1.0 - (f64::from(k) + 0.5) / f64::from(n))).collect();
    let bar: Vec<f64> = column.iter().flat_map(|v| [*v; BAR as usize]).collect();
    page.paste((x, top), BAR, &scale.paint(&bar, BAR as usize, palette, contours));
    let mut free = u32::MAX;
    for (v, text) in &ticks {
        let y = top + ((1.0 - scale.position(*v)) * f64::from(n - 1)).round() as u32;
        (0..STROKE).for_each(|k| page.ink(x + BAR + k, y, 255));
        // Words need room of their own; they come from below.
        if y + line / 2 <= free {
            label::draw(&mut page, text, style, x + BAR + 2 * STROKE, y.saturating_sub(line / 2));
            free = y.saturating_sub(line / 2);
        }
    }
    page
}

/// A round number as one writes it.
fn number(v: f64) -> String {
    if v != 0.0 && !(1e-4..1e7).contains(&v.abs()) {
        return format!("{v:e}");
    }
    let text = format!("{v:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_short() {
        assert_eq!([0.0, 0.5, 200.0, 1e-7, 2e9, 0.0005].map(number), ["0", "0.5", "200", "1e-7", "2e9", "0.0005"]);
    }
}
