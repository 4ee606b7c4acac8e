//! Lays pictures out with their titles, and figures under headings.

use ghand_pictures::plot::label;
use image::imageops::replace;
use image::{Rgb, RgbImage};

/// Colours of the page and its text.
const PAPER: [u8; 3] = [255; 3];
const INK: [u8; 3] = [40, 40, 46];
const FAINT: [u8; 3] = [105, 105, 112];
/// Heights of text, pixels.
const TITLE: f64 = 30.0;
const HEADING: f64 = 24.0;
const CAPTION: f64 = 17.0;
const SMALL: f64 = 14.0;
/// Height of a line of a height of text.
const SPACING: f64 = 1.45;
/// Space around figures, pixels.
const MARGIN: u32 = 20;
/// Figures fill about this width, pixels.
const WIDTH: u32 = 2000;

/// A picture with a line above.
pub struct Cell {
    /// The line.
    pub title: String,
    /// The picture.
    pub picture: RgbImage,
}

/// A figure, which is a file of its own.
pub struct Figure {
    /// Name of its file.
    pub file: String,
    /// The picture.
    pub picture: RgbImage,
}

/// Figures under a heading.
pub struct Section {
    /// The heading.
    pub heading: String,
    /// Lines below it.
    pub text: Vec<String>,
    /// The figures.
    pub figures: Vec<Figure>,
}

fn line(height: f64) -> u32 {
    (height * SPACING).round() as u32
}

fn blank(width: u32, height: u32) -> RgbImage {
    RgbImage::from_pixel(width.max(1), height.max(1), Rgb(PAPER))
}

fn put(page: &mut RgbImage, picture: &RgbImage, [x, y]: [u32; 2]) {
    replace(page, picture, i64::from(x), i64::from(y));
}

fn write(page: &mut RgbImage, [x, y]: [u32; 2], height: f64, color: [u8; 3], text: &str) {
    label(page, [x as i32, y as i32], height, Rgb(color), text);
}

/// Rows of cells of one size under a title, with a legend at the right, whose height is that of a cell.
pub fn figure(title: &str, rows: &[Vec<Cell>], legend: impl FnOnce(u32) -> Option<RgbImage>) -> RgbImage {
    let cells = || rows.iter().flatten();
    let cell_width = cells().map(|cell| cell.picture.width()).max().unwrap_or(1);
    let cell_height = cells().map(|cell| cell.picture.height()).max().unwrap_or(1);
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let legend = legend(cell_height);
    let legend_width = legend.as_ref().map_or(0, RgbImage::width);
    let top = line(CAPTION) + 4;
    let row_height = line(SMALL) + cell_height + 4;
    let mut page = blank(columns * cell_width + legend_width, top + rows.len() as u32 * row_height);
    write(&mut page, [0, 0], CAPTION, INK, title);
    for (y, row) in (0..).zip(rows) {
        for (x, cell) in (0..).zip(row) {
            let place = [x * cell_width, top + y * row_height];
            write(&mut page, [place[0] + 4, place[1]], SMALL, FAINT, &cell.title);
            put(&mut page, &cell.picture, [place[0], place[1] + line(SMALL)]);
        }
    }
    if let Some(legend) = legend {
        put(&mut page, &legend, [columns * cell_width, top + line(SMALL)]);
    }
    page
}

/// A picture with space around it.
pub fn framed(picture: &RgbImage) -> RgbImage {
    let mut page = blank(picture.width() + 2 * MARGIN, picture.height() + 2 * MARGIN);
    put(&mut page, picture, [MARGIN; 2]);
    page
}

/// Pictures side by side.
pub fn beside(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(|picture| picture.width() + MARGIN).sum::<u32>().saturating_sub(MARGIN);
    let mut page = blank(width, pictures.iter().map(RgbImage::height).max().unwrap_or(1));
    let mut x = 0;
    for picture in pictures {
        put(&mut page, picture, [x, 0]);
        x += picture.width() + MARGIN;
    }
    page
}

/// All sections, one below the other.
pub fn sheet(title: &str, sections: &[Section]) -> RgbImage {
    let blocks: Vec<RgbImage> = sections.iter().map(section).collect();
    let widest = blocks.iter().map(RgbImage::width).max().unwrap_or(1);
    let top = MARGIN + line(TITLE) + MARGIN;
    let height = top + blocks.iter().map(|block| block.height() + MARGIN).sum::<u32>();
    let mut page = blank(widest + 2 * MARGIN, height);
    write(&mut page, [MARGIN, MARGIN], TITLE, INK, title);
    let mut y = top;
    for block in &blocks {
        put(&mut page, block, [MARGIN, y]);
        y += block.height() + MARGIN;
    }
    page
}

/// The heading, the text, and the figures in rows.
fn section(section: &Section) -> RgbImage {
    let mut rows: Vec<Vec<&RgbImage>> = vec![];
    let mut used = u32::MAX;
    for picture in section.figures.iter().map(|figure| &figure.picture) {
        match rows.last_mut() {
            Some(row) if used.saturating_add(picture.width()) <= WIDTH => row.push(picture),
            _ => {
                rows.push(vec![picture]);
                used = 0;
            }
        }
        used += picture.width() + MARGIN;
    }
    let row_height = |row: &Vec<&RgbImage>| row.iter().map(|picture| picture.height()).max().unwrap_or(0) + MARGIN;
    let text_height = line(HEADING) + section.text.len() as u32 * line(CAPTION) + MARGIN;
    let mut page = blank(WIDTH, text_height + rows.iter().map(row_height).sum::<u32>());
    // A line above sets the sections apart.
    (0..WIDTH).for_each(|x| page.put_pixel(x, 0, Rgb([200, 200, 206])));
    write(&mut page, [0, 8], HEADING, INK, &section.heading);
    for (k, text) in (0..).zip(&section.text) {
        write(&mut page, [0, 8 + line(HEADING) + k * line(CAPTION)], CAPTION, FAINT, text);
    }
    let mut y = text_height;
    for row in &rows {
        let mut x = 0;
        for picture in row {
            put(&mut page, picture, [x, y]);
            x += picture.width() + MARGIN;
        }
        y += row_height(row);
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_fill_rows_and_do_not_touch() {
        let colored =
            |color: [u8; 3]| Figure { file: String::new(), picture: RgbImage::from_pixel(700, 90, Rgb(color)) };
        let figures = vec![colored([1, 0, 0]), colored([0, 1, 0]), colored([0, 0, 1]), colored([2, 0, 0])];
        let sections = [Section { heading: "One".into(), text: vec!["line".into()], figures }];
        let page = sheet("Title", &sections);
        assert_eq!(page.width(), WIDTH + 2 * MARGIN);
        for color in [[1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0]] {
            assert_eq!(page.pixels().filter(|p| p.0 == color).count(), 700 * 90);
        }
        let empty = Section { heading: "None".into(), text: vec![], figures: vec![] };
        assert!(sheet("", &[empty]).height() < 200);
    }

    #[test]
    fn the_legend_of_a_figure_is_as_high_as_its_cells() {
        let cell = || Cell { title: "a".into(), picture: RgbImage::new(50, 80) };
        let page = figure("t", &[vec![cell(), cell()], vec![cell()]], |height| Some(blank(30, height)));
        assert_eq!(page.width(), 130);
        assert!(page.height() > 2 * 80 && page.height() < 2 * 80 + 100);
    }
}
