//! The text forms of values in protocol 0, and Latin-1.

use std::borrow::Cow;

/// One byte per character; `None` if a character is beyond Latin-1.
pub(super) fn latin1(text: &str) -> Option<Vec<u8>> {
    text.chars().map(|c| u8::try_from(c).ok()).collect()
}

/// A string in quotes as Python 2 prints it: `'a\x00\n'`.
pub(super) fn quoted(line: &[u8]) -> Option<Cow<'_, [u8]>> {
    let line = line.trim_ascii();
    let quote = *line.first().filter(|quote| matches!(quote, b'\'' | b'"'))?;
    let inner = line.get(1..)?.strip_suffix(&[quote])?;
    if !inner.contains(&b'\\') {
        return Some(Cow::Borrowed(inner));
    }
    let mut bytes = Vec::with_capacity(inner.len());
    let mut rest = inner;
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        if byte != b'\\' {
            bytes.push(byte);
            continue;
        }
        let (&escape, after) = rest.split_first()?;
        rest = after;
        bytes.push(match escape {
            b'\\' | b'\'' | b'"' => escape,
            b'n' => b'\n',
            b'r' => b'\r',
            b't' => b'\t',
            b'a' => 0x07,
            b'b' => 0x08,
            b'f' => 0x0c,
            b'v' => 0x0b,
            b'x' => u8::try_from(hexadecimal(&mut rest, 2)?).ok()?,
            b'0'..=b'7' => {
                let mut value = u32::from(escape - b'0');
                for _ in 0..2 {
                    let Some((&digit @ b'0'..=b'7', after)) = rest.split_first() else { break };
                    value = value * 8 + u32::from(digit - b'0');
                    rest = after;
                }
                u8::try_from(value).ok()?
            }
            _ => return None,
        });
    }
    Some(Cow::Owned(bytes))
}

/// Text in protocol 0: Latin-1, and `\u` or `\U` with 4 or 8 hexadecimal digits for other characters.
pub(super) fn raw_unicode(line: &[u8]) -> Option<String> {
    let mut text = String::with_capacity(line.len());
    let mut rest = line;
    let mut high_surrogate = None;
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        let digits = match (byte, rest.first()) {
            (b'\\', Some(b'u')) => 4,
            (b'\\', Some(b'U')) => 8,
            _ => {
                text.push(char::from(byte));
                continue;
            }
        };
        rest = rest.get(1..)?;
        let code = hexadecimal(&mut rest, digits)?;
        // Python 2 may split a character beyond 16 bits into two.
        match (high_surrogate.take(), code) {
            (None, 0xd800..0xdc00) => high_surrogate = Some(code),
            (None, _) => text.push(char::from_u32(code)?),
            (Some(high), 0xdc00..0xe000) => {
                text.push(char::from_u32(0x10000 + ((high - 0xd800) << 10) + (code - 0xdc00))?);
            }
            (Some(_), _) => return None,
        }
    }
    high_surrogate.is_none().then_some(text)
}

fn hexadecimal(rest: &mut &[u8], digits: usize) -> Option<u32> {
    let (number, after) = rest.split_at_checked(digits)?;
    *rest = after;
    let digit = |value: u32, &byte: &u8| Some(value << 4 | char::from(byte).to_digit(16)?);
    number.iter().try_fold(0, digit)
}
