//! The header of an `.npy` file: type of the elements, their order, and the shape.

use super::array::{ArrayError, ElementType};

/// The header of an `.npy` file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub elements: ElementType,
    pub fortran: bool,
    pub shape: Vec<usize>,
}

/// Most bytes of a header. NumPy itself rejects longer ones.
const MAX_HEADER: usize = 10_000;

/// Splits an `.npy` file (format versions 1 to 3) into its header and the bytes after it.
pub(super) fn split_header(bytes: &[u8]) -> Result<(Header, &[u8]), ArrayError> {
    let damaged =
        |problem: &str| ArrayError(format!("is not a readable .npy file ({problem}); write it again with numpy.savez"));
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or_else(|| damaged("its first bytes are wrong"))?;
    let (version, rest) = rest.split_at_checked(2).ok_or_else(|| damaged("it is truncated"))?;
    let length_bytes = match version {
        [1, 0] => 2,
        [2 | 3, 0] => 4,
        _ => return Err(damaged("its format version is not 1, 2 or 3")),
    };
    let (length, rest) = rest.split_at_checked(length_bytes).ok_or_else(|| damaged("it is truncated"))?;
    let length = length.iter().rev().fold(0usize, |value, &byte| value << 8 | usize::from(byte));
    if length > MAX_HEADER {
        return Err(damaged("its header is too long"));
    }
    let (text, data) = rest.split_at_checked(length).ok_or_else(|| damaged("it is truncated"))?;
    let text = std::str::from_utf8(text).map_err(|_| damaged("its header is not text"))?;
    let mut literal = Literal { rest: text };
    let header = literal.header().ok_or_else(|| damaged("its header is not a description of a plain array"))?;
    let (code, fortran, shape) = header;
    Ok((Header { elements: ElementType::parse(&code)?, fortran, shape }, data))
}

/// Reads the only kind of Python literal that a header may be:
/// `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }`, keys in any order.
struct Literal<'a> {
    rest: &'a str,
}

impl<'a> Literal<'a> {
    fn header(&mut self) -> Option<(String, bool, Vec<usize>)> {
        let mut code = None;
        let mut fortran = None;
        let mut shape = None;
        self.token("{")?;
        while self.token("}").is_none() {
            let key = self.quoted()?;
            self.token(":")?;
            match key {
                "descr" if code.is_none() => code = Some(self.quoted()?.to_owned()),
                "fortran_order" if fortran.is_none() => fortran = Some(self.boolean()?),
                "shape" if shape.is_none() => shape = Some(self.shape()?),
                _ => return None,
            }
            if self.token(",").is_none() {
                self.token("}")?;
                break;
            }
        }
        self.rest.trim().is_empty().then_some(())?;
        Some((code?, fortran?, shape?))
    }

    fn token(&mut self, token: &str) -> Option<()> {
        self.rest = self.rest.trim_start().strip_prefix(token)?;
        Some(())
    }

    fn quoted(&mut self) -> Option<&'a str> {
        let rest = self.rest.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
        let (text, rest) = rest.get(1..)?.split_once(quote)?;
        self.rest = rest;
        Some(text)
    }

    fn boolean(&mut self) -> Option<bool> {
        if self.token("True").is_some() {
            return Some(true);
        }
        self.token("False").map(|()| false)
    }

    fn shape(&mut self) -> Option<Vec<usize>> {
        self.token("(")?;
        let mut shape = Vec::new();
        while self.token(")").is_none() {
            shape.push(self.number()?);
            if self.token(",").is_none() {
                self.token(")")?;
                break;
            }
        }
        Some(shape)
    }

    fn number(&mut self) -> Option<usize> {
        let rest = self.rest.trim_start();
        let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let (digits, rest) = rest.split_at_checked(end)?;
        // Python 2 marks long integers.
        self.rest = rest.strip_prefix('L').unwrap_or(rest);
        digits.parse().ok()
    }
}
