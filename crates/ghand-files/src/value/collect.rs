//! Collects items into an array of numbers as long as they have the same shape, else into a list.

use super::Value;
use super::budget::Budget;
use crate::npz::NumericArray;

/// The items so far.
pub(super) enum Items {
    /// This many `null`s and nothing else.
    Nothing(usize),
    /// This many arrays of one shape.
    Alike { count: usize, shape: Vec<usize>, values: Vec<f64> },
    /// Anything.
    Mixed(Vec<Value>),
}

impl Items {
    /// Adds an item.
    pub(super) fn push(&mut self, item: Value, budget: &Budget) -> Result<(), String> {
        match (&mut *self, item) {
            (Items::Nothing(count), Value::Nothing) => {
                budget.values(1)?;
                *count += 1;
            }
            (Items::Nothing(count), Value::Numbers(array)) if *count == 0 || array.shape.is_empty() => {
                let mut values = vec![f64::NAN; *count];
                values.extend(&array.values);
                *self = Items::Alike { count: *count + 1, shape: array.shape, values };
            }
            (Items::Alike { count, shape, values }, Value::Numbers(array)) if *shape == array.shape => {
                values.extend(&array.values);
                *count += 1;
            }
            (Items::Alike { count, shape, values }, Value::Nothing) if shape.is_empty() => {
                budget.numbers(1)?;
                values.push(f64::NAN);
                *count += 1;
            }
            (_, item) => {
                let items = self.mix(budget)?;
                budget.values(1)?;
                items.push(item);
            }
        }
        Ok(())
    }

    /// The items as separate values.
    fn mix(&mut self, budget: &Budget) -> Result<&mut Vec<Value>, String> {
        let items = match self {
            Items::Mixed(items) => std::mem::take(items),
            Items::Nothing(count) => vec![Value::Nothing; *count],
            Items::Alike { count, shape, values } => {
                budget.values(*count)?;
                let size = shape.iter().product::<usize>();
                let item = |k: usize| {
                    let values = values.get(k * size..(k + 1) * size).unwrap_or_default().to_vec();
                    Value::Numbers(NumericArray { shape: shape.clone(), values })
                };
                (0..*count).map(item).collect()
            }
        };
        *self = Items::Mixed(items);
        match self {
            Items::Mixed(items) => Ok(items),
            Items::Nothing(_) | Items::Alike { .. } => Err("cannot be read".into()),
        }
    }

    /// The list or array of all items. Rows with nothing but `null` are missing numbers.
    pub(super) fn finish(self) -> Value {
        match self {
            Items::Nothing(0) => Value::List(vec![]),
            Items::Nothing(count) => Value::Numbers(NumericArray { shape: vec![count], values: vec![f64::NAN; count] }),
            Items::Alike { count, mut shape, values } => {
                shape.insert(0, count);
                Value::Numbers(NumericArray { shape, values })
            }
            Items::Mixed(items) => Value::List(items),
        }
    }
}
