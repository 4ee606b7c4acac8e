//! The images of a capture with their annotations, from `InterHand2.6M_{subset}_data.json`.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::path::Path;

use ghand_core::Side;
use serde::Deserialize;
use serde::de::MapAccess;

use super::annotations::REMEDY;
use crate::error::CaptureError;
use crate::reading::json_stream::{ForEach, Keys, Name, Numbers, Object, read_streaming, skip};
use crate::reading::validation::FileValidator;

/// Most images that are kept; the largest subset has 1.4 million in total.
const MOST_IMAGES: usize = 1 << 22;
/// Most names of sequences or cameras of a capture; there are a few hundred.
const MOST_NAMES: usize = 1 << 14;
/// Prefix of the ids of grey cameras.
const GREY: &str = "41";

/// One image with its annotation.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Image {
    /// Index into the wanted sequences.
    pub sequence: usize,
    /// Number of the frame.
    pub number: u64,
    /// Index into [`Images::cameras`].
    pub camera: usize,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// The hand that it shows, if it shows one.
    pub side: Option<Side>,
    /// The hand's box: x, y, width, height, pixels.
    pub bounds: Option<[f64; 4]>,
}

impl Image {
    /// Identifies its frame: sequence and number.
    pub fn frame(&self) -> (usize, u64) {
        (self.sequence, self.number)
    }
}

/// The images of colour cameras in the wanted sequences of a capture.
#[derive(Debug, Default)]
pub(crate) struct Images {
    /// The images, in the order of the file.
    pub all: Vec<Image>,
    /// Ids of the cameras.
    pub cameras: Vec<String>,
    /// Width and height of the first image of each camera.
    pub camera_sizes: Vec<[u32; 2]>,
    /// All sequences of the capture.
    pub sequences: BTreeSet<String>,
}

impl Images {
    /// The numbers of all frames.
    pub fn frame_numbers(&self) -> HashSet<u64> {
        self.all.iter().map(|image| image.number).collect()
    }
}

#[derive(Deserialize)]
struct ImageRecord {
    id: u64,
    width: u32,
    height: u32,
    capture: Name,
    seq_name: String,
    camera: Name,
    frame_idx: u64,
}

#[derive(Deserialize)]
struct AnnotationRecord {
    image_id: u64,
    bbox: Option<Numbers<4>>,
    hand_type: Option<String>,
}

/// The images of colour cameras in the given sequences of a capture.
pub(super) fn read_images(path: &Path, capture: &str, sequences: &[String]) -> Result<Images, CaptureError> {
    let mut reader = Reader::new(capture, sequences);
    read_streaming(path, Object(&mut reader), REMEDY)?;
    if reader.annotations_came_first {
        read_streaming(path, Object(&mut reader.again()), REMEDY)?;
    }
    if !reader.images_seen {
        return Err(FileValidator { path }.invalid("images", format!("is missing; {REMEDY}")));
    }
    Ok(reader.images)
}

struct Reader<'a> {
    capture: &'a str,
    wanted: HashMap<&'a str, usize>,
    images: Images,
    /// Index into the images by their id.
    by_id: HashMap<u64, usize>,
    camera_index: HashMap<String, usize>,
    pairs: HashSet<(u64, usize, usize)>,
    images_seen: bool,
    annotations_came_first: bool,
}

impl<'a> Reader<'a> {
    fn new(capture: &'a str, sequences: &'a [String]) -> Reader<'a> {
        Reader {
            capture,
            wanted: sequences.iter().enumerate().map(|(i, s)| (s.as_str(), i)).collect(),
            images: Images::default(),
            by_id: HashMap::new(),
            camera_index: HashMap::new(),
            pairs: HashSet::new(),
            images_seen: false,
            annotations_came_first: false,
        }
    }

    /// For a second pass over a file whose annotations precede their images.
    fn again(&mut self) -> AnnotationsOnly<'_, 'a> {
        AnnotationsOnly(self)
    }

    fn image(&mut self, record: ImageRecord) -> Result<(), String> {
        if record.capture.0 != self.capture {
            return Ok(());
        }
        if !self.images.sequences.contains(&record.seq_name) {
            if self.images.sequences.len() >= MOST_NAMES {
                return Err(format!("more than {MOST_NAMES} sequences"));
            }
            self.images.sequences.insert(record.seq_name.clone());
        }
        let Some(&sequence) = self.wanted.get(record.seq_name.as_str()) else { return Ok(()) };
        if record.camera.0.starts_with(GREY) {
            return Ok(());
        }
        if self.images.all.len() >= MOST_IMAGES {
            return Err(format!("more than {MOST_IMAGES} images"));
        }
        let size = [record.width, record.height];
        let next = self.camera_index.len();
        let camera = *self.camera_index.entry(record.camera.0).or_insert_with_key(|id| {
            self.images.cameras.push(id.clone());
            self.images.camera_sizes.push(size);
            next
        });
        if next >= MOST_NAMES {
            return Err(format!("more than {MOST_NAMES} cameras"));
        }
        if self.by_id.insert(record.id, self.images.all.len()).is_some() {
            return Err(format!("image id {} occurs twice", record.id));
        }
        if !self.pairs.insert((record.frame_idx, sequence, camera)) {
            return Err(format!("frame {} of one camera and sequence occurs twice", record.frame_idx));
        }
        let number = record.frame_idx;
        self.images.all.push(Image { sequence, number, camera, size, side: None, bounds: None });
        Ok(())
    }

    fn annotation(&mut self, record: AnnotationRecord) {
        let image = self.by_id.get(&record.image_id).and_then(|&i| self.images.all.get_mut(i));
        if let Some(image) = image {
            image.bounds = record.bbox.map(|b| b.0);
            image.side = match record.hand_type.as_deref() {
                Some("right") => Some(Side::Right),
                Some("left") => Some(Side::Left),
                _ => None,
            };
        }
    }
}

impl Keys for Reader<'_> {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        match key {
            "images" => {
                self.images_seen = true;
                map.next_value_seed(ForEach::new(|record| self.image(record)))
            }
            "annotations" if self.images_seen => AnnotationsOnly(self).value(key, map),
            "annotations" => {
                self.annotations_came_first = true;
                skip(map)
            }
            _ => skip(map),
        }
    }
}

struct AnnotationsOnly<'a, 'b>(&'a mut Reader<'b>);

impl Keys for AnnotationsOnly<'_, '_> {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        if key != "annotations" {
            return skip(map);
        }
        map.next_value_seed(ForEach::new(|record| {
            self.0.annotation(record);
            Ok(())
        }))
    }
}
