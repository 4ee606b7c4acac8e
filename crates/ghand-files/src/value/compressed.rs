//! Files that are compressed as a whole: by zlib or gzip, as joblib does. Other methods are named with a remedy.

use std::io::Read;

use flate2::read::{MultiGzDecoder, ZlibDecoder};

/// Methods that are not read: their first bytes, their names, and a program that undoes them.
const OTHERS: [(&[u8], &str, &str); 5] = [
    (b"BZh", "bzip2", "bunzip2"),
    (b"\xfd7zXZ\0", "xz", "unxz"),
    (b"]\0\0", "lzma", "unlzma"),
    (b"\x04\x22\x4d\x18", "lz4", "unlz4"),
    (b"\x28\xb5\x2f\xfd", "zstd", "unzstd"),
];

/// The unpacked bytes, at most `most`; `None` if the file is not compressed.
pub(super) fn unpacked(bytes: &[u8], most: u64) -> Result<Option<Vec<u8>>, String> {
    if let Some((_, name, program)) = OTHERS.iter().find(|(magic, _, _)| bytes.starts_with(magic)) {
        return Err(format!(
            "is compressed by {name}, which is not read; unpack it with {program}, or write it again with \
             joblib.dump(joblib.load(\"IN\"), \"OUT.joblib\")"
        ));
    }
    if bytes.starts_with(b"\x1f\x8b") {
        return read(MultiGzDecoder::new(bytes), "gzip", most).map(Some);
    }
    // Text may begin with x^, the second of these.
    match bytes {
        [b'x', 0x01 | 0x9c | 0xda, ..] => read(ZlibDecoder::new(bytes), "zlib", most).map(Some),
        [b'x', b'^', ..] => Ok(read(ZlibDecoder::new(bytes), "zlib", most).ok()),
        _ => Ok(None),
    }
}

fn read(unpacker: impl Read, name: &str, most: u64) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let read = unpacker.take(most.saturating_add(1)).read_to_end(&mut bytes);
    read.map_err(|error| format!("is compressed by {name} and damaged ({error}); copy or write the file again"))?;
    if bytes.len() as u64 > most {
        let most = most >> 20;
        return Err(format!("is larger than {most} MiB when unpacked; split it, or keep only what is needed"));
    }
    Ok(bytes)
}
