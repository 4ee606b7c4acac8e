//! Views that the user keeps under a name.

use serde::{Deserialize, Serialize};

use ghand_avatar::orbit_camera::ViewPoint;
use ghand_avatar::view_side::ViewSide;

/// Most characters of a name: more do not fit the panel.
const LONGEST_NAME: usize = 30;

/// A view and its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedView {
    /// Its name, unique among the saved ones.
    pub name: String,
    /// The view.
    #[serde(flatten)]
    pub point: ViewPoint,
}

/// The name as it is kept.
///
/// # Errors
/// One sentence that says what is wrong with it.
pub fn view_name(text: &str) -> Result<String, String> {
    let name = text.trim();
    if name.is_empty() {
        return Err("A view needs a name.".into());
    }
    if name.chars().count() > LONGEST_NAME || name.chars().any(char::is_control) {
        return Err(format!("The name of a view has at most {LONGEST_NAME} characters on one line."));
    }
    match ViewSide::of(name) {
        Some(_) => Err(format!("{name:?} is a side of the hand already; give the view another name.")),
        None => Ok(name.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_trimmed_and_unusable_ones_explained() {
        assert_eq!(view_name("  my view "), Ok("my view".into()));
        for (text, said) in [("", "needs"), (" ", "needs"), ("palm", "side"), ("a\nb", "line"), (&"x".repeat(31), "30")]
        {
            assert!(view_name(text).unwrap_err().contains(said), "{text:?}");
        }
    }
}
