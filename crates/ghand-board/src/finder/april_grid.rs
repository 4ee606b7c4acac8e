//! Finds Kalibr's AprilGrids, whole or in part: corners where the tags and the small squares between them meet, then tags
//! with their codes between four corners, then the corners of tags that were not read.

use calib_targets_aruco::{MarkerCell, MarkerDetection, Matcher, ScanDecodeConfig, scan_decode_markers_in_cells};
use calib_targets_charuco::ChessCorner;
use calib_targets_chessboard::{GrayImageView, detect_corners};
use glam::DVec2;
use image::GrayImage;
use image::imageops::{FilterType, resize};

use super::quads::quads;
use super::{Sight, corner_search, pixel};
use crate::calibration::homography::homography;
use crate::kind::{BORDER, Tags};
use crate::{BoardKind, SeenCorner};

/// Images of fewer pixels are searched again at twice their size unless most tags are read: the detector looks five pixels
/// around a corner, and the small squares may be smaller.
const SMALL: usize = 1_000_000;
/// Tags that must be read where the board has them; and as many that it does not have are another board's.
const LEAST_TAGS: usize = 2;
/// Wrong cells with which a tag is read. Tags of this family differ in 11.
const MOST_WRONG: u8 = 2;
/// A tag is sampled as if its side had so many pixels.
const SAMPLED_SIDE: f32 = 60.0;
/// Tags around one that tell where it must be.
const AROUND: usize = 4;
/// How far corners may be from where the tags around tell, relative to the side of a tag: lenses distort.
const MOST_OFF: f64 = 0.15;
/// A corner of a tag that was not read is nearer than this to where it must be, relative to the side of a tag.
const MOST_OFF_ALONE: f64 = 0.08;

pub(super) struct AprilGridFinder {
    kind: BoardKind,
    matcher: Matcher,
    search: ScanDecodeConfig,
}

/// A tag that was read.
struct Tag {
    number: usize,
    /// Corners clockwise from the top left of the upright tag, pixels.
    corners: [DVec2; 4],
}

impl Tag {
    fn middle(&self) -> DVec2 {
        self.corners.iter().sum::<DVec2>() / 4.0
    }

    /// The shortest edge, pixels.
    fn side(&self) -> f64 {
        (0..4).map(|k| self.corners[k].distance(self.corners[(k + 1) % 4])).fold(f64::INFINITY, f64::min)
    }
}

impl AprilGridFinder {
    pub(super) fn new(kind: &BoardKind, tags: &Tags) -> AprilGridFinder {
        let search = ScanDecodeConfig::default().with_border_bits(BORDER).with_inset_frac(0.0);
        AprilGridFinder { kind: *kind, matcher: Matcher::new(tags.dictionary, MOST_WRONG), search }
    }

    pub(super) fn find(&self, image: &GrayImageView) -> Sight {
        let first = self.find_at_size(image);
        let wanted = self.kind.corner_count() * 3 / 4;
        let is_found = matches!(&first, Sight::Board(corners) if corners.len() >= wanted);
        if is_found || image.width * image.height >= SMALL {
            return first;
        }
        let (width, height) = (image.width as u32, image.height as u32);
        let Some(small) = GrayImage::from_raw(width, height, image.data.to_vec()) else { return first };
        let large = resize(&small, 2 * width, 2 * height, FilterType::Triangle);
        let view = GrayImageView { width: 2 * image.width, height: 2 * image.height, data: large.as_raw() };
        match (self.find_at_size(&view), first) {
            (Sight::Board(corners), Sight::Board(first)) if corners.len() <= first.len() => Sight::Board(first),
            (Sight::Board(corners), _) => {
                let half = |corner: SeenCorner| SeenCorner { pixel: 0.5 * corner.pixel, ..corner };
                Sight::Board(corners.into_iter().map(half).collect())
            }
            (_, first @ Sight::Board(_)) | (Sight::Nothing, first) => first,
            (second, _) => second,
        }
    }

    fn find_at_size(&self, image: &GrayImageView) -> Sight {
        let found = detect_corners(image, &corner_search());
        let tags = self.tags(image, &found);
        let [across, down] = self.kind.tag_counts();
        let placed: Vec<&Tag> = tags.iter().filter(|tag| self.is_placed(tag, &tags)).collect();
        let beyond = tags.iter().filter(|tag| tag.number >= across * down).count();
        if placed.len() < LEAST_TAGS || beyond >= LEAST_TAGS || 2 * placed.len() < tags.len() {
            return layout(&tags).map_or(Sight::Nothing, |[across, down]| Sight::Other([2 * across, 2 * down]));
        }
        let mut corners = vec![None; self.kind.corner_count()];
        for tag in &placed {
            for (number, pixel) in self.numbers(tag.number).into_iter().zip(tag.corners) {
                corners[number] = Some(pixel);
            }
        }
        let unread = (0..across * down).filter(|number| placed.iter().all(|tag| tag.number != *number));
        for tag in unread {
            for (number, pixel) in self.unread_corners(tag, &placed, &found) {
                corners[number] = Some(pixel);
            }
        }
        let seen =
            corners.into_iter().enumerate().filter_map(|(number, pixel)| Some(SeenCorner { number, pixel: pixel? }));
        Sight::Board(seen.collect())
    }

    /// Tags that are read between four corners.
    fn tags(&self, image: &GrayImageView, found: &[ChessCorner]) -> Vec<Tag> {
        let cells: Vec<MarkerCell> = quads(found)
            .into_iter()
            .map(|quad| MarkerCell::new(Default::default(), quad.map(|corner| found[corner].position)))
            .collect();
        let read = scan_decode_markers_in_cells(image, &cells, SAMPLED_SIDE, &self.search, &self.matcher);
        let tag = |read: MarkerDetection| {
            let corners = read.corners_img.filter(|_| !read.inverted)?;
            // The dictionary's tags are upside down, and seen turned to the right by so many quarters.
            let first = read.rotation as usize + 2;
            Some(Tag { number: read.id as usize, corners: [0, 1, 2, 3].map(|k| pixel(corners[(first + k) % 4])) })
        };
        read.into_iter().filter_map(tag).collect()
    }

    /// Numbers of a tag's corners, clockwise from its top left.
    fn numbers(&self, tag: usize) -> [usize; 4] {
        let [columns, _] = self.kind.corners();
        let [across, _] = self.kind.tag_counts();
        let below = 2 * (tag / across) * columns + 2 * (tag % across);
        [below + columns, below + columns + 1, below + 1, below]
    }

    /// Places of a tag's corners on the board, sides of a tag.
    fn places(&self, tag: usize) -> [DVec2; 4] {
        self.numbers(tag).map(|number| self.kind.corner(number).truncate() / self.kind.side())
    }

    /// Whether a tag is the board's, and where the nearest others tell.
    fn is_placed(&self, tag: &Tag, all: &[Tag]) -> bool {
        let [across, down] = self.kind.tag_counts();
        let count = across * down;
        if tag.number >= count {
            return false;
        }
        let others: Vec<&Tag> = all.iter().filter(|other| other.number != tag.number && other.number < count).collect();
        let near = nearest(others, tag.middle());
        let own = near.iter().copied().chain([tag]);
        let places: Vec<DVec2> = own.clone().flat_map(|tag| self.places(tag.number)).collect();
        let pixels: Vec<DVec2> = own.flat_map(|tag| tag.corners).collect();
        let Some(map) = homography(&places, &pixels) else { return false };
        let off = |(place, pixel): (&DVec2, &DVec2)| mapped(map, *place).distance(*pixel);
        places.iter().zip(&pixels).map(off).fold(0.0, f64::max) < MOST_OFF * tag.side()
    }

    /// Corners of a tag that was not read, by those around it.
    fn unread_corners(&self, tag: usize, placed: &[&Tag], found: &[ChessCorner]) -> Vec<(usize, DVec2)> {
        let middle = self.places(tag).iter().sum::<DVec2>() / 4.0;
        let far = |other: &&&Tag| {
            let place = self.places(other.number).iter().sum::<DVec2>() / 4.0;
            place.distance(middle)
        };
        let mut near: Vec<&&Tag> = placed.iter().collect();
        near.sort_by(|a, b| far(a).total_cmp(&far(b)));
        near.truncate(AROUND);
        let places: Vec<DVec2> = near.iter().flat_map(|tag| self.places(tag.number)).collect();
        let pixels: Vec<DVec2> = near.iter().flat_map(|tag| tag.corners).collect();
        let Some(map) = homography(&places, &pixels) else { return vec![] };
        let side = near.iter().map(|tag| tag.side()).fold(f64::INFINITY, f64::min);
        let corner = |(number, place): (usize, DVec2)| {
            let wanted = mapped(map, place);
            let distance = |corner: &ChessCorner| pixel(corner.position).distance(wanted);
            let nearest = found.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            (distance(nearest) < MOST_OFF_ALONE * side).then(|| (number, pixel(nearest.position)))
        };
        self.numbers(tag).into_iter().zip(self.places(tag)).filter_map(corner).collect()
    }
}

/// Those nearest to a pixel.
fn nearest(mut tags: Vec<&Tag>, pixel: DVec2) -> Vec<&Tag> {
    tags.sort_by(|a, b| a.middle().distance(pixel).total_cmp(&b.middle().distance(pixel)));
    tags.truncate(AROUND);
    tags
}

/// How many tags the board of these has at least, across and down: those above each other tell how many are in a row.
fn layout(tags: &[Tag]) -> Option<[usize; 2]> {
    let mut steps = vec![];
    for tag in tags {
        let [top_left, _, _, bottom_left] = tag.corners;
        let up = top_left - bottom_left;
        for other in tags.iter().filter(|other| other.number > tag.number) {
            let off = (other.middle() - tag.middle()) / up.length();
            let along = off.dot(up.normalize_or_zero());
            // In the next row, in the same column.
            if (1.0..1.9).contains(&along) && off.perp_dot(up.normalize_or_zero()).abs() < 0.5 {
                steps.push(other.number - tag.number);
            }
        }
    }
    steps.sort_unstable();
    let across = *steps.get(steps.len() / 2)?;
    let most = tags.iter().map(|tag| tag.number).max()?;
    Some([across, most / across.max(1) + 1])
}

fn mapped(map: glam::DMat3, place: DVec2) -> DVec2 {
    let at = map * place.extend(1.0);
    at.truncate() / at.z
}
