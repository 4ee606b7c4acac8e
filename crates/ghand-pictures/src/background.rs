//! The background of a picture.

/// The background of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Background {
    /// A colour, display values from 0 to 1.
    Color([f32; 3]),
    /// Nothing.
    Transparent,
}

impl Background {
    /// The colour to render over. Transparent pictures are rendered over black: their colours are then those of the
    /// foreground times the coverage.
    pub fn color(self) -> [f32; 3] {
        match self {
            Background::Color(color) => color,
            Background::Transparent => [0.0; 3],
        }
    }
}

/// Parses a background like `0.2,0.2,0.2`, display values from 0 to 1, or `transparent`.
///
/// # Errors
/// A description of the problem with the text.
pub fn parse_background(text: &str) -> Result<Background, String> {
    if text == "transparent" {
        return Ok(Background::Transparent);
    }
    let values: Option<Vec<f32>> =
        text.split(',').map(|t| t.trim().parse().ok().filter(|v| (0.0..=1.0).contains(v))).collect();
    match values.as_deref() {
        Some(&[r, g, b]) => Ok(Background::Color([r, g, b])),
        _ => Err("must be red,green,blue, each from 0 to 1, such as 0.2,0.2,0.2, or transparent".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds_are_parsed_and_invalid_ones_rejected() {
        assert_eq!(parse_background("0, 0.5,1"), Ok(Background::Color([0.0, 0.5, 1.0])));
        assert_eq!(parse_background("transparent"), Ok(Background::Transparent));
        for text in ["", "1,2", "0,0,2", "0,0,nan", "0,0,0,0", "a,b,c", "Transparent,"] {
            assert!(parse_background(text).is_err(), "{text}");
        }
    }
}
