//! Where things stand on the page: a title, the labels of the columns, the labels of the rows, the cells.

use super::axis::Axis;
use super::label::{self, Style};
use crate::args::Size;

/// Pixels between things.
const MARGIN: u32 = 12;
const GAP: u32 = 6;
/// Lines a label may have.
const LABEL_LINES: usize = 4;
const PAPER: u8 = 255;
const INK: u8 = 24;

/// Where everything goes, pixels from the upper left corner.
pub(crate) struct Layout {
    pub(crate) width: u32,
    pub(crate) height: u32,
    cell: Size,
    style: Style,
    title: Vec<String>,
    columns: Vec<Vec<String>>,
    rows: Vec<Vec<String>>,
    left: u32,
    top: u32,
}

impl Layout {
    /// A page for cells of one size; `None` when it would be larger than any picture.
    pub(crate) fn new(title: &str, rows: &Axis, columns: &Axis, cell: Size) -> Option<Self> {
        let style = Style::for_cells(cell.width);
        let labels = |axis: &Axis, most| -> Vec<Vec<String>> {
            axis.entries.iter().map(|e| label::wrap(&e.label, style, most, LABEL_LINES)).collect()
        };
        let column_labels = labels(columns, cell.width);
        let row_labels = labels(rows, cell.width.clamp(120, 260));
        let widest = row_labels.iter().flatten().map(|l| label::width(l, style)).max().unwrap_or(0);
        let left = if widest == 0 { MARGIN } else { MARGIN + widest + GAP };
        let across = |n: usize, side: u32| u32::try_from(n).ok()?.checked_mul(side.checked_add(GAP)?);
        let width = left.checked_add(across(columns.entries.len(), cell.width)?)?.checked_sub(GAP)?.checked_add(MARGIN)?;
        let title = label::wrap(title, style.bold(), width - 2 * MARGIN, 3);
        let line = style.line_height();
        let title_height = if title.is_empty() { 0 } else { title.len() as u32 * line + GAP };
        let label_height = column_labels.iter().map(Vec::len).max().unwrap_or(0) as u32 * line;
        let top = MARGIN + title_height + label_height + if label_height > 0 { 2 } else { 0 };
        let height = top.checked_add(across(rows.entries.len(), cell.height)?)?.checked_sub(GAP)?.checked_add(MARGIN)?;
        let most = radiosa::film::Film::MAX_SIDE;
        let layout = Self { width, height, cell, style, title, columns: column_labels, rows: row_labels, left, top };
        (width <= most && height <= most).then_some(layout)
    }

    /// The upper left corner of a cell.
    pub(crate) fn corner(&self, row: usize, column: usize) -> (u32, u32) {
        (self.left + column as u32 * (self.cell.width + GAP), self.top + row as u32 * (self.cell.height + GAP))
    }

    /// The page with everything but the cells.
    pub(crate) fn page(&self) -> Page {
        let mut page = Page::new(self.width, self.height);
        let line = self.style.line_height();
        for (i, text) in self.title.iter().enumerate() {
            let bold = self.style.bold();
            label::draw(&mut page, text, bold, (self.width - label::width(text, bold)) / 2, MARGIN - 4 + i as u32 * line);
        }
        for (column, lines) in self.columns.iter().enumerate() {
            let (x, top) = self.corner(0, column);
            for (i, text) in lines.iter().enumerate() {
                // They stand on the cell, however many lines others have.
                let y = top - 2 - (lines.len() - i) as u32 * line;
                label::draw(&mut page, text, self.style, x + (self.cell.width - label::width(text, self.style)) / 2, y);
            }
        }
        for (row, lines) in self.rows.iter().enumerate() {
            let (x, top) = self.corner(row, 0);
            // In the middle of the row, and within the page where a cell is lower than its label.
            let y = (top + self.cell.height / 2).saturating_sub(lines.len() as u32 * line / 2);
            for (i, text) in lines.iter().enumerate() {
                label::draw(&mut page, text, self.style, x - GAP - label::width(text, self.style), y + i as u32 * line);
            }
        }
        page
    }
}

/// Paper: RGB bytes, row-major from the top left.
pub(crate) struct Page {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) rgb: Vec<u8>,
}

impl Page {
    /// A blank one.
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self { width, height, rgb: vec![PAPER; 3 * width as usize * height as usize] }
    }

    /// Darkens a pixel; nothing where there is no page.
    pub(crate) fn ink(&mut self, x: u32, y: u32, ink: u8) {
        if x < self.width && y < self.height {
            let at = 3 * (y as usize * self.width as usize + x as usize);
            for v in &mut self.rgb[at..at + 3] {
                let (old, ink) = (u32::from(*v), u32::from(ink));
                *v = ((old * (255 - ink) + u32::from(INK) * ink + 127) / 255) as u8;
            }
        }
    }

    /// Puts a picture of RGB bytes, `width` pixels across, where its upper left corner is given.
    pub(crate) fn paste(&mut self, (x, y): (u32, u32), width: u32, rgb: &[u8]) {
        for (row, line) in rgb.chunks_exact(3 * width as usize).enumerate() {
            let at = 3 * ((y as usize + row) * self.width as usize + x as usize);
            self.rgb[at..at + line.len()].copy_from_slice(line);
        }
    }
}
