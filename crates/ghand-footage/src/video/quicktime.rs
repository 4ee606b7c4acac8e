//! What a QuickTime or MP4 file says of its camera: ffprobe tells the metadata of files, but not those of tracks, where
//! phones state the lens.
//!
//! Boxes have a length and a name; those that are read here are in other boxes at a fixed depth:
//! `moov/meta`, `moov/udta/meta` and `moov/trak/meta` hold a table of keys (`keys`) and a list of values (`ilst`).

use std::io::{self, Read, Seek, SeekFrom};

/// Most boxes that are looked at in one box; films have some tens.
const MOST_BOXES: usize = 10_000;
/// Largest table of keys with its values, bytes.
const MOST_METADATA: u64 = 1 << 20;
/// Longest name of a lens, characters.
const MOST_NAME: usize = 100;
/// The keys' names.
const EQUIVALENT: &str = "com.apple.quicktime.camera.focal_length.35mm_equivalent";
const LENS: &str = "com.apple.quicktime.camera.lens_model";

/// What a file says of the lens of its film.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Lens {
    /// Focal length of the same view on film of 36 x 24 mm, millimetres.
    pub equivalent: Option<f64>,
    /// As the phone names it.
    pub name: Option<String>,
}

/// What a file says of its lens: of its first film, else of itself. Nothing if it is another kind of file, or damaged.
pub(crate) fn lens(file: &mut (impl Read + Seek)) -> Lens {
    // Whatever cannot be read is not stated; whether the film can be, ffmpeg decides.
    read_lens(file).unwrap_or_default()
}

/// A part of a file: the inside of a box.
#[derive(Debug, Clone, Copy)]
struct Part {
    name: [u8; 4],
    start: u64,
    end: u64,
}

fn read_lens(file: &mut (impl Read + Seek)) -> io::Result<Lens> {
    let end = file.seek(SeekFrom::End(0))?;
    let whole = Part { name: *b"file", start: 0, end };
    let Some(movie) = boxes(file, whole)?.into_iter().find(|part| part.name == *b"moov") else {
        return Ok(Lens::default());
    };
    let parts = boxes(file, movie)?;
    for track in parts.iter().filter(|part| part.name == *b"trak") {
        if is_film(file, *track)? {
            let of_track = of_metadata(file, *track)?;
            if of_track.equivalent.is_some() {
                return Ok(of_track);
            }
            break;
        }
    }
    let of_file = of_metadata(file, movie)?;
    if of_file.equivalent.is_some() {
        return Ok(of_file);
    }
    let user = parts.into_iter().find(|part| part.name == *b"udta");
    user.map_or(Ok(of_file), |user| of_metadata(file, user))
}

/// The boxes in a box, as far as they are whole.
fn boxes(file: &mut (impl Read + Seek), of: Part) -> io::Result<Vec<Part>> {
    let mut found = vec![];
    let mut at = of.start;
    while at + 8 <= of.end && found.len() < MOST_BOXES {
        file.seek(SeekFrom::Start(at))?;
        let mut head = [0; 8];
        file.read_exact(&mut head)?;
        let [a, b, c, d, name @ ..] = head;
        let mut length = u64::from(u32::from_be_bytes([a, b, c, d]));
        let mut start = at + 8;
        if length == 1 {
            let mut long = [0; 8];
            file.read_exact(&mut long)?;
            length = u64::from_be_bytes(long);
            start += 8;
        } else if length == 0 {
            // To the end of what it is in.
            length = of.end - at;
        }
        let Some(end) = at.checked_add(length).filter(|end| *end >= start && *end <= of.end) else { break };
        found.push(Part { name, start, end });
        at = end;
    }
    Ok(found)
}

/// Whether a track has pictures: its handler is `vide`.
fn is_film(file: &mut (impl Read + Seek), track: Part) -> io::Result<bool> {
    let Some(media) = boxes(file, track)?.into_iter().find(|part| part.name == *b"mdia") else { return Ok(false) };
    let Some(handler) = boxes(file, media)?.into_iter().find(|part| part.name == *b"hdlr") else { return Ok(false) };
    if handler.end - handler.start < 12 {
        return Ok(false);
    }
    // After version, flags, and the kind of component.
    file.seek(SeekFrom::Start(handler.start + 8))?;
    let mut kind = [0; 4];
    file.read_exact(&mut kind)?;
    Ok(kind == *b"vide")
}

/// The lens in the metadata of a movie, a track, or the user's data.
fn of_metadata(file: &mut (impl Read + Seek), of: Part) -> io::Result<Lens> {
    let mut lens = Lens::default();
    let Some(meta) = boxes(file, of)?.into_iter().find(|part| part.name == *b"meta") else { return Ok(lens) };
    // In MP4, not in QuickTime, it begins with version and flags.
    let is_whole = |parts: &[Part]| parts.iter().any(|part| part.name == *b"keys");
    let mut parts = boxes(file, meta)?;
    if !is_whole(&parts) {
        parts = boxes(file, Part { start: meta.start.saturating_add(4).min(meta.end), ..meta })?;
    }
    let mut named = |name: &[u8; 4]| -> io::Result<Vec<u8>> {
        let part = parts.iter().find(|part| part.name == *name && part.end - part.start <= MOST_METADATA);
        let Some(part) = part else { return Ok(vec![]) };
        file.seek(SeekFrom::Start(part.start))?;
        let mut bytes = vec![];
        file.take(part.end - part.start).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let (keys, values) = (named(b"keys")?, named(b"ilst")?);
    let keys = keys_of(&keys);
    for (number, kind, value) in values_of(&values) {
        match number.checked_sub(1).and_then(|place| keys.get(place)) {
            Some(key) if *key == EQUIVALENT.as_bytes() => lens.equivalent = number_of(kind, value),
            Some(key) if *key == LENS.as_bytes() => lens.name = text_of(kind, value),
            _ => {}
        }
    }
    Ok(lens)
}

/// The four bytes at a place as a number.
fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let word = bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
    usize::try_from(u32::from_be_bytes(word)).ok()
}

/// Names of keys, in the order of their numbers from 1 on.
fn keys_of(table: &[u8]) -> Vec<&[u8]> {
    let mut found = vec![];
    // After version, flags and a count, which the lengths tell, too.
    let mut at = 8;
    while let Some(length) = word(table, at).filter(|length| *length >= 8) {
        let Some(name) = at.checked_add(length).and_then(|end| table.get(at + 8..end)) else { break };
        found.push(name);
        at += length;
    }
    found
}

/// Values of a list: the number of the key, the kind, the bytes.
fn values_of(list: &[u8]) -> Vec<(usize, usize, &[u8])> {
    let mut found = vec![];
    let mut at = 0usize;
    while let Some(length) = word(list, at).filter(|length| *length >= 8) {
        let Some(item) = at.checked_add(length).and_then(|end| list.get(at..end)) else { break };
        // In it a box `data`: length, name, kind, language, value.
        if let (Some(number), Some(inner), Some(b"data")) = (word(item, 4), word(item, 8), item.get(12..16))
            && let (Some(kind), Some(value)) = (word(item, 16), inner.checked_add(8).and_then(|end| item.get(24..end)))
        {
            found.push((number, kind, value));
        }
        at += length;
    }
    found
}

/// A value as a number: text, or one of the kinds of numbers of QuickTime.
fn number_of(kind: usize, value: &[u8]) -> Option<f64> {
    let unsigned =
        || (value.len() <= 8 && !value.is_empty()).then(|| value.iter().fold(0u64, |all, b| all << 8 | u64::from(*b)));
    match kind {
        1 => std::str::from_utf8(value).ok()?.trim().parse().ok(),
        23 => Some(f32::from_be_bytes(value.try_into().ok()?).into()),
        24 => Some(f64::from_be_bytes(value.try_into().ok()?)),
        // Signed: the sign is in the first bit.
        21 | 65 | 66 | 67 | 74 => {
            let bits = unsigned()?;
            let shift = 64 - 8 * value.len() as u32;
            Some((((bits << shift) as i64) >> shift) as f64)
        }
        22 | 75..=78 => Some(unsigned()? as f64),
        _ => None,
    }
}

/// A value as text of one line.
fn text_of(kind: usize, value: &[u8]) -> Option<String> {
    let text = (kind == 1).then(|| std::str::from_utf8(value).ok())??;
    let text: String = text.chars().filter(|c| !c.is_control()).take(MOST_NAME).collect();
    (!text.trim().is_empty()).then(|| text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn boxed(name: &[u8; 4], inside: &[&[u8]]) -> Vec<u8> {
        let inside = inside.concat();
        [&(inside.len() as u32 + 8).to_be_bytes()[..], name, &inside].concat()
    }

    fn metadata(is_mp4: bool, values: &[(&str, u32, &[u8])]) -> Vec<u8> {
        let key = |(name, ..): &(&str, u32, &[u8])| boxed(b"mdta", &[name.as_bytes()]);
        let table: Vec<u8> = values.iter().flat_map(key).collect();
        let keys = boxed(b"keys", &[&[0; 4], &(values.len() as u32).to_be_bytes(), &table]);
        let item = |(k, (_, kind, value)): (usize, &(&str, u32, &[u8]))| {
            boxed(&(k as u32 + 1).to_be_bytes(), &[&boxed(b"data", &[&kind.to_be_bytes(), &[0; 4], value])])
        };
        let list: Vec<u8> = values.iter().enumerate().flat_map(item).collect();
        let handler = boxed(b"hdlr", &[&[0; 8], b"mdta", &[0; 12]]);
        let version: &[u8] = if is_mp4 { &[0; 4] } else { &[] };
        boxed(b"meta", &[version, &handler, &keys, &boxed(b"ilst", &[&list])])
    }

    fn track(kind: &[u8; 4], metadata: &[u8]) -> Vec<u8> {
        let media = boxed(b"mdia", &[&boxed(b"mdhd", &[&[0; 24]]), &boxed(b"hdlr", &[&[0; 8], kind, &[0; 12]])]);
        boxed(b"trak", &[&boxed(b"tkhd", &[&[0; 84]]), &media, metadata])
    }

    fn file(movie: &[&[u8]]) -> Vec<u8> {
        // A long box before the movie.
        let long = [&1u32.to_be_bytes()[..], b"mdat", &20u64.to_be_bytes(), &[7; 4]].concat();
        [boxed(b"ftyp", &[b"qt  \0\0\0\0qt  "]), long, boxed(b"moov", movie)].concat()
    }

    fn read(bytes: &[u8]) -> Lens {
        lens(&mut Cursor::new(bytes))
    }

    /// As an iPhone writes it.
    fn of_phone() -> Vec<u8> {
        let name: &[u8] = b"iPhone 13 Pro back camera 5.7mm f/1.5";
        let sound = metadata(false, &[(EQUIVALENT, 67, &99u32.to_be_bytes())]);
        let film =
            metadata(false, &[(LENS, 1, name), ("com.apple.other", 1, b"x"), (EQUIVALENT, 67, &26u32.to_be_bytes())]);
        let of_file = metadata(false, &[("com.apple.quicktime.make", 1, b"Apple"), (EQUIVALENT, 1, b"77")]);
        file(&[&boxed(b"mvhd", &[&[0; 100]]), &track(b"soun", &sound), &track(b"vide", &film), &of_file])
    }

    #[test]
    fn the_lens_is_that_of_the_film_else_of_the_file() {
        let found = read(&of_phone());
        let name = Some("iPhone 13 Pro back camera 5.7mm f/1.5".to_owned());
        assert_eq!(found, Lens { equivalent: Some(26.0), name });
        let plain = track(b"vide", &[]);
        let of_file = metadata(true, &[(EQUIVALENT, 1, b" 13.5 ")]);
        assert_eq!(read(&file(&[&plain, &of_file])).equivalent, Some(13.5));
        assert_eq!(read(&file(&[&plain, &boxed(b"udta", &[&of_file])])).equivalent, Some(13.5));
        assert_eq!(read(&file(&[&plain])), Lens::default());
        for (kind, value, expected) in [
            (23, &26.5f32.to_be_bytes()[..], Some(26.5)),
            (24, &26.5f64.to_be_bytes(), Some(26.5)),
            (21, &[26], Some(26.0)),
            (66, &(-2i16).to_be_bytes(), Some(-2.0)),
            (78, &26u64.to_be_bytes(), Some(26.0)),
            (22, &[], None),
            (21, &[0; 9], None),
            (1, b"wide", None),
            (13, b"26", None),
        ] {
            let film = metadata(false, &[(EQUIVALENT, kind, value)]);
            assert_eq!(read(&file(&[&track(b"vide", &film)])).equivalent, expected, "{kind}");
        }
    }

    #[test]
    fn damaged_files_end_the_search_and_nothing_else() {
        let whole = of_phone();
        for end in 0..whole.len() {
            assert!(matches!(read(&whole[..end]).equivalent, None | Some(26.0 | 77.0)), "{end}");
        }
        // Lengths beyond the file, of nothing, and of more than can be counted, at every place.
        for at in 0..whole.len() - 4 {
            for length in [0u32, 1, 7, 9, u32::MAX] {
                let mut damaged = whole.clone();
                damaged[at..at + 4].copy_from_slice(&length.to_be_bytes());
                let _ = read(&damaged);
            }
        }
        let mut endless = whole.clone();
        endless.extend([&1u32.to_be_bytes()[..], b"free", &u64::MAX.to_be_bytes()].concat());
        assert_eq!(read(&endless).equivalent, Some(26.0));
        // More empty boxes than any file has before the movie, and boxes in boxes.
        let empty = boxed(b"free", &[]).repeat(MOST_BOXES + 1);
        assert_eq!(read(&[empty, whole].concat()), Lens::default());
        let nested = (0..5000).fold(vec![], |inner, _| boxed(b"moov", &[&inner]));
        assert_eq!(read(&nested), Lens::default());
        let long = [b'x'; 500];
        let film = metadata(false, &[(LENS, 1, &long), (EQUIVALENT, 1, b"26")]);
        assert_eq!(read(&file(&[&track(b"vide", &film)])).name.unwrap().len(), MOST_NAME);
    }
}
