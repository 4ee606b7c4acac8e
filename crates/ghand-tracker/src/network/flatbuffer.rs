//! Reading of flatbuffers: tables, vectors and numbers, little-endian and aligned or not.
//!
//! For the two files that are compiled in: an offset that points outside of a file is a bug and panics.

/// A table inside the bytes of a file.
#[derive(Clone, Copy)]
pub struct Table<'a> {
    bytes: &'a [u8],
    position: usize,
}

/// `N` bytes at a position.
fn at<const N: usize>(bytes: &[u8], position: usize) -> [u8; N] {
    std::array::from_fn(|k| bytes[position + k])
}

fn u32_at(bytes: &[u8], position: usize) -> usize {
    u32::from_le_bytes(at(bytes, position)) as usize
}

/// The position that the offset at `position` points to.
fn follow(bytes: &[u8], position: usize) -> usize {
    position + u32_at(bytes, position)
}

impl<'a> Table<'a> {
    /// The root table of a file.
    pub fn root(bytes: &'a [u8]) -> Self {
        Table { bytes, position: follow(bytes, 0) }
    }

    /// The position of a field, or `None` if the table has the field's default.
    fn field(&self, index: usize) -> Option<usize> {
        let back = i32::from_le_bytes(at(self.bytes, self.position));
        let layout = (self.position as i64 - i64::from(back)) as usize;
        let size = u16::from_le_bytes(at(self.bytes, layout));
        let entry = 4 + 2 * index;
        if entry + 2 > usize::from(size) {
            return None;
        }
        let offset = u16::from_le_bytes(at(self.bytes, layout + entry));
        (offset != 0).then(|| self.position + usize::from(offset))
    }

    /// A number of one byte; absent: zero.
    pub fn byte(&self, index: usize) -> u8 {
        self.field(index).map_or(0, |position| self.bytes[position])
    }

    /// A number of four bytes that is not negative; absent: zero.
    pub fn number(&self, index: usize) -> usize {
        self.field(index).map_or(0, |position| u32_at(self.bytes, position))
    }

    /// A table in a field.
    pub fn table(&self, index: usize) -> Table<'a> {
        let Some(position) = self.field(index) else { unreachable!("a table without its field {index}") };
        Table { bytes: self.bytes, position: follow(self.bytes, position) }
    }

    /// The entries of a vector whose entries have `size` bytes each; absent: empty.
    pub fn vector(&self, index: usize, size: usize) -> &'a [u8] {
        self.field(index).map_or(&[], |position| {
            let start = follow(self.bytes, position);
            &self.bytes[start + 4..][..u32_at(self.bytes, start) * size]
        })
    }

    /// A vector of numbers of four bytes that are not negative; absent: empty.
    pub fn numbers(&self, index: usize) -> Vec<usize> {
        self.vector(index, 4).as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes) as usize).collect()
    }

    /// A vector of tables; absent: empty.
    pub fn tables(&self, index: usize) -> Vec<Table<'a>> {
        let Some(position) = self.field(index) else { return Vec::new() };
        let entries = follow(self.bytes, position) + 4;
        let count = self.vector(index, 4).len() / 4;
        let table = |k| Table { bytes: self.bytes, position: follow(self.bytes, entries + 4 * k) };
        (0..count).map(table).collect()
    }
}
