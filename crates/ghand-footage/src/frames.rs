//! Frames, one after the other.

use std::collections::VecDeque;

use crate::FootageError;
use crate::footage::Source;
use crate::pictures::Pictures;
use crate::video::decoder::Decoder;

/// A stream of frames, in order. Dropping it stops the decoder.
pub struct Frames {
    count: usize,
    /// The numbers that are still wanted; `None` for all.
    wanted: Option<VecDeque<usize>>,
    delivered: usize,
    missing: usize,
    reader: Reader,
}

enum Reader {
    Video(Box<Decoder>),
    Pictures(Pictures, usize),
    /// No frame is left.
    Ended,
}

impl Frames {
    pub(crate) fn new(source: &Source, times: &[f64], wanted: Option<Vec<usize>>) -> Result<Frames, FootageError> {
        let reader = match source {
            _ if wanted.as_ref().is_some_and(Vec::is_empty) => Reader::Ended,
            Source::Video(video) => Reader::Video(Box::new(Decoder::start(video, times)?)),
            Source::Pictures(pictures) => Reader::Pictures(pictures.clone(), 0),
        };
        let wanted = wanted.map(VecDeque::from);
        Ok(Frames { count: times.len(), wanted, delivered: 0, missing: 0, reader })
    }

    /// The next frame into `rgb`, whose memory is used again: red, green, blue, row by row. Returns its number, `None`
    /// after the last frame.
    ///
    /// # Errors
    /// If a picture cannot be read, or not a single frame of a video can be decoded.
    pub fn next_into(&mut self, rgb: &mut Vec<u8>) -> Result<Option<usize>, FootageError> {
        let found = self.advance(rgb);
        match found {
            Ok(Some(_)) => self.delivered += 1,
            Ok(None) | Err(_) => {
                self.reader = Reader::Ended;
                // Of those that were wanted, some may not have come.
                self.missing += self.wanted.take().map_or(0, |left| left.len());
            }
        }
        found
    }

    fn advance(&mut self, rgb: &mut Vec<u8>) -> Result<Option<usize>, FootageError> {
        match &mut self.reader {
            Reader::Ended => Ok(None),
            Reader::Pictures(pictures, next) => {
                let number = match &mut self.wanted {
                    Some(wanted) => wanted.pop_front(),
                    None => (*next < self.count).then_some(*next),
                };
                let Some(number) = number else { return Ok(None) };
                *next = number + 1;
                pictures.read(number, rgb)?;
                Ok(Some(number))
            }
            Reader::Video(decoder) => loop {
                if self.wanted.as_ref().is_some_and(VecDeque::is_empty) {
                    return Ok(None);
                }
                let Some(number) = decoder.next_into(rgb)? else {
                    if self.wanted.is_none() {
                        self.missing = self.count.saturating_sub(self.delivered);
                    }
                    return Ok(None);
                };
                let Some(wanted) = &mut self.wanted else { return Ok(Some(number)) };
                // Those before it cannot be decoded.
                while wanted.front().is_some_and(|first| *first < number) {
                    wanted.pop_front();
                    self.missing += 1;
                }
                if wanted.front() == Some(&number) {
                    wanted.pop_front();
                    return Ok(Some(number));
                }
            },
        }
    }

    /// After the last frame: how many frames were wanted and could not be decoded.
    pub fn missing(&self) -> usize {
        self.missing
    }
}
