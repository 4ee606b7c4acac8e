//! Shape parameters as people write them: by name, by number, or all in order.

use ghand_core::pose::check_shape_range;
use ghand_core::{HandModel, InvalidHandModel};

/// Similarity of two names, from 0 to 1, above which one counts as a misspelling of the other.
const MIN_SIMILARITY: f64 = 0.6;

/// Shape parameters from text: `finger-length=2,hand-scale=-1`, `0=2` (numbers count from 0), or the values of the
/// first directions in order, `0.5,1,-2`. Parameters that are not given are 0; empty text gives none.
///
/// ```
/// use ghand_core::Side;
/// use ghand_hand_model::builtin::builtin_hand;
/// use ghand_hand_model::shape_values::shape_from_text;
///
/// let hand = builtin_hand(Side::Right)?;
/// assert_eq!(shape_from_text(&hand, "finger-length=2, 2=-1")?[..3], [2.0, 0.0, -1.0]);
/// assert_eq!(shape_from_text(&hand, "0.5,1")?, [0.5, 1.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`InvalidHandModel`] with the nearest name if the model has no such direction, and if a value is not a number,
/// beyond [`ghand_core::pose::LARGEST_SHAPE`], given twice, or one too many.
pub fn shape_from_text(model: &HandModel, text: &str) -> Result<Vec<f64>, InvalidHandModel> {
    let parts: Vec<&str> = match text.trim() {
        "" => vec![],
        text => text.split(',').map(str::trim).collect(),
    };
    let number =
        |text: &str| text.trim().parse::<f64>().map_err(|_| invalid(model, format!("{text:?} is not a number")));
    if parts.iter().any(|part| part.contains('=')) {
        let pair = |part: &&str| match part.rsplit_once('=') {
            Some((name, value)) => Ok((name.trim().to_owned(), number(value)?)),
            None => Err(invalid(
                model,
                format!("{part:?} has no name; write NAME=VALUE for each parameter, or only values"),
            )),
        };
        return shape_from_names(model, &parts.iter().map(pair).collect::<Result<Vec<_>, _>>()?);
    }
    let found = parts.len();
    let taken = model.shape_count();
    if found > taken {
        return Err(invalid(model, format!("has {found} numbers, the model takes {taken}; remove the others")));
    }
    checked(model, parts.into_iter().map(number).collect::<Result<_, _>>()?)
}

/// All `n_s` shape parameters from the names or numbers of some of them; the others are 0.
///
/// # Errors
/// As for [`shape_from_text`].
pub fn shape_from_names(model: &HandModel, values: &[(String, f64)]) -> Result<Vec<f64>, InvalidHandModel> {
    let mut shape = vec![None; model.shape_count()];
    for (name, value) in values {
        let slot = shape_index(model, name).and_then(|k| shape.get_mut(k)).ok_or_else(|| unknown(model, name))?;
        if slot.replace(*value).is_some() {
            return Err(invalid(model, format!("{name:?} is given twice; keep one of the values")));
        }
    }
    checked(model, shape.into_iter().map(Option::unwrap_or_default).collect())
}

/// The shape direction of that name, else of that number, counted from 0.
fn shape_index(model: &HandModel, name: &str) -> Option<usize> {
    let by_number = || name.parse().ok().filter(|k| *k < model.shape_count());
    model.shape_names.iter().position(|known| known == name).or_else(by_number)
}

fn checked(model: &HandModel, shape: Vec<f64>) -> Result<Vec<f64>, InvalidHandModel> {
    check_shape_range(&shape).map_err(|error| invalid(model, error.to_string()))?;
    Ok(shape)
}

fn unknown(model: &HandModel, name: &str) -> InvalidHandModel {
    let count = model.shape_count();
    if model.shape_names.is_empty() {
        let known = match count {
            0 => "the model has no shape directions".into(),
            _ => format!("the model's are numbered from 0 to {} and have no names", count - 1),
        };
        return invalid(model, format!("{name:?} is unknown; {known}"));
    }
    let plain = name.to_lowercase().replace(['_', ' '], "-");
    let likeness = |known: &String| strsim::normalized_damerau_levenshtein(&plain, &known.to_lowercase());
    let nearest = (model.shape_names.iter())
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
        .filter(|known| likeness(known) >= MIN_SIMILARITY);
    let question = nearest.map_or(String::new(), |known| format!("did you mean {known:?}? "));
    invalid(model, format!("{name:?} is unknown; {question}the model has {}", model.shape_names.join(", ")))
}

fn invalid(model: &HandModel, problem: String) -> InvalidHandModel {
    InvalidHandModel { origin: model.name.clone(), field: "shape".into(), problem }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ghand_test_support::procedural_hand::ProceduralHand;

    fn hand() -> HandModel {
        ProceduralHand { detail: 1, ..Default::default() }.build().unwrap()
    }

    #[test]
    fn names_numbers_and_lists_give_the_same_shape() {
        let hand = hand();
        let mut expected = [0.0; 10];
        (expected[1], expected[9]) = (2.0, -0.5);
        for text in ["palm-length=2,pinky-length=-0.5", " 9 = -5e-1 , palm-length = 2 ", "1=2,9=-.5"] {
            assert_eq!(shape_from_text(&hand, text).unwrap(), expected, "{text}");
        }
        assert_eq!(shape_from_text(&hand, "0,2,0,0,0,0,0,0,0,-0.5").unwrap(), expected);
        assert_eq!(shape_from_text(&hand, "1, -2").unwrap(), [1.0, -2.0]);
        assert_eq!(shape_from_text(&hand, " ").unwrap(), Vec::<f64>::new());
    }

    #[test]
    fn a_name_that_is_a_number_or_has_an_equals_sign_is_found() {
        let mut hand = hand();
        hand.shape_names[3] = "0".into();
        hand.shape_names[4] = "a=b".into();
        let shape = shape_from_text(&hand, "0=1,a=b=2").unwrap();
        assert_eq!(shape[..5], [0.0, 0.0, 0.0, 1.0, 2.0]);
    }

    #[test]
    fn mistakes_are_named_with_the_nearest_name() {
        let hand = hand();
        let cases = [
            (
                "palm_lenght=1",
                r#"shape: "palm_lenght" is unknown; did you mean "palm-length"? the model has hand-size, "#,
            ),
            ("zebra=1", r#""zebra" is unknown; the model has hand-size"#),
            ("10=1", r#""10" is unknown"#),
            ("-1=1", r#""-1" is unknown"#),
            ("hand-size=big", r#""big" is not a number"#),
            ("hand-size=", r#""" is not a number"#),
            ("hand-size=1,2", r#""2" has no name; write NAME=VALUE"#),
            ("hand-size=1,0=2", r#""0" is given twice"#),
            ("1,,2", r#""" is not a number"#),
            ("0,0,0,0,0,0,0,0,0,0,0", "has 11 numbers, the model takes 10"),
            ("hand-size=1e9", "number 0 is 1000000000.0, must be from -100 to 100"),
            ("NaN", "number 0 is NaN"),
        ];
        for (text, expected) in cases {
            let message = shape_from_text(&hand, text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: wanted {expected:?}, got {message:?}");
        }
        let unnamed = HandModel { shape_names: vec![], ..hand.clone() };
        let message = shape_from_text(&unnamed, "size=1").unwrap_err().to_string();
        assert!(message.contains("numbered from 0 to 9 and have no names"), "{message}");
        let message = shape_from_text(&hand.without_blend_shapes(), "0=1").unwrap_err().to_string();
        assert!(message.contains("the model has no shape directions"), "{message}");
    }
}
